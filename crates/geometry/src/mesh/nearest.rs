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

fn distance_to_segment(point: &Vec3, a: &Vec3, b: &Vec3) -> f64 {
    let (along, to) = (b - a, point - a);
    let square = along.norm_squared();
    let t = if square > 0.0 {
        (to.dot(&along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (to - along * t).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::shapes::holed_sheet;
    use crate::mesh::topology::Topology;
    use crate::mesh::weld::weld;

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
}
