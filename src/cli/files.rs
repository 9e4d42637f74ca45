//! Reads and writes whole files: a file is written completely or not at all. Reads scans with the files beside them.

use super::failure::{Failure, OrFail};
use crate::settings::SizeArgs;
use darn_budget::Budget;
use darn_contract::port::NewFile;
use darn_gltf_scan::{
    Container, Scan, Siblings, material_image_paths, material_library_paths, sibling_paths,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The bytes of a file.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).or_fail(format!("read {}", path.display()))
}

/// A scan, and the files beside it that a glTF, or an OBJ with its material libraries, refers to by relative paths. No file above the scan's folder is read.
pub fn read_scan(path: &Path, size: &SizeArgs, budget: &Budget<'_>) -> Result<Scan, Failure> {
    let bytes = read(path)?;
    let files = read_files_of(path, &bytes)?;
    let reading = format!("read {}", path.display());
    Scan::read_with_siblings(bytes, files, &size.limits(), budget).or_fail(reading)
}

/// The files that a scan at a path refers to, as [`read_scan`] reads them.
pub fn read_files_of(path: &Path, scan: &[u8]) -> Result<Siblings, Failure> {
    if is_json(scan) {
        let reading = format!("read {}", path.display());
        siblings(path, sibling_paths(scan).or_fail(reading)?)
    } else {
        materials(path, scan)
    }
}

fn is_json(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    text.trim_ascii_start().starts_with(b"{")
}

/// The material libraries of an OBJ and the images that they name, as far as they are there; of another scan none.
fn materials(obj: &Path, bytes: &[u8]) -> Result<Siblings, Failure> {
    let Siblings(mut files) = siblings(obj, material_library_paths(bytes))?;
    let images = files
        .iter()
        .flat_map(|(path, library)| material_image_paths(path, library));
    let images = siblings(obj, images.collect())?;
    files.extend(images.0);
    Ok(Siblings(files))
}

/// Those of the files below a scan's folder that are there; reading the scan names one that it misses.
fn siblings(gltf: &Path, paths: Vec<String>) -> Result<Siblings, Failure> {
    let folder = gltf.parent().unwrap_or(Path::new(""));
    let mut files = BTreeMap::new();
    for path in paths {
        let place = folder.join(&path);
        if place.is_file() {
            files.insert(path, read(&place)?.into());
        }
    }
    Ok(Siblings(files))
}

/// Whether an output's name asks for one file with all others in it.
pub fn packs(output: &Path) -> bool {
    let extension = output.extension().unwrap_or_default();
    extension.eq_ignore_ascii_case("glb")
}

/// A mended scan as a GLB with all its files, if that is what the output's name asks for and the scan is not one already.
pub fn packed_scan(path: &Path, scan: &Scan, mended: &[u8]) -> Result<Option<Vec<u8>>, Failure> {
    let extension = path.extension().unwrap_or_default();
    if let Some(own) = own_extension(scan.container())
        && !extension.eq_ignore_ascii_case(own)
    {
        let name = path.display();
        return Err(Failure::Usage(format!(
            "{name}: the mended scan has the format of the scan; let the output's name end in .{own}"
        )));
    }
    if packs(path) && scan.container() != Container::Glb {
        let packed = scan
            .packed(mended)
            .or_fail(format!("write {}", path.display()));
        return packed.map(Some);
    }
    Ok(None)
}

/// Writes a mended scan in the container it was read from, and the file of its patches if they have one. A glTF or an OBJ written into another folder
/// takes its files there; a file that is there already stays.
pub fn write_scan(
    path: &Path,
    scan: &Scan,
    mended: &[u8],
    file: Option<&NewFile>,
) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(file) = file {
        write(&folder.join(&file.path), &file.bytes)?;
    }
    write_files_of(path, scan.siblings())?;
    write(path, mended)
}

/// Writes the files of a scan at a path, by their paths relative to it; one that is there already stays.
pub fn write_files_of<'f>(
    path: &Path,
    files: impl IntoIterator<Item = (&'f str, &'f [u8])>,
) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new(""));
    for (name, bytes) in files {
        let place = folder.join(name);
        if !place.exists() {
            let parent = place.parent().unwrap_or(folder);
            fs::create_dir_all(parent).or_fail(format!("create {}", parent.display()))?;
            write(&place, bytes)?;
        }
    }
    Ok(())
}

/// What the name of a mesh file ends in; a glTF may have any name.
fn own_extension(container: Container) -> Option<&'static str> {
    match container {
        Container::Obj => Some("obj"),
        Container::Ply => Some("ply"),
        Container::Glb | Container::Gltf | Container::Zip => None,
    }
}

/// A message as the text of a JSON file; `doing` says what fails when it cannot be written.
pub fn json(message: &impl Serialize, doing: &str) -> Result<Vec<u8>, Failure> {
    let mut text = serde_json::to_vec_pretty(message).or_fail(doing)?;
    text.push(b'\n');
    Ok(text)
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
