//! The files of a folder of sheets: reading finished or growing folders, and writing so that no reader sees half a file.

use super::error::ScarfError;
use super::lattice::{SIDE, VERTICES};
use super::manifest::{Manifest, SheetRecord};
use super::sheet::SimulatedSheet;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Name of the file with all sheets of a finished set.
pub(super) const WHOLE: &str = "sheets.safetensors";
/// Name of the file with the records of a finished set.
pub(super) const MANIFEST: &str = "manifest.json";

/// The header of a part file.
#[derive(Serialize, Deserialize)]
pub(super) struct PartHeader {
    pub version: u32,
    pub seed: u64,
    pub sheets: Vec<SheetRecord>,
}

/// Name of the part file whose first sheet is number `start`.
pub(super) fn part_name(start: usize) -> String {
    format!("part-{start:06}.safetensors")
}

/// Reads all sheets of a folder: the merged file or, while the set is still being made, the finished parts.
///
/// # Errors
/// Unreadable files, tensors of another shape, no sheets at all.
pub fn read(dir: &Path) -> Result<Vec<SimulatedSheet>, ScarfError> {
    let whole = dir.join(WHOLE);
    if whole.exists() {
        return read_sheets(&whole);
    }
    let entries = std::fs::read_dir(dir).map_err(|source| ScarfError::Io {
        path: dir.into(),
        source,
    })?;
    let mut parts: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|p| {
            let name = p.file_name().and_then(|n| n.to_str()).unwrap_or_default();
            name.starts_with("part-") && name.ends_with(".safetensors")
        })
        .collect();
    parts.sort();
    let mut sheets = Vec::new();
    for part in &parts {
        sheets.extend(read_sheets(part)?);
    }
    if sheets.is_empty() {
        return Err(ScarfError::Empty { path: dir.into() });
    }
    Ok(sheets)
}

/// Reads `manifest.json` of a finished folder.
///
/// # Errors
/// A file that cannot be read or has another format.
pub fn read_manifest(dir: &Path) -> Result<Manifest, ScarfError> {
    let path = dir.join(MANIFEST);
    let text = std::fs::read(&path).map_err(|source| ScarfError::Io {
        path: path.clone(),
        source,
    })?;
    serde_json::from_slice(&text).map_err(|e| format_error(&path, &e.to_string()))
}

pub(super) fn format_error(path: &Path, reason: &str) -> ScarfError {
    ScarfError::Format {
        path: path.into(),
        reason: reason.into(),
    }
}

/// Writes sheets, with the records of a part in the header.
pub(super) fn write_file(
    path: &Path,
    sheets: &[SimulatedSheet],
    header: Option<&PartHeader>,
) -> Result<(), ScarfError> {
    let bytes: Vec<u8> = sheets
        .iter()
        .flat_map(|s| &s.positions)
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let fail = |reason: String| format_error(path, &reason);
    let view = TensorView::new(Dtype::F32, vec![sheets.len(), SIDE, SIDE, 3], &bytes)
        .map_err(|e| fail(e.to_string()))?;
    let metadata = match header {
        Some(header) => {
            let text = serde_json::to_string(header).map_err(|e| fail(e.to_string()))?;
            Some(HashMap::from([("scarffolds".to_string(), text)]))
        }
        None => None,
    };
    let file =
        safetensors::serialize([("positions", view)], metadata).map_err(|e| fail(e.to_string()))?;
    write_whole(path, &file)
}

/// Writes another file and renames it, so that a reader never sees half a file.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ScarfError> {
    let beside = path.with_extension("unfinished");
    std::fs::write(&beside, bytes)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|source| ScarfError::Io {
            path: path.into(),
            source,
        })
}

fn read_sheets(path: &Path) -> Result<Vec<SimulatedSheet>, ScarfError> {
    let bytes = std::fs::read(path).map_err(|source| ScarfError::Io {
        path: path.into(),
        source,
    })?;
    let fail = |reason: String| format_error(path, &reason);
    let file = SafeTensors::deserialize(&bytes).map_err(|e| fail(e.to_string()))?;
    let tensor = file.tensor("positions").map_err(|e| fail(e.to_string()))?;
    if tensor.dtype() != Dtype::F32 || tensor.shape().get(1..) != Some(&[SIDE, SIDE, 3]) {
        return Err(fail(format!(
            "positions are {:?} {:?}, not F32 [n, 51, 51, 3]",
            tensor.dtype(),
            tensor.shape()
        )));
    }
    Ok(tensor
        .data()
        .chunks_exact(VERTICES * 12)
        .map(|sheet| SimulatedSheet {
            positions: sheet
                .as_chunks::<12>()
                .0
                .iter()
                .map(|p| {
                    let x = |k: usize| {
                        f32::from_le_bytes([p[4 * k], p[4 * k + 1], p[4 * k + 2], p[4 * k + 3]])
                    };
                    [x(0), x(1), x(2)]
                })
                .collect(),
        })
        .collect())
}

/// Reads a part file with its records.
pub(super) fn read_part(path: &Path) -> Result<(Vec<SimulatedSheet>, PartHeader), ScarfError> {
    let fail = |reason: String| format_error(path, &reason);
    let sheets = read_sheets(path)?;
    let bytes = std::fs::read(path).map_err(|source| ScarfError::Io {
        path: path.into(),
        source,
    })?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|e| fail(e.to_string()))?;
    let text = header.metadata().as_ref().and_then(|m| m.get("scarffolds"));
    let text = text.ok_or_else(|| fail("its header has no records".into()))?;
    Ok((
        sheets,
        serde_json::from_str(text).map_err(|e| fail(e.to_string()))?,
    ))
}
