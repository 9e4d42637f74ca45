//! Measures the quality of a patch for the report.

use super::Patch;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec3};

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

/// How far the edges of a patch with an inner vertex are stretched: length ÷ length in the chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchStretch {
    /// The mean; 1 without such edges or a chart.
    pub mean: f64,
    /// The maximum of the same.
    pub max: f64,
}

/// Measures how far a patch is stretched.
pub fn stretch(patch: &Patch) -> PatchStretch {
    let (mut edges, mut sum, mut most) = (0usize, 0.0, 0.0f64);
    for face in &patch.faces {
        let p = face.map(|v| patch.positions[v as usize]);
        let flat = face.map(|v| patch.flat.get(v as usize));
        for k in 0..3 {
            let next = (k + 1) % 3;
            let to_next = p[next] - p[k];
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
    match edges {
        0 => PatchStretch {
            mean: 1.0,
            max: 1.0,
        },
        edges => PatchStretch {
            mean: sum / edges as f64,
            max: most,
        },
    }
}

/// Area of a patch, scene units squared.
pub fn area(patch: &Patch) -> f64 {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| patch.positions[v as usize]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    patch.faces.iter().map(area).sum()
}

/// Measures a patch against its chart, if it has one, and the region it closes.
pub fn measure(patch: &Patch, region: &Region) -> Quality {
    let stretch = stretch(patch);
    let gap =
        |(k, v): (usize, &u32)| (patch.positions[k] - region.mesh.positions[*v as usize]).norm();
    Quality {
        area: area(patch),
        stretch_mean: stretch.mean,
        stretch_max: stretch.max,
        gaussian_curvature: gaussian_curvature(patch),
        seam_gap: patch.rim.iter().enumerate().map(gap).fold(0.0, f64::max),
        self_intersections: patch.crossings,
    }
}

/// Mean size of the angle defect of a patch's inner vertices, radians; 0 without any.
pub fn gaussian_curvature(patch: &Patch) -> f64 {
    let inner = |v: usize| v >= patch.rim.len();
    mean_defect(&patch.positions, &patch.faces, &inner)
}

/// The same of the cloth around a hole: of the vertices on none of its boundaries.
pub fn region_curvature(region: &Region) -> f64 {
    let mut on_boundary = vec![false; region.mesh.positions.len()];
    let inside = region.holes.iter().chain(&region.islands).flatten();
    let loops = inside.chain(&region.rim).chain(&region.outer);
    loops.for_each(|v| on_boundary[*v as usize] = true);
    mean_defect(&region.mesh.positions, &region.mesh.faces, &|v| {
        !on_boundary[v]
    })
}

fn mean_defect(positions: &[Vec3], faces: &[[u32; 3]], counts: &dyn Fn(usize) -> bool) -> f64 {
    let mut angles = vec![0.0; positions.len()];
    for face in faces {
        let p = face.map(|v| positions[v as usize]);
        for k in 0..3 {
            let (to_next, to_last) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            angles[face[k] as usize] += to_next.cross(&to_last).norm().atan2(to_next.dot(&to_last));
        }
    }
    let (mut sum, mut count) = (0.0, 0usize);
    for (_, angle) in angles.iter().enumerate().filter(|(v, _)| counts(*v)) {
        sum += (std::f64::consts::TAU - angle).abs();
        count += 1;
    }
    sum / count.max(1) as f64
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
