//! `darn holes`: the boundary loops of a scan.

use super::failure::{Failure, OrFail};
use super::files;
use crate::settings::{DeadlineArgs, SizeArgs};
use darn_contract::port::HolesQuery;
use darn_contract::v1::{BorderCandidate, HolesReport, Loop, LoopKind, SetAside, Suspect};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct HolesArgs {
    /// The scan: GLB; glTF, with its files beside it; or a zip of those
    scan: PathBuf,
    /// Print the report that POST /holes answers with
    #[arg(long)]
    json: bool,
    /// List what a mesher has probably sealed, too, each with a cut that takes it out
    #[arg(long)]
    suspects: bool,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
}

/// Runs `darn holes`.
pub fn run(args: &HolesArgs) -> Result<(), Failure> {
    let budget = args.deadline.budget();
    let scan = files::read_scan(&args.scan, &args.size, &budget)?;
    let wanted = HolesQuery {
        suspects: args.suspects,
    };
    let report = darn_mend::find_holes(&scan, wanted, &budget).or_fail("find the holes")?;
    if args.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&report).or_fail("write the report")?
        );
    } else {
        print!("{}", table(&report));
    }
    Ok(())
}

fn table(report: &HolesReport) -> String {
    let mut text = format!(
        "{:>4}  {:<14} {:>10} {:>9} {:>12} {:>12} {:>9}  centroid\n",
        "id", "kind", "confidence", "vertices", "length", "diameter", "turning"
    );
    for rim in &report.loops {
        text.push_str(&line(rim));
    }
    text.push_str(&set_aside(&report.set_aside));
    for bite in &report.candidates {
        text.push_str(&candidate_line(bite));
    }
    for suspect in &report.suspects {
        text.push_str(&suspect_line(suspect));
    }
    for note in &report.notes {
        text.push_str(&format!("note: {note}\n"));
    }
    text
}

/// One line that says what was set aside, if anything was.
pub fn set_aside(kinds: &[SetAside]) -> String {
    let each = kinds.iter().map(|k| format!("{} {}", k.count, k.kind));
    let each: Vec<String> = each.collect();
    match each.as_slice() {
        [] => String::new(),
        each => format!("set aside: {}\n", each.join(", ")),
    }
}

fn line(rim: &Loop) -> String {
    let centroid: Vec<String> = rim.centroid.iter().map(|c| format!("{c:.4}")).collect();
    format!(
        "{:>4}  {:<14} {:>10.2} {:>9} {:>12.4} {:>12.4} {:>9.2}  {}\n",
        rim.id,
        kind_name(rim.kind()),
        rim.confidence,
        rim.vertices,
        rim.length,
        rim.diameter,
        rim.turning,
        centroid.join(" ")
    )
}

fn candidate_line(candidate: &BorderCandidate) -> String {
    let border = serde_json::to_string(&candidate.border).unwrap_or_default();
    let BorderCandidate { r#loop: id, .. } = candidate;
    let what = match candidate.facing_loop {
        Some(facing) => format!(
            "tear between loops {id} and {facing}, {:.4} long and {:.4} wide",
            candidate.length, candidate.mouth
        ),
        None => {
            let is_corner = (candidate.border.as_ref()).is_some_and(|b| !b.along.is_empty());
            let what = if is_corner {
                "torn corner"
            } else {
                "bite or rip"
            };
            format!(
                "{what} at loop {id}, {:.4} wide and {:.4} deep",
                candidate.mouth, candidate.depth
            )
        }
    };
    format!("{what}\n      border: {border}\n")
}

fn suspect_line(suspect: &Suspect) -> String {
    let cut = serde_json::to_string(&suspect.cut).unwrap_or_default();
    format!(
        "{} patch of {} faces, area {:.4}: {}\n      cut: {cut}\n",
        suspect.reason, suspect.faces, suspect.area, suspect.detail
    )
}

/// The name of a kind of loop, as commands print it.
pub fn kind_name(kind: LoopKind) -> &'static str {
    match kind {
        LoopKind::Hole => "hole",
        LoopKind::Opening => "opening",
        LoopKind::OuterBoundary => "outer boundary",
        LoopKind::TubeEnd => "end of a tube",
        LoopKind::Unspecified => "unknown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loop_and_note_has_a_line() {
        let rim = Loop {
            id: 7,
            kind: LoopKind::Hole.into(),
            vertices: 12,
            length: 3.25,
            diameter: 1.125,
            confidence: 0.87,
            centroid: vec![0.0, 1.0, 2.0],
            ..Loop::default()
        };
        let report = HolesReport {
            loops: vec![rim],
            notes: vec!["a bow-tie".into()],
            ..HolesReport::default()
        };
        let text = table(&report);
        assert_eq!(text.lines().count(), 3);
        for shown in ["hole", "3.2500", "1.1250", "0.87"] {
            assert!(text.contains(shown), "{shown}: {text}");
        }
        assert!(text.ends_with("note: a bow-tie\n"));
    }
}
