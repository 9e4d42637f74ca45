//! What lies nearest to a point.

use super::loops::BoundaryLoop;
use super::{TriMesh, Vec3};

/// The vertex nearest to `point` and its distance; the lower-numbered of equals, `None` without vertices. O(n).
pub fn closest_vertex(mesh: &TriMesh, point: &Vec3) -> Option<(u32, f64)> {
    let distances = mesh.positions.iter().map(|p| (p - point).norm());
    distances
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(v, d)| (v as u32, d))
}

/// The loop whose curve passes nearest to `point`, as an index into `loops`, and its distance; `None` without loops. O(total edges).
pub fn closest_loop(mesh: &TriMesh, loops: &[BoundaryLoop], point: &Vec3) -> Option<(usize, f64)> {
    let distances = loops.iter().map(|l| distance_to_loop(mesh, l, point));
    distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Distance from `point` to the curve of a loop, scene units; infinite for a loop without vertices.
pub fn distance_to_loop(mesh: &TriMesh, rim: &BoundaryLoop, point: &Vec3) -> f64 {
    let corners = rim.vertices.iter().map(|&v| mesh.positions[v as usize]);
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
    fn the_middle_of_a_hole_is_nearest_to_the_hole() {
        let mesh = weld(&holed_sheet(16, 0.2)).mesh;
        let loops = boundary_loops(&mesh, &Topology::new(&mesh));
        let (nearest, distance) =
            closest_loop(&mesh, &loops, &Vec3::new(0.5, 0.5, 0.0)).expect("two loops");
        assert_eq!(loops[nearest].kind, LoopKind::Hole);
        assert!(distance > 0.1 && distance < 0.2);
        let (_, on_the_border) =
            closest_loop(&mesh, &loops, &Vec3::new(0.03, 0.0, 0.0)).expect("two loops");
        assert_eq!(on_the_border, 0.0);
    }

    #[test]
    fn the_nearest_vertex_is_found() {
        let mesh = holed_sheet(4, 0.0);
        assert_eq!(
            closest_vertex(&mesh, &Vec3::new(0.26, 0.01, 0.0)).map(|n| n.0),
            Some(1)
        );
        assert_eq!(closest_vertex(&TriMesh::default(), &Vec3::zeros()), None);
    }
}
