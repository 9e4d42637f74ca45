//! `darn inpaint`: fill the holes of a scan.

use super::failure::{Failure, OrFail};
use super::files;
use super::holes::{kind_name, set_aside};
use super::network::mender;
use super::progress::WorkProgress;
use super::provenance;
use crate::settings::{DeadlineArgs, NetworkArgs, SizeArgs, TextureArgs};
use darn_contract::v1::{HoleReport, Report};
use darn_contract::{Constraints, FieldError};
use darn_mend::Call;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Debug, clap::Args)]
pub struct InpaintArgs {
    /// The scan: GLB; glTF, with its files beside it; or a zip of those
    scan: PathBuf,
    /// Where the mended scan goes, in the container the scan came in; a name that ends in .glb makes one file of a glTF and its files
    #[arg(short, long)]
    output: PathBuf,
    /// What the new cloth is to keep to, as JSON
    #[arg(short, long)]
    constraints: Option<PathBuf>,
    /// Where the report goes, as JSON
    #[arg(long)]
    report: Option<PathBuf>,
    /// Where the provenance of the mend goes, as linked data (CRMdig and PREMIS in JSON-LD)
    #[arg(long, value_name = "FILE")]
    provenance: Option<PathBuf>,
    /// When the mend is said to be, in the provenance; left out, it has no date
    #[arg(long, requires = "provenance", value_parser = provenance::date)]
    date: Option<String>,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    texture: TextureArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
    #[command(flatten)]
    network: NetworkArgs,
}

/// Runs `darn inpaint`.
pub fn run(args: &InpaintArgs) -> Result<(), Failure> {
    let name = args.scan.display();
    let progress = WorkProgress::staged("darn");
    progress.stage("reading");
    let constraints = match &args.constraints {
        Some(path) => constraints(path)?,
        None => Constraints::default(),
    };
    let budget = args.deadline.budget();
    let started = Instant::now();
    let scan = files::read_scan(&args.scan, &args.size, &budget)?;
    let read = started.elapsed();
    progress.stage("loading weights");
    let mut mender = mender(&args.network)?;
    args.texture.apply(&mut mender);
    progress.stage("mending");
    let call = Call {
        mender: &mender,
        budget: &budget,
    };
    let mut mended = darn_mend::mend(&scan, &constraints, call).or_fail(format!("mend {name}"))?;
    darn_mend::add_read_time(&mut mended.report.timings, read);
    progress.stage("writing");
    if let Some(packed) = files::write_scan(&args.output, &scan, &mended.bytes)? {
        mended.report.output = Some(packed);
    }
    let report = files::json(&mended.report, "write the report")?;
    if let Some(path) = &args.report {
        files::write(path, &report)?;
    }
    if let Some(path) = &args.provenance {
        write_provenance(path, args, &mended.report, &report)?;
    }
    drop(progress);
    print!("{}", summary(&mended.report));
    Ok(())
}

/// Writes the provenance of a mend; `text` is its report as it was written.
fn write_provenance(
    path: &Path,
    args: &InpaintArgs,
    report: &Report,
    text: &[u8],
) -> Result<(), Failure> {
    let name = |path: &Path| {
        path.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let constraints = match &args.constraints {
        Some(path) => files::read(path)?,
        None => b"{}".to_vec(),
    };
    let log = args.report.as_deref().map(name);
    let document = provenance::document(&provenance::Mend {
        report,
        input: &name(&args.scan),
        output: &name(&args.output),
        constraints: &constraints,
        log: log.as_deref().map(|log| (log, text)),
        date: args.date.as_deref(),
    });
    files::write(path, &files::json(&document, "write the provenance")?)
}

/// The constraints in a file; invalid ones are wrong usage.
fn constraints(path: &Path) -> Result<Constraints, Failure> {
    let name = path.display();
    let text = files::read(path)?;
    let message = darn_contract::from_json(&text)
        .map_err(|error| Failure::Usage(format!("{name}: {error}")))?;
    Constraints::check(&message).map_err(|errors| {
        let all: Vec<String> = errors.iter().map(FieldError::to_string).collect();
        Failure::Usage(format!("{name}: {}", all.join("; ")))
    })
}

/// One line for each loop, with its patch or the reason why it was left, and one for each note.
fn summary(report: &Report) -> String {
    let mut text = String::new();
    for hole in &report.holes {
        let patch = hole.patch.clone().unwrap_or_default();
        let crossings = match patch.self_intersections {
            0 => String::new(),
            n => format!(", {n} self-intersections"),
        };
        text.push_str(&format!(
            "hole {}: rim of {} vertices, length {:.4}; patched with {} faces, stretch {:.3}{crossings}{}\n",
            hole.id,
            hole.vertices,
            hole.length,
            patch.faces,
            patch.stretch_mean,
            texture(hole)
        ));
        text.push_str(&distances(hole));
    }
    for left in &report.skipped {
        text.push_str(&format!(
            "left loop {} ({}): {}\n",
            left.id,
            kind_name(left.kind()),
            left.reason
        ));
    }
    text.push_str(&set_aside(&report.set_aside));
    for note in report
        .notes
        .iter()
        .chain(report.holes.iter().flat_map(|hole| &hole.notes))
    {
        text.push_str(&format!("note: {note}\n"));
    }
    text
}

/// What a patch's line says about images of its own.
fn texture(hole: &HoleReport) -> String {
    match &hole.texture {
        Some(own) if own.layers > 0 => {
            format!(", a texture of {} x {} texels", own.width, own.height)
        }
        _ => String::new(),
    }
}

/// One line for each anchor or gesture: its distance to the cloth.
fn distances(hole: &HoleReport) -> String {
    let anchors = hole.anchors.iter().map(|a| {
        let at: Vec<String> = a.uv.iter().map(|x| format!("{x:.3}")).collect();
        format!("  anchor at {}: {:.4} away\n", at.join(" "), a.distance)
    });
    let edits = hole.edits.iter().map(|e| {
        format!(
            "  gesture of {} point(s): at most {:.4} away\n",
            e.anchors, e.distance
        )
    });
    anchors.chain(edits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_contract::v1::Skipped;

    #[test]
    fn every_loop_has_a_line() {
        let report = Report {
            holes: vec![HoleReport {
                id: 1,
                ..HoleReport::default()
            }],
            skipped: vec![Skipped {
                id: 0,
                reason: "it is the cloth's own edge".into(),
                ..Skipped::default()
            }],
            ..Report::default()
        };
        let text = summary(&report);
        assert!(
            text.starts_with("hole 1: ") && text.contains("left loop 0"),
            "{text}"
        );
    }

    #[test]
    fn invalid_constraints_are_wrong_usage() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("c.json");
        std::fs::write(&path, r#"{"hole": []}"#).expect("written");
        assert_eq!(constraints(&path).unwrap_err().code(), 64);
    }
}
