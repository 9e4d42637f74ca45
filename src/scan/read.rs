//! From the file's bytes to the soup of triangles.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES};
use serde_json::Value;

use super::accessor::{Accessor, is_unsigned};
use super::buffers::Document;
use super::json::{Place, values_at_most};
use super::scene::{Drawn, drawn};
use super::skin::{Influence, Influences, skinned_meshes};
use super::triangles::Runs;
use super::{Block, Limits, Part, Scan, ScanError};
use crate::mesh::{TriMesh, Vec3};

type Uvs = Arc<[[f32; 2]]>;
type Rgba = Arc<[[f32; 4]]>;

const DRACO: &str = "KHR_draco_mesh_compression";
const QUANTIZED: &str = "KHR_mesh_quantization";

pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Scan, ScanError> {
    let layout = super::container::layout(bytes)?;
    let text = bytes.get(layout.json.clone()).unwrap_or_default();
    within(
        limits.max_json_values,
        "max_json_values",
        values_at_most(text),
        "",
    )?;
    let json = crate::plain::value(text).map_err(|error| ScanError::Container {
        offset: layout.json.start + offset_of(text, error.line(), error.column()),
        detail: format!("the JSON does not parse: {error}"),
    })?;
    let root = Place::root(&json);
    check_version(&root)?;
    let bin = layout.bin.clone().and_then(|range| bytes.get(range));
    let document = Document::new(root.clone(), bin)?;
    let scene = drawn(&root, limits)?;
    let mut instances: HashMap<usize, usize> = HashMap::new();
    for drawn in &scene {
        *instances.entry(drawn.mesh).or_default() += 1;
    }
    let mut reader = Reader::new(&document, limits);
    for drawn in &scene {
        let first = reader.parts.len();
        reader.mesh(drawn)?;
        let fresh = reader.met.insert(drawn.mesh);
        for part in reader.parts.iter_mut().skip(first) {
            part.shared = instances.get(&drawn.mesh).is_some_and(|n| *n > 1);
            part.first_instance = fresh;
        }
    }
    let Reader {
        surface,
        parts,
        blocks,
        ..
    } = reader;
    if surface.faces.is_empty() {
        return Err(ScanError::NoTriangles);
    }
    Ok(Scan {
        surface,
        parts,
        blocks,
        bytes: bytes.to_vec(),
        layout,
        json,
    })
}

fn check_version(root: &Place<'_>) -> Result<(), ScanError> {
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

fn within(
    allowed: usize,
    limit: &'static str,
    found: usize,
    pointer: &str,
) -> Result<(), ScanError> {
    if found <= allowed {
        return Ok(());
    }
    Err(ScanError::Limit {
        pointer: pointer.into(),
        limit,
        allowed,
        found,
    })
}

struct Reader<'d, 'a> {
    document: &'d Document<'a>,
    limits: &'d Limits,
    surface: TriMesh,
    parts: Vec<Part>,
    blocks: Vec<Block>,
    met: BTreeSet<usize>,
    /// Texture coordinate and colour sets by accessor: primitives and instances share them.
    texcoords: HashMap<usize, Uvs>,
    colors: HashMap<usize, (Type, Rgba)>,
    /// Sets of joints and weights, likewise, by the accessors of both.
    influences: HashMap<(usize, usize), Influences>,
    skinned: BTreeSet<usize>,
    attribute_values: usize,
    primitives: usize,
    faces: usize,
}

impl<'d, 'a> Reader<'d, 'a> {
    fn new(document: &'d Document<'a>, limits: &'d Limits) -> Self {
        Self {
            document,
            limits,
            surface: TriMesh::default(),
            parts: Vec::new(),
            blocks: Vec::new(),
            met: BTreeSet::new(),
            texcoords: HashMap::new(),
            colors: HashMap::new(),
            influences: HashMap::new(),
            skinned: skinned_meshes(document.root.value),
            attribute_values: 0,
            primitives: 0,
            faces: 0,
        }
    }

    /// Adds the triangle primitives of a drawn mesh.
    fn mesh(&mut self, drawn: &Drawn) -> Result<(), ScanError> {
        let Some(meshes) = self.document.root.get("meshes")? else {
            return Ok(());
        };
        let Some(mesh) = meshes.item(drawn.mesh)? else {
            return Ok(());
        };
        // Blocks of this node by POSITION accessor; a BTreeMap only for its small size.
        let mut blocks = BTreeMap::new();
        for (index, place) in mesh.need("primitives")?.items()?.enumerate() {
            self.primitives += 1;
            within(
                self.limits.max_primitives,
                "max_primitives",
                self.primitives,
                &place.pointer,
            )?;
            if let Some(part) = self.primitive(drawn, &place, &mut blocks)? {
                self.parts.push(Part {
                    primitive: index,
                    ..part
                });
            }
        }
        Ok(())
    }

    /// One primitive, or `None` when it draws no triangles (points, lines, no positions).
    fn primitive(
        &mut self,
        drawn: &Drawn,
        place: &Place<'a>,
        blocks: &mut BTreeMap<usize, (u32, usize)>,
    ) -> Result<Option<Part>, ScanError> {
        let mode = u32::try_from(place.integer_or("mode", TRIANGLES as usize)?).unwrap_or(u32::MAX);
        if ![TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN].contains(&mode) {
            return Ok(None);
        }
        let attributes = place.need("attributes")?;
        let Some(position) = attributes.get("POSITION")? else {
            return Ok(None);
        };
        let (key, accessor) = self.document.root.referred("accessors", &position)?;
        if let Some(draco) = place.extension(DRACO)? {
            // Unless it is required, plain accessors may be there as a fallback.
            if self.document.requires(DRACO) || accessor.get("bufferView")?.is_none() {
                return Err(ScanError::Unsupported {
                    pointer: draco.pointer,
                    extension: DRACO,
                });
            }
        }
        let (start, count) = match blocks.get(&key) {
            Some(block) => *block,
            None => {
                let block = self.positions(drawn, &accessor)?;
                blocks.insert(key, block);
                block
            }
        };
        let faces = self.triangles(place, mode, count)?;
        let mirrored = drawn.placement.mirrors();
        let first = self.surface.faces.len() as u32;
        self.surface.faces.extend(
            faces
                .into_iter()
                .filter(|[a, b, c]| a != b && b != c && c != a)
                .map(|[a, b, c]| {
                    let [b, c] = if mirrored { [c, b] } else { [b, c] };
                    [start + a, start + b, start + c]
                }),
        );
        let normals = self.normals(&attributes, count)?;
        let (texcoords, (color_kinds, colors)) = (
            self.texcoords(&attributes, count)?,
            self.colors(&attributes, count)?,
        );
        let skinned = self.skinned.contains(&drawn.mesh);
        let skinning = skinned
            .then(|| self.influences(&attributes, count))
            .transpose()?;
        let material = match place.get("material")? {
            Some(reference) => Some(self.document.root.referred("materials", &reference)?.0),
            None => None,
        };
        Ok(Some(Part {
            node: drawn.node,
            mesh: drawn.mesh,
            primitive: 0,
            material,
            vertices: start..start + count as u32,
            faces: first..self.surface.faces.len() as u32,
            texcoords,
            colors,
            normals,
            reconstructed: place.value.pointer("/extras/darn/reconstructed")
                == Some(&Value::Bool(true)),
            shared: false,
            first_instance: false,
            targets: place
                .get("targets")?
                .map_or(Ok(0), |targets| targets.array().map(<[_]>::len))?,
            color_kinds,
            placement: drawn.placement.clone(),
            skinning,
        }))
    }

    /// Decodes a POSITION accessor as a new block of vertices; its first vertex and its length.
    fn positions(&mut self, drawn: &Drawn, place: &Place<'a>) -> Result<(u32, usize), ScanError> {
        let accessor = Accessor::open(self.document, place)?;
        if accessor.kind != Type::Vec3 {
            return Err(place.invalid("positions must be VEC3"));
        }
        if accessor.component != ComponentType::F32 {
            return Err(ScanError::Unsupported {
                pointer: accessor.pointer,
                extension: QUANTIZED,
            });
        }
        let first = self.surface.positions.len();
        let allowed = self.limits.max_vertices.min(u32::MAX as usize);
        within(
            allowed,
            "max_vertices",
            first.saturating_add(accessor.count),
            &accessor.pointer,
        )?;
        let local = accessor.floats([0.0_f32; 3])?;
        for (element, point) in local.iter().enumerate() {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(ScanError::NotFinite {
                    pointer: accessor.pointer,
                    element,
                });
            }
            let point = drawn.placement.point(Vec3::from(point.map(f64::from)));
            if !point.iter().all(|x| x.is_finite()) {
                return Err(ScanError::NotFinite {
                    pointer: format!("/nodes/{}", drawn.node),
                    element,
                });
            }
            self.surface.positions.push(point);
        }
        let (start, count) = (first as u32, local.len());
        self.blocks.push(Block {
            node: drawn.node,
            start,
            local,
        });
        Ok((start, count))
    }

    /// The triangles of a primitive, indices below `vertices`; degenerate ones included.
    fn triangles(
        &mut self,
        place: &Place<'a>,
        mode: u32,
        vertices: usize,
    ) -> Result<Vec<[u32; 3]>, ScanError> {
        let indices = match place.get("indices")? {
            Some(reference) => {
                let (_, place) = self.document.root.referred("accessors", &reference)?;
                let accessor = Accessor::open(self.document, &place)?;
                if accessor.kind != Type::Scalar || !is_unsigned(accessor.component) {
                    return Err(place.invalid("indices must be unsigned scalars"));
                }
                self.bound_faces(mode, accessor.count, &accessor.pointer)?;
                let restart = match (mode, accessor.component) {
                    (TRIANGLES, _) => None,
                    (_, ComponentType::U8) => Some(u32::from(u8::MAX)),
                    (_, ComponentType::U16) => Some(u32::from(u16::MAX)),
                    _ => Some(u32::MAX),
                };
                let indices = accessor.integers()?;
                let wrong = |index: u32| index as usize >= vertices && Some(index) != restart;
                if let Some((element, &index)) =
                    indices.iter().enumerate().find(|(_, index)| wrong(**index))
                {
                    return Err(ScanError::IndexOutOfRange {
                        pointer: accessor.pointer,
                        element,
                        index,
                        vertices,
                    });
                }
                Runs { indices, restart }
            }
            None => {
                self.bound_faces(mode, vertices, &place.pointer)?;
                Runs {
                    indices: (0..vertices as u32).collect(),
                    restart: None,
                }
            }
        };
        Ok(indices.triangles(mode))
    }

    fn bound_faces(&mut self, mode: u32, indices: usize, pointer: &str) -> Result<(), ScanError> {
        let faces = if mode == TRIANGLES {
            indices / 3
        } else {
            indices.saturating_sub(2)
        };
        self.faces = self.faces.saturating_add(faces);
        within(self.limits.max_faces, "max_faces", self.faces, pointer)
    }

    /// The normals, if there are any; NaN and infinities read as 0.
    fn normals(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<Option<Arc<[[f32; 3]]>>, ScanError> {
        let Some(reference) = attributes.get("NORMAL")? else {
            return Ok(None);
        };
        let (_, place) = self.document.root.referred("accessors", &reference)?;
        let accessor = self.attribute(&place, &[Type::Vec3])?;
        let normals: Arc<[_]> = (accessor.floats([0.0; 3])?.into_iter())
            .map(|normal| normal.map(tame))
            .collect();
        same_count(&place, normals.len(), vertices)?;
        Ok(Some(normals))
    }

    fn texcoords(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<Vec<Uvs>, ScanError> {
        let mut sets = Vec::new();
        while let Some(reference) = attributes.get(&format!("TEXCOORD_{}", sets.len()))? {
            let (key, place) = self.document.root.referred("accessors", &reference)?;
            let set = match self.texcoords.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let accessor = self.attribute(&place, &[Type::Vec2])?;
                    let set: Arc<[_]> = accessor
                        .floats([0.0; 2])?
                        .into_iter()
                        .map(|uv| uv.map(tame))
                        .collect();
                    self.texcoords.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&place, set.len(), vertices)?;
            sets.push(set);
            within(
                self.limits.max_attribute_sets,
                "max_attribute_sets",
                sets.len(),
                &attributes.pointer,
            )?;
        }
        Ok(sets)
    }

    /// The colour sets and, beside them, their types in the file.
    fn colors(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<(Vec<Type>, Vec<Rgba>), ScanError> {
        let (mut kinds, mut sets) = (Vec::new(), Vec::new());
        while let Some(reference) = attributes.get(&format!("COLOR_{}", sets.len()))? {
            let (key, place) = self.document.root.referred("accessors", &reference)?;
            let (kind, set) = match self.colors.get(&key) {
                Some((kind, set)) => (*kind, Arc::clone(set)),
                None => {
                    let accessor = self.attribute(&place, &[Type::Vec3, Type::Vec4])?;
                    let set = accessor
                        .floats([0.0, 0.0, 0.0, 1.0])?
                        .into_iter()
                        .map(|rgba| rgba.map(tame));
                    let set: Arc<[_]> = set.collect();
                    self.colors.insert(key, (accessor.kind, Arc::clone(&set)));
                    (accessor.kind, set)
                }
            };
            same_count(&place, set.len(), vertices)?;
            kinds.push(kind);
            sets.push(set);
            within(
                self.limits.max_attribute_sets,
                "max_attribute_sets",
                sets.len(),
                &attributes.pointer,
            )?;
        }
        Ok((kinds, sets))
    }

    /// The sets of joints and weights, as far as both are there.
    fn influences(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<Vec<Influences>, ScanError> {
        let mut sets = Vec::new();
        while let (Some(joints), Some(weights)) = (
            attributes.get(&format!("JOINTS_{}", sets.len()))?,
            attributes.get(&format!("WEIGHTS_{}", sets.len()))?,
        ) {
            let (of_joints, joints) = self.document.root.referred("accessors", &joints)?;
            let (of_weights, weights) = self.document.root.referred("accessors", &weights)?;
            let key = (of_joints, of_weights);
            let set = match self.influences.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let set = self.weighted_joints(&joints, &weights, vertices)?;
                    self.influences.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&joints, set.len(), vertices)?;
            sets.push(set);
            within(
                self.limits.max_attribute_sets,
                "max_attribute_sets",
                sets.len(),
                &attributes.pointer,
            )?;
        }
        Ok(sets)
    }

    /// Decodes a JOINTS accessor and the WEIGHTS that go with it; negative weights read as 0.
    fn weighted_joints(
        &mut self,
        joints: &Place<'a>,
        weights: &Place<'a>,
        vertices: usize,
    ) -> Result<Influences, ScanError> {
        let accessor = self.attribute(joints, &[Type::Vec4])?;
        if ![ComponentType::U8, ComponentType::U16].contains(&accessor.component) {
            return Err(joints.invalid("joints must be unsigned bytes or shorts"));
        }
        same_count(joints, accessor.count, vertices)?;
        let of_joints = accessor.quadruples()?;
        let accessor = self.attribute(weights, &[Type::Vec4])?;
        same_count(weights, accessor.count, vertices)?;
        let of_weights = accessor.floats([0.0; 4])?.into_iter();
        let of_weights = of_weights.map(|weights| weights.map(|w| tame(w).max(0.0)));
        let influences = of_joints.into_iter().zip(of_weights);
        Ok(influences
            .map(|(joints, weights)| Influence { joints, weights })
            .collect())
    }

    /// Opens a vertex attribute and counts its values against the limit.
    fn attribute(&mut self, place: &Place<'a>, kinds: &[Type]) -> Result<Accessor<'d>, ScanError> {
        let accessor = Accessor::open(self.document, place)?;
        if !kinds.contains(&accessor.kind) {
            return Err(place.invalid(format!("must be one of {kinds:?} here")));
        }
        let values = accessor.count.saturating_mul(accessor.kind.multiplicity());
        self.attribute_values = self.attribute_values.saturating_add(values);
        within(
            self.limits.max_attribute_values,
            "max_attribute_values",
            self.attribute_values,
            &place.pointer,
        )?;
        Ok(accessor)
    }
}

/// A file may carry NaN in attributes that nothing depends on; a patch must not spread it.
fn tame(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

fn same_count(place: &Place<'_>, count: usize, vertices: usize) -> Result<(), ScanError> {
    if count == vertices {
        return Ok(());
    }
    Err(place.invalid(format!(
        "has {count} elements, but the primitive has {vertices} vertices"
    )))
}
