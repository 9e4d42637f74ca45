//! Whether what looks like noise is coherent, and so the cloth's shape.
//!
//! Noise knows nothing of its surroundings: it is as large measured over two rings as over four, a vertex above the
//! cloth says nothing of its neighbours, and normals are scattered in all directions. Narrow folds grow with the
//! rings, coarse triangles of smooth cloth lie on the same side of it at neighbouring vertices, and the normals at
//! a fold or crease are scattered across it alone.

use super::{CLEAN, Incidence, RINGS, SAMPLES, level_over, off_cubic};
use crate::mesh::curvature::doubled_normal;
use crate::mesh::{TriMesh, Vec3};

/// Rings over which folds are far from cubics.
const WIDE_RINGS: usize = 4;
/// How many times as far they are there, at least, as over two rings. Folds of 4 to 8 edges are 5 to 18 times as far,
/// creases 1.5 to 6 times.
const GROWTH: f64 = 4.0;
/// Mean product of the sides (±1) that neighbours lie on: −0.1 to 0.08 for noise, from 0.13 for coarse cloth.
const ALIKE: f64 = 0.11;
/// Variance of normals along the direction of less scatter ÷ along that of more, for a noise level of one edge. Noise
/// of up to 0.3 edges has 1.5 to 2.2, creases of three to five edges 0.5 to 1.1.
const SCATTER: f64 = 1.25;
/// Vertices whose neighbours are compared, about: each costs seven fits.
const COMPARED: usize = 400;

/// Whether distances from cubics of this standard deviation (mean edges) are coherent.
pub(super) fn is_coherent(mesh: &TriMesh, incidence: &Incidence, level: f64) -> bool {
    let wide = level_over(mesh, incidence, SAMPLES, WIDE_RINGS);
    // If noise n and folds f add up to `level`, n and GROWTH · f add up to `wide`.
    let square = (GROWTH * level).powi(2) - wide.powi(2);
    square < CLEAN.powi(2) * (GROWTH.powi(2) - 1.0)
        || sides_alike(mesh, incidence) > ALIKE
        || scatter(mesh, incidence) < SCATTER * level
}

/// Mean over edges of +1 where both ends lie on the same side of the cloth around them, −1 where not.
fn sides_alike(mesh: &TriMesh, incidence: &Incidence) -> f64 {
    let off = |v: u32| off_cubic(mesh, incidence, v, RINGS);
    let (mut sum, mut count) = (0.0, 0usize);
    for v in incidence.samples(mesh, COMPARED) {
        let Some(own) = off(v) else {
            continue;
        };
        let ring = incidence.rings(mesh, v, 1);
        let inner = ring
            .iter()
            .filter(|w| !incidence.is_hub(**w) && !incidence.is_border(mesh, **w));
        for other in inner.filter_map(|w| off(*w)) {
            sum += (own * other).signum();
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// Median over vertices of the variance of the normals of the faces within three edges in the direction of less
/// scatter, divided by that in the direction of more; 1 for a plane.
fn scatter(mesh: &TriMesh, incidence: &Incidence) -> f64 {
    let share = |v: u32| {
        let mut faces: Vec<u32> = (incidence.rings(mesh, v, RINGS).iter())
            .chain([&v])
            .flat_map(|w| incidence.faces_at(*w))
            .collect();
        faces.sort_unstable();
        faces.dedup();
        // A face counts as its area.
        let normals: Vec<Vec3> = faces
            .iter()
            .map(|f| doubled_normal(mesh, *f as usize))
            .collect();
        let area: f64 = normals.iter().map(Vec3::norm).sum();
        let mean: Vec3 = normals.iter().sum::<Vec3>() / area;
        let spread = normals.iter().filter_map(|n| {
            let d = n.try_normalize(0.0)? - mean;
            Some(d * d.transpose() * n.norm())
        });
        let mut variances = spread
            .sum::<nalgebra::Matrix3<f64>>()
            .symmetric_eigenvalues();
        variances.as_mut_slice().sort_unstable_by(f64::total_cmp);
        let (less, more) = (variances[1], variances[2]);
        if more > 0.0 { less / more } else { 1.0 }
    };
    let mut shares: Vec<f64> = incidence.samples(mesh, COMPARED).map(share).collect();
    let middle = shares.len() / 2;
    if shares.is_empty() {
        return 1.0;
    }
    *shares.select_nth_unstable_by(middle, f64::total_cmp).1
}
