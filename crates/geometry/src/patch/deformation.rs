//! How a triangle is deformed from its rest shape, and the nearest deformation within the strain limit.

use nalgebra::{Matrix2, Matrix3x2};

use crate::flatten::RestTriangle;
use crate::mesh::{Vec2, Vec3};

/// A triangle of the energy with what it needs of its rest shape.
pub(super) struct StrainTriangle {
    /// Its vertices.
    pub face: [u32; 3],
    /// Gradients of the three hat functions at rest, 1 ÷ scene units.
    pub gradient: [Vec2; 3],
    /// Area at rest, scene units squared.
    pub area: f64,
    /// How far the rest shape is stretched from the chart, in doubt by as much: 0 where cloth lies flat.
    pub doubt: f64,
}

// Inlined: these run for every triangle in every round.
impl StrainTriangle {
    /// The triangle with the given vertices; `points` are the rest positions of all vertices.
    pub fn new(face: &[u32; 3], points: &[Vec2]) -> StrainTriangle {
        Self::stretched(face, points, &Matrix2::identity())
    }

    /// The same with a rest shape that is stretched in the plane by a symmetric matrix.
    pub fn stretched(face: &[u32; 3], points: &[Vec2], by: &Matrix2<f64>) -> StrainTriangle {
        let rest = RestTriangle::from_corners(face.map(|v| by * points[v as usize]));
        StrainTriangle {
            face: *face,
            gradient: rest.gradients(),
            area: rest.area,
            doubt: (by - Matrix2::identity()).norm(),
        }
    }

    /// The logarithm of the stretch from rest to `positions`, a symmetric matrix.
    pub fn log_stretch(&self, positions: &[Vec3]) -> Matrix2<f64> {
        let f = self.deformation(positions);
        of_symmetric(f.transpose() * f, |square| 0.5 * square.max(1e-12).ln())
    }

    /// The deformation gradient F: its columns are the images of the chart's axes.
    #[inline]
    fn deformation(&self, positions: &[Vec3]) -> Matrix3x2<f64> {
        let [a, b, c] = self.face.map(|v| positions[v as usize]);
        let (ab, ac) = (b - a, c - a);
        // The gradients of the hat functions add up to zero.
        Matrix3x2::from_columns(&[
            ab * self.gradient[1].x + ac * self.gradient[2].x,
            ab * self.gradient[1].y + ac * self.gradient[2].y,
        ])
    }

    /// The deformation gradient with its singular values clamped to 1 ± (`max_strain` + doubt).
    #[inline]
    pub fn limited(&self, positions: &[Vec3], max_strain: f64) -> Matrix3x2<f64> {
        let f = self.deformation(positions);
        let max_strain = max_strain + self.doubt;
        let limited = |square: f64| {
            let s = square.max(1e-12).sqrt();
            s.clamp(1.0 - max_strain, 1.0 + max_strain) / s
        };
        f * of_symmetric(f.transpose() * f, limited)
    }

    /// The stretch S of the polar decomposition F = R S.
    pub fn stretch(&self, positions: &[Vec3]) -> Matrix2<f64> {
        let f = self.deformation(positions);
        of_symmetric(f.transpose() * f, |square| square.max(0.0).sqrt())
    }

    /// The deformation R S nearest to the present one, for the given S and any rotation R.
    #[inline]
    pub fn rotated(&self, positions: &[Vec3], stretch: &Matrix2<f64>) -> Matrix3x2<f64> {
        let along = self.deformation(positions) * stretch;
        let inverse_root = |square: f64| square.max(1e-24).sqrt().recip();
        along * of_symmetric(along.transpose() * along, inverse_root) * stretch
    }
}

/// g(C) of a symmetric 2×2 matrix C by its eigenvalues.
#[inline]
pub(super) fn of_symmetric(c: Matrix2<f64>, g: impl Fn(f64) -> f64) -> Matrix2<f64> {
    let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
    // Not `hypot`, which is slower: no value here is near overflow.
    let radius = (half * half + c[(0, 1)] * c[(0, 1)]).sqrt();
    let (high, low) = (g(mean + radius), g(mean - radius));
    if radius <= 1e-12 * mean.abs() {
        return Matrix2::identity() * high;
    }
    // g(C) = ½(g₊ + g₋) I + ½(g₊ − g₋) (C − mean I) / radius
    (c - Matrix2::identity() * mean) * (0.5 * (high - low) / radius)
        + Matrix2::identity() * (0.5 * (high + low))
}
