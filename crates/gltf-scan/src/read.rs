//! From the file's bytes to the soup of triangles.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES};
use serde_json::Value;

use super::accessor::{Accessor, is_unsigned};
use super::attributes::Attributes;
use super::buffers::Document;
use super::json::{Place, values_at_most};
use super::scene::{Drawn, drawn};
use super::skin::skinned_meshes;
use super::triangles::Runs;
use super::{Block, Part, Scan, ScanError, ScanLimits};
use darn_geometry::mesh::{TriMesh, Vec3};

const DRACO: &str = "KHR_draco_mesh_compression";
const QUANTIZED: &str = "KHR_mesh_quantization";

pub(super) fn read(bytes: &[u8], limits: &ScanLimits) -> Result<Scan, ScanError> {
    let layout = super::container::layout(bytes)?;
    let text = bytes.get(layout.json.clone()).unwrap_or_default();
    within(
        limits.max_json_values,
        "max_json_values",
        values_at_most(text),
        "",
    )?;
    let json = darn_json::value(text).map_err(|error| ScanError::Container {
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

pub(super) fn within(
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
    limits: &'d ScanLimits,
    surface: TriMesh,
    parts: Vec<Part>,
    blocks: Vec<Block>,
    met: BTreeSet<usize>,
    attributes: Attributes<'d, 'a>,
    skinned: BTreeSet<usize>,
    primitives: usize,
    faces: usize,
}

impl<'d, 'a> Reader<'d, 'a> {
    fn new(document: &'d Document<'a>, limits: &'d ScanLimits) -> Self {
        Self {
            document,
            limits,
            surface: TriMesh::default(),
            parts: Vec::new(),
            blocks: Vec::new(),
            met: BTreeSet::new(),
            attributes: Attributes::new(document, limits),
            skinned: skinned_meshes(document.root.value),
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
        let normals = self.attributes.normals(&attributes, count)?;
        let (texcoords, (color_kinds, colors)) = (
            self.attributes.texcoords(&attributes, count)?,
            self.attributes.colors(&attributes, count)?,
        );
        let skinned = self.skinned.contains(&drawn.mesh);
        let skinning = skinned
            .then(|| self.attributes.influences(&attributes, count))
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
}
