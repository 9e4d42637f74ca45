//! Patches as primitives of the meshes they mend.

use std::collections::HashMap;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::TRIANGLES;
use serde_json::{Map, Value, json};

use super::append::{Appender, Content, Target};
use super::skin::{self, Influence};
use super::{Part, Scan, ScanError};
use darn_geometry::mesh::Vec3;

/// A patch to append to the scan as a primitive of its own.
///
/// Its attributes follow the part whose material it takes: with normals if that has them, and as many texture coordinate and
/// colour sets, each `[points.len()]`. What moves it on a skinned mesh comes from the scan's vertices among its points.
#[derive(Debug, Clone)]
pub struct Addition {
    /// Index into `Scan::parts` of a part of the mesh and node that take the patch.
    pub part: usize,
    /// Index into `Scan::parts` of the part whose material is copied.
    pub material_of: usize,
    /// The patch's vertices.
    pub points: Vec<PatchPoint>,
    /// Triangles over `points`, counter-clockwise in scene space.
    pub faces: Vec<[u32; 3]>,
    /// Whether it is drawn once more with its other side out, as scans are that have two triangles for each piece of cloth.
    pub both_sides: bool,
    /// Normals in scene space, of any length but zero; not read if the part has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinate sets.
    pub texcoords: Vec<Vec<[f32; 2]>>,
    /// Colour sets, linear RGBA.
    pub colors: Vec<Vec<[f32; 4]>>,
    /// Name of the new accessors and buffer views.
    pub name: String,
    /// What is to be known about the patch: `extras.darn` of its primitive.
    pub extras: Value,
}

/// A vertex of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PatchPoint {
    /// A vertex of `Scan::surface`. Its stored position is copied bit for bit if it belongs to the node that takes the patch.
    Scan(u32),
    /// A point in scene space, brought to the node's space and rounded to f32.
    New(Vec3),
}

/// How far the squared length of a stored normal may be from 1; the validator allows about half of it.
const UNIT: f32 = 1e-3;

const RECONSTRUCTION: &str = "darn reconstruction";

pub(super) fn write(scan: &Scan, additions: &[Addition]) -> Result<Vec<u8>, ScanError> {
    if additions.is_empty() {
        return Ok(scan.bytes.clone());
    }
    let mut out = Appender::new(scan);
    let mut materials = HashMap::new();
    for (index, addition) in additions.iter().enumerate() {
        let patch = Patch::check(scan, addition, index)?;
        let material = match patch.look.material {
            Some(source) => Some(match materials.get(&source) {
                Some(copy) => *copy,
                None => {
                    let copy = copy_material(scan, &mut out, source)?;
                    materials.insert(source, copy);
                    copy
                }
            }),
            None => None,
        };
        let front = patch.primitive(&mut out, material);
        let back = (addition.both_sides).then(|| patch.back(&mut out, &front));
        for primitive in [front].into_iter().chain(back) {
            out.primitive(patch.home.mesh, primitive);
        }
    }
    out.finish()
}

/// Appends a copy of a material that says it is a reconstruction; its index. A material that already says so serves as it is.
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
    // Extras that are no object have no room for ours; the primitive's extras say it all the same.
    if let Some(darn) = inner(&mut copy, "extras")
        .and_then(|extras| inner(extras, "darn"))
        .and_then(Value::as_object_mut)
    {
        darn.insert("reconstructed".into(), Value::Bool(true));
    }
    Ok(out.push("materials", copy))
}

/// The object `key` of an object, made if it is not there; `None` if something else stands there.
fn inner<'v>(object: &'v mut Value, key: &str) -> Option<&'v mut Value> {
    let inner = object
        .as_object_mut()?
        .entry(key)
        .or_insert_with(|| Value::Object(Map::new()));
    inner.is_object().then_some(inner)
}

/// An addition that has been checked against the scan.
struct Patch<'s> {
    addition: &'s Addition,
    /// The part whose mesh and node take the patch.
    home: &'s Part,
    /// The part whose material and attributes it has.
    look: &'s Part,
    /// Positions in the node's space.
    points: Vec<[f32; 3]>,
    /// Sets of joints and weights; none if the mesh has no skin.
    skinning: Vec<Vec<Influence>>,
}

impl<'s> Patch<'s> {
    fn check(scan: &'s Scan, addition: &'s Addition, index: usize) -> Result<Self, ScanError> {
        let fail = |detail: String| ScanError::Addition {
            addition: index,
            detail,
        };
        let part = |at: usize| {
            scan.parts
                .get(at)
                .ok_or_else(|| fail(format!("there is no part {at}")))
        };
        let (home, look) = (part(addition.part)?, part(addition.material_of)?);
        let n = addition.points.len();
        if addition.faces.is_empty() || u32::try_from(n).is_err() {
            return Err(fail(format!(
                "{} faces over {n} points",
                addition.faces.len()
            )));
        }
        if let Some(face) = addition
            .faces
            .iter()
            .find(|face| face.iter().any(|v| *v as usize >= n))
        {
            return Err(fail(format!("face {face:?} goes past the {n} points")));
        }
        if look.normals.is_some() {
            expect_count(addition.normals.len(), n, "normals").map_err(fail)?;
        }
        expect_count(
            addition.texcoords.len(),
            look.texcoords.len(),
            "texture coordinate sets",
        )
        .map_err(fail)?;
        expect_count(addition.colors.len(), look.colors.len(), "colour sets").map_err(fail)?;
        for set in &addition.texcoords {
            expect_count(set.len(), n, "texture coordinates").map_err(fail)?;
        }
        for set in &addition.colors {
            expect_count(set.len(), n, "colours").map_err(fail)?;
        }
        let finite = addition
            .texcoords
            .iter()
            .flatten()
            .flatten()
            .all(|x| x.is_finite())
            && addition
                .colors
                .iter()
                .flatten()
                .flatten()
                .all(|x| x.is_finite());
        if !finite {
            return Err(fail("a texture coordinate or colour is not finite".into()));
        }
        let inverse = home.placement.inverse();
        let mut points = Vec::with_capacity(n);
        for (k, point) in addition.points.iter().enumerate() {
            let point = match *point {
                PatchPoint::Scan(vertex) => match scan.stored(vertex) {
                    Some((node, local)) if node == home.node => Ok(local),
                    _ => Err(*scan.surface.positions.get(vertex as usize).ok_or_else(|| {
                        fail(format!(
                            "point {k} is vertex {vertex}, which the scan does not have"
                        ))
                    })?),
                },
                PatchPoint::New(point) => Err(point),
            };
            let local = match point {
                Ok(local) => local,
                Err(scene) => {
                    let inverse = inverse
                        .as_ref()
                        .ok_or(ScanError::Singular { node: home.node })?;
                    inverse.point(scene).map(|x| x as f32).into()
                }
            };
            if !local.iter().all(|x| x.is_finite()) {
                return Err(fail(format!(
                    "point {k} is not finite in the space of node {}",
                    home.node
                )));
            }
            points.push(local);
        }
        let skinning = match home.skinning {
            Some(_) => skin::carried(scan, home, &addition.points, &points),
            None => Vec::new(),
        };
        Ok(Self {
            addition,
            home,
            look,
            points,
            skinning,
        })
    }

    /// Appends the patch's accessors; the primitive over them.
    fn primitive(&self, out: &mut Appender<'_>, material: Option<usize>) -> Value {
        let addition = self.addition;
        let mut attributes = Map::new();
        let floats = |out: &mut Appender<'_>, kind: Type, bytes: Vec<u8>, bounds| {
            let (name, target, component) =
                (addition.name.as_str(), Target::Vertices, ComponentType::F32);
            out.accessor(Content {
                name,
                target,
                component,
                kind,
                bytes,
                bounds,
            })
        };
        let position = floats(
            out,
            Type::Vec3,
            bytes_of(&self.points),
            Some(bounds(&self.points)),
        );
        attributes.insert("POSITION".into(), position);
        if self.look.normals.is_some() {
            attributes.insert(
                "NORMAL".into(),
                floats(out, Type::Vec3, bytes_of(&self.normals()), None),
            );
        }
        for (n, set) in addition.texcoords.iter().enumerate() {
            attributes.insert(
                format!("TEXCOORD_{n}"),
                floats(out, Type::Vec2, bytes_of(set), None),
            );
        }
        for (n, (set, kind)) in addition
            .colors
            .iter()
            .zip(&self.look.color_kinds)
            .enumerate()
        {
            let bytes = match kind {
                Type::Vec3 => bytes_of(
                    &set.iter()
                        .map(|&[r, g, b, _]| [r, g, b])
                        .collect::<Vec<_>>(),
                ),
                _ => bytes_of(set),
            };
            attributes.insert(format!("COLOR_{n}"), floats(out, *kind, bytes, None));
        }
        for (n, set) in self.skinning.iter().enumerate() {
            let weights: Vec<_> = set.iter().map(|influence| influence.weights).collect();
            let weights = floats(out, Type::Vec4, bytes_of(&weights), None);
            attributes.insert(format!("JOINTS_{n}"), self.joints(out, set));
            attributes.insert(format!("WEIGHTS_{n}"), weights);
        }
        let targets = if self.home.targets > 0 {
            // All primitives of a mesh must have as many targets; this one does not move with any.
            let still = vec![[0.0; 3]; self.points.len()];
            let still = floats(out, Type::Vec3, bytes_of(&still), Some(bounds(&still)));
            vec![json!({ "POSITION": still }); self.home.targets]
        } else {
            Vec::new()
        };
        let mut primitive = Map::new();
        primitive.insert("attributes".into(), Value::Object(attributes));
        primitive.insert("indices".into(), self.indices(out, false));
        if let Some(material) = material {
            primitive.insert("material".into(), json!(material));
        }
        primitive.insert("mode".into(), json!(TRIANGLES));
        if !targets.is_empty() {
            primitive.insert("targets".into(), Value::Array(targets));
        }
        primitive.insert("extras".into(), json!({ "darn": addition.extras }));
        Value::Object(primitive)
    }

    /// A primitive with its other side out: it shares all but normals and indices.
    fn back(&self, out: &mut Appender<'_>, front: &Value) -> Value {
        let mut back = front.clone();
        back["indices"] = self.indices(out, true);
        if self.look.normals.is_some() {
            let inward: Vec<[f32; 3]> = self.normals().iter().map(|n| n.map(|x| -x)).collect();
            back["attributes"]["NORMAL"] = out.accessor(Content {
                name: &self.addition.name,
                target: Target::Vertices,
                component: ComponentType::F32,
                kind: Type::Vec3,
                bytes: bytes_of(&inward),
                bounds: None,
            });
        }
        back
    }

    /// Appends the joints of one set.
    fn joints(&self, out: &mut Appender<'_>, set: &[Influence]) -> Value {
        let joints = set.iter().flat_map(|influence| influence.joints);
        out.accessor(Content {
            name: &self.addition.name,
            target: Target::Vertices,
            component: ComponentType::U16,
            kind: Type::Vec4,
            bytes: joints.flat_map(u16::to_le_bytes).collect(),
            bounds: None,
        })
    }

    /// Normals in the node's space, unit: the transpose of its linear part undoes the inverse transpose that renderers apply.
    /// At the scan's own vertices they are the scan's own, so that light does not break where patch and scan meet.
    fn normals(&self) -> Vec<[f32; 3]> {
        let back = self.home.placement.linear.transpose();
        let unit = |normal: &Vec3| {
            (back * normal)
                .try_normalize(f64::MIN_POSITIVE)
                .unwrap_or_else(Vec3::z)
        };
        (self.addition.points.iter())
            .zip(&self.addition.normals)
            .map(|(point, normal)| {
                self.stored_normal(point)
                    .unwrap_or_else(|| unit(normal).map(|x| x as f32).into())
            })
            .collect()
    }

    /// The scan's normal at a patch point that is one of the look's own vertices, if it is one (of unit length).
    fn stored_normal(&self, point: &PatchPoint) -> Option<[f32; 3]> {
        let PatchPoint::Scan(vertex) = *point else {
            return None;
        };
        let at = vertex.checked_sub(self.look.vertices.start)? as usize;
        let stored = *self.look.normals.as_ref()?.get(at)?;
        let unit = (stored.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < UNIT;
        (self.look.node == self.home.node && unit).then_some(stored)
    }

    /// Appends the triangles, turned round where the node's transform will turn them again, and for the back.
    fn indices(&self, out: &mut Appender<'_>, back: bool) -> Value {
        let turned = self.home.placement.mirrors() != back;
        let faces = self
            .addition
            .faces
            .iter()
            .map(|&[a, b, c]| if turned { [a, c, b] } else { [a, b, c] });
        // 65535 is not an index but a restart in u16.
        let (component, bytes) = if self.points.len() <= usize::from(u16::MAX) {
            (
                ComponentType::U16,
                faces
                    .flatten()
                    .flat_map(|index| (index as u16).to_le_bytes())
                    .collect(),
            )
        } else {
            (
                ComponentType::U32,
                faces.flatten().flat_map(u32::to_le_bytes).collect(),
            )
        };
        let (name, target, kind) = (self.addition.name.as_str(), Target::Indices, Type::Scalar);
        out.accessor(Content {
            name,
            target,
            component,
            kind,
            bytes,
            bounds: None,
        })
    }
}

fn expect_count(found: usize, wanted: usize, what: &str) -> Result<(), String> {
    if found == wanted {
        Ok(())
    } else {
        Err(format!("{found} {what}, where {wanted} are wanted"))
    }
}

fn bytes_of<const N: usize>(values: &[[f32; N]]) -> Vec<u8> {
    values
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

fn bounds(points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let mut out = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let [min, max] = &mut out;
    for point in points {
        for ((min, max), x) in min.iter_mut().zip(max.iter_mut()).zip(point) {
            *min = min.min(*x);
            *max = max.max(*x);
        }
    }
    out
}
