//! Rotations that unfold a surface face by face: carried across edges, breadth first, they agree wherever the cloth is developable.

use super::RestTriangle;
use crate::mesh::{TriMesh, Vec2};

/// Per face the unit vector that turns its rest triangle so that it lies beside the one it was reached from.
///
/// On a curved surface they depend on the way; as a start for ARAP they need not be better.
pub fn rotations(mesh: &TriMesh, rest: &[RestTriangle]) -> Vec<Vec2> {
    let beside = neighbours(mesh);
    let edge = |f: usize, k: usize| rest[f].corners[(k + 1) % 3] - rest[f].corners[k];
    let mut turn = vec![Vec2::zeros(); mesh.faces.len()];
    let mut reached = vec![false; mesh.faces.len()];
    let mut queue = Vec::with_capacity(mesh.faces.len());
    for first in 0..mesh.faces.len() {
        if std::mem::replace(&mut reached[first], true) {
            continue;
        }
        turn[first] = Vec2::x();
        queue.push(first);
        let mut next = queue.len() - 1;
        while let Some(&f) = queue.get(next) {
            next += 1;
            for k in 0..3 {
                let Some((g, l)) = beside[3 * f + k] else {
                    continue;
                };
                if !std::mem::replace(&mut reached[g], true) {
                    // The common edge runs the other way in g.
                    let there = product(turn[f], edge(f, k));
                    let here = -edge(g, l);
                    turn[g] = product(there, Vec2::new(here.x, -here.y)).normalize();
                    queue.push(g);
                }
            }
        }
    }
    turn
}

/// Two vectors multiplied as complex numbers.
fn product(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// Per half-edge (3 · face + corner) the face across it and the corner its edge starts from there.
fn neighbours(mesh: &TriMesh) -> Vec<Option<(usize, usize)>> {
    let count = 3 * mesh.faces.len();
    let ends = |h: usize| {
        let face = &mesh.faces[h / 3];
        (face[h % 3], face[(h % 3 + 1) % 3])
    };
    let mut starts = vec![0; mesh.positions.len() + 1];
    (0..count).for_each(|h| starts[ends(h).0 as usize + 1] += 1);
    for v in 0..mesh.positions.len() {
        starts[v + 1] += starts[v];
    }
    let mut fill = starts.clone();
    let mut leaving = vec![0; count];
    for h in 0..count {
        let place = &mut fill[ends(h).0 as usize];
        leaving[*place] = h;
        *place += 1;
    }
    // Sorted, for a hub's would be looked through once for every face at it; where several come into question the first is taken.
    for s in starts.windows(2) {
        leaving[s[0]..s[1]].sort_unstable_by_key(|&h| (ends(h).1, h));
    }
    (0..count)
        .map(|h| {
            let (from, to) = ends(h);
            let back = &leaving[starts[to as usize]..starts[to as usize + 1]];
            let first = back.get(back.partition_point(|&t| ends(t).1 < from));
            let twin = first.copied().filter(|&t| ends(t).1 == from)?;
            Some((twin / 3, twin % 3))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;

    fn mesh(vertices: usize, faces: Vec<[u32; 3]>) -> TriMesh {
        TriMesh {
            positions: vec![Vec3::zeros(); vertices],
            faces,
        }
    }

    /// For every half-edge the first of all that runs the other way.
    fn by_looking_through(faces: &[[u32; 3]]) -> Vec<Option<(usize, usize)>> {
        let ends = |h: usize| (faces[h / 3][h % 3], faces[h / 3][(h % 3 + 1) % 3]);
        let twin = |h: usize| {
            let (from, to) = ends(h);
            (0..3 * faces.len()).find(|t| ends(*t) == (to, from))
        };
        (0..3 * faces.len())
            .map(|h| twin(h).map(|t| (t / 3, t % 3)))
            .collect()
    }

    proptest! {
        #[test]
        fn half_edges_are_paired_as_by_looking_through_all(faces in prop::collection::vec(prop::array::uniform3(0u32..12), 1..60)) {
            // Most such edges have more than two faces, some one end only.
            let expected = by_looking_through(&faces);
            prop_assert_eq!(neighbours(&mesh(12, faces)), expected);
        }
    }

    #[test]
    fn a_fan_round_a_hub_unfolds_to_a_disk() {
        let spokes = 50_000u32;
        let faces = (0..spokes).map(|k| [0, 1 + k, 1 + (k + 1) % spokes]);
        let fan = mesh(spokes as usize + 1, faces.collect());
        let spoke = |k: f64| {
            let angle = std::f64::consts::TAU * k / f64::from(spokes);
            Vec2::new(angle.cos(), angle.sin())
        };
        let slice = RestTriangle::from_corners([Vec2::zeros(), spoke(0.0), spoke(1.0)]);
        let turns = rotations(&fan, &vec![slice; spokes as usize]);
        for (k, turn) in (0..spokes).zip(turns) {
            assert!((turn - spoke(f64::from(k))).norm() < 1e-9, "{k}");
        }
    }
}
