//! `darn strip`: a scan as it was before darn.

use super::failure::{Failure, OrFail};
use super::files;
use crate::settings::{DeadlineArgs, SizeArgs};
use darn_contract::port::ScanForm;
use darn_contract::v1::StripReport;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct StripArgs {
    /// The mended scan: GLB; glTF, whose other files are not needed; or a zip
    scan: PathBuf,
    /// Where the scan without what darn put in goes, in the container the mended one came in; another folder gets its files, too
    #[arg(short, long)]
    output: PathBuf,
    /// Where the report goes, as JSON
    #[arg(long)]
    report: Option<PathBuf>,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
}

/// Runs `darn strip`.
pub fn run(args: &StripArgs) -> Result<(), Failure> {
    let name = args.scan.display();
    let budget = args.deadline.budget();
    let scan = files::read(&args.scan)?;
    let stripped = darn_mend::strip(scan, ScanForm::AsReceived, &args.size.limits(), &budget)
        .or_fail(format!("strip {name}"))?;
    if args.output.parent() != args.scan.parent() {
        let beside = files::read_files_of(&args.scan, &stripped.bytes)?;
        let each = beside.0.iter();
        let each = each.map(|(path, bytes)| (path.as_str(), bytes.as_ref()));
        files::write_files_of(&args.output, each)?;
    }
    files::write(&args.output, &stripped.bytes)?;
    if let Some(path) = &args.report {
        files::write(path, &files::json(&stripped.report, "write the report")?)?;
    }
    print!("{}", summary(&stripped.report));
    Ok(())
}

/// One line that says what was taken out and whether the bytes from before are back, and one for each note.
fn summary(report: &StripReport) -> String {
    let how = match report.exact {
        true => "exact: the bytes from before darn",
        false => "structural: not the bytes from before darn, but without its patches",
    };
    let mut text = format!(
        "{how}; {} mend(s) undone, {} patch(es) taken out, {} cut primitive(s) put back\n",
        report.mends, report.patches, report.cuts
    );
    for note in &report.notes {
        text.push_str(&format!("note: {note}\n"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_says_how_and_has_a_line_for_each_note() {
        let mut report = StripReport {
            exact: true,
            mends: 2,
            ..StripReport::default()
        };
        assert!(summary(&report).starts_with("exact: "));
        report.exact = false;
        report.notes.push("changed".to_owned());
        let text = summary(&report);
        assert!(text.starts_with("structural: ") && text.ends_with("note: changed\n"));
    }
}
