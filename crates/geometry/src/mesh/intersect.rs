//! Where a surface cuts through itself: a tree of bounding boxes finds candidate pairs of faces, exact predicates
//! decide.

use darn_budget::{Budget, Exhausted, Steps};
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::bounds::{BoundedFace, Bounds, BoxTree};
use super::{TriMesh, Vec3};

/// All pairs of faces `(f, g)`, `f < g`, that cut each other, ascending.
///
/// Decided exactly on the given coordinates (Shewchuk 1997, adaptive predicates). O(n log n + pairs of overlapping
/// boxes). What counts:
///
/// - Faces that share one corner position count when they cut away from it; faces that share two never count, even
///   folded flat onto each other.
/// - In one plane, faces count when they overlap in an area.
/// - Otherwise an edge must pass from one side of the other face's plane to the other: a corner that only touches a
///   face does not count, two edges that cross in a point do.
/// - Faces with a position that is not finite do not count.
pub fn self_intersections(mesh: &TriMesh) -> Vec<(u32, u32)> {
    let all: Vec<u32> = (0..mesh.faces.len() as u32).collect();
    intersections_with(mesh, &all)
}

/// Those pairs of [`self_intersections`] with at least one face in `faces`; indices of faces that do not exist are
/// ignored.
///
/// Meant for a patch in a large scan: a face outside the bounding box of `faces` costs one comparison.
pub fn intersections_with(mesh: &TriMesh, faces: &[u32]) -> Vec<(u32, u32)> {
    // Without limits there is no error.
    intersections_within(mesh, faces, Budget::unlimited()).unwrap_or_default()
}

/// [`intersections_with`] within a budget: in a tangle every face may cut every other.
///
/// # Errors
/// `Exhausted`.
pub fn intersections_within(
    mesh: &TriMesh,
    faces: &[u32],
    budget: &Budget,
) -> Result<Vec<(u32, u32)>, Exhausted> {
    let mut asked = vec![false; mesh.faces.len()];
    let known = faces.iter().filter(|&&f| (f as usize) < mesh.faces.len());
    known.for_each(|&f| asked[f as usize] = true);
    let bounded = |face: u32| {
        let bounds = Bounds::of_face(mesh, face as usize)?;
        Some(BoundedFace { bounds, face })
    };
    let own = (0..mesh.faces.len() as u32).filter(|&f| asked[f as usize]);
    let tree = BoxTree::new(own.filter_map(bounded).collect());
    let Some(bounds) = tree.bounds() else {
        return Ok(Vec::new());
    };
    let mut steps = Steps::of(budget);
    let mut pairs = Vec::new();
    for other in (0..mesh.faces.len() as u32).filter_map(bounded) {
        if other.bounds.meets(bounds) {
            let g = other.face;
            let mut tested = 0;
            tree.meeting(&other.bounds, |f| {
                tested += 1;
                // Of two faces asked for, each finds the other; only one of the two counts.
                let once = f < g || (f > g && !asked[g as usize]);
                if once && cut(mesh, f, g) {
                    pairs.push((f.min(g), f.max(g)));
                }
            });
            steps.take(BOX_WORK + PAIR_WORK * tested)?;
        }
    }
    pairs.sort_unstable();
    Ok(pairs)
}

/// Nanoseconds of work a face in the search for boxes that meet its own.
const BOX_WORK: u64 = 100;
/// Nanoseconds of work a pair of faces whose boxes meet.
const PAIR_WORK: u64 = 100;

/// Whether two faces, with finite corners, cut each other; see [`self_intersections`] for what counts.
pub(crate) fn cut(mesh: &TriMesh, f: u32, g: u32) -> bool {
    let (mut a, mut b) = (mesh.triangle(f as usize), mesh.triangle(g as usize));
    let mut shared = (0..9)
        .map(|i| (i / 3, i % 3))
        .filter(|&(i, j)| a[i] == b[j]);
    let first = shared.next();
    if shared.next().is_some() {
        return false;
    }
    if let Some((i, j)) = first {
        a.rotate_left(i);
        b.rotate_left(j);
    }
    // A shared corner is now the first one; it lies in the other face's plane.
    let own = usize::from(first.is_some());
    let on_one_side = |sides: &[i8; 3]| {
        sides[own..].iter().all(|&s| s > 0) || sides[own..].iter().all(|&s| s < 0)
    };
    let sides = |face: &[Vec3; 3], points: &[Vec3; 3]| {
        [0, 1, 2].map(|k| if k < own { 0 } else { side(face, points[k]) })
    };
    let a_sides = sides(&b, &a);
    if on_one_side(&a_sides) {
        return false;
    }
    let b_sides = sides(&a, &b);
    if on_one_side(&b_sides) {
        return false;
    }
    if a_sides == [0, 0, 0] || b_sides == [0, 0, 0] {
        return overlap_in_plane(&a, &b);
    }
    // Edges at a shared corner only touch the other face's plane there; the opposite edge alone can pass through it.
    let edges = if first.is_none() { 0..3 } else { 1..2 };
    edges.into_iter().any(|k| {
        let n = (k + 1) % 3;
        (a_sides[k] * a_sides[n] < 0 && line_meets(&b, a[k], a[n]))
            || (b_sides[k] * b_sides[n] < 0 && line_meets(&a, b[k], b[n]))
    })
}

/// On which side of a face's plane a point lies: −1, 0 or 1.
fn side(face: &[Vec3; 3], p: Vec3) -> i8 {
    volume(face[0], face[1], face[2], p)
}

/// Sign of the volume of a tetrahedron.
fn volume(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> i8 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    sign(orient3d(a, b, c, d))
}

fn sign(x: f64) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

/// Whether the line through `p` and `q` (not in the face's plane) meets the closed face.
fn line_meets(face: &[Vec3; 3], p: Vec3, q: Vec3) -> bool {
    let turns = [0, 1, 2].map(|k| volume(p, q, face[k], face[(k + 1) % 3]));
    turns.iter().all(|&t| t >= 0) || turns.iter().all(|&t| t <= 0)
}

/// Whether two triangles in one plane share an area: no side of either has the other wholly behind it.
fn overlap_in_plane(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let normal =
        (a[1] - a[0]).cross(&(a[2] - a[0])).abs() + (b[1] - b[0]).cross(&(b[2] - b[0])).abs();
    let dropped = normal.imax();
    let flat = |p: &Vec3| Coord {
        x: p[(dropped + 1) % 3],
        y: p[(dropped + 2) % 3],
    };
    let (a, b) = (a.each_ref().map(flat), b.each_ref().map(flat));
    let separates = |t: &[Coord<f64>; 3], other: &[Coord<f64>; 3]| {
        let way = sign(orient2d(t[0], t[1], t[2]));
        // A triangle without area separates itself from everything.
        (0..3).any(|k| {
            other
                .iter()
                .all(|&p| sign(orient2d(t[k], t[(k + 1) % 3], p)) * way <= 0)
        })
    };
    !separates(&a, &b) && !separates(&b, &a)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::shapes::{concat, holed_sheet, jitter, sheet, tube};
    use crate::mesh::weld::weld;

    fn pair(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> TriMesh {
        TriMesh {
            positions: a.into_iter().chain(b).map(Vec3::from).collect(),
            faces: vec![[0, 1, 2], [3, 4, 5]],
        }
    }

    const FLOOR: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    fn cuts_floor(other: [[f64; 3]; 3]) -> bool {
        let mesh = pair(FLOOR, other);
        let reversed = pair(other, FLOOR);
        let found = self_intersections(&mesh);
        assert_eq!(
            found,
            self_intersections(&reversed),
            "the order of faces does not matter"
        );
        assert_eq!(found, intersections_with(&mesh, &[1]));
        !found.is_empty()
    }

    #[test]
    fn a_face_through_another_is_found_and_one_beside_it_is_not() {
        assert!(cuts_floor([
            [1.0, 1.0, -1.0],
            [1.0, 1.0, 1.0],
            [9.0, 9.0, 0.5]
        ]));
        assert!(!cuts_floor([
            [3.0, 3.0, -1.0],
            [3.0, 3.0, 1.0],
            [9.0, 9.0, 0.5]
        ]));
        assert!(!cuts_floor([
            [1.0, 1.0, 0.1],
            [1.0, 1.0, 1.0],
            [9.0, 9.0, 0.5]
        ]));
    }

    #[test]
    fn a_touch_does_not_count() {
        assert!(!cuts_floor([
            [1.0, 1.0, 0.0],
            [1.0, 2.0, 1.0],
            [2.0, 1.0, 1.0]
        ]));
        assert!(!cuts_floor([
            [1.0, 1.0, 0.0],
            [1.0, 2.0, 0.0],
            [2.0, 1.0, 1.0]
        ]));
        assert!(cuts_floor([
            [1.0, 1.0, 0.0],
            [1.0, 2.0, -1.0],
            [2.0, 1.0, 1.0]
        ]));
    }

    #[test]
    fn in_a_plane_only_overlap_counts() {
        assert!(cuts_floor([
            [1.0, 1.0, 0.0],
            [9.0, 1.0, 0.0],
            [9.0, 9.0, 0.0]
        ]));
        assert!(!cuts_floor([
            [4.0, 0.0, 0.0],
            [9.0, 9.0, 0.0],
            [0.0, 4.0, 0.0]
        ]));
        assert!(!cuts_floor([
            [2.0, 2.0, 0.0],
            [9.0, 2.0, 0.0],
            [9.0, 9.0, 0.0]
        ]));
    }

    #[test]
    fn faces_with_a_common_corner_count_when_they_cut_elsewhere() {
        assert!(cuts_floor([
            [0.0, 0.0, 0.0],
            [1.0, 1.0, -1.0],
            [1.0, 1.0, 1.0]
        ]));
        assert!(!cuts_floor([
            [0.0, 0.0, 0.0],
            [-1.0, -1.0, -1.0],
            [-1.0, -1.0, 1.0]
        ]));
        assert!(!cuts_floor([
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [1.0, 1.0, 0.0]
        ]));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn smooth_surfaces_do_not_cut_themselves(n in 4usize..16, noise in 0.0..0.1f64, seed: u64) {
            prop_assert_eq!(self_intersections(&holed_sheet(n, 0.2)), []);
            prop_assert_eq!(self_intersections(&jitter(&weld(&tube(n, |_, _| true)).mesh, noise / n as f64, seed)), []);
        }

        #[test]
        fn the_tree_finds_what_all_pairs_find(seed: u64, n in 2usize..6) {
            let tangle = jitter(&sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0)), 0.5, seed);
            let count = tangle.faces.len() as u32;
            let pairs = (0..count).flat_map(|f| (f + 1..count).map(move |g| (f, g)));
            let expected: Vec<(u32, u32)> = pairs.filter(|&(f, g)| cut(&tangle, f, g)).collect();
            let few = [0, count / 2];
            let of_few: Vec<_> = expected.iter().copied().filter(|p| few.contains(&p.0) || few.contains(&p.1)).collect();
            prop_assert_eq!(intersections_with(&tangle, &few), of_few);
            prop_assert_eq!(self_intersections(&tangle), expected);
        }

        #[test]
        fn crossing_sheets_cut_along_a_line(n in 3usize..12) {
            let floor = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            let wall = sheet(n, |_, _| true, |u, v| Vec3::new(0.47, 0.9 * u + 0.03, 1.01 * v - 0.52));
            let found = self_intersections(&concat(&floor, &wall));
            prop_assert!(found.len() >= 2 * n - 2, "{}", found.len());
            let faces = floor.faces.len() as u32;
            prop_assert!(found.iter().all(|&(f, g)| f < faces && g >= faces));
        }
    }

    #[test]
    fn positions_that_are_not_numbers_are_left_out() {
        let broken = pair(
            FLOOR,
            [[1.0, 1.0, -1.0], [1.0, f64::NAN, 1.0], [9.0, 9.0, 0.5]],
        );
        assert_eq!(self_intersections(&broken), []);
        assert_eq!(intersections_with(&broken, &[0, 1, 5]), []);
    }
}
