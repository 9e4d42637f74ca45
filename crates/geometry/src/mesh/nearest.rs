//! Which vertex is nearest to a point, and how far a loop is from it.

use super::loops::BoundaryLoop;
use super::{TriMesh, Vec3};

/// The vertex nearest to `point`; the lower-numbered of equals, `None` without vertices. O(n).
pub fn closest_vertex(mesh: &TriMesh, point: &Vec3) -> Option<u32> {
    let distances = mesh.positions.iter().map(|p| (p - point).norm());
    distances
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(v, _)| v as u32)
}

/// Distance from `point` to the curve of a loop, scene units; infinite for a loop without vertices. O(edges of the
/// loop).
pub fn distance_to_loop(mesh: &TriMesh, rim: &BoundaryLoop, point: &Vec3) -> f64 {
    let corners = rim.vertices.iter().map(|v| mesh.positions[v.index()]);
    let following = corners.clone().cycle().skip(1);
    corners
        .zip(following)
        .map(|(a, b)| distance_to_segment(point, &a, &b))
        .fold(f64::INFINITY, f64::min)
}

/// Distance from `point` to the line from `a` to `b`, scene units.
pub fn distance_to_segment(point: &Vec3, a: &Vec3, b: &Vec3) -> f64 {
    let (along, to) = (b - a, point - a);
    let square = along.norm_squared();
    let t = if square > 0.0 {
        (to.dot(&along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (to - along * t).norm()
}

/// The point of a triangle that is nearest to `point` (Ericson 2004, Real-Time Collision Detection, 5.1.5: by the Voronoi
/// regions of corners, edges and inside).
pub fn nearest_on_triangle(point: &Vec3, [a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(&(point - a)), ac.dot(&(point - a)));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let (d3, d4) = (ab.dot(&(point - b)), ac.dot(&(point - b)));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let beside_c = d1 * d4 - d3 * d2;
    if beside_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let (d5, d6) = (ab.dot(&(point - c)), ac.dot(&(point - c)));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let beside_b = d5 * d2 - d1 * d6;
    if beside_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let beside_a = d3 * d6 - d5 * d4;
    if beside_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let whole = beside_a + beside_b + beside_c;
    a + ab * (beside_b / whole) + ac * (beside_c / whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::shapes::holed_sheet;
    use crate::mesh::topology::Topology;
    use crate::mesh::weld::weld;
    use proptest::prelude::*;

    #[test]
    fn a_loop_is_as_far_as_the_nearest_point_of_its_curve() {
        let mesh = weld(&holed_sheet(16, 0.2)).mesh;
        let loops = boundary_loops(&mesh, &Topology::new(&mesh));
        let distances = |point: Vec3| -> Vec<f64> {
            let of = |rim: &BoundaryLoop| distance_to_loop(&mesh, rim, &point);
            loops.iter().map(of).collect()
        };
        assert_eq!(loops[1].kind, LoopKind::Hole);
        let in_the_middle = distances(Vec3::new(0.5, 0.5, 0.0));
        assert!(in_the_middle[1] > 0.1 && in_the_middle[1] < 0.2);
        assert!((in_the_middle[0] - 0.5).abs() < 1e-12);
        assert_eq!(distances(Vec3::new(0.03, 0.0, 0.0))[0], 0.0);
    }

    #[test]
    fn the_nearest_vertex_is_found() {
        let mesh = holed_sheet(4, 0.0);
        assert_eq!(closest_vertex(&mesh, &Vec3::new(0.26, 0.01, 0.0)), Some(1));
        assert_eq!(closest_vertex(&TriMesh::default(), &Vec3::zeros()), None);
    }

    proptest! {
        #[test]
        fn no_point_of_a_triangle_is_nearer_than_the_nearest(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)),
            point in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let (corners, point) = (corners.map(Vec3::from), Vec3::from(point));
            let found = (nearest_on_triangle(&point, &corners) - point).norm();
            let n = 40;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                    let p = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
                    prop_assert!(found <= (p - point).norm() + 1e-9);
                }
            }
            let on_it = nearest_on_triangle(&point, &corners);
            prop_assert!((nearest_on_triangle(&on_it, &corners) - on_it).norm() < 1e-9, "it lies on the triangle");
        }
    }
}
