//! A smooth surface over a chart, from some of its cloth: a thin-plate spline (Duchon 1977), which bends as little as possible.

use darn_budget::{Budget, Exhausted};
use nalgebra::{DMatrix, Matrix3xX};

use crate::mesh::{Vec2, Vec3};

/// Points that the surface is made to meet, about.
const POINTS: usize = 150;
/// Fewer points say nothing about a surface.
const FEWEST: usize = 12;
/// How little the surface need meet them, against what bending costs; without unit, as places are in shares of the points' extent.
const GIVE: f64 = 1e-3;
/// Nanoseconds of work of a system of one unknown; it grows with the cube of their number.
const SOLVE_WORK: u64 = 1;

/// A position in space for every place of a chart.
pub(super) struct SmoothSheet {
    /// Centre and extent of the places.
    centre: Vec2,
    extent: f64,
    /// The places that it was made to meet, without unit.
    places: Vec<Vec2>,
    /// Columns: a weight for each place, then those of 1, x and y.
    weights: Matrix3xX<f64>,
}

impl SmoothSheet {
    /// The surface through some of these points, each with its place on the chart; `None` where there are too few, or all lie on a line.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn through(
        points: &[(Vec2, Vec3)],
        budget: &Budget,
    ) -> Result<Option<SmoothSheet>, Exhausted> {
        let chosen: Vec<&(Vec2, Vec3)> = points
            .iter()
            .step_by((points.len() / POINTS).max(1))
            .collect();
        let count = chosen.len();
        if count < FEWEST {
            return Ok(None);
        }
        budget.spend(SOLVE_WORK * (count * count * count) as u64)?;
        let low = chosen.iter().fold(chosen[0].0, |m, (p, _)| m.inf(p));
        let high = chosen.iter().fold(chosen[0].0, |m, (p, _)| m.sup(p));
        let (centre, extent) = (0.5 * (low + high), 0.5 * (high - low).max());
        let places: Vec<Vec2> = chosen.iter().map(|(p, _)| (p - centre) / extent).collect();
        let mut system = DMatrix::zeros(count + 3, count + 3);
        let mut right = DMatrix::zeros(count + 3, 3);
        for (i, (p, (_, place))) in places.iter().zip(&chosen).enumerate() {
            for (j, q) in places.iter().enumerate() {
                system[(i, j)] = bump(p, q);
            }
            system[(i, i)] = GIVE;
            for (k, x) in [1.0, p.x, p.y].into_iter().enumerate() {
                system[(i, count + k)] = x;
                system[(count + k, i)] = x;
            }
            (0..3).for_each(|d| right[(i, d)] = place[d]);
        }
        let solved = system.lu().solve(&right);
        Ok(solved
            .filter(|weights| weights.iter().all(|w| w.is_finite()))
            .map(|weights| SmoothSheet {
                centre,
                extent,
                places,
                weights: Matrix3xX::from_fn(count + 3, |d, k| weights[(k, d)]),
            }))
    }

    /// Its position at a place of the chart.
    pub fn at(&self, place: &Vec2) -> Vec3 {
        let p = (place - self.centre) / self.extent;
        let count = self.places.len();
        let weight = |k: usize| self.weights.column(k);
        let plane = weight(count) + weight(count + 1) * p.x + weight(count + 2) * p.y;
        let bumps = self.places.iter().enumerate();
        bumps.fold(plane, |sum, (k, q)| sum + weight(k) * bump(&p, q))
    }
}

/// r² ln r of the distance of two places.
fn bump(a: &Vec2, b: &Vec2) -> f64 {
    let square = (a - b).norm_squared();
    if square > 0.0 {
        0.5 * square * square.ln()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_goes_on_from_a_ring_of_cloth_that_bends_little(bend in 0.0..0.5f64, slope in -1.0..1.0f64, size in 0.01..100.0f64) {
            let cloth = |p: Vec2| Vec3::new(p.x, p.y, slope * p.x + bend * p.x * p.y / size);
            let ring: Vec<(Vec2, Vec3)> = (0..60)
                .map(|k| {
                    let turn = std::f64::consts::TAU * f64::from(k) / 20.0;
                    Vec2::new(turn.cos(), turn.sin()) * size * (1.0 + f64::from(k / 20) * 0.3)
                })
                .map(|p| (p, cloth(p)))
                .collect();
            let sheet = SmoothSheet::through(&ring, Budget::unlimited()).unwrap().expect("enough points");
            for p in [Vec2::new(0.0, 0.0), Vec2::new(0.3, -0.2), Vec2::new(-0.5, 0.4)] {
                let off = (sheet.at(&(p * size)) - cloth(p * size)).norm();
                prop_assert!(off < 0.03 * size, "off by {off}");
            }
        }
    }

    #[test]
    fn points_on_a_line_make_no_surface() {
        let line: Vec<(Vec2, Vec3)> = (0..40)
            .map(|k| {
                (
                    Vec2::new(f64::from(k), 0.0),
                    Vec3::new(f64::from(k), 0.0, 0.0),
                )
            })
            .collect();
        let sheet = SmoothSheet::through(&line, Budget::unlimited()).unwrap();
        assert!(sheet.is_none());
        assert!(
            SmoothSheet::through(&line[..5], Budget::unlimited())
                .unwrap()
                .is_none()
        );
    }
}
