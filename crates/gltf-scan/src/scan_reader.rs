//! The triangles and attributes of a document's meshes, as its nodes draw them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES};
use rayon::prelude::*;
use serde_json::Value;

use super::accessor::{Accessor, is_unsigned};
use super::attributes::AttributeReader;
use super::buffers::Document;
use super::content::SceneContent;
use super::error::ScanError;
use super::json::JsonPlace;
use super::limits::{Limit, ScanLimits};
use super::patch_primitive::is_reconstructed;
use super::primitive::{AttributeSource, ElementsKey, PrimitiveSource};
use super::scan::{ScanPart, VertexBlock};
use super::scene::MeshNode;
use super::skin::skinned_meshes;
use super::triangles::IndexList;
use darn_geometry::mesh::{TriMesh, Vec3};

/// One node that draws a mesh, and what other nodes draw the same mesh.
pub(super) struct MeshInstance<'s> {
    /// The node.
    pub(super) node: &'s MeshNode,
    /// Whether other nodes draw the mesh too.
    pub(super) shared: bool,
    /// Whether no earlier node draws the mesh.
    pub(super) first: bool,
}

/// Collects the surface and its parts, and counts them against the limits.
pub(super) struct ScanReader<'d, 'a> {
    document: &'d Document<'a>,
    limits: &'d ScanLimits,
    /// The triangles read so far.
    pub(super) surface: TriMesh,
    /// Their parts.
    pub(super) parts: Vec<ScanPart>,
    /// Where their vertices are stored.
    pub(super) blocks: Vec<VertexBlock>,
    /// Vertices whose position is not finite, ascending; triangles that use one are refused.
    pub(super) not_finite: Vec<u32>,
    /// Primitives whose accessors state another count than their Draco stream has.
    pub(super) misstated: usize,
    attributes: AttributeReader<'d>,
    skinned: BTreeSet<usize>,
    /// Primitives that draw no triangles.
    pub(super) others: SceneContent,
    /// Primitives so far, points and lines included.
    primitives: usize,
    /// Triangles so far, degenerate ones included.
    faces: usize,
}

impl<'d, 'a> ScanReader<'d, 'a> {
    pub(super) fn new(document: &'d Document<'a>, limits: &'d ScanLimits) -> Self {
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
            misstated: 0,
            attributes: AttributeReader::new(limits),
            skinned: skinned_meshes(document.root.value),
            primitives: 0,
            faces: 0,
        }
    }

    /// Adds the triangle primitives of a mesh as one node draws it.
    pub(super) fn read_mesh(&mut self, instance: &MeshInstance<'_>) -> Result<(), ScanError> {
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
        self.misstated += usize::from(source.misstates_stream()?);
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
        let in_scene_space = node.transform.is_identity();
        let placed = local.par_iter().map(|point| {
            let point = Vec3::from(point.map(f64::from));
            match in_scene_space {
                true => point,
                false => node.transform.point(point),
            }
        });
        let mut placed: Vec<Vec3> = placed.collect();
        let unusable_before = self.not_finite.len();
        for (vertex, point) in (first as u32..).zip(&mut placed) {
            if point.iter().any(|x| !x.is_finite()) {
                self.not_finite.push(vertex);
                *point = Vec3::zeros();
            }
        }
        let (start, count) = (first as u32, local.len() as u32);
        match self.surface.positions.is_empty() {
            true => self.surface.positions = placed,
            false => self.surface.positions.append(&mut placed),
        }
        let is_same = in_scene_space && self.not_finite.len() == unusable_before;
        self.blocks.push(VertexBlock {
            node: node.index,
            start,
            count,
            origin: node.transform.offset.amax(),
            local: (!is_same).then_some(local),
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
            Some(block)
                if (block.local.as_ref().and_then(|local| local.get(element)))
                    .is_some_and(|stored| stored.iter().all(|x| x.is_finite())) =>
            {
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
