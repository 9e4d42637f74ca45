//! `darn inpaint --batch`: many scans one after another, a line of JSON for each.
//!
//! A scan whose output is there already is not mended again, so that a batch that was interrupted goes on where it was:
//! outputs are renamed into place when they are whole.

use super::failure::{Failure, OrFail};
use super::inpaint::{BatchPlace, FileMender, FileOutcome, InpaintArgs, ReportLine, stage_line};
use std::fs;
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

/// What the names of scans end in.
const SCANS: [&str; 5] = ["glb", "gltf", "obj", "ply", "zip"];

/// A scan of a batch.
#[derive(Debug, PartialEq, Eq)]
struct BatchFile {
    scan: PathBuf,
    /// Where the mended scan goes, below the folder of outputs.
    below: PathBuf,
}

/// Runs a batch. A scan that fails is told and the others go on; the batch fails at the end then.
pub fn run(args: &InpaintArgs, source: &Path) -> Result<(), Failure> {
    let files = match source.as_os_str() == "-" {
        true => listed(std::io::stdin().lock())?,
        false => found(source)?,
    };
    let mender = FileMender::new(args)?;
    let mut failed = 0;
    for (before, file) in files.iter().enumerate() {
        let place = BatchPlace {
            done: before,
            of: files.len(),
        };
        let mut line = mended(file, args, &mender, place);
        failed += usize::from(line.outcome.is_failure());
        line.place = Some(BatchPlace {
            done: before + 1,
            ..place
        });
        print(&line.text()?);
        writeln!(std::io::stderr(), "{}", line.summary()).ok();
    }
    match failed {
        0 => Ok(()),
        _ => Err(format!("{failed} of {} scans", files.len())).or_fail("mend all scans"),
    }
}

/// Prints a line. A reader that went away must not end the batch: the outputs are what it is about.
fn print(line: &str) {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).ok();
}

/// Mends a scan of a batch and tells how it went; `place` is how far the batch is before.
fn mended(
    file: &BatchFile,
    args: &InpaintArgs,
    mender: &FileMender,
    place: BatchPlace,
) -> ReportLine {
    let started = Instant::now();
    let stage = |stage: &str| {
        if args.json_lines {
            let mut line = stage_line(stage, started);
            line["scan"] = file.scan.to_string_lossy().into();
            line["done"] = place.done.into();
            line["of"] = place.of.into();
            print(&line.to_string());
        }
    };
    let output = args.output.join(&file.below);
    let outcome = if output.exists() {
        FileOutcome::DoneBefore
    } else {
        let report = report_path(&output);
        let folder = output.parent().unwrap_or(Path::new(""));
        let made = fs::create_dir_all(folder).or_fail(format!("create {}", folder.display()));
        // The report first: a scan that is there is done.
        let mended = made.and_then(|()| mender.mend(&file.scan, &output, Some(&report), &stage));
        mended.unwrap_or_else(FileOutcome::Failed)
    };
    ReportLine::new(&file.scan, &output, outcome, started)
}

/// Where the report of a mended scan goes.
fn report_path(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".report.json");
    output.with_file_name(name)
}

/// The scans in a folder and below it, by path.
fn found(folder: &Path) -> Result<Vec<BatchFile>, Failure> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        let reading = || format!("read {}", next.display());
        for entry in fs::read_dir(&next).or_fail(reading())? {
            let entry = entry.or_fail(reading())?;
            let (path, kind) = (entry.path(), entry.file_type().or_fail(reading())?);
            // Links to folders are not followed: they may lead in circles.
            if kind.is_dir() {
                open.push(path);
            } else if is_scan(&path) {
                let below = path.strip_prefix(folder).unwrap_or(&path).to_owned();
                files.push(BatchFile { scan: path, below });
            }
        }
    }
    files.sort_by(|a, b| a.below.cmp(&b.below));
    Ok(files)
}

fn is_scan(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    SCANS
        .iter()
        .any(|known| extension.eq_ignore_ascii_case(known))
}

/// The scans that a list names, one on a line.
fn listed(list: impl std::io::BufRead) -> Result<Vec<BatchFile>, Failure> {
    let mut files = Vec::new();
    for line in list.lines() {
        let line = line.or_fail("read the list of scans")?;
        let path = line.trim_end_matches('\r');
        if !path.is_empty() {
            files.push(BatchFile {
                scan: path.into(),
                below: below(Path::new(path)),
            });
        }
    }
    let mut names: Vec<&Path> = files.iter().map(|file| file.below.as_path()).collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        None => Ok(files),
        Some(pair) => Err(Failure::Usage(format!(
            "two scans of the list have the same output, {}",
            pair[0].display()
        ))),
    }
}

/// A path without what leads out of a folder: its root, and parents.
fn below(path: &Path) -> PathBuf {
    let plain = path.components().filter_map(|part| match part {
        Component::Normal(name) => Some(name),
        _ => None,
    });
    plain.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_are_found_below_a_folder_in_the_order_of_their_paths() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("b")).expect("a folder");
        for name in ["b/two.PLY", "one.glb", "note.txt", "three.obj"] {
            fs::write(folder.path().join(name), b"").expect("written");
        }
        let found = found(folder.path()).expect("a folder");
        let names: Vec<&Path> = found.iter().map(|file| file.below.as_path()).collect();
        assert_eq!(names, ["b/two.PLY", "one.glb", "three.obj"].map(Path::new));
    }

    #[test]
    fn outputs_of_a_list_stay_below_their_folder_and_apart() {
        let files = listed(&b"/a/../b.glb\r\n\n./c/d.obj\n"[..]).expect("a list");
        let names: Vec<&Path> = files.iter().map(|file| file.below.as_path()).collect();
        assert_eq!(names, ["a/b.glb", "c/d.obj"].map(Path::new));
        assert_eq!(listed(&b"a.glb\n./a.glb\n"[..]).unwrap_err().code(), 64);
    }
}
