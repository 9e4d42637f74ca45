//! Reading: from the file's bytes to a list of triangles.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use bytes::Bytes;
use darn_budget::Budget;
use serde_json::Value;

use super::buffers::Document;
use super::compressed::DecodeAllowance;
use super::container::ContainerLayout;
use super::error::ScanError;
use super::files::{Companions, Siblings};
use super::json::{JsonPlace, json_held, values_at_most};
use super::limits::{Limit, ScanLimits};
use super::mesh_file::read_mesh_file;
use super::scan::Scan;
use super::scan_reader::{MeshInstance, ScanReader};
use super::scene::mesh_nodes;
use super::zip_files::{self, ZipFiles};
use darn_mesh_files::MeshFormat;

impl Scan {
    /// Reads a scan. Its first bytes decide between GLB, JSON, zip, OBJ and PLY; data is read from the BIN chunk, data URIs and the zip.
    ///
    /// The scan keeps `bytes` and does not copy them (a `Vec<u8>` is taken over, a slice needs
    /// [`Bytes::copy_from_slice`]). Further memory: about 100 bytes a JSON value, 36 a vertex, 12 a face and 4 an
    /// attribute value; `limits` bounds each before it is allocated.
    ///
    /// # Errors
    /// See [`ScanError`]; a scan that draws no triangle is [`ScanError::NoTriangles`].
    pub fn read(bytes: impl Into<Bytes>, limits: &ScanLimits) -> Result<Self, ScanError> {
        read(
            bytes.into(),
            Siblings::default(),
            limits,
            Budget::unlimited(),
        )
    }

    /// [`Scan::read`] within a request's budget.
    ///
    /// # Errors
    /// As [`Scan::read`]; `Exhausted`.
    pub fn read_within(
        bytes: impl Into<Bytes>,
        limits: &ScanLimits,
        budget: &Budget,
    ) -> Result<Self, ScanError> {
        read(bytes.into(), Siblings::default(), limits, budget)
    }

    /// [`Scan::read_within`], with the files beside a glTF, or beside an OBJ, which are not looked at.
    ///
    /// # Errors
    /// As [`Scan::read_within`].
    pub fn read_with_siblings(
        bytes: impl Into<Bytes>,
        siblings: Siblings,
        limits: &ScanLimits,
        budget: &Budget,
    ) -> Result<Self, ScanError> {
        read(bytes.into(), siblings, limits, budget)
    }
}

/// About the bytes that a parsed JSON value takes.
const JSON_VALUE: usize = 100;
/// Nanoseconds of work a JSON value.
const VALUE_WORK: u64 = 150;

fn read(
    bytes: Bytes,
    siblings: Siblings,
    limits: &ScanLimits,
    budget: &Budget,
) -> Result<Scan, ScanError> {
    let allowance = DecodeAllowance::new(limits, budget);
    if bytes.starts_with(zip_files::MAGIC) {
        let zip = ZipFiles::open(bytes)?;
        let main = zip.main(&allowance)?;
        if let Some(format) = MeshFormat::of(&main) {
            return read_mesh_file(main, format, Companions::Zip(zip), allowance);
        }
        return read_files(main, Companions::Zip(zip), allowance);
    }
    if let Some(format) = MeshFormat::of(&bytes) {
        return read_mesh_file(bytes, format, Companions::Siblings(siblings), allowance);
    }
    read_files(bytes, Companions::Siblings(siblings), allowance)
}

/// Reads a glTF and the files that it refers to.
pub(super) fn read_files(
    bytes: Bytes,
    companions: Companions,
    allowance: DecodeAllowance<'_>,
) -> Result<Scan, ScanError> {
    let (limits, budget) = (allowance.limits, allowance.budget);
    let layout = super::container::layout(&bytes)?;
    let json = parsed_json(&bytes, &layout, limits, budget)?;
    let root = JsonPlace::root(&json);
    check_version(&root)?;
    let bin = layout.bin.clone().and_then(|range| bytes.get(range));
    let document = Document::new(root.clone(), bin, &companions, allowance)?;
    let nodes = mesh_nodes(&root, limits)?;
    let mut instances: HashMap<usize, usize> = HashMap::new();
    for node in &nodes {
        *instances.entry(node.mesh).or_default() += 1;
    }
    let mut reader = ScanReader::new(&document, limits);
    let mut met = BTreeSet::new();
    for node in &nodes {
        budget.check()?;
        reader.read_mesh(&MeshInstance {
            node,
            shared: instances.get(&node.mesh).is_some_and(|n| *n > 1),
            first: met.insert(node.mesh),
        })?;
    }
    let ScanReader {
        surface,
        parts,
        blocks,
        not_finite,
        misstated,
        others: content,
        ..
    } = reader;
    if surface.faces.is_empty() {
        return Err(ScanError::NoTriangles { content });
    }
    document.release();
    let json_held = json_held(&json);
    let scan = Scan {
        surface,
        parts,
        not_finite: not_finite.len(),
        misstated_streams: misstated,
        blocks,
        bytes,
        layout,
        companions,
        json,
        cut: BTreeSet::new(),
        json_held,
        origin: None,
        digests: Arc::default(),
    };
    budget.hold(scan.unpacked_bytes())?;
    budget.hold(scan.decoded_bytes())?;
    Ok(scan)
}

/// The JSON of a glTF.
///
/// # Errors
/// It does not parse, or has more values than the limit; `Exhausted`.
pub(super) fn parsed_json(
    bytes: &[u8],
    layout: &ContainerLayout,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<Value, ScanError> {
    let text = bytes.get(layout.json.clone()).unwrap_or_default();
    let limit = Limit {
        name: "max_json_values",
        allowed: limits.max_json_values,
    };
    let values = values_at_most(text);
    limit.check(values, "")?;
    budget.hold(JSON_VALUE * values)?;
    budget.spend(VALUE_WORK * values as u64)?;
    darn_json::value(text).map_err(|error| ScanError::Container {
        offset: layout.json.start + offset_of(text, error.line(), error.column()),
        detail: format!("the JSON does not parse: {error}"),
    })
}

fn check_version(root: &JsonPlace<'_>) -> Result<(), ScanError> {
    let version = root.need("asset")?.need("version")?;
    match version.text()?.split_once('.') {
        Some(("2", _)) => Ok(()),
        _ => Err(version.invalid("only glTF 2 is known")),
    }
}

/// Byte offset of a line and column (both from 1) in a text.
fn offset_of(text: &[u8], line: usize, column: usize) -> usize {
    let lines = text
        .split(|byte| *byte == b'\n')
        .take(line.saturating_sub(1));
    lines.map(|line| line.len() + 1).sum::<usize>() + column.saturating_sub(1)
}
