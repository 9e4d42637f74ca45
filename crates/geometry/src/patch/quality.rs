//! Measures the quality of a patch for the report.

use super::Patch;
use crate::mesh::TriMesh;
use crate::mesh::region::Region;

/// Measurements of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Area, scene units squared.
    pub area: f64,
    /// Mean of length ÷ length in the chart over the edges with an inner vertex; 1 without such edges or a chart.
    pub stretch_mean: f64,
    /// Maximum of the same.
    pub stretch_max: f64,
    /// Mean |2π − Σ angles| over the inner vertices, radians; 0 when the patch is developable.
    pub gaussian_curvature: f64,
    /// Largest distance between the patch's rim and the scan's, scene units.
    pub seam_gap: f64,
    /// Pairs of triangles that cut each other, at least one of them the patch's.
    pub self_intersections: usize,
}

/// Measures a patch against its chart, if it has one, and the region it closes.
pub fn measure(patch: &Patch, region: &Region) -> Quality {
    let (mut edges, mut sum, mut most) = (0usize, 0.0, 0.0f64);
    let mut area = 0.0;
    let mut angles = vec![0.0; patch.positions.len()];
    for face in &patch.faces {
        let p = face.map(|v| patch.positions[v as usize]);
        let flat = face.map(|v| patch.flat.get(v as usize));
        area += 0.5 * (p[1] - p[0]).cross(&(p[2] - p[0])).norm();
        for k in 0..3 {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            let (to_next, to_last) = (p[next] - p[k], p[last] - p[k]);
            angles[face[k] as usize] += to_next.cross(&to_last).norm().atan2(to_next.dot(&to_last));
            // The scan sets the length of an edge between two rim vertices.
            let is_inner = face[k].max(face[next]) as usize >= patch.rim.len();
            if let (true, Some(to), Some(from)) = (is_inner, flat[next], flat[k]) {
                let stretch = to_next.norm() / (to - from).norm().max(f64::MIN_POSITIVE);
                sum += stretch;
                most = most.max(stretch);
                edges += 1;
            }
        }
    }
    let inner = &angles[patch.rim.len()..];
    let defects: f64 = inner
        .iter()
        .map(|a| (std::f64::consts::TAU - a).abs())
        .sum();
    let gap =
        |(k, v): (usize, &u32)| (patch.positions[k] - region.mesh.positions[*v as usize]).norm();
    Quality {
        area,
        stretch_mean: if edges == 0 { 1.0 } else { sum / edges as f64 },
        stretch_max: if edges == 0 { 1.0 } else { most },
        gaussian_curvature: defects / inner.len().max(1) as f64,
        seam_gap: patch.rim.iter().enumerate().map(gap).fold(0.0, f64::max),
        self_intersections: patch.crossings,
    }
}

/// The region's mesh with the patch appended: the patch's inner vertices and its faces come last.
pub fn joined(patch: &Patch, region: &Region) -> TriMesh {
    let mut mesh = region.mesh.clone();
    let (rim, base) = (patch.rim.len(), mesh.positions.len() as u32);
    mesh.positions.extend_from_slice(&patch.positions[rim..]);
    let vertex = |v: u32| {
        patch
            .rim
            .get(v as usize)
            .copied()
            .unwrap_or(base + v - rim as u32)
    };
    mesh.faces.extend(patch.faces.iter().map(|f| f.map(vertex)));
    mesh
}
