//! `darn inpaint`: fill the holes of a scan.

use super::failure::{Failure, OrFail};
use super::files;
use super::mend_summary::summary;
use super::network::mender;
use super::progress::WorkProgress;
use super::provenance::{self, NamedFile, ScanFiles};
use super::provenance_date::MendDate;
use crate::settings::{DeadlineArgs, NetworkArgs, SizeArgs, TextureArgs};
use darn_contract::port::Mended;
use darn_contract::v1::{FileDigests, Report};
use darn_contract::{Constraints, FieldError, LAST_ALTERNATIVE, Outcome, PatchBuffer};
use darn_gltf_scan::Scan;
use darn_mend::{Call, MendError, NetworkMender};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Debug, clap::Args)]
pub struct InpaintArgs {
    /// The scan: GLB; glTF, with its files beside it; a zip of those; OBJ; or PLY
    #[arg(required_unless_present = "batch", conflicts_with = "batch")]
    scan: Option<PathBuf>,
    /// Where the mended scan goes, in the format the scan came in; a name that ends in .glb makes one file of a glTF and its files. With --batch the
    /// folder where all mended scans go, each with its report
    #[arg(short, long)]
    pub output: PathBuf,
    /// Mend all scans in a folder and below it, or (-) those that standard input names, one on a line; those whose output is there already are done.
    /// Prints a line of JSON for each
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["report", "provenance"])]
    batch: Option<PathBuf>,
    /// What becomes of a scan without holes
    #[arg(long, value_name = "WHAT", default_value = "fail")]
    if_no_holes: IfNoHoles,
    /// Print lines of JSON: one when a stage begins, and one with the outcome and the report. A batch prints the latter in any case
    #[arg(long)]
    pub json_lines: bool,
    /// What the new cloth is to keep to, as JSON
    #[arg(short, long)]
    constraints: Option<PathBuf>,
    /// Write so many plausible fills, a file each: the likeliest to the output's name, the others with -1, -2 and so on after it; the reports likewise
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=ALTERNATIVES),
        conflicts_with_all = ["batch", "provenance", "json_lines"])]
    alternatives: u8,
    /// Where the report goes, as JSON
    #[arg(long)]
    report: Option<PathBuf>,
    /// Where the provenance of the mend goes, as linked data (CRMdig and PREMIS in JSON-LD)
    #[arg(long, value_name = "FILE")]
    provenance: Option<PathBuf>,
    /// When the mend is said to be, in the provenance: a day such as 2026-11-28, or an instant such as 2026-11-28T09:30:00Z; left out, it has no date
    #[arg(long, requires = "provenance", value_parser = MendDate::parsed)]
    date: Option<MendDate>,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    texture: TextureArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
    #[command(flatten)]
    network: NetworkArgs,
}

/// Most plausible fills of a hole.
const ALTERNATIVES: i64 = LAST_ALTERNATIVE as i64 + 1;

/// What becomes of a scan without holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum IfNoHoles {
    /// The command fails.
    Fail,
    /// The output is a copy of the scan.
    Copy,
}

/// Runs `darn inpaint`.
pub fn run(args: &InpaintArgs) -> Result<(), Failure> {
    if let Some(source) = &args.batch {
        return super::batch::run(args, source);
    }
    let scan = args.scan.as_deref().unwrap_or(Path::new(""));
    let started = Instant::now();
    let progress = (!args.json_lines).then(|| WorkProgress::staged("darn"));
    let stage = |what: &str| match &progress {
        Some(progress) => progress.stage(what),
        None => println!("{}", stage_line(what, started)),
    };
    stage("loading weights");
    let mended = FileMender::new(args).and_then(|mut mender| {
        for number in 1..args.alternatives {
            mender.constraints.alternative = Some(number);
            let report = args.report.as_ref().map(|path| numbered(path, number));
            mender.mend(
                scan,
                &numbered(&args.output, number),
                report.as_deref(),
                &stage,
            )?;
        }
        if args.alternatives > 1 {
            mender.constraints.alternative = Some(0);
        }
        mender.mend(scan, &args.output, args.report.as_deref(), &stage)
    });
    drop(progress);
    if args.json_lines {
        let outcome = mended.unwrap_or_else(FileOutcome::Failed);
        let line = ReportLine::new(scan, &args.output, outcome, started);
        println!("{}", line.text()?);
        return line.outcome.into_result();
    }
    match mended? {
        FileOutcome::Mended(report) => print!("{}", summary(&report)),
        _ => println!("the scan has no holes and was copied"),
    }
    Ok(())
}

/// A path with a number after the name of the file: `mended-2.glb`.
fn numbered(path: &Path, number: u8) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// What mends scans in files, with the settings of a command.
pub struct FileMender<'a> {
    args: &'a InpaintArgs,
    constraints: Constraints,
    mender: NetworkMender,
}

impl<'a> FileMender<'a> {
    /// Loads the weights.
    pub fn new(args: &'a InpaintArgs) -> Result<Self, Failure> {
        let constraints = match &args.constraints {
            Some(path) => constraints(path)?,
            None => Constraints::default(),
        };
        let mut mender = mender(&args.network)?;
        args.texture.apply(&mut mender);
        Ok(FileMender {
            args,
            constraints,
            mender,
        })
    }

    /// Mends a scan; `stage` is told what begins.
    pub fn mend(
        &self,
        scan: &Path,
        output: &Path,
        report: Option<&Path>,
        stage: &dyn Fn(&str),
    ) -> Result<FileOutcome, Failure> {
        stage("reading");
        let budget = self.args.deadline.budget();
        let started = Instant::now();
        let read_scan = files::read_scan(scan, &self.args.size, &budget)?;
        let read = started.elapsed();
        stage("mending");
        let call = Call {
            mender: &self.mender,
            budget: &budget,
        };
        let mut constraints = self.constraints.clone();
        if files::packs(output) {
            constraints.patch_buffer = PatchBuffer::Data;
        }
        let mut mended = match darn_mend::mend(&read_scan, &constraints, call) {
            Err(MendError::NoHoles { .. }) if self.args.if_no_holes == IfNoHoles::Copy => {
                stage("copying");
                files::write_scan(output, &read_scan, &files::read(scan)?, None)?;
                return Ok(FileOutcome::Copied);
            }
            mended => mended.or_fail(format!("mend {}", scan.display()))?,
        };
        darn_mend::add_read_time(&mut mended.report.timings, read);
        stage("writing");
        // The scan last: in a batch one that is there is done.
        let packed = files::packed_scan(output, &read_scan, &mended.bytes)?;
        if let Some(packed) = &packed {
            mended.report.output = Some(darn_mend::file_digests(packed));
        }
        let text = files::json(&mended.report, "write the report")?;
        if let Some(path) = report {
            files::write(path, &text)?;
        }
        if let Some(path) = &self.args.provenance {
            let document = Provenance {
                args: self.args,
                scan: &read_scan,
                mended: &mended,
                packed: packed.as_deref(),
                report_text: &text,
            };
            files::write(path, &document.text()?)?;
        }
        match packed {
            Some(packed) => files::write(output, &packed)?,
            None => files::write_scan(output, &read_scan, &mended.bytes, mended.file.as_ref())?,
        }
        Ok(FileOutcome::Mended(Box::new(mended.report)))
    }
}

/// How the mend of a file went.
pub enum FileOutcome {
    /// Its holes were filled.
    Mended(Box<Report>),
    /// It has no holes, and was copied.
    Copied,
    /// Its output was there already.
    DoneBefore,
    /// It failed.
    Failed(Failure),
}

impl FileOutcome {
    /// The outcome as lines of JSON name it.
    fn word(&self) -> &'static str {
        match self {
            FileOutcome::Mended(_) => "mended",
            FileOutcome::Copied => "copied",
            FileOutcome::DoneBefore => "done_before",
            FileOutcome::Failed(_) => "failed",
        }
    }

    /// Whether it failed.
    pub fn is_failure(&self) -> bool {
        matches!(self, FileOutcome::Failed(_))
    }

    fn into_result(self) -> Result<(), Failure> {
        match self {
            FileOutcome::Failed(failure) => Err(failure),
            _ => Ok(()),
        }
    }
}

/// How far a batch is.
#[derive(Debug, Clone, Copy)]
pub struct BatchPlace {
    /// Scans that are finished.
    pub done: usize,
    /// All of its scans.
    pub of: usize,
}

/// The line of JSON about a file.
pub struct ReportLine {
    scan: PathBuf,
    output: PathBuf,
    /// How it went.
    pub outcome: FileOutcome,
    seconds: f64,
    /// In a batch.
    pub place: Option<BatchPlace>,
}

impl ReportLine {
    /// What is to be told of a mend that began at an instant.
    pub fn new(scan: &Path, output: &Path, outcome: FileOutcome, started: Instant) -> Self {
        ReportLine {
            scan: scan.to_owned(),
            output: output.to_owned(),
            outcome,
            seconds: started.elapsed().as_secs_f64(),
            place: None,
        }
    }

    /// The line about a scan of a batch for a person: how far the batch is, the scan, and how it went.
    pub fn summary(&self) -> String {
        let place = self
            .place
            .map_or_else(String::new, |BatchPlace { done, of }| {
                format!("{done} of {of}: ")
            });
        let detail = match &self.outcome {
            FileOutcome::Failed(failure) => format!(": {failure}"),
            _ => String::new(),
        };
        let (scan, word) = (self.scan.display(), self.outcome.word());
        format!("{place}{scan}: {word}, {:.1} s{detail}", self.seconds)
    }

    /// The line, without its end.
    pub fn text(&self) -> Result<String, Failure> {
        let mut line = serde_json::json!({
            "type": "report",
            "scan": self.scan.to_string_lossy(),
            "output": self.output.to_string_lossy(),
            "status": self.outcome.word(),
            "seconds": (self.seconds * 1e3).round() / 1e3,
        });
        if let Some(BatchPlace { done, of }) = self.place {
            line["done"] = done.into();
            line["of"] = of.into();
        }
        match &self.outcome {
            FileOutcome::Mended(report) => {
                let outcome = Outcome::of(report);
                line["filled"] = outcome.filled.into();
                line["skipped"] = outcome.skipped.into();
                line["doubtful"] = outcome.doubtful.into();
                line["report"] = serde_json::to_value(report).or_fail("write the report")?;
            }
            FileOutcome::Failed(failure) => {
                line["code"] = failure.row().word.into();
                line["detail"] = failure.to_string().into();
            }
            FileOutcome::Copied | FileOutcome::DoneBefore => {}
        }
        Ok(line.to_string())
    }
}

/// The line of JSON about a stage that begins.
pub fn stage_line(stage: &str, started: Instant) -> serde_json::Value {
    let seconds = (started.elapsed().as_secs_f64() * 1e3).round() / 1e3;
    serde_json::json!({"type": "stage", "stage": stage, "seconds": seconds})
}

/// What the provenance of a mend is written from.
struct Provenance<'a> {
    args: &'a InpaintArgs,
    scan: &'a Scan,
    mended: &'a Mended,
    /// The mended scan as one GLB, if it is written so.
    packed: Option<&'a [u8]>,
    /// The report as it is written.
    report_text: &'a [u8],
}

impl Provenance<'_> {
    /// The document's text.
    fn text(&self) -> Result<Vec<u8>, Failure> {
        let constraints = match &self.args.constraints {
            Some(path) => files::read(path)?,
            None => b"{}".to_vec(),
        };
        let report = &self.mended.report;
        let scan_path = self.args.scan.as_deref().unwrap_or(Path::new(""));
        let [input, output] = [scan_path, &self.args.output].map(file_name);
        let input = NamedFile {
            name: &input,
            bytes: self.scan.received(),
        };
        let output = NamedFile {
            name: &output,
            bytes: self.packed.unwrap_or(&self.mended.bytes),
        };
        let log = self.args.report.as_deref().map(file_name);
        let document = provenance::document(&provenance::Mend {
            report,
            input: self.with_parts(input, report.input.as_ref()),
            output: match self.packed {
                Some(_) => ScanFiles::alone(output),
                None => self.with_parts(output, report.output.as_ref()),
            },
            constraints: &constraints,
            log: log.as_deref().map(|name| NamedFile {
                name,
                bytes: self.report_text,
            }),
            date: self.args.date.as_ref(),
        });
        files::json(&document, "write the provenance")
    }

    /// A file of the scan's own container with what is in it or beside it; `digests` are those of a zip's glTF.
    fn with_parts<'f>(
        &'f self,
        main: NamedFile<'f>,
        digests: Option<&FileDigests>,
    ) -> ScanFiles<'f> {
        let siblings = self.scan.siblings();
        ScanFiles {
            main,
            inner: self.scan.path_in_zip().zip(digests.cloned()),
            beside: siblings
                .map(|(name, bytes)| NamedFile { name, bytes })
                .collect(),
        }
    }
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_an_alternative_follows_the_name() {
        let numbered = |path: &str| numbered(Path::new(path), 2);
        assert_eq!(numbered("out/mended.glb"), Path::new("out/mended-2.glb"));
        assert_eq!(numbered("mended"), Path::new("mended-2"));
    }

    #[test]
    fn invalid_constraints_are_wrong_usage() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("c.json");
        std::fs::write(&path, r#"{"hole": []}"#).expect("written");
        assert_eq!(constraints(&path).unwrap_err().code(), 64);
    }
}
