//! How far a network's answer may be from the cloth that was there: a standard deviation for every cell, from what the answer itself shows.
//!
//! Two things are seen at every mend: how far the answers to the grid's symmetries lie apart, and how rough the known cells are. On held-out cloth the
//! first ranks cells by their error (Spearman 0.7 to 0.8), the second is what no network can know. Their weights, and how the error grows with the
//! distance from the known cloth, are measured on held-out sheets (`darn calibrate`) and belong to the model card. Scaling by a quantile of measured
//! errors is conformal prediction (Vovk et al. 2005; with a scale that differs from place to place, Lei et al. 2018).

use darn_geometry::grid::{CELLS, NormalGrid, SIDE, distances_to};
use serde::{Deserialize, Serialize};

/// Nine of ten cells are nearer to the truth than so many of their standard deviations, as with a normal distribution along one line.
pub const WITHIN_90: f64 = 1.645;

/// How errors follow from what is seen; lengths are in cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorModel {
    /// Standard deviation for each cell that the answers to the symmetries lie apart.
    pub spread: f64,
    /// Standard deviation for each cell of the known cells' roughness.
    pub roughness: f64,
    /// What both are multiplied by, at some depths, ascending; linear between them.
    pub growth: Vec<DepthGrowth>,
}

/// What deviations are multiplied by at a depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthGrowth {
    /// Distance from the nearest known cell, in cells.
    pub depth: f64,
    /// The factor there.
    pub factor: f64,
}

impl ErrorModel {
    /// The standard deviation of every cell of a grid, in the network's units; 0 where the cell is known. `spread` is that of the network's answer.
    pub fn deviations(&self, grid: &NormalGrid, spread: &[f32]) -> Vec<f64> {
        let rough = grid.roughness();
        let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
        let depths = distances_to(&known);
        let of_cell = |k: usize| match (known.get(k), spread.get(k)) {
            (Some(false), Some(spread)) => {
                let apart = f64::from(*spread) * SIDE as f64;
                let factor = self.factor(f64::from(depths[k]));
                factor * self.unscaled(apart, rough) / SIDE as f64
            }
            _ => 0.0,
        };
        (0..CELLS).map(of_cell).collect()
    }

    /// The deviation before it is multiplied by the growth, from the spread and the roughness, all in cells.
    pub fn unscaled(&self, spread: f64, roughness: f64) -> f64 {
        (self.spread * spread).hypot(self.roughness * roughness)
    }

    /// The factor at a depth, in cells.
    pub fn factor(&self, depth: f64) -> f64 {
        let after = self.growth.partition_point(|at| at.depth <= depth);
        let before = after.checked_sub(1).and_then(|k| self.growth.get(k));
        match (before, self.growth.get(after)) {
            (Some(a), Some(b)) => {
                let share = (depth - a.depth) / (b.depth - a.depth);
                a.factor + share * (b.factor - a.factor)
            }
            (Some(end), None) | (None, Some(end)) => end.factor,
            (None, None) => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> ErrorModel {
        let growth = [(2.0, 1.0), (6.0, 2.0)];
        ErrorModel {
            spread: 3.0,
            roughness: 1.0,
            growth: growth
                .map(|(depth, factor)| DepthGrowth { depth, factor })
                .into(),
        }
    }

    #[test]
    fn growth_is_linear_between_depths_and_constant_beyond() {
        let factors = [0.0, 2.0, 3.0, 6.0, 40.0].map(|depth| model().factor(depth));
        assert_eq!(factors, [1.0, 1.0, 1.25, 2.0, 2.0]);
        let flat = ErrorModel {
            growth: Vec::new(),
            ..model()
        };
        assert_eq!(flat.factor(5.0), 1.0);
    }

    #[test]
    fn cells_where_answers_lie_apart_deviate_and_known_ones_do_not() {
        let known = |k: usize| (k % SIDE).abs_diff(32) > 8 || (k / SIDE).abs_diff(32) > 8;
        let grid = NormalGrid {
            positions: (0..CELLS)
                .map(|k| [(k % SIDE) as f32 / 64.0, (k / SIDE) as f32 / 64.0, 0.0])
                .collect(),
            known: (0..CELLS).map(|k| f32::from(u8::from(known(k)))).collect(),
            base: None,
        };
        let apart = 0.5 / SIDE as f32;
        let deviations = model().deviations(&grid, &vec![apart; CELLS]);
        for (k, deviation) in deviations.iter().enumerate() {
            let cells = deviation * SIDE as f64;
            let depth = 9 - (k % SIDE).abs_diff(32).max((k / SIDE).abs_diff(32)) as i64;
            match (known(k), depth) {
                (true, _) => assert_eq!(cells, 0.0),
                // A flat sheet has no roughness beyond that of its numbers.
                (false, 1 | 2) => assert!((cells - 1.5).abs() < 1e-3, "{cells}"),
                (false, 6..) => assert!((cells - 3.0).abs() < 1e-3, "{cells}"),
                (false, _) => assert!(cells > 1.5 && cells < 3.0),
            }
        }
    }
}
