//! Plausible fills beside the likeliest one: along the principal directions in which a network's answers to the symmetries of a grid differ.
//!
//! A network that knew everything would answer alike whichever way the grid is turned. Where it is unsure it does not, and its answers differ most along
//! the folds that could be deeper or shallower.

use darn_geometry::grid::{CELLS, NormalGrid};
use nalgebra::{DMatrix, Vector3};

/// Symmetries of the grid.
pub const SYMMETRIES: usize = 8;
/// How many fills there are, the first included.
const FILLS: usize = 8;
/// Standard deviations from the first fill to each of the others.
const STEP: f64 = 2.0;

/// The first fill and those on either side of it, along the principal directions of the `answers` in the grid's unknown cells.
pub fn around(
    first: Vec<[f32; 3]>,
    answers: &[Vec<[f32; 3]>],
    grid: &NormalGrid,
) -> Vec<Vec<[f32; 3]>> {
    let count = answers.len();
    let open: Vec<usize> = (0..CELLS).filter(|k| grid.known[*k] <= 0.5).collect();
    let wide = |p: &[f32; 3]| Vector3::from(p.map(f64::from));
    let mean = |k: usize| -> Vector3<f64> {
        answers
            .iter()
            .map(|answer| wide(&answer[k]))
            .sum::<Vector3<f64>>()
            / count as f64
    };
    let means: Vec<Vector3<f64>> = open.iter().map(|k| mean(*k)).collect();
    let off: Vec<Vec<Vector3<f64>>> = (answers.iter())
        .map(|answer| {
            let each = open.iter().zip(&means);
            each.map(|(k, mean)| wide(&answer[*k]) - mean).collect()
        })
        .collect();
    let product = |a: &[Vector3<f64>], b: &[Vector3<f64>]| -> f64 {
        a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
    };
    let gram = DMatrix::from_fn(count, count, |i, j| product(&off[i], &off[j]));
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));

    let base = grid.base.as_deref().unwrap_or(&grid.positions);
    let from_base: Vec<Vector3<f64>> = (open.iter())
        .map(|k| wide(&first[*k]) - wide(&base[*k]))
        .collect();
    let mut fills = vec![first];
    for direction in order {
        let weights = eigen.eigenvectors.column(direction);
        // One standard deviation of the answers along it.
        let along: Vec<Vector3<f64>> = (0..open.len())
            .map(|n| {
                let each = off.iter().zip(weights.iter());
                each.map(|(off, weight)| off[n] * *weight)
                    .sum::<Vector3<f64>>()
                    / (count as f64).sqrt()
            })
            .collect();
        // An eigenvector's sign is arbitrary.
        let outward = if product(&along, &from_base) < 0.0 {
            -1.0
        } else {
            1.0
        };
        for sign in [outward, -outward] {
            let mut fill = fills[0].clone();
            for (k, along) in open.iter().zip(&along) {
                fill[*k] = (wide(&fill[*k]) + along * (sign * STEP)).cast().into();
            }
            fills.push(fill);
        }
    }
    fills.truncate(FILLS);
    fills
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::grid::SIDE;

    #[test]
    fn fills_lie_on_either_side_of_the_first_along_what_the_answers_differ_in() {
        let hole = |k: usize| (k % SIDE).abs_diff(32) < 8 && (k / SIDE).abs_diff(32) < 8;
        let sheet = |height: &dyn Fn(usize) -> f32| -> Vec<[f32; 3]> {
            let place = |k: usize| {
                [
                    (k % SIDE) as f32 / 64.0,
                    (k / SIDE) as f32 / 64.0,
                    height(k),
                ]
            };
            (0..CELLS).map(place).collect()
        };
        let grid = NormalGrid {
            positions: sheet(&|_| 0.0),
            known: (0..CELLS).map(|k| f32::from(u8::from(!hole(k)))).collect(),
            base: Some(sheet(&|_| 0.0)),
        };
        // Heights that differ by one wave, more and less of it.
        let wave = |k: usize| {
            if hole(k) {
                ((k % SIDE) as f32 * 0.7).sin()
            } else {
                0.0
            }
        };
        let amounts = [0.05f32, -0.05, 0.02, -0.02, 0.05, -0.05, 0.02, -0.02];
        let answers: Vec<_> = (amounts.iter())
            .map(|amount| sheet(&|k| 0.1 + amount * wave(k)))
            .collect();
        let first = sheet(&|_| 0.1);
        let fills = around(first.clone(), &answers, &grid);
        assert_eq!(fills.len(), FILLS);
        assert_eq!(fills[0], first);
        let deviation = amounts.iter().map(|a| a * a).sum::<f32>() / amounts.len() as f32;
        for k in 0..CELLS {
            let [up, down] = [fills[1][k][2] - first[k][2], fills[2][k][2] - first[k][2]];
            assert!((up + down).abs() < 1e-6, "a pair is symmetric");
            let expected = 2.0 * deviation.sqrt() * wave(k);
            assert!((up.abs() - expected.abs()).abs() < 1e-5, "{up} {expected}");
            // The answers differ in one direction only.
            assert!((fills[3][k][2] - first[k][2]).abs() < 1e-5);
        }
    }
}
