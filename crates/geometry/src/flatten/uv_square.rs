//! The unit square of uv laid over a chart: the smallest enclosing square over all rotations.

use crate::mesh::Vec2;
use crate::polygon::convex_hull;

/// A square in the plane of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UvSquare {
    /// The corner at uv (0, 0).
    pub origin: Vec2,
    /// Unit vector along u; v runs along this vector rotated by +90°.
    pub axis: Vec2,
    /// Side length, the chart's units.
    pub side: f64,
}

/// Rotations tried for the square; a finer search changes the side by less than a tenth of a per cent.
const DIRECTIONS: usize = 180;

impl UvSquare {
    /// The smallest square that holds all points, over 180 rotations within a quarter turn; centred on the points.
    /// Meaningless without points.
    pub fn tightest(points: &[Vec2]) -> UvSquare {
        let points = &convex_hull(points)[..];
        let candidates = (0..DIRECTIONS).map(|k| {
            let angle = std::f64::consts::FRAC_PI_2 * k as f64 / DIRECTIONS as f64;
            Self::along(Vec2::new(angle.cos(), angle.sin()), points)
        });
        candidates
            .min_by(|a, b| a.side.total_cmp(&b.side))
            .unwrap_or(UvSquare {
                origin: Vec2::zeros(),
                axis: Vec2::x(),
                side: 1.0,
            })
    }

    /// The smallest square along `axis` that holds all points.
    fn along(axis: Vec2, points: &[Vec2]) -> UvSquare {
        let up = Vec2::new(-axis.y, axis.x);
        let (mut low, mut high) = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        for p in points {
            let q = Vec2::new(axis.dot(p), up.dot(p));
            low = low.inf(&q);
            high = high.sup(&q);
        }
        let extent = high - low;
        let side = extent.max();
        let corner = low - (Vec2::repeat(side) - extent) / 2.0;
        UvSquare {
            origin: axis * corner.x + up * corner.y,
            axis,
            side,
        }
    }

    /// The uv of a chart point.
    #[inline]
    pub fn uv(&self, p: Vec2) -> Vec2 {
        let d = p - self.origin;
        Vec2::new(self.axis.dot(&d), self.axis.perp(&d)) / self.side
    }

    /// The chart point at a uv.
    #[inline]
    pub fn point(&self, uv: Vec2) -> Vec2 {
        let up = Vec2::new(-self.axis.y, self.axis.x);
        self.origin + (self.axis * uv.x + up * uv.y) * self.side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_points_lie_in_the_square_and_come_back(
            points in prop::collection::vec((-5.0..5.0f64, -5.0..5.0f64), 3..40)
        ) {
            let points: Vec<Vec2> = points.into_iter().map(|(x, y)| Vec2::new(x, y)).collect();
            let square = UvSquare::tightest(&points);
            for p in &points {
                let uv = square.uv(*p);
                prop_assert!(uv.min() >= -1e-12 && uv.max() <= 1.0 + 1e-12);
                prop_assert!((square.point(uv) - p).norm() < 1e-11);
            }
        }
    }

    #[test]
    fn a_rotated_square_is_found() {
        let rotated = [Vec2::x(), Vec2::y(), -Vec2::x(), -Vec2::y()];
        assert!((UvSquare::tightest(&rotated).side - 2f64.sqrt()).abs() < 1e-9);
    }
}
