//! Which triangles of a patch cut each other or the cloth around: a sweep along one axis, floating-point rejection with margins, and
//! the exact predicates of `mesh::intersect` on the few pairs that are left.

use crate::mesh::intersect::intersections_with;
use crate::mesh::{TriMesh, Vec3};

/// All pairs of faces `(f, g)`, `f < g`, that cut each other, `g` at least `first`; ascending. The same as `intersections_with` gives.
pub(super) fn crossings(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
    let doubtful = doubtful(mesh, first);
    if doubtful.is_empty() {
        return Vec::new();
    }
    // The exact test, on a mesh of the doubtful faces alone.
    let mut faces: Vec<u32> = doubtful.iter().flat_map(|(f, g)| [*f, *g]).collect();
    faces.sort_unstable();
    faces.dedup();
    let few = mesh.part(faces.iter().map(|f| mesh.faces[*f as usize]));
    let asked: Vec<u32> = (0u32..)
        .zip(&faces)
        .filter(|(_, f)| **f as usize >= first)
        .map(|(k, _)| k)
        .collect();
    // `faces` ascend, so the pairs do, too.
    let found = intersections_with(&few, &asked).into_iter();
    found
        .map(|(f, g)| (faces[f as usize], faces[g as usize]))
        .collect()
}

/// A face with its box.
struct Boxed {
    low: Vec3,
    high: Vec3,
    face: u32,
}

/// Pairs that may cut: boxes overlap and no plane test keeps them surely apart.
fn doubtful(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
    let boxed = |face: usize| {
        let [a, b, c] = mesh.triangle(face);
        Boxed {
            low: a.inf(&b).inf(&c),
            high: a.sup(&b).sup(&c),
            face: face as u32,
        }
    };
    let own: Vec<Boxed> = (first..mesh.faces.len()).map(boxed).collect();
    let low = own
        .iter()
        .fold(Vec3::repeat(f64::INFINITY), |m, b| m.inf(&b.low));
    let high = own
        .iter()
        .fold(Vec3::repeat(f64::NEG_INFINITY), |m, b| m.sup(&b.high));
    let near = |b: &Boxed| (0..3).all(|d| b.low[d] <= high[d] && b.high[d] >= low[d]);
    let mut boxes: Vec<Boxed> = (0..first).map(boxed).filter(near).collect();
    boxes.extend(own);
    let axis = (high - low).imax();
    let (second, third) = ((axis + 1) % 3, (axis + 2) % 3);
    boxes.sort_unstable_by(|a, b| {
        a.low[axis]
            .total_cmp(&b.low[axis])
            .then(a.face.cmp(&b.face))
    });
    let mut pairs = Vec::new();
    for (k, a) in boxes.iter().enumerate() {
        let own = a.face as usize >= first;
        for b in &boxes[k + 1..] {
            if b.low[axis] > a.high[axis] {
                break;
            }
            let meet = b.low[second] <= a.high[second]
                && b.high[second] >= a.low[second]
                && b.low[third] <= a.high[third]
                && b.high[third] >= a.low[third];
            if meet && (own || b.face as usize >= first) && !surely_apart(mesh, a.face, b.face) {
                pairs.push((a.face.min(b.face), a.face.max(b.face)));
            }
        }
    }
    pairs
}

/// Whether floating point alone shows that two faces do not cut each other, or they share an edge.
fn surely_apart(mesh: &TriMesh, f: u32, g: u32) -> bool {
    let (f, g) = (mesh.faces[f as usize], mesh.faces[g as usize]);
    let (mut turned_f, mut turned_g, mut shared) = (f, g, 0);
    for (i, v) in f.iter().enumerate() {
        if let Some(j) = g.iter().position(|w| w == v) {
            shared += 1;
            turned_f.rotate_left(i);
            turned_g.rotate_left(j);
        }
    }
    if shared > 1 {
        return true;
    }
    let place = |v: u32| mesh.positions[v as usize];
    let (a, b) = (turned_f.map(place), turned_g.map(place));
    // With a shared corner, which comes first now, only the edges opposite it can pass through the other face.
    let edges = if shared == 1 { 1..2 } else { 0..3 };
    misses(&a, &b, edges.clone()) && misses(&b, &a, edges)
}

/// Whether none of the edges of `a` passes through `b`, for sure.
fn misses(a: &[Vec3; 3], b: &[Vec3; 3], mut edges: std::ops::Range<usize>) -> bool {
    let (u, v) = (b[1] - b[0], b[2] - b[0]);
    let normal = u.cross(&v);
    let size =
        (u.amax() + v.amax()) + (a[0] - b[0]).amax() + (a[1] - b[0]).amax() + (a[2] - b[0]).amax();
    let doubt = MARGIN * size * size * size;
    let side = |p: &Vec3| normal.dot(&(p - b[0]));
    edges.all(|k| {
        let (p, q) = (a[k], a[(k + 1) % 3]);
        let (below, above) = (side(&p), side(&q));
        if (below > doubt && above > doubt) || (below < -doubt && above < -doubt) {
            return true;
        }
        // The line from p to q passes beside the face when it turns one way round one side and the other way round another.
        let along = q - p;
        let corners = b.map(|c| c - p);
        let turn = |k: usize| along.dot(&corners[k].cross(&corners[(k + 1) % 3]));
        let turns = [turn(0), turn(1), turn(2)];
        turns.iter().any(|t| *t > doubt) && turns.iter().any(|t| *t < -doubt)
    })
}

/// Rounding of a volume, in cubed lengths: far above what f64 loses.
const MARGIN: f64 = 1e-13;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_sweep_finds_what_the_tree_finds(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 30..60),
            faces in prop::collection::vec(prop::array::uniform3(0u32..30), 20..60),
            share in 0.0..1.0f64, grain in prop::sample::select(vec![1e-9, 0.25]),
        ) {
            // A coarse grain makes corners coincide and triangles coplanar.
            let rounded = |p: [f64; 3]| Vec3::from(p.map(|x| (x / grain).round() * grain));
            let mesh = TriMesh {
                positions: points.into_iter().map(rounded).collect(),
                faces: faces.into_iter().filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]).collect(),
            };
            let first = (share * mesh.faces.len() as f64) as usize;
            let own: Vec<u32> = (first as u32..mesh.faces.len() as u32).collect();
            prop_assert_eq!(crossings(&mesh, first), intersections_with(&mesh, &own));
        }
    }
}
