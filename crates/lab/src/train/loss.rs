//! The loss in burn, which is its definition: positions, differences of neighbours, lengths between neighbours, and repulsion of cloth that
//! comes too close. All lengths are in cells.
//!
//! L = L_data + α L_grad + γ L_stretch + β L_selfpen. The paper (§3.4) has the first, second and last of them, with squared errors:
//! that is [`LossWeights::paper`]. By default distances are quadratic near zero only (√(r² + δ²) − δ), so that one crumpled sample does not
//! dominate a batch, and lengths between neighbours count as well.

use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor, TensorData};
use serde::{Deserialize, Serialize};

use super::batch::TrainingBatch;
use super::near_pairs::{REACH, near_pairs};
use darn_geometry::grid::{CELLS, SIDE};

/// Where the data term turns from quadratic to linear, in cells.
pub(super) const DATA_BEND: f32 = 1.0;
/// The same for differences of neighbours.
pub(super) const GRADIENT_BEND: f32 = 0.25;
/// Added under the root of a length, in cells squared: keeps its derivative finite.
pub(super) const LENGTH_GUARD: f32 = 1e-4;

/// The penalty of an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LossKind {
    /// Quadratic near zero, linear beyond.
    #[default]
    Softened,
    /// Squared (the paper).
    Squared,
}

/// Weights of the loss's terms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LossWeights {
    /// Penalty of the errors of positions and of differences.
    pub kind: LossKind,
    /// α: differences of neighbours, which keep folds sharp.
    pub gradient: f64,
    /// γ: lengths between neighbours, which keep the area of the cloth.
    pub stretch: f64,
    /// β: repulsion of cloth from cloth.
    pub self_penetration: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        LossWeights {
            kind: LossKind::Softened,
            gradient: 2.0,
            stretch: 5.0,
            self_penetration: 0.0,
        }
    }
}

impl LossWeights {
    /// The default with a strong repulsion: a hole cell half the reach away from another layer costs as much as a cell with an error of 8
    /// cells. With a weight of 1 the cloth intersects itself as often as without.
    pub fn interpen() -> Self {
        LossWeights {
            self_penetration: 30.0,
            ..LossWeights::default()
        }
    }

    /// The paper's form: squared errors, no lengths, a small repulsion.
    pub fn paper() -> Self {
        LossWeights {
            kind: LossKind::Squared,
            gradient: 1.0,
            stretch: 0.0,
            self_penetration: 0.1,
        }
    }
}

/// The numbers of a loss.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LossTerms {
    /// Weighted sum of the terms.
    pub total: f32,
    /// Mean softened or squared distance to the truth.
    pub data: f32,
    /// Mean softened or squared error of differences along u and v.
    pub gradient: f32,
    /// Mean squared error of lengths between neighbours.
    pub stretch: f32,
    /// Repulsion of near cells, for each hole cell.
    pub self_penetration: f32,
}

impl LossTerms {
    /// All terms times a factor.
    pub(super) fn scaled(self, factor: f32) -> Self {
        LossTerms {
            total: self.total * factor,
            data: self.data * factor,
            gradient: self.gradient * factor,
            stretch: self.stretch * factor,
            self_penetration: self.self_penetration * factor,
        }
    }
}

impl std::iter::Sum for LossTerms {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(LossTerms::default(), |sum, terms| LossTerms {
            total: sum.total + terms.total,
            data: sum.data + terms.data,
            gradient: sum.gradient + terms.gradient,
            stretch: sum.stretch + terms.stretch,
            self_penetration: sum.self_penetration + terms.self_penetration,
        })
    }
}

/// A loss as tensors, each term a mean.
#[derive(Debug, Clone)]
pub(super) struct LossTensors<B: Backend> {
    /// Weighted sum, `[1]`.
    pub total: Tensor<B, 1>,
    /// Mean softened or squared distance to the truth.
    pub data: Tensor<B, 1>,
    /// Mean softened or squared error of differences along u and v, over pairs that touch the hole.
    pub gradient: Tensor<B, 1>,
    /// Mean squared error of lengths between neighbours, over the same pairs.
    pub stretch: Tensor<B, 1>,
    /// Sum of (1 − d)² over pairs of cells that are d < 1 cell apart in space but not neighbours on the sheet, at least one of them a hole
    /// cell, ÷ number of hole cells. Zero, and not computed, when its weight is zero.
    pub self_penetration: Tensor<B, 1>,
}

impl<B: Backend> LossTensors<B> {
    /// Total, data, gradient, stretch, self-penetration: `[5]`.
    pub(super) fn stacked(&self) -> Tensor<B, 1> {
        let terms = [
            &self.total,
            &self.data,
            &self.gradient,
            &self.stretch,
            &self.self_penetration,
        ];
        Tensor::cat(terms.map(Tensor::clone).to_vec(), 0)
    }
}

/// The truth that a prediction is compared with.
#[derive(Debug, Clone)]
pub(super) struct LossTarget<B: Backend> {
    truth: Tensor<B, 4>,
    weight: Tensor<B, 4>,
    hole: Tensor<B, 4>,
    pairs_u: Tensor<B, 4>,
    pairs_v: Tensor<B, 4>,
    /// Cells of the composed grid, sample after sample.
    present: Vec<bool>,
    /// Hole cells among them.
    open: Vec<bool>,
}

impl<B: Backend> LossTarget<B> {
    /// The truth of a batch as tensors.
    pub fn of(batch: TrainingBatch, device: &B::Device) -> Self {
        let tensor = |values: Vec<f32>, shape: [usize; 4]| {
            Tensor::from_data(TensorData::new(values, shape), device)
        };
        let flags = |values: &[f32]| values.iter().map(|x| *x > 0.0).collect();
        let n = batch.count;
        LossTarget {
            present: flags(&batch.weight),
            open: flags(&batch.hole),
            truth: tensor(batch.truth, [n, 3, SIDE, SIDE]),
            weight: tensor(batch.weight, [n, 1, SIDE, SIDE]),
            hole: tensor(batch.hole, [n, 1, SIDE, SIDE]),
            pairs_u: tensor(batch.pairs_u, [n, 1, SIDE, SIDE - 1]),
            pairs_v: tensor(batch.pairs_v, [n, 1, SIDE - 1, SIDE]),
        }
    }
}

/// The loss of `predicted [batch, 3, 64, 64]`, in the network's units.
pub fn loss<B: Backend>(
    predicted: Tensor<B, 4>,
    target: &LossTarget<B>,
    weights: &LossWeights,
) -> LossTensors<B> {
    let cells = SIDE as f32;
    let truth = target.truth.clone() * cells;
    let error = predicted * cells - truth.clone();
    let data = mean(
        counted(error.clone(), weights.kind, DATA_BEND),
        target.weight.clone(),
    );
    // Known cells keep the scan's positions, so only hole cells carry an error into the pairs.
    let error = error * target.hole.clone();
    let composed = truth.clone() + error.clone();
    let gradient_u = gradient_term(3, &error, &target.pairs_u, weights.kind);
    let gradient_v = gradient_term(2, &error, &target.pairs_v, weights.kind);
    let gradient = (gradient_u + gradient_v) * 0.5;
    let stretch_u = stretch_term(3, &composed, &truth, &target.pairs_u);
    let stretch_v = stretch_term(2, &composed, &truth, &target.pairs_v);
    let stretch = (stretch_u + stretch_v) * 0.5;
    let self_penetration = if weights.self_penetration > 0.0 {
        repulsion(composed, target)
    } else {
        Tensor::zeros([1], &data.device())
    };
    let total = data.clone()
        + gradient.clone() * weights.gradient
        + stretch.clone() * weights.stretch
        + self_penetration.clone() * weights.self_penetration;
    LossTensors {
        total,
        data,
        gradient,
        stretch,
        self_penetration,
    }
}

/// Mean error of the differences along dimension `dim`.
fn gradient_term<B: Backend>(
    dim: usize,
    error: &Tensor<B, 4>,
    pairs: &Tensor<B, 4>,
    kind: LossKind,
) -> Tensor<B, 1> {
    mean(
        counted(difference(error, dim), kind, GRADIENT_BEND),
        pairs.clone(),
    )
}

/// Mean squared error of the lengths along dimension `dim`.
fn stretch_term<B: Backend>(
    dim: usize,
    composed: &Tensor<B, 4>,
    truth: &Tensor<B, 4>,
    pairs: &Tensor<B, 4>,
) -> Tensor<B, 1> {
    let length = |x: &Tensor<B, 4>| (squared(difference(x, dim)) + LENGTH_GUARD).sqrt();
    mean(
        (length(composed) - length(truth)).powi_scalar(2),
        pairs.clone(),
    )
}

/// Repulsion of near pairs, the self-penetration term; `composed [batch, 3, 64, 64]` in cells. The search for pairs has no gradient; the
/// distances are gathered from the tensor, so the term is differentiable.
fn repulsion<B: Backend>(composed: Tensor<B, 4>, target: &LossTarget<B>) -> Tensor<B, 1> {
    let device = composed.device();
    let [batch, ..] = composed.dims();
    let cells = composed
        .swap_dims(1, 2)
        .swap_dims(2, 3)
        .reshape([batch * CELLS, 3]);
    let places: Vec<f32> = cells
        .clone()
        .detach()
        .into_data()
        .convert::<f32>()
        .into_vec()
        .unwrap_or_default();
    let places: Vec<[f32; 3]> = places.as_chunks::<3>().0.to_vec();
    let (mut first, mut second, mut each) = (Vec::new(), Vec::new(), Vec::new());
    for (start, grid) in (0..).step_by(CELLS).zip(places.chunks_exact(CELLS)) {
        let own = start..start + CELLS;
        let near = near_pairs(grid, &target.present[own.clone()], &target.open[own]);
        each.extend(std::iter::repeat_n(near.each, near.pairs.len()));
        for (a, b) in near.pairs {
            first.push((start + a) as i32);
            second.push((start + b) as i32);
        }
    }
    let pairs = each.len();
    if pairs == 0 {
        return Tensor::zeros([1], &device);
    }
    let holes = target.open.iter().filter(|open| **open).count().max(1) as f32;
    let gather = |indices: Vec<i32>| {
        let indices = Tensor::<B, 1, Int>::from_data(TensorData::new(indices, [pairs]), &device);
        cells.clone().select(0, indices)
    };
    let apart = gather(first) - gather(second);
    let distance = (apart.clone().mul(apart).sum_dim(1) + LENGTH_GUARD).sqrt();
    let depth = (distance.neg() + REACH).clamp_min(0.0);
    let each = Tensor::<B, 2>::from_data(TensorData::new(each, [pairs, 1]), &device);
    (depth.powi_scalar(2) * each).sum() / holes
}

/// Next minus this along a dimension.
fn difference<B: Backend>(x: &Tensor<B, 4>, dim: usize) -> Tensor<B, 4> {
    let n = x.dims()[dim];
    x.clone().narrow(dim, 1, n - 1) - x.clone().narrow(dim, 0, n - 1)
}

/// Squared length over the channels: `[b, c, h, w] -> [b, 1, h, w]`.
fn squared<B: Backend>(x: Tensor<B, 4>) -> Tensor<B, 4> {
    x.clone().mul(x).sum_dim(1)
}

/// ‖x‖², or √(‖x‖² + δ²) − δ: `[b, c, h, w] -> [b, 1, h, w]`.
fn counted<B: Backend>(x: Tensor<B, 4>, kind: LossKind, bend: f32) -> Tensor<B, 4> {
    match kind {
        LossKind::Squared => squared(x),
        LossKind::Softened => (squared(x) + bend * bend).sqrt() - bend,
    }
}

/// Mean of `x` under non-negative weights; zero when all weights are.
fn mean<B: Backend>(x: Tensor<B, 4>, weight: Tensor<B, 4>) -> Tensor<B, 1> {
    (x * weight.clone()).sum() / weight.sum().clamp_min(1e-6)
}

#[cfg(test)]
#[path = "loss_tests.rs"]
mod tests;
