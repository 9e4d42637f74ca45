//! Joints and weights of a patch on a skinned mesh: those of the rim beside it.
//!
//! Viewers treat every primitive of a mesh as skinned if some node draws the mesh with a skin, so a patch needs joints
//! and weights too.

use std::iter::once;

use super::patch_primitive::PatchPoint;
use super::scan::{Scan, ScanPart};
use super::skin::Influence;
use darn_geometry::mesh::nearest::closest_vertex;
use darn_geometry::mesh::{TriMesh, Vec3};

/// The skin's first joint alone.
const FIRST_JOINT: Influence = Influence {
    joints: [0; 4],
    weights: FIRST_ONLY,
};

const FIRST_ONLY: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// How far the sum of a vertex's weights may be from 1, for each weight that is not 0; the glTF validator allows as
/// much.
const ROUNDING: f64 = 2e-7;

/// The influences of a patch on `home`, `[sets][points]`, at least one set; `positions` are its points in the node's
/// space.
///
/// A vertex of the home's node keeps its own influences. Any other point takes those of the nearest such vertex, the
/// first of several, and no blend: a blend of several vertices may name more joints than the sets have room for.
pub(super) fn patch_influences(
    scan: &Scan,
    home: &ScanPart,
    points: &[PatchPoint],
    positions: &[[f32; 3]],
) -> Vec<Vec<Influence>> {
    let skinned = skinned_parts(scan, home);
    let own: Vec<Option<Vec<Influence>>> = points
        .iter()
        .map(|point| stored_influences(&skinned, point))
        .collect();
    let position = |local: &[f32; 3]| Vec3::from(local.map(f64::from));
    let known = own.iter().zip(positions);
    let (known, known_positions): (Vec<&[Influence]>, Vec<Vec3>) = known
        .filter_map(|(own, at)| Some((own.as_deref()?, position(at))))
        .unzip();
    let rim = TriMesh {
        positions: known_positions,
        faces: Vec::new(),
    };
    let nearest = |at: &[f32; 3]| {
        let vertex = closest_vertex(&rim, &position(at))?;
        known.get(vertex as usize).copied()
    };
    let of_points = own.iter().zip(positions).map(|(own, at)| {
        own.as_deref()
            .or_else(|| nearest(at))
            .unwrap_or(&[FIRST_JOINT])
    });
    let of_points: Vec<&[Influence]> = of_points.collect();
    let sets = of_points.iter().map(|sets| sets.len()).max().unwrap_or(1);
    let set = |n: usize| -> Vec<Influence> {
        let each = of_points.iter().map(|sets| sets.get(n).copied());
        each.map(Option::unwrap_or_default).collect()
    };
    (0..sets).map(set).collect()
}

/// The parts of the home's node that have joints, the home itself first. Parts of other nodes may belong to another
/// skin.
fn skinned_parts<'s>(scan: &'s Scan, home: &'s ScanPart) -> Vec<&'s ScanPart> {
    let has_joints = |part: &&ScanPart| part.skinning.as_ref().is_some_and(|sets| !sets.is_empty());
    let parts = once(home).chain(&scan.parts);
    parts
        .filter(|part| part.node == home.node)
        .filter(has_joints)
        .collect()
}

/// All sets of a patch point that is a vertex of one of the parts.
fn stored_influences(parts: &[&ScanPart], point: &PatchPoint) -> Option<Vec<Influence>> {
    let PatchPoint::Scan(vertex) = *point else {
        return None;
    };
    let part = parts.iter().find(|part| part.vertices.contains(&vertex))?;
    let at = (vertex - part.vertices.start) as usize;
    let sets = part.skinning.iter().flatten();
    let sets = sets.filter_map(|set| set.get(at)).copied().collect();
    Some(normalized(sets))
}

/// A vertex's sets with weights that sum to 1 over all sets; weights that already do keep their bits. If all weights
/// are 0, the first joint gets weight 1, as in three.js.
fn normalized(mut sets: Vec<Influence>) -> Vec<Influence> {
    let weights = sets.iter().flat_map(|set| set.weights);
    let (mut sum, mut used) = (0.0_f64, 0.0_f64);
    for weight in weights.filter(|weight| *weight > 0.0) {
        sum += f64::from(weight);
        used += 1.0;
    }
    if sum == 0.0 {
        sets.iter_mut()
            .take(1)
            .for_each(|set| set.weights = FIRST_ONLY);
    } else if (sum - 1.0).abs() > ROUNDING * used {
        for weight in sets.iter_mut().flat_map(|set| &mut set.weights) {
            *weight = (f64::from(*weight) / sum) as f32;
        }
    }
    sets
}
