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
    (0..count)
        .map(|h| {
            let (from, to) = ends(h);
            let back = leaving[starts[to as usize]..starts[to as usize + 1]].iter();
            let twin = back.copied().find(|&t| ends(t).1 == from)?;
            Some((twin / 3, twin % 3))
        })
        .collect()
}
