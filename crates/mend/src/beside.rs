//! Patches of one scan that come near each other: each hole is filled without knowing of the others.

use std::collections::HashSet;

use super::hole::Filled;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Pushes every patch off those before it, where their boxes meet; in order of id, so that the outcome does not depend on threads.
pub fn apart(holes: &mut [Filled]) {
    for own in 1..holes.len() {
        let (before, rest) = holes.split_at_mut(own);
        let own = &mut rest[0];
        let others = near(own, before);
        if !others.faces.is_empty() {
            own.prepared.plan.separate(&mut own.patch, &others);
        }
    }
}

/// The triangles of other patches whose box meets that of a patch. One that has a vertex of the patch's rim touches it there and does not
/// count.
fn near(own: &Filled, others: &[Filled]) -> TriMesh {
    let (low, high) = bounds(&own.patch.positions);
    let on_rim: HashSet<u32> = rim(own).collect();
    let mut near = TriMesh::default();
    for other in others {
        let patch = &other.patch;
        let (least, most) = bounds(&patch.positions);
        if (0..3).any(|k| most[k] < low[k] || least[k] > high[k]) {
            continue;
        }
        let shared: Vec<bool> = rim(other).map(|v| on_rim.contains(&v)).collect();
        let touches = |face: &&[u32; 3]| {
            let on_rim = |v: &u32| shared.get(*v as usize) == Some(&true);
            face.iter().any(on_rim)
        };
        let base = near.positions.len() as u32;
        near.positions.extend_from_slice(&patch.positions);
        let faces = patch.faces.iter().filter(|face| !touches(face));
        near.faces.extend(faces.map(|f| f.map(|v| base + v)));
    }
    near
}

/// The rim's vertices in the whole scan's numbering.
fn rim<'a>(filled: &'a Filled) -> impl Iterator<Item = u32> + 'a {
    let region = &filled.prepared.region;
    filled
        .patch
        .rim
        .iter()
        .map(|v| region.vertices[*v as usize].0)
}

fn bounds(positions: &[Vec3]) -> (Vec3, Vec3) {
    let low = positions
        .iter()
        .fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
    let high = positions
        .iter()
        .fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
    (low, high)
}
