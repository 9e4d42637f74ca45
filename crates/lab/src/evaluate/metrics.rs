//! Metrics of a filled grid against the truth: position, direction, amount of cloth, developability, self-intersections.

use std::f64::consts::TAU;

use serde::Serialize;

use darn_geometry::grid::{CELLS, SIDE, Spacing, spacing};
use darn_geometry::mesh::intersect::intersections_with;
use darn_geometry::mesh::{TriMesh, Vec3};

use super::cases::EvaluationCase;
use super::shaded_views::ShadedViews;
use crate::cell_normals::{neighbours, normal};

/// The metrics of one fill of one case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct FillMetrics {
    /// Root mean square distance to the truth over hole cells, in cells.
    pub rmse: f64,
    /// Mean angle to the true normals in hole cells, degrees.
    pub normal: f64,
    /// Mean distance of neighbours that touch the hole, in the paper's units; the truth is 1/64.
    pub spacing_mean: f64,
    /// Variance of these distances, the same units squared.
    pub spacing_variance: f64,
    /// Area of the hole's cells ÷ the truth's.
    pub area: f64,
    /// Mean absolute angle defect of hole cells, radians: Gaussian curvature × a cell's area.
    pub curvature: f64,
    /// Pairs of triangles that intersect, at least one of them touching the hole.
    pub self_intersections: f64,
    /// Mean structural similarity (Wang et al. 2004) of six shaded pictures of the hole to those of the truth; 1 is equal.
    pub ssim: f64,
}

/// The metrics of a fill, and the angle defects of its hole cells for histograms.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measurement {
    /// The metrics.
    pub metrics: FillMetrics,
    /// Angle defects of the hole's cells, radians.
    pub defects: Vec<f64>,
}

/// Measures a composed grid (known cells as observed, hole cells filled; one position per cell) against the truth of the case, and against pictures of
/// it.
pub(super) fn measure(
    case: &EvaluationCase,
    views: &ShadedViews,
    composed: &[Vec3],
) -> Measurement {
    let sample = &case.sample;
    let present: Vec<bool> = (0..CELLS)
        .map(|k| sample.known[k] || sample.hole[k])
        .collect();
    let open: Vec<usize> = (0..CELLS).filter(|&k| sample.hole[k]).collect();
    let truth: Vec<Vec3> = (0..CELLS).map(|k| case.truth(k)).collect();
    let (mut angle, mut count, mut areas) = (0.0, 0usize, [0.0; 2]);
    for &k in &open {
        if let (Some(a), Some(b)) = (normal(composed, &present, k), normal(&truth, &present, k)) {
            angle += a.angle(&b).to_degrees();
            count += 1;
            areas = [areas[0] + a.norm(), areas[1] + b.norm()];
        }
    }
    let Spacing { mean, variance, .. } = spacing(composed, |a, b| {
        present[a] && present[b] && (sample.hole[a] || sample.hole[b])
    });
    let defects: Vec<f64> = open
        .iter()
        .filter_map(|&k| defect(composed, &present, k))
        .collect();
    let curvature = defects.iter().map(|d| d.abs()).sum::<f64>() / defects.len().max(1) as f64;
    Measurement {
        metrics: FillMetrics {
            rmse: rmse(case, composed),
            normal: angle / count.max(1) as f64,
            spacing_mean: mean,
            spacing_variance: variance,
            area: areas[0] / areas[1].max(f64::MIN_POSITIVE),
            curvature,
            self_intersections: self_intersections(composed, &present, &sample.hole) as f64,
            ssim: views.similarity(composed),
        },
        defects,
    }
}

/// Root mean square distance to the truth over hole cells, in cells.
pub(super) fn rmse(case: &EvaluationCase, composed: &[Vec3]) -> f64 {
    let open = || (0..CELLS).filter(|&k| case.sample.hole[k]);
    let squares: f64 = open()
        .map(|k| (composed[k] - case.truth(k)).norm_squared())
        .sum();
    (squares / open().count().max(1) as f64).sqrt() * SIDE as f64
}

/// Angle defect of a cell: 2π minus the angles of the four triangles between it and its neighbours.
fn defect(x: &[Vec3], present: &[bool], k: usize) -> Option<f64> {
    let spokes = neighbours(present, k)?.map(|n| x[n] - x[k]);
    let angles = (0..4).map(|n| {
        let (a, b) = (spokes[n], spokes[(n + 1) % 4]);
        a.cross(&b).norm().atan2(a.dot(&b))
    });
    Some(TAU - angles.sum::<f64>())
}

/// Intersecting pairs of the grid's triangles, at least one of each pair touching the hole.
fn self_intersections(x: &[Vec3], present: &[bool], hole: &[bool]) -> usize {
    let mesh = TriMesh {
        positions: x.to_vec(),
        faces: faces(present),
    };
    let touching = |f: &[u32; 3]| f.iter().any(|&k| hole[k as usize]);
    let own: Vec<u32> = (0..mesh.faces.len() as u32)
        .filter(|&f| touching(&mesh.faces[f as usize]))
        .collect();
    intersections_with(&mesh, &own).len()
}

/// Two triangles for every square of four present cells.
pub(super) fn faces(present: &[bool]) -> Vec<[u32; 3]> {
    let squares = (0..CELLS - SIDE).filter(|k| k % SIDE + 1 < SIDE);
    let whole = squares.filter(|&k| {
        [k, k + 1, k + SIDE, k + SIDE + 1]
            .iter()
            .all(|&c| present[c])
    });
    let split = |k: usize| {
        let [a, b, c, d] = [k, k + 1, k + SIDE, k + SIDE + 1].map(|c| c as u32);
        [[a, b, d], [a, d, c]]
    };
    whole.flat_map(split).collect()
}
