//! Writing: checks patches and appends them as primitives of the meshes they mend.

use std::collections::HashMap;

use darn_budget::Budget;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::TRIANGLES;
use serde_json::{Map, Value, json};

use super::append::{AccessorBounds, AccessorData, Appender};
use super::buffers::BufferTarget;
use super::container::float_bytes;
use super::cut::{cut_primitives, index_bytes};
use super::error::ScanError;
use super::files::Companions;
use super::patch_primitive::{PatchPoint, PatchPrimitive};
use super::patch_skin::patch_influences;
use super::scan::{Scan, ScanPart};
use super::skin::Influence;
use darn_geometry::mesh::Vec3;

/// How far the squared length of a stored normal may be from 1; the glTF validator allows about half of it.
const UNIT: f32 = 1e-3;

const RECONSTRUCTION: &str = "darn reconstruction";

impl Scan {
    /// The scan with patches appended, in the container it was read from. Without patches and cuts: the bytes that were
    /// read.
    ///
    /// Everything that was there keeps its value, spelling and index; the BIN chunk keeps its bytes as a prefix. Only
    /// primitives of which triangles were cut out get new indices.
    ///
    /// # Errors
    /// [`ScanError::InvalidPatch`] for a patch that contradicts itself or the scan, [`ScanError::Singular`] for one on
    /// a node whose transform is singular.
    pub fn write(&self, patches: &[PatchPrimitive]) -> Result<Vec<u8>, ScanError> {
        self.write_within(patches, Budget::unlimited())
    }

    /// [`Scan::write`] within a request's budget.
    ///
    /// # Errors
    /// As [`Scan::write`]; `Exhausted`.
    pub fn write_within(
        &self,
        patches: &[PatchPrimitive],
        budget: &Budget,
    ) -> Result<Vec<u8>, ScanError> {
        if patches.is_empty() && self.cut.is_empty() {
            let bytes = match &self.companions {
                Companions::Zip(zip) => &zip.bytes,
                _ => &self.bytes,
            };
            return Ok(bytes.to_vec());
        }
        let mut out = Appender::new(self);
        cut_primitives(self, &mut out)?;
        let mut materials = HashMap::new();
        for (index, patch) in patches.iter().enumerate() {
            let checked = CheckedPatch::new(self, patch, index)?;
            budget.hold(TARGET * checked.home.targets)?;
            budget.spend(TARGET_WORK * checked.home.targets as u64)?;
            let material = match checked.look.material {
                Some(source) => Some(match materials.get(&source) {
                    Some(copy) => *copy,
                    None => {
                        let copy = copy_material(self, &mut out, source)?;
                        materials.insert(source, copy);
                        copy
                    }
                }),
                None => None,
            };
            let front = checked.front(&mut out, material);
            let back = (patch.both_sides).then(|| checked.back(&mut out, &front));
            for primitive in [front].into_iter().chain(back) {
                out.primitive(checked.home.mesh, primitive);
            }
        }
        budget.check_output(self.bytes.len() + out.appended_bytes())?;
        let mended = out.finish()?;
        match &self.companions {
            Companions::Zip(zip) => zip.with_main(&mended),
            _ => Ok(mended),
        }
    }
}

/// Bytes of memory of a morph target of a patch, as JSON and as text.
const TARGET: usize = 300;
/// Nanoseconds of work a morph target of a patch.
const TARGET_WORK: u64 = 300;

/// Appends a copy of a material that is marked as a reconstruction, and returns its index. A material that has the mark
/// is used as it is.
fn copy_material(scan: &Scan, out: &mut Appender<'_>, source: usize) -> Result<usize, ScanError> {
    let invalid = || ScanError::Invalid {
        pointer: format!("/materials/{source}"),
        detail: "must be an object".into(),
    };
    let mut copy = scan
        .json
        .pointer(&format!("/materials/{source}"))
        .cloned()
        .ok_or_else(invalid)?;
    if copy.pointer("/extras/darn/reconstructed") == Some(&Value::Bool(true)) {
        return Ok(source);
    }
    let name = match copy.get("name").and_then(Value::as_str) {
        Some(name) => format!("{name} ({RECONSTRUCTION})"),
        None => RECONSTRUCTION.into(),
    };
    copy.as_object_mut()
        .ok_or_else(invalid)?
        .insert("name".into(), name.into());
    // Extras that are not an object cannot take the mark; the primitive's extras have it too.
    if let Some(darn) = member_object(&mut copy, "extras")
        .and_then(|extras| member_object(extras, "darn"))
        .and_then(Value::as_object_mut)
    {
        darn.insert("reconstructed".into(), Value::Bool(true));
    }
    Ok(out.push("materials", copy))
}

/// The object `key` of an object, created if it is missing; `None` if `key` is something else.
fn member_object<'v>(object: &'v mut Value, key: &str) -> Option<&'v mut Value> {
    let member = object
        .as_object_mut()?
        .entry(key)
        .or_insert_with(|| Value::Object(Map::new()));
    member.is_object().then_some(member)
}

/// The side of the cloth that a primitive of a patch shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PatchSide {
    Front,
    Back,
}

/// A patch that has been checked against the scan.
struct CheckedPatch<'s> {
    patch: &'s PatchPrimitive,
    /// The part whose mesh and node take the patch.
    home: &'s ScanPart,
    /// The part whose material and attributes the patch takes.
    look: &'s ScanPart,
    /// Positions in the node's space.
    points: Vec<[f32; 3]>,
    /// Sets of joints and weights; none if the mesh has no skin.
    skinning: Vec<Vec<Influence>>,
}

impl<'s> CheckedPatch<'s> {
    fn new(scan: &'s Scan, patch: &'s PatchPrimitive, index: usize) -> Result<Self, ScanError> {
        let fail = |detail: String| ScanError::InvalidPatch {
            patch: index,
            detail,
        };
        let part = |at: usize| {
            scan.parts
                .get(at)
                .ok_or_else(|| fail(format!("there is no part {at}")))
        };
        let (home, look) = (part(patch.part)?, part(patch.material_of)?);
        check_values(patch, look).map_err(fail)?;
        let inverse = home.transform.inverse();
        let mut points = Vec::with_capacity(patch.points.len());
        for (k, point) in patch.points.iter().enumerate() {
            let local = match *point {
                PatchPoint::Scan(vertex) => stored_on(scan, home, vertex),
                PatchPoint::New(_) => None,
            };
            if let Some(local) = local {
                points.push(local);
                continue;
            }
            let in_scene = match *point {
                PatchPoint::New(point) => point,
                PatchPoint::Scan(vertex) => {
                    let position = scan.surface.positions.get(vertex as usize);
                    *position.ok_or_else(|| {
                        fail(format!(
                            "point {k} is vertex {vertex}, which the scan does not have"
                        ))
                    })?
                }
            };
            let inverse = inverse
                .as_ref()
                .ok_or(ScanError::Singular { node: home.node })?;
            let local: [f32; 3] = inverse.point(in_scene).map(|x| x as f32).into();
            if !local.iter().all(|x| x.is_finite()) {
                return Err(fail(format!(
                    "point {k} is not finite in the space of node {}",
                    home.node
                )));
            }
            points.push(local);
        }
        let skinning = match home.skinning {
            Some(_) => patch_influences(scan, home, &patch.points, &points),
            None => Vec::new(),
        };
        Ok(Self {
            patch,
            home,
            look,
            points,
            skinning,
        })
    }

    /// Appends the accessors of the patch's front; returns the primitive with them.
    fn front(&self, out: &mut Appender<'_>, material: Option<usize>) -> Value {
        let patch = self.patch;
        let mut attributes = Map::new();
        let bounds = Some(AccessorBounds::of(&self.points));
        attributes.insert("POSITION".into(), self.floats(out, &self.points, bounds));
        if self.look.normals.is_some() {
            let normals = self.floats(out, &self.normals(), None);
            attributes.insert("NORMAL".into(), normals);
        }
        for (n, set) in patch.texcoords.iter().enumerate() {
            attributes.insert(format!("TEXCOORD_{n}"), self.floats(out, set, None));
        }
        let colors = patch.colors.iter().zip(&self.look.color_kinds);
        for (n, (set, kind)) in colors.enumerate() {
            let set = match kind {
                Type::Vec3 => {
                    let rgb: Vec<[f32; 3]> = set.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
                    self.floats(out, &rgb, None)
                }
                _ => self.floats(out, set, None),
            };
            attributes.insert(format!("COLOR_{n}"), set);
        }
        for (n, set) in self.skinning.iter().enumerate() {
            let weights: Vec<_> = set.iter().map(|influence| influence.weights).collect();
            let weights = self.floats(out, &weights, None);
            attributes.insert(format!("JOINTS_{n}"), self.joints(out, set));
            attributes.insert(format!("WEIGHTS_{n}"), weights);
        }
        let targets = if self.home.targets > 0 {
            // All primitives of a mesh must have the same number of targets; none moves the patch.
            let still = vec![[0.0; 3]; self.points.len()];
            let still = self.floats(out, &still, Some(AccessorBounds::of(&still)));
            vec![json!({ "POSITION": still }); self.home.targets]
        } else {
            Vec::new()
        };
        let mut primitive = Map::new();
        primitive.insert("attributes".into(), Value::Object(attributes));
        primitive.insert("indices".into(), self.indices(out, PatchSide::Front));
        if let Some(material) = material {
            primitive.insert("material".into(), json!(material));
        }
        primitive.insert("mode".into(), json!(TRIANGLES));
        if !targets.is_empty() {
            primitive.insert("targets".into(), Value::Array(targets));
        }
        primitive.insert("extras".into(), json!({ "darn": patch.extras }));
        Value::Object(primitive)
    }

    /// The primitive of the patch's back: it shares all accessors of the front except normals and indices.
    fn back(&self, out: &mut Appender<'_>, front: &Value) -> Value {
        let mut back = front.clone();
        back["indices"] = self.indices(out, PatchSide::Back);
        if self.look.normals.is_some() {
            let inward: Vec<[f32; 3]> = self.normals().iter().map(|n| n.map(|x| -x)).collect();
            back["attributes"]["NORMAL"] = self.floats(out, &inward, None);
        }
        back
    }

    /// Appends an accessor of VEC`N` over the vertices; returns its index.
    fn floats<const N: usize>(
        &self,
        out: &mut Appender<'_>,
        rows: &[[f32; N]],
        bounds: Option<AccessorBounds>,
    ) -> Value {
        out.accessor(AccessorData {
            name: &self.patch.name,
            target: BufferTarget::Vertices,
            component: ComponentType::F32,
            kind: match N {
                2 => Type::Vec2,
                3 => Type::Vec3,
                _ => Type::Vec4,
            },
            bytes: float_bytes(rows),
            bounds,
        })
    }

    /// Appends the joints of one set; returns the accessor's index.
    fn joints(&self, out: &mut Appender<'_>, set: &[Influence]) -> Value {
        let joints = set.iter().flat_map(|influence| influence.joints);
        out.accessor(AccessorData {
            name: &self.patch.name,
            target: BufferTarget::Vertices,
            component: ComponentType::U16,
            kind: Type::Vec4,
            bytes: joints.flat_map(u16::to_le_bytes).collect(),
            bounds: None,
        })
    }

    /// Unit normals in the node's space: the transpose of its linear part, since renderers apply the inverse transpose.
    /// The scan's own vertices keep their stored normals, so that the shading has no seam between patch and scan.
    fn normals(&self) -> Vec<[f32; 3]> {
        let to_node = self.home.transform.linear.transpose();
        let unit = |normal: &Vec3| {
            (to_node * normal)
                .try_normalize(f64::MIN_POSITIVE)
                .unwrap_or_else(Vec3::z)
        };
        (self.patch.points.iter())
            .zip(&self.patch.normals)
            .map(|(point, normal)| {
                self.stored_normal(point)
                    .unwrap_or_else(|| unit(normal).map(|x| x as f32).into())
            })
            .collect()
    }

    /// The scan's normal at a patch point that is a vertex of `look`, if it has unit length.
    fn stored_normal(&self, point: &PatchPoint) -> Option<[f32; 3]> {
        let PatchPoint::Scan(vertex) = *point else {
            return None;
        };
        let at = vertex.checked_sub(self.look.vertices.start)? as usize;
        let stored = *self.look.normals.as_ref()?.get(at)?;
        let unit = (stored.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < UNIT;
        (self.look.node == self.home.node && unit).then_some(stored)
    }

    /// Appends the triangles of one side; returns the accessor's index. Their winding is reversed on the back, and
    /// reversed if the node's transform mirrors.
    fn indices(&self, out: &mut Appender<'_>, side: PatchSide) -> Value {
        let reversed = self.home.transform.mirrors() != (side == PatchSide::Back);
        let faces = self
            .patch
            .faces
            .iter()
            .map(|&[a, b, c]| if reversed { [a, c, b] } else { [a, b, c] });
        let (component, bytes) = index_bytes(faces, self.points.len());
        out.accessor(AccessorData {
            name: &self.patch.name,
            target: BufferTarget::Indices,
            component,
            kind: Type::Scalar,
            bytes,
            bounds: None,
        })
    }
}

/// Checks that a patch has faces over its points, and finite attributes, as many as the part whose look it takes.
fn check_values(patch: &PatchPrimitive, look: &ScanPart) -> Result<(), String> {
    let n = patch.points.len();
    if patch.faces.is_empty() || u32::try_from(n).is_err() {
        return Err(format!("{} faces over {n} points", patch.faces.len()));
    }
    let outside = |face: &&[u32; 3]| face.iter().any(|v| *v as usize >= n);
    if let Some(face) = patch.faces.iter().find(outside) {
        return Err(format!("face {face:?} goes past the {n} points"));
    }
    if look.normals.is_some() {
        expect_count(patch.normals.len(), n, "normals")?;
    }
    let sets = patch.texcoords.len();
    expect_count(sets, look.texcoords.len(), "texture coordinate sets")?;
    expect_count(patch.colors.len(), look.colors.len(), "colour sets")?;
    for set in &patch.texcoords {
        expect_count(set.len(), n, "texture coordinates")?;
    }
    for set in &patch.colors {
        expect_count(set.len(), n, "colours")?;
    }
    let mut texcoords = patch.texcoords.iter().flatten().flatten();
    let mut colors = patch.colors.iter().flatten().flatten();
    if !(texcoords.all(|x| x.is_finite()) && colors.all(|x| x.is_finite())) {
        return Err("a texture coordinate or colour is not finite".into());
    }
    Ok(())
}

/// The stored position of a vertex of the surface that belongs to the home's node; such positions are finite.
fn stored_on(scan: &Scan, home: &ScanPart, vertex: u32) -> Option<[f32; 3]> {
    let (node, local) = scan.stored_position(vertex)?;
    (node == home.node).then_some(local)
}

fn expect_count(found: usize, wanted: usize, what: &str) -> Result<(), String> {
    if found == wanted {
        Ok(())
    } else {
        Err(format!("{found} {what}, where {wanted} are wanted"))
    }
}
