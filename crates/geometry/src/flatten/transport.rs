//! Rotations that unfold a surface face by face (discrete parallel transport), breadth first across edges. Where the
//! cloth is developable they do not depend on the path.

use super::rest_triangle::RestTriangle;
use crate::mesh::{TriMesh, Vec2};

/// Per face the unit vector that rotates its rest triangle to lie beside the one it was reached from. The first face
/// of a component is not rotated.
///
/// On a curved surface the rotations depend on the path; they are good enough as a start for ARAP.
pub(super) fn rotations(mesh: &TriMesh, rest: &[RestTriangle]) -> Vec<Vec2> {
    let across = neighbours(mesh);
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
                let Some(Neighbour { face: g, corner: l }) = across[3 * f + k] else {
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

/// The face across a half-edge, and the corner there that the common edge starts from.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Neighbour {
    face: usize,
    corner: usize,
}

/// Per half-edge (3 · face + corner) the face across it. Where several fit, the first counts.
fn neighbours(mesh: &TriMesh) -> Vec<Option<Neighbour>> {
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
    // Sorted for binary search: a linear search at a vertex with many faces would be quadratic. Of several matches
    // the first is taken.
    for s in starts.windows(2) {
        leaving[s[0]..s[1]].sort_unstable_by_key(|&h| (ends(h).1, h));
    }
    (0..count)
        .map(|h| {
            let (from, to) = ends(h);
            let back = &leaving[starts[to as usize]..starts[to as usize + 1]];
            let first = back.get(back.partition_point(|&t| ends(t).1 < from));
            let twin = first.copied().filter(|&t| ends(t).1 == from)?;
            Some(Neighbour {
                face: twin / 3,
                corner: twin % 3,
            })
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

    /// For every half-edge the first of all half-edges that runs the other way.
    fn by_linear_search(faces: &[[u32; 3]]) -> Vec<Option<Neighbour>> {
        let ends = |h: usize| (faces[h / 3][h % 3], faces[h / 3][(h % 3 + 1) % 3]);
        let twin = |h: usize| {
            let (from, to) = ends(h);
            (0..3 * faces.len()).find(|t| ends(*t) == (to, from))
        };
        (0..3 * faces.len())
            .map(twin)
            .map(|twin| {
                twin.map(|t| Neighbour {
                    face: t / 3,
                    corner: t % 3,
                })
            })
            .collect()
    }

    proptest! {
        #[test]
        fn half_edges_are_paired_as_by_linear_search(faces in prop::collection::vec(prop::array::uniform3(0u32..12), 1..60)) {
            // Most edges of random faces have more than two faces; some have one vertex at both ends.
            let expected = by_linear_search(&faces);
            prop_assert_eq!(neighbours(&mesh(12, faces)), expected);
        }
    }

    #[test]
    fn a_fan_of_many_faces_unfolds_to_a_disk() {
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
