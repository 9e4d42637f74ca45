//! Held-out scores: the error of predicted hole cells in position, direction and amount of cloth.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::batch::PreparedSample;
use crate::cell_normals::normal;
use darn_geometry::grid::{CELLS, SIDE, neighbour_pairs};

/// Means over samples; positions in cells, angles in degrees.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Root mean square distance to the truth over hole cells, mean over samples.
    pub rmse: f64,
    /// The same, median over samples.
    pub rmse_median: f64,
    /// Mean angle to the true normals in hole cells.
    pub normal: f64,
    /// Mean distance of neighbours that touch the hole ÷ the truth's.
    pub spacing: f64,
    /// Mean area of the cells' parallelograms in the hole ÷ the truth's.
    pub area: f64,
}

/// The scores of a network and of its input fill on the same samples.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeldOutScores {
    /// The network's.
    pub network: Score,
    /// The input fill's.
    pub fill: Score,
}

/// Scores predictions `[cell]` of prepared samples; known cells are taken from the samples.
pub(super) fn score(samples: &[PreparedSample], predictions: &[Vec<[f32; 3]>]) -> Score {
    let each: Vec<Score> = samples
        .iter()
        .zip(predictions)
        .map(|(s, p)| one(s, p))
        .collect();
    let mean = |of: fn(&Score) -> f64| each.iter().map(of).sum::<f64>() / each.len().max(1) as f64;
    let mut sorted: Vec<f64> = each.iter().map(|s| s.rmse).collect();
    sorted.sort_by(f64::total_cmp);
    Score {
        rmse: mean(|s| s.rmse),
        rmse_median: sorted.get(sorted.len() / 2).copied().unwrap_or(0.0),
        normal: mean(|s| s.normal),
        spacing: mean(|s| s.spacing),
        area: mean(|s| s.area),
    }
}

fn one(sample: &PreparedSample, predicted: &[[f32; 3]]) -> Score {
    let hole = |k: usize| sample.hole[k];
    let truth: Vec<Vector3<f64>> = sample.truth.iter().map(vector).collect();
    let answer: Vec<Vector3<f64>> = (0..CELLS)
        .map(|k| {
            if hole(k) {
                vector(&predicted[k])
            } else {
                truth[k]
            }
        })
        .collect();
    let mut squares = (0.0, 0usize);
    let mut angles = (0.0, 0usize);
    let mut areas = (0.0, 0.0);
    for k in (0..CELLS).filter(|k| hole(*k)) {
        squares = (
            squares.0 + (answer[k] - truth[k]).norm_squared(),
            squares.1 + 1,
        );
        if let (Some(a), Some(b)) = (
            normal(&answer, &sample.valid, k),
            normal(&truth, &sample.valid, k),
        ) {
            angles = (angles.0 + a.angle(&b).to_degrees(), angles.1 + 1);
            areas = (areas.0 + a.norm(), areas.1 + b.norm());
        }
    }
    let pairs: Vec<_> = neighbour_pairs()
        .filter(|(a, b)| sample.valid[*a] && sample.valid[*b] && (hole(*a) || hole(*b)))
        .collect();
    let length = |x: &[Vector3<f64>]| {
        pairs
            .iter()
            .map(|(a, b)| (x[*a] - x[*b]).norm())
            .sum::<f64>()
    };
    let rmse = (squares.0 / squares.1.max(1) as f64).sqrt() * SIDE as f64;
    Score {
        rmse,
        rmse_median: rmse,
        normal: angles.0 / angles.1.max(1) as f64,
        spacing: length(&answer) / length(&truth).max(1e-12),
        area: areas.0 / areas.1.max(1e-12),
    }
}

fn vector(p: &[f32; 3]) -> Vector3<f64> {
    Vector3::new(p[0].into(), p[1].into(), p[2].into())
}
