//! Curvature and size of a mesh, from its angles, areas and edges.

use std::f64::consts::TAU;

use super::topology::{NONE, Topology};
use super::{TriMesh, Vec3};

/// Per vertex 2π − Σθ, radians: the discrete Gaussian curvature, 0 on developable cloth. 0 on the boundary and for vertices
/// without faces.
pub fn angle_defects(mesh: &TriMesh, topology: &Topology) -> Vec<f64> {
    let boundary = topology.boundary_vertices();
    let defect = |v: usize| {
        if boundary[v] {
            0.0
        } else {
            angle_defect(mesh, topology, v as u32)
        }
    };
    (0..mesh.positions.len()).map(defect).collect()
}

/// 2π − Σθ at one vertex, radians. On the boundary that is not curvature: see [`turning`](super::loops::turning).
pub fn angle_defect(mesh: &TriMesh, topology: &Topology, vertex: u32) -> f64 {
    let angle = |&h: &u32| mesh.corner_angle(h as usize / 3, h as usize % 3);
    TAU - topology.leaving(vertex).iter().map(angle).sum::<f64>()
}

/// Per face its area, scene units squared.
pub fn face_areas(mesh: &TriMesh) -> Vec<f64> {
    (0..mesh.faces.len())
        .map(|f| 0.5 * doubled_normal(mesh, f).norm())
        .collect()
}

/// Per face its unit normal; zero for a face without area.
pub fn face_normals(mesh: &TriMesh) -> Vec<Vec3> {
    (0..mesh.faces.len())
        .map(|f| unit(doubled_normal(mesh, f)))
        .collect()
}

/// Per vertex the unit normal: its faces' normals weighted by their angle there (Thürmer & Wüthrich 1998). Zero where they cancel.
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

/// What the edges of a mesh measure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EdgeLengths {
    /// How many edges there are.
    pub count: usize,
    /// Mean, scene units; 0 without edges.
    pub mean: f64,
    /// Standard deviation, scene units.
    pub deviation: f64,
    /// Shortest, scene units.
    pub min: f64,
    /// Longest, scene units.
    pub max: f64,
}

/// Statistics of the edge lengths, every edge once.
pub fn edge_lengths(mesh: &TriMesh, topology: &Topology) -> EdgeLengths {
    let lengths: Vec<f64> = topology
        .edges()
        .map(|h| {
            (mesh.positions[topology.to(h) as usize] - mesh.positions[topology.from(h) as usize])
                .norm()
        })
        .collect();
    if lengths.is_empty() {
        return EdgeLengths::default();
    }
    let count = lengths.len();
    let mean = lengths.iter().sum::<f64>() / count as f64;
    let variance = lengths.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / count as f64;
    EdgeLengths {
        count,
        mean,
        deviation: variance.sqrt(),
        min: lengths.iter().copied().fold(f64::INFINITY, f64::min),
        max: lengths.iter().copied().fold(0.0, f64::max),
    }
}

/// Mean angle between the normals of faces that share an edge, radians: 0 when flat, large when crumpled. 0 without inner edges.
pub fn mean_dihedral(mesh: &TriMesh, topology: &Topology) -> f64 {
    let normals = face_normals(mesh);
    let (mut sum, mut count) = (0.0, 0.0);
    for h in topology.edges() {
        let twin = topology.twin[h as usize];
        if twin != NONE {
            let (a, b) = (normals[h as usize / 3], normals[twin as usize / 3]);
            sum += a.cross(&b).norm().atan2(a.dot(&b));
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

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
            for defect in angle_defects(&mesh, &topology) {
                prop_assert!(defect.abs() < 1e-9);
            }
            for (p, normal) in mesh.positions.iter().zip(vertex_normals(&mesh)) {
                let out = Vec3::new(p.x, p.y, 0.0);
                prop_assert!((normal - out).norm() < 2.0 / n as f64, "{normal} {out}");
            }
        }

        #[test]
        fn areas_and_edges_of_a_flat_sheet(n in 1usize..20) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            let topology = Topology::new(&mesh);
            prop_assert!((face_areas(&mesh).iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let edges = edge_lengths(&mesh, &topology);
            prop_assert_eq!(edges.count, 3 * n * n + 2 * n);
            prop_assert!((edges.max - edges.min * 2f64.sqrt()).abs() < 1e-9);
            prop_assert!(edges.min <= edges.mean && edges.mean <= edges.max && edges.deviation < edges.max - edges.min);
            prop_assert!(mean_dihedral(&mesh, &topology) < 1e-12);
        }
    }

    #[test]
    fn a_fold_by_a_right_angle_is_measured() {
        let mesh = TriMesh {
            positions: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
            faces: vec![[0, 1, 2], [1, 0, 3]],
        };
        let bend = mean_dihedral(&mesh, &Topology::new(&mesh));
        assert!((bend - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
