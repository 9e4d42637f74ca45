//! The loss of [`super::loss`] and its derivatives with respect to a prediction, written out on plain slices, for the engine's trainer. A
//! test holds both against burn's autodiff. No locks are taken, so it may run on the threads of a pool.

use super::batch::TrainingBatch;
use super::loss::{DATA_BEND, GRADIENT_BEND, LENGTH_GUARD, LossKind, LossTerms, LossWeights};
use super::near_pairs::{REACH, near_pairs};
use darn_geometry::grid::{CELLS, SIDE};

/// A position or a difference of positions, in cells.
type Vector = [f32; 3];

/// The loss of predictions `[n, 3, 64, 64]` of a batch of n; writes its derivatives with respect to them into `by`.
pub(super) fn loss_and_gradient(
    predictions: &[f32],
    batch: &TrainingBatch,
    weights: &LossWeights,
    by: &mut [f32],
) -> LossTerms {
    let grids: Vec<SampleGrid> = (0..batch.count)
        .map(|grid| SampleGrid::of(grid, predictions, batch))
        .collect();
    let share = |of: &[f32]| 1.0 / of.iter().sum::<f32>().max(1e-6);
    let (of_cell, of_u, of_v) = (
        share(&batch.weight),
        share(&batch.pairs_u),
        share(&batch.pairs_v),
    );
    let holes = batch.hole.iter().filter(|h| **h > 0.0).count().max(1) as f32;
    let (mut data, mut gradient, mut stretch, mut repulsion) = (0.0, 0.0, 0.0, 0.0);
    for (number, grid) in grids.iter().enumerate() {
        let mut slope = vec![[0.0; 3]; CELLS];
        for (cell, weight) in grid.weight.iter().enumerate() {
            let (value, by) = counted(grid.error[cell], weights.kind, DATA_BEND);
            data += value * weight * of_cell;
            add(&mut slope[cell], by, weight * of_cell);
        }
        // The other terms use the error in the hole only: known cells keep the positions of the scan.
        let mut by_composed = vec![[0.0; 3]; CELLS];
        let along_u = grid.pairs_u.iter().enumerate().map(|(k, weight)| {
            let cell = k / (SIDE - 1) * SIDE + k % (SIDE - 1);
            ([cell, cell + 1], weight * of_u)
        });
        let along_v = grid.pairs_v.iter().enumerate();
        let along_v = along_v.map(|(cell, weight)| ([cell, cell + SIDE], weight * of_v));
        for ([a, b], weight) in along_u.chain(along_v).filter(|(_, weight)| *weight > 0.0) {
            let weight = 0.5 * weight;
            let off = minus(grid.hole_error(b), grid.hole_error(a));
            let (value, by) = counted(off, weights.kind, GRADIENT_BEND);
            gradient += value * weight;
            let by_gradient = weight * weights.gradient as f32;
            let true_step = minus(grid.truth[b], grid.truth[a]);
            let step: Vector = std::array::from_fn(|d| true_step[d] + off[d]);
            let [long, wanted] =
                [step, true_step].map(|step| (squared(step) + LENGTH_GUARD).sqrt());
            stretch += (long - wanted).powi(2) * weight;
            let by_stretch = 2.0 * (long - wanted) / long * weight * weights.stretch as f32;
            for (cell, sign) in [(b, 1.0), (a, -1.0)] {
                add(&mut by_composed[cell], by, sign * by_gradient);
                add(&mut by_composed[cell], step, sign * by_stretch);
            }
        }
        if weights.self_penetration > 0.0 {
            let weight = weights.self_penetration as f32 / holes;
            repulsion += grid.repelled(weight, &mut by_composed) / holes;
        }
        for (cell, slope) in slope.iter_mut().enumerate() {
            add(slope, by_composed[cell], grid.hole[cell]);
            for (axis, x) in slope.iter().enumerate() {
                by[(3 * number + axis) * CELLS + cell] = x * SIDE as f32;
            }
        }
    }
    let total = data
        + gradient * weights.gradient as f32
        + stretch * weights.stretch as f32
        + repulsion * weights.self_penetration as f32;
    LossTerms {
        total,
        data,
        gradient,
        stretch,
        self_penetration: repulsion,
    }
}

/// One sample, in cells.
struct SampleGrid<'a> {
    truth: Vec<Vector>,
    /// Predicted minus true.
    error: Vec<Vector>,
    /// 1 in the hole, 0 elsewhere.
    hole: &'a [f32],
    weight: &'a [f32],
    pairs_u: &'a [f32],
    pairs_v: &'a [f32],
}

/// Pairs of neighbours along one axis.
const PAIRS: usize = SIDE * (SIDE - 1);

impl<'a> SampleGrid<'a> {
    fn of(grid: usize, predictions: &[f32], batch: &'a TrainingBatch) -> SampleGrid<'a> {
        let vectors = |planes: &[f32]| -> Vec<Vector> {
            let planes = &planes[grid * 3 * CELLS..];
            let at = |cell: usize| [0, 1, 2].map(|axis| planes[axis * CELLS + cell] * SIDE as f32);
            (0..CELLS).map(at).collect()
        };
        let (truth, said) = (vectors(&batch.truth), vectors(predictions));
        let part = |values: &'a [f32], size: usize| &values[grid * size..(grid + 1) * size];
        SampleGrid {
            error: said
                .into_iter()
                .zip(&truth)
                .map(|(p, t)| minus(p, *t))
                .collect(),
            truth,
            hole: part(&batch.hole, CELLS),
            weight: part(&batch.weight, CELLS),
            pairs_u: part(&batch.pairs_u, PAIRS),
            pairs_v: part(&batch.pairs_v, PAIRS),
        }
    }

    fn hole_error(&self, cell: usize) -> Vector {
        self.error[cell].map(|x| x * self.hole[cell])
    }

    /// Σ (reach − d)² over near pairs of the composed grid; adds its derivatives, times `weight`, to `by`.
    fn repelled(&self, weight: f32, by: &mut [Vector]) -> f32 {
        let place = |cell: usize| -> Vector {
            let error = self.hole_error(cell);
            std::array::from_fn(|d| self.truth[cell][d] + error[d])
        };
        let places: Vec<Vector> = (0..CELLS).map(place).collect();
        let [present, open] = [self.weight, self.hole]
            .map(|flags| flags.iter().map(|x| *x > 0.0).collect::<Vec<bool>>());
        let near = near_pairs(&places, &present, &open);
        let mut sum = 0.0;
        for (a, b) in near.pairs {
            let apart = minus(places[a], places[b]);
            let distance = (squared(apart) + LENGTH_GUARD).sqrt();
            let depth = (REACH - distance).max(0.0);
            sum += depth * depth * near.each;
            let slope = -2.0 * depth / distance * near.each * weight;
            add(&mut by[a], apart, slope);
            add(&mut by[b], apart, -slope);
        }
        sum
    }
}

/// The penalty ‖x‖² or √(‖x‖² + δ²) − δ, and its derivative.
fn counted(x: Vector, kind: LossKind, bend: f32) -> (f32, Vector) {
    match kind {
        LossKind::Squared => (squared(x), x.map(|x| 2.0 * x)),
        LossKind::Softened => {
            let root = (squared(x) + bend * bend).sqrt();
            (root - bend, x.map(|x| x / root))
        }
    }
}

fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|d| a[d] - b[d])
}

fn squared(x: Vector) -> f32 {
    x.iter().map(|x| x * x).sum()
}

fn add(to: &mut Vector, x: Vector, times: f32) {
    to.iter_mut().zip(x).for_each(|(to, x)| *to += x * times);
}

#[cfg(test)]
mod tests {
    use burn::backend::{Autodiff, Flex};
    use burn::tensor::{Tensor, TensorData};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::batch::prepare;
    use super::super::loss::{LossTarget, loss};
    use super::*;
    use crate::scarffolds::samples::TrainingSample;
    use darn_geometry::grid::cell_centre;
    use darn_net::UnetConfig;

    type Auto = Autodiff<Flex>;

    /// A bent sheet with a hole between two columns and rows; its last rows are not there.
    fn sample(first: usize, last: usize) -> TrainingSample {
        let within =
            |k: usize| (first..last).contains(&(k % SIDE)) && (first..last).contains(&(k / SIDE));
        let hole: Vec<bool> = (0..CELLS).map(within).collect();
        let valid: Vec<bool> = (0..CELLS).map(|k| k / SIDE < 60).collect();
        let bent = |k: usize| {
            let p = cell_centre(k).map(|x| x as f32);
            [p.x, p.y, 0.1 * (7.0 * p.x).sin()]
        };
        let both = hole.iter().zip(&valid);
        TrainingSample {
            known: both.map(|(hole, valid)| *valid && !hole).collect(),
            truth: (0..CELLS)
                .map(|k| if valid[k] { bent(k) } else { [0.0; 3] })
                .collect(),
            valid,
            hole,
        }
    }

    #[test]
    fn the_derivatives_are_those_of_autodiff() {
        let prepared = [sample(10, 40), sample(25, 31)]
            .map(|sample| prepare(&sample, &UnetConfig::default()).unwrap());
        let batch = TrainingBatch::of(&prepared);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut shaken = |amount: f32| -> Vec<f32> {
            let off = |x: &f32| x + rng.random_range(-amount..amount) / SIDE as f32;
            batch.truth.iter().map(off).collect()
        };
        // Small errors, and errors so large that layers repel each other.
        for (answer, repelled) in [(shaken(0.5), false), (shaken(6.0), true)] {
            for kind in [LossKind::Softened, LossKind::Squared] {
                let weights = LossWeights {
                    kind,
                    self_penetration: 30.0,
                    ..LossWeights::default()
                };
                let mut by = vec![f32::NAN; answer.len()];
                let terms = loss_and_gradient(&answer, &batch, &weights, &mut by);
                let found = [
                    terms.total,
                    terms.data,
                    terms.gradient,
                    terms.stretch,
                    terms.self_penetration,
                ];

                let device = Default::default();
                let shape = [batch.count, 3, SIDE, SIDE];
                let input =
                    Tensor::<Auto, 4>::from_data(TensorData::new(answer.clone(), shape), &device)
                        .require_grad();
                let target = LossTarget::of(batch.clone(), &device);
                let wanted = loss(input.clone(), &target, &weights);
                let stacked: Vec<f32> = wanted.stacked().into_data().into_vec().unwrap();
                for (found, wanted) in found.iter().zip(stacked) {
                    assert!(
                        (found - wanted).abs() <= 1e-4 * wanted.abs(),
                        "{found} {wanted}"
                    );
                }
                assert_eq!(terms.self_penetration > 0.0, repelled);
                let gradients = wanted.total.backward();
                let wanted = input.grad(&gradients).unwrap().into_data();
                let wanted: Vec<f32> = wanted.into_vec().unwrap();
                let largest = wanted.iter().fold(0.0, |m: f32, x| m.max(x.abs()));
                for (found, wanted) in by.iter().zip(wanted) {
                    assert!((found - wanted).abs() < 1e-4 * largest, "{found} {wanted}");
                }
            }
        }
    }
}
