//! Undoes mends: a scan as it was before darn.
//!
//! A mend is undone byte for byte by its record ([`super::undo`]), and the digest in the record proves that. Where there
//! is no record that fits, as the file was changed afterwards, darn's patches are taken out of the JSON instead
//! ([`super::unmarked`]).

use bytes::Bytes;
use darn_budget::Budget;
use darn_mesh_files::MeshFormat;
use serde_json::Value;

use super::compressed::DecodeAllowance;
use super::container::{self, Container};
use super::digests::FileDigests;
use super::error::ScanError;
use super::limits::ScanLimits;
use super::mesh_file::stripped_mesh_file;
use super::read::parsed_json;
use super::undo::{Undone, packed_from, undone};
use super::unmarked::{Marks, without_marks};
use super::zip_files::{self, ZipFiles};

/// Nanoseconds of work a byte of a scan for each mend that is undone.
const BYTE_WORK: u64 = 10;
/// How often the bytes of a scan are held while a mend is undone.
const COPIES: usize = 4;

/// A scan without what darn did to it.
#[derive(Debug, Clone)]
pub struct Stripped {
    /// The scan, in the container it came in.
    pub bytes: Vec<u8>,
    /// That container.
    pub container: Container,
    /// Whether these are the bytes from before the first mend, proven by their digest.
    pub exact: bool,
    /// How many mends were undone by their records.
    pub mends: usize,
    /// What was there of darn.
    pub marks: Marks,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Of the glTF that came: the file, or the glTF in a zip.
    pub input: FileDigests,
    /// Of the glTF without what darn did to it, likewise.
    pub output: FileDigests,
}

/// Takes everything out of a scan that darn put in. Files beside a glTF are not needed. `None` if there is nothing of
/// darn's.
///
/// # Errors
/// The bytes are no glTF, or larger than the limits; `Exhausted`.
pub fn stripped(
    bytes: impl Into<Bytes>,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<Option<Stripped>, ScanError> {
    let bytes = bytes.into();
    budget.hold(COPIES * bytes.len())?;
    if bytes.starts_with(zip_files::MAGIC) {
        stripped_zip(bytes, &DecodeAllowance::new(limits, budget))
    } else if let Some(format) = MeshFormat::of(&bytes) {
        stripped_mesh_file(bytes, format, budget)
    } else {
        stripped_file(bytes, limits, budget)
    }
}

fn stripped_file(
    mut bytes: Bytes,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<Option<Stripped>, ScanError> {
    let container = container::layout(&bytes)?.container;
    let input = FileDigests::of(&bytes);
    let marks = Marks::of(&json_of(&bytes, limits, budget)?);
    let mut mends = 0;
    let mut notes = Vec::new();
    loop {
        budget.spend_at_once(BYTE_WORK * bytes.len() as u64)?;
        // A mend that is undone is shorter than it was, so that this ends.
        match undone(&bytes)? {
            Undone::Before(before) => {
                bytes = before.into();
                mends += 1;
            }
            Undone::Changed => {
                notes.push(CHANGED.to_owned());
                break;
            }
            Undone::NoRecord => break,
        }
    }
    let mut json = json_of(&bytes, limits, budget)?;
    notes.extend(packed_from(&json).map(packed_note));
    let left = without_marks(&mut json);
    if left.is_none() && mends == 0 {
        return Ok(None);
    }
    let exact = left.is_none();
    let bytes = match left {
        None => bytes.to_vec(),
        Some(more) => {
            if notes.is_empty() {
                notes.push(NO_RECORD.to_owned());
            }
            notes.extend(more);
            with_json(&bytes, &json)?
        }
    };
    Ok(Some(Stripped {
        output: FileDigests::of(&bytes),
        bytes,
        container,
        exact,
        mends,
        marks,
        notes,
        input,
    }))
}

const CHANGED: &str = "the scan was changed after darn mended it, so that its bytes from before are lost; darn's patches were \
     taken out of what it is now";
const NO_RECORD: &str = "the scan has no record of its bytes from before: another version of darn mended it, or other software wrote it \
     anew; darn's patches were taken out of what it is now";
/// What a person should know of a GLB that darn packed of a glTF with this SHA-256 and its files.
fn packed_note(sha256: &str) -> String {
    format!(
        "darn packed this GLB of a mended glTF and its files; the glTF from before the mend, whose SHA-256 is {sha256}, cannot be made from it; darn's \
         patches were taken out of the GLB"
    )
}

const PACKED_ANEW: &str = "the zip was packed by others; the glTF in it is the one from before, and the other files are as they came";

fn stripped_zip(
    mut bytes: Bytes,
    allowance: &DecodeAllowance<'_>,
) -> Result<Option<Stripped>, ScanError> {
    let (limits, budget) = (allowance.limits, allowance.budget);
    let mut zip = ZipFiles::open(bytes.clone())?;
    let main = zip.main(allowance)?;
    let marks = match MeshFormat::of(&main) {
        Some(format) => {
            let found = stripped_mesh_file(main.clone(), format, budget)?;
            found.map_or_else(Marks::default, |found| found.marks)
        }
        None => Marks::of(&json_of(&main, limits, budget)?),
    };
    let input = FileDigests::of(&main);
    let mut mends = 0;
    while let Some(before) = zip.before(allowance)? {
        budget.spend_at_once(BYTE_WORK * bytes.len() as u64)?;
        bytes = before.into();
        zip = ZipFiles::open(bytes.clone())?;
        mends += 1;
    }
    let main = zip.main(allowance)?;
    let inner = match MeshFormat::of(&main) {
        Some(format) => stripped_mesh_file(main.clone(), format, budget)?,
        None => stripped_file(main.clone(), limits, budget)?,
    };
    let stripped = match inner {
        None if mends == 0 => return Ok(None),
        None => Stripped {
            bytes: bytes.to_vec(),
            container: Container::Zip,
            exact: true,
            mends,
            marks,
            notes: Vec::new(),
            input,
            output: FileDigests::of(&main),
        },
        Some(mut inner) => {
            if inner.exact {
                inner.notes.push(PACKED_ANEW.to_owned());
            }
            Stripped {
                bytes: zip.replaced(&inner.bytes)?,
                container: Container::Zip,
                mends: mends + inner.mends,
                marks,
                input,
                ..inner
            }
        }
    };
    Ok(Some(stripped))
}

fn json_of(bytes: &[u8], limits: &ScanLimits, budget: &Budget<'_>) -> Result<Value, ScanError> {
    let layout = container::layout(bytes)?;
    parsed_json(bytes, &layout, limits, budget)
}

/// A file with another JSON text.
fn with_json(bytes: &[u8], json: &Value) -> Result<Vec<u8>, ScanError> {
    let layout = container::layout(bytes)?;
    let text = json.to_string();
    let part = |range: std::ops::Range<usize>| bytes.get(range).unwrap_or_default();
    if layout.container == Container::Gltf {
        return Ok([part(0..layout.json.start), text.as_bytes()].concat());
    }
    let bin = layout.bin.clone().map(part);
    let packed = container::pack_glb(text.as_bytes(), bin, part(layout.rest.clone()));
    let mut out = packed.ok_or_else(|| container::too_long(bytes.len()))?;
    out.extend_from_slice(part(layout.trailing.clone()));
    Ok(out)
}
