//! Commands of the binary that several tests run, and what they read and write.

use std::{
    io::{Cursor, Write as _},
    path::Path,
    process::Output,
};

use zip::{ZipWriter, write::SimpleFileOptions};

use crate::darn;

/// What `darn holes` says of a scan.
pub fn holes(scan: &Path) -> Vec<u8> {
    let found = darn().arg("holes").arg(scan).output().expect("darn runs");
    assert!(
        found.status.success(),
        "{}",
        String::from_utf8_lossy(&found.stderr)
    );
    found.stdout
}

/// The exit code of a command that has run, and its lines of JSON.
pub fn code_and_lines(ran: Output) -> (Option<i32>, Vec<serde_json::Value>) {
    let text = String::from_utf8(ran.stdout).expect("text");
    let lines = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("a line of JSON"));
    (ran.status.code(), lines.collect())
}

/// A zip of these files.
pub fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let started = zip.start_file(*name, SimpleFileOptions::default());
        started.expect("an entry");
        zip.write_all(bytes).expect("written");
    }
    zip.finish().expect("a zip").into_inner()
}
