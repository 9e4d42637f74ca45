//! A patch checked against the scan that takes it.

use super::error::ScanError;
use super::patch_primitive::{PatchPoint, PatchPrimitive};
use super::patch_skin::patch_influences;
use super::scan::{Scan, ScanPart};
use super::skin::Influence;
use darn_geometry::mesh::Vec3;

/// How far the squared length of a stored normal may be from 1; the glTF validator allows about half of it.
const UNIT: f32 = 1e-3;

/// A patch that has been checked against the scan.
pub(super) struct CheckedPatch<'s> {
    pub patch: &'s PatchPrimitive,
    /// The part whose mesh and node take the patch.
    pub home: &'s ScanPart,
    /// The part whose material and attributes the patch takes.
    pub look: &'s ScanPart,
    /// Positions in the node's space.
    pub points: Vec<[f32; 3]>,
    /// Sets of joints and weights; none if the mesh has no skin.
    pub skinning: Vec<Vec<Influence>>,
}

/// What patches must have in common to share a primitive: where they are, how they look, and their attributes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PatchKind {
    node: usize,
    mesh: usize,
    /// Number of the materials.
    materials: usize,
    /// Number of the appearance.
    appearance: usize,
    hatch: Option<usize>,
    both_sides: bool,
    normals: bool,
    tangents: bool,
    texcoords: usize,
    /// Channels of each colour set.
    colors: Vec<usize>,
    /// Whether it is known how far vertices may be off.
    deviations: bool,
    /// Sets of joints and weights.
    influences: usize,
    targets: usize,
}

impl<'s> CheckedPatch<'s> {
    /// Checks a patch, the `index`-th of those to write.
    pub fn new(scan: &'s Scan, patch: &'s PatchPrimitive, index: usize) -> Result<Self, ScanError> {
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

    /// What patches must have in common to share a primitive; `materials` is a number of the materials that the part has
    /// whose look it takes, `appearance` one of its appearance.
    pub fn kind(&self, materials: usize, appearance: usize) -> PatchKind {
        let kinds = self.look.color_kinds.iter().take(self.patch.colors.len());
        PatchKind {
            node: self.home.node,
            mesh: self.home.mesh,
            materials,
            appearance,
            hatch: self.look.hatch,
            both_sides: self.patch.both_sides,
            normals: self.look.normals.is_some(),
            tangents: !self.patch.tangents.is_empty(),
            texcoords: self.patch.texcoords.len(),
            colors: kinds.map(|kind| kind.multiplicity()).collect(),
            deviations: !self.patch.deviations.is_empty(),
            influences: self.skinning.len(),
            targets: self.home.targets,
        }
    }

    /// Unit normals in the node's space: the transpose of its linear part, since renderers apply the inverse transpose.
    /// The scan's own vertices keep their stored normals, so that the shading has no seam between patch and scan.
    pub fn normals(&self) -> Vec<[f32; 3]> {
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

    /// Tangents in the node's space, at right angles to the normals.
    pub fn tangents(&self, normals: &[[f32; 3]]) -> Vec<[f32; 4]> {
        let to_node = (self.home.transform.inverse())
            .map_or_else(nalgebra::Matrix3::identity, |inverse| inverse.linear);
        let handedness = if self.home.transform.mirrors() {
            -1.0
        } else {
            1.0
        };
        (self.patch.tangents.iter().zip(normals))
            .map(|([x, y, z, w], normal)| {
                let normal = Vec3::from(normal.map(f64::from));
                let along = to_node * Vec3::from([*x, *y, *z].map(f64::from));
                let across = along - normal * normal.dot(&along);
                let unit = (across.try_normalize(1e-9 * along.norm()))
                    .unwrap_or_else(|| any_across(&normal));
                let [x, y, z]: [f32; 3] = unit.map(|x| x as f32).into();
                [x, y, z, w * handedness]
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
}

/// A unit vector at right angles to a unit vector.
fn any_across(normal: &Vec3) -> Vec3 {
    let axis = if normal.x.abs() < 0.5 {
        Vec3::x()
    } else {
        Vec3::y()
    };
    normal
        .cross(&axis)
        .try_normalize(0.0)
        .unwrap_or_else(Vec3::x)
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
    let [texcoords, colors] = (patch.appearance).sets([look.texcoords.len(), look.colors.len()]);
    expect_count(patch.texcoords.len(), texcoords, "texture coordinate sets")?;
    expect_count(patch.colors.len(), colors, "colour sets")?;
    if let Some(own) = patch.appearance.own() {
        expect_count(own.layers.len(), own.look.layers.len(), "images")?;
        let texels = own.width as usize * own.height as usize;
        for layer in own.layers.iter() {
            expect_count(layer.len(), texels, "texels")?;
        }
        if texels == 0 {
            return Err("an image without texels".into());
        }
    }
    if !patch.tangents.is_empty() {
        expect_count(patch.tangents.len(), n, "tangents")?;
    }
    if !patch.tangents.iter().flatten().all(|x| x.is_finite()) {
        return Err("a tangent is not finite".into());
    }
    if !patch.deviations.is_empty() {
        expect_count(patch.deviations.len(), n, "deviations")?;
    }
    if !patch.deviations.iter().all(|x| x.is_finite()) {
        return Err("a deviation is not finite".into());
    }
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
