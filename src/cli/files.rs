//! Reads and writes whole files. A file is written completely or not at all.

use super::failure::{Failure, OrFail};
use std::fs;
use std::path::{Path, PathBuf};

/// The bytes of a file.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).or_fail(format!("read {}", path.display()))
}

/// Writes a file beside its target and renames it, so that no reader sees a part of it.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let doing = || format!("write {}", path.display());
    let Some(name) = path.file_name() else {
        return Err(Failure::Usage(format!(
            "{} is no file name",
            path.display()
        )));
    };
    let mut partial = name.to_owned();
    partial.push(format!(".{}.part", std::process::id()));
    let partial: PathBuf = path.with_file_name(partial);
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    if written.is_err() {
        // The first failure is reported; one of this clean-up is not.
        let _ = fs::remove_file(&partial);
    }
    written.or_fail(doing())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_file_reads_back_and_leaves_no_other() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.glb");
        write(&path, b"first").expect("written");
        write(&path, b"second").expect("written over");
        assert_eq!(read(&path).expect("read"), b"second");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let failure = write(Path::new("/nowhere/at/all.glb"), b"").unwrap_err();
        assert!(
            failure
                .to_string()
                .starts_with("cannot write /nowhere/at/all.glb: "),
            "{failure}"
        );
    }
}
