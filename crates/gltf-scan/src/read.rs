//! Reading: from the file's bytes to a list of triangles.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use darn_budget::Budget;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES};
use serde_json::Value;

use super::accessor::{Accessor, is_unsigned};
use super::attributes::AttributeReader;
use super::buffers::Document;
use super::compressed::DecodeAllowance;
use super::container::ContainerLayout;
use super::content::SceneContent;
use super::error::ScanError;
use super::files::{Companions, Siblings};
use super::json::{JsonPlace, json_held, values_at_most};
use super::limits::{Limit, ScanLimits};
use super::mesh_file::read_mesh_file;
use super::patch_primitive::is_reconstructed;
use super::primitive::{AttributeSource, ElementsKey, PrimitiveSource};
use super::scan::{Scan, ScanPart, VertexBlock};
use super::scene::{MeshNode, mesh_nodes};
use super::skin::skinned_meshes;
use super::triangles::IndexList;
use super::zip_files::{self, ZipFiles};
use darn_geometry::mesh::{TriMesh, Vec3};
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

    /// [`Scan::read_within`], with the files beside a glTF.
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
        return read_files(main, Companions::Zip(zip), allowance);
    }
    if let Some(format) = MeshFormat::of(&bytes) {
        return read_mesh_file(bytes, format, allowance);
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

/// One node that draws a mesh, and what other nodes draw the same mesh.
struct MeshInstance<'s> {
    node: &'s MeshNode,
    /// Whether other nodes draw the mesh too.
    shared: bool,
    /// Whether no earlier node draws the mesh.
    first: bool,
}

/// Collects the surface and its parts, and counts them against the limits.
struct ScanReader<'d, 'a> {
    document: &'d Document<'a>,
    limits: &'d ScanLimits,
    surface: TriMesh,
    parts: Vec<ScanPart>,
    blocks: Vec<VertexBlock>,
    /// Vertices whose position is not finite, ascending; triangles that use one are refused.
    not_finite: Vec<u32>,
    attributes: AttributeReader<'d>,
    skinned: BTreeSet<usize>,
    /// Primitives that draw no triangles.
    others: SceneContent,
    /// Primitives so far, points and lines included.
    primitives: usize,
    /// Triangles so far, degenerate ones included.
    faces: usize,
}

impl<'d, 'a> ScanReader<'d, 'a> {
    fn new(document: &'d Document<'a>, limits: &'d ScanLimits) -> Self {
        let meshes = document.root.value.get("meshes");
        let meshes = meshes.and_then(Value::as_array).map_or(0, Vec::len);
        Self {
            document,
            limits,
            others: SceneContent::of(meshes),
            surface: TriMesh::default(),
            parts: Vec::new(),
            blocks: Vec::new(),
            not_finite: Vec::new(),
            attributes: AttributeReader::new(limits),
            skinned: skinned_meshes(document.root.value),
            primitives: 0,
            faces: 0,
        }
    }

    /// Adds the triangle primitives of a mesh as one node draws it.
    fn read_mesh(&mut self, instance: &MeshInstance<'_>) -> Result<(), ScanError> {
        let Some(meshes) = self.document.root.get("meshes")? else {
            return Ok(());
        };
        let Some(mesh) = meshes.item(instance.node.mesh)? else {
            return Ok(());
        };
        // The node's vertices by what their positions are read from.
        let mut vertices = BTreeMap::new();
        for (index, place) in mesh.need("primitives")?.items()?.enumerate() {
            self.primitives += 1;
            let limit = Limit {
                name: "max_primitives",
                allowed: self.limits.max_primitives,
            };
            limit.check(self.primitives, &place.pointer)?;
            let part = self.read_primitive(instance, index, &place, &mut vertices)?;
            self.parts.extend(part);
        }
        Ok(())
    }

    /// One primitive, or `None` when it draws no triangles (points, lines, no positions).
    fn read_primitive(
        &mut self,
        instance: &MeshInstance<'_>,
        index: usize,
        place: &JsonPlace<'a>,
        vertices_of: &mut BTreeMap<ElementsKey, Range<u32>>,
    ) -> Result<Option<ScanPart>, ScanError> {
        let mode = u32::try_from(place.integer_or("mode", TRIANGLES as usize)?).unwrap_or(u32::MAX);
        if ![TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN].contains(&mode) {
            self.others.count(place, mode)?;
            return Ok(None);
        }
        let source = PrimitiveSource::open(self.document, place)?;
        let Some(position) = source.attribute("POSITION")? else {
            self.others.count(place, mode)?;
            return Ok(None);
        };
        let node = instance.node;
        let vertices = match vertices_of.get(&position.key) {
            Some(vertices) => vertices.clone(),
            None => {
                let vertices = self.read_positions(node, &position)?;
                vertices_of.insert(position.key, vertices.clone());
                vertices
            }
        };
        let (start, count) = (vertices.start, vertices.len());
        let mut faces = self.read_triangles(&source, mode, count)?;
        self.check_used(&faces, &vertices, &position.place.pointer)?;
        let mirrored = node.transform.mirrors();
        let first = self.surface.faces.len() as u32;
        faces.retain(|[a, b, c]| a != b && b != c && c != a);
        for face in &mut faces {
            let [a, b, c] = *face;
            let [b, c] = if mirrored { [c, b] } else { [b, c] };
            *face = [start + a, start + b, start + c];
        }
        match self.surface.faces.is_empty() {
            true => self.surface.faces = faces,
            false => self.surface.faces.append(&mut faces),
        }
        let normals = self.attributes.normals(&source, count)?;
        let texcoords = self.attributes.texcoords(&source, count)?;
        let (color_kinds, colors) = self.attributes.colors(&source, count)?;
        let skinned = self.skinned.contains(&node.mesh);
        let skinning = skinned
            .then(|| self.attributes.influences(&source, count))
            .transpose()?;
        let reconstructed = is_reconstructed(place.value.get("extras"));
        let deviations = (reconstructed)
            .then(|| self.attributes.deviations(&source, count))
            .flatten();
        let material = match place.get("material")? {
            Some(reference) => Some(self.document.root.referred("materials", &reference)?.0),
            None => None,
        };
        Ok(Some(ScanPart {
            node: node.index,
            mesh: node.mesh,
            primitive: index,
            material,
            vertices,
            faces: first..self.surface.faces.len() as u32,
            texcoords,
            colors,
            normals,
            deviations,
            reconstructed,
            hatch: (place.value.pointer("/extras/darn/hatch"))
                .and_then(|set| usize::try_from(set.as_u64()?).ok()),
            shared: instance.shared,
            first_instance: instance.first,
            targets: self.count_targets(place)?,
            color_kinds,
            transform: node.transform.clone(),
            skinning,
        }))
    }

    /// The number of morph targets of a primitive. Each must be an object: every patch repeats their number.
    fn count_targets(&self, place: &JsonPlace<'a>) -> Result<usize, ScanError> {
        let Some(targets) = place.get("targets")? else {
            return Ok(0);
        };
        let limit = Limit {
            name: "max_morph_targets",
            allowed: self.limits.max_morph_targets,
        };
        limit.check(targets.array()?.len(), &targets.pointer)?;
        let mut count = 0;
        for target in targets.items()? {
            if !target.value.is_object() {
                return Err(target.invalid("a morph target must be an object"));
            }
            count += 1;
        }
        Ok(count)
    }

    /// Decodes a POSITION accessor as a new block of vertices; returns their range in the surface.
    fn read_positions(
        &mut self,
        node: &MeshNode,
        position: &AttributeSource<'d, 'a>,
    ) -> Result<Range<u32>, ScanError> {
        let accessor = position.open()?;
        let place = &position.place;
        if accessor.kind != Type::Vec3 {
            return Err(place.invalid("positions must be VEC3"));
        }
        // Integers up to 16 bits are quantized positions (KHR_mesh_quantization), exact in f32.
        if accessor.component == ComponentType::U32 {
            return Err(place.invalid("positions must be floats, bytes or shorts"));
        }
        let first = self.surface.positions.len();
        let limit = Limit {
            name: "max_vertices",
            allowed: self.limits.max_vertices.min(u32::MAX as usize),
        };
        limit.check(first.saturating_add(accessor.count), &accessor.pointer)?;
        let local = accessor.floats([0.0_f32; 3])?;
        self.surface.positions.reserve(local.len());
        for (vertex, point) in (first as u32..).zip(&local) {
            let point = node.transform.point(Vec3::from(point.map(f64::from)));
            if point.iter().all(|x| x.is_finite()) {
                self.surface.positions.push(point);
            } else {
                self.not_finite.push(vertex);
                self.surface.positions.push(Vec3::zeros());
            }
        }
        let (start, count) = (first as u32, local.len() as u32);
        self.blocks.push(VertexBlock {
            node: node.index,
            start,
            origin: node.transform.offset.amax(),
            local,
        });
        Ok(start..start + count)
    }

    /// Refuses triangles (indices into the block `vertices`) that use a position that is not finite.
    fn check_used(
        &self,
        faces: &[[u32; 3]],
        vertices: &Range<u32>,
        accessor: &str,
    ) -> Result<(), ScanError> {
        let within = |v: &u32| self.not_finite.partition_point(|other| other < v);
        if within(&vertices.start) == within(&vertices.end) {
            return Ok(());
        }
        let unusable = |v: &u32| self.not_finite.binary_search(&(vertices.start + v)).is_ok();
        let Some(&element) = faces.iter().flatten().find(|v| unusable(v)) else {
            return Ok(());
        };
        let block = (self.blocks.iter().rev()).find(|block| block.start == vertices.start);
        let element = element as usize;
        let pointer = match block {
            // The stored position is sound: its node's transform overflows.
            Some(block) if block.local[element].iter().all(|x| x.is_finite()) => {
                format!("/nodes/{}", block.node)
            }
            _ => accessor.into(),
        };
        Err(ScanError::NotFinite { pointer, element })
    }

    /// The triangles of a primitive, indices below `vertices`; degenerate ones included.
    fn read_triangles(
        &mut self,
        source: &PrimitiveSource<'d, 'a>,
        mode: u32,
        vertices: usize,
    ) -> Result<Vec<[u32; 3]>, ScanError> {
        let place = &source.place;
        if let Some(count) = source.stream_faces() {
            self.count_faces(TRIANGLES, count.saturating_mul(3), &place.pointer)?;
            return source.stream_triangles(vertices);
        }
        let indices = match place.get("indices")? {
            Some(reference) => {
                let (_, place) = self.document.root.referred("accessors", &reference)?;
                let accessor = Accessor::open(self.document, &place)?;
                if accessor.kind != Type::Scalar || !is_unsigned(accessor.component) {
                    return Err(place.invalid("indices must be unsigned scalars"));
                }
                self.count_faces(mode, accessor.count, &accessor.pointer)?;
                let mut list = IndexList::zeros(accessor.count);
                accessor.integers(list.indices_mut())?;
                list.restart = match (mode, accessor.component) {
                    (TRIANGLES, _) => None,
                    (_, ComponentType::U8) => Some(u32::from(u8::MAX)),
                    (_, ComponentType::U16) => Some(u32::from(u16::MAX)),
                    _ => Some(u32::MAX),
                };
                let wrong = |index: u32| index as usize >= vertices && Some(index) != list.restart;
                let mut indices = list.indices().iter().enumerate();
                if let Some((element, &index)) = indices.find(|(_, index)| wrong(**index)) {
                    return Err(ScanError::IndexOutOfRange {
                        pointer: accessor.pointer,
                        element,
                        index,
                        vertices,
                    });
                }
                list
            }
            None => {
                self.count_faces(mode, vertices, &place.pointer)?;
                IndexList::counting(vertices)
            }
        };
        Ok(indices.triangles(mode))
    }

    /// Counts the triangles of so many indices against the limit.
    fn count_faces(&mut self, mode: u32, indices: usize, pointer: &str) -> Result<(), ScanError> {
        let faces = if mode == TRIANGLES {
            indices / 3
        } else {
            indices.saturating_sub(2)
        };
        self.faces = self.faces.saturating_add(faces);
        let limit = Limit {
            name: "max_faces",
            allowed: self.limits.max_faces,
        };
        limit.check(self.faces, pointer)
    }
}
