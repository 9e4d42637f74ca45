//! What the rim of a boundary loop looks like, told so that noise, trimmed triangles and one rip do not change it.

use std::f64::consts::PI;

use super::loops::BoundaryLoop;
use super::topology::Topology;
use super::turning::vertex_turnings;
use super::{TriMesh, Vec2, Vec3, unit_for};
use crate::polygon::convex_hull;

/// Deviation of a rim's turning at a vertex from its mean that a hem's own polygon has, radians.
const POLYGON: f64 = 0.5;
/// Vertices on each side of a vertex over which roughness is averaged.
const BESIDE: usize = 4;
/// The share of the rim that may be rougher without being told: a rip, or a part that was trimmed.
const SMOOTHER_SHARE: f64 = 0.35;
/// Edges of the chords that a rim's length is measured by, so that teeth of an edge or two do not count.
const CHORD: usize = 4;
/// A rim is at least this share of its chords around, from whatever side it is seen.
const LEAST_AROUND: f64 = 0.5;

/// The shape of a rim.
#[derive(Debug, Clone, Copy)]
pub(super) struct RimShape {
    /// How the rim turns on the surface where it is smoothest: radians a vertex by which the turning differs from the rim's mean by more
    /// than a polygon's does, averaged over nine vertices, and of these averages the 35 % quantile.
    pub(super) roughness: f64,
    /// Whether the cloth runs towards the loop from one side, 0 to 1: the length of the sum of its outward directions along the rim over the length of the
    /// rim's outline seen along that sum. 1 at the end of a tube, sin α at a round mouth of a ball that is α wide from its pole, 0 in a flat sheet.
    pub(super) mouth: f64,
    /// 4π · area / length² of the flattest surface across it, lengths by chords: 1 for a circle.
    pub(super) roundness: f64,
}

impl RimShape {
    /// The shape of a loop's rim. Takes time in the order of n log n, n the loop's vertices.
    pub(super) fn of(mesh: &TriMesh, topology: &Topology, l: &BoundaryLoop) -> RimShape {
        let origin = l
            .vertices
            .first()
            .map_or(Vec3::zeros(), |v| mesh.positions[v.index()]);
        let from_origin = |v: usize| mesh.positions[v] - origin;
        let reach = (l.vertices.iter()).map(|v| from_origin(v.index()).amax());
        let unit = unit_for(reach.fold(0.0, f64::max));
        let points: Vec<Vec3> = (l.vertices.iter())
            .map(|v| from_origin(v.index()) / unit)
            .collect();
        let (mut outward, mut area) = (Vec3::zeros(), Vec3::zeros());
        for (k, &h) in l.half_edges.iter().enumerate() {
            let (a, b) = (points[k], points[(k + 1) % points.len()]);
            let third = from_origin(topology.origin(h.previous()).index()) / unit;
            let normal = (b - a).cross(&(third - a)).try_normalize(0.0);
            outward += normal.map_or(Vec3::zeros(), |n| (b - a).cross(&n));
            area += a.cross(&b) * 0.5;
        }
        let chords = by_chords(&points);
        let around = outline(&points, &outward).max(LEAST_AROUND * chords);
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        RimShape {
            roughness: roughness(mesh, topology, l),
            mouth: share(outward.norm(), around).min(1.0),
            roundness: share(4.0 * PI * area.norm(), chords * chords).min(1.0),
        }
    }
}

/// See [`RimShape::roughness`]. Turning is measured on the surface, so that folds do not count.
fn roughness(mesh: &TriMesh, topology: &Topology, l: &BoundaryLoop) -> f64 {
    let turnings: Vec<f64> = vertex_turnings(mesh, topology, &l.half_edges).collect();
    let n = turnings.len();
    if n == 0 {
        return 0.0;
    }
    let mean = turnings.iter().sum::<f64>() / n as f64;
    let beyond: Vec<f64> = (turnings.iter())
        .map(|t| ((t - mean).abs() - POLYGON).max(0.0))
        .collect();
    if n < 2 * BESIDE {
        return beyond.iter().sum::<f64>() / n as f64;
    }
    let window = |k: usize| (0..=2 * BESIDE).map(move |b| (k + n - BESIDE + b) % n);
    let mut local: Vec<f64> = (0..n)
        .map(|k| window(k).map(|j| beyond[j]).sum::<f64>() / (2 * BESIDE + 1) as f64)
        .collect();
    local.sort_unstable_by(f64::total_cmp);
    local[(SMOOTHER_SHARE * (n - 1) as f64).round() as usize]
}

/// Length of a closed line by chords of [`CHORD`] edges; by its edges when it has few.
fn by_chords(points: &[Vec3]) -> f64 {
    let n = points.len();
    let edges = if n < 3 * CHORD { 1 } else { CHORD };
    let chord = |k: usize| (points[(k + edges) % n] - points[k]).norm();
    (0..n).map(chord).sum::<f64>() / edges as f64
}

/// Length of the convex outline of points seen along a direction.
fn outline(points: &[Vec3], along: &Vec3) -> f64 {
    let Some(along) = along.try_normalize(0.0) else {
        return 0.0;
    };
    // The axis that it runs along least.
    let axis = along.iamin();
    let right = along.cross(&Vec3::ith(axis, 1.0)).normalize();
    let up = along.cross(&right);
    let seen: Vec<Vec2> = (points.iter())
        .map(|p| Vec2::new(right.dot(p), up.dot(p)))
        .collect();
    let hull = convex_hull(&seen);
    hull.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum()
}
