//! Angle defect, areas and normals of a mesh.

use std::f64::consts::TAU;

use super::index::{HalfEdgeId, VertexId};
use super::topology::Topology;
use super::{TriMesh, Vec3};

/// 2π − Σθ, radians, θ the angles of the faces at `vertex`: inside a mesh its discrete Gaussian curvature
/// (Gauss–Bonnet), 0 on developable cloth. On the boundary that is not curvature; see
/// [`turning`](super::turning::turning).
pub fn angle_defect(mesh: &TriMesh, topology: &Topology, vertex: VertexId) -> f64 {
    TAU - inner_angle(mesh, topology, vertex)
}

/// The angle of the faces at a vertex, radians.
pub fn inner_angle(mesh: &TriMesh, topology: &Topology, vertex: VertexId) -> f64 {
    sum_at(topology, vertex, |h| {
        mesh.corner_angle(h.face().index(), h.corner())
    })
}

/// [`angle_defect`] for angles that another function gives: that of a face where a half-edge starts.
pub(super) fn angle_defect_of(
    topology: &Topology,
    vertex: VertexId,
    angle: impl Fn(HalfEdgeId) -> f64,
) -> f64 {
    TAU - sum_at(topology, vertex, angle)
}

/// The sum of what a function gives for the half-edges that leave a vertex.
fn sum_at(topology: &Topology, vertex: VertexId, angle: impl Fn(HalfEdgeId) -> f64) -> f64 {
    topology.leaving(vertex).into_iter().map(angle).sum()
}

/// Per face its area, scene units squared.
pub fn face_areas(mesh: &TriMesh) -> Vec<f64> {
    (0..mesh.faces.len()).map(|f| face_area(mesh, f)).collect()
}

/// The area of a face, scene units squared.
pub(super) fn face_area(mesh: &TriMesh, face: usize) -> f64 {
    0.5 * doubled_normal(mesh, face).norm()
}

/// Per vertex the unit normal: its faces' normals weighted by their angle there (Thürmer & Wüthrich 1998). Zero where
/// they cancel.
pub fn vertex_normals(mesh: &TriMesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); mesh.positions.len()];
    for (f, face) in mesh.faces.iter().enumerate() {
        let normal = unit(doubled_normal(mesh, f));
        for (k, &v) in face.iter().enumerate() {
            normals[v as usize] += normal * mesh.corner_angle(f, k);
        }
    }
    normals.into_iter().map(unit).collect()
}

/// The normal of a face with the length of twice its area, scene units squared.
pub(super) fn doubled_normal(mesh: &TriMesh, face: usize) -> Vec3 {
    let [a, b, c] = mesh.triangle(face);
    (b - a).cross(&(c - a))
}

fn unit(v: Vec3) -> Vec3 {
    v.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::shapes::{sheet, tube};
    use crate::mesh::weld::weld;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_tube_is_developable_and_its_normals_point_outwards(n in 6usize..30) {
            let mesh = weld(&tube(n, |_, _| true)).mesh;
            let topology = Topology::new(&mesh);
            let boundary = topology.boundary_vertices();
            for v in (0..mesh.positions.len() as u32).map(VertexId).filter(|v| !boundary[v.index()]) {
                prop_assert!(angle_defect(&mesh, &topology, v).abs() < 1e-9);
            }
            for (p, normal) in mesh.positions.iter().zip(vertex_normals(&mesh)) {
                let out = Vec3::new(p.x, p.y, 0.0);
                prop_assert!((normal - out).norm() < 2.0 / n as f64, "{normal} {out}");
            }
        }

        #[test]
        fn the_areas_of_a_flat_sheet_add_up(n in 1usize..20) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            prop_assert!((face_areas(&mesh).iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
