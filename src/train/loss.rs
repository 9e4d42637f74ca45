//! The loss: where cells are, how they differ from their neighbours, how far they are from them. All in cells.
//! Distances are softened near zero only (√(r² + δ²) − δ), so that one crumpled sample does not drown a batch.

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

use super::batch::Batch;
use crate::grid::SIDE;

/// Where the data term turns from quadratic to linear, in cells.
const DATA_BEND: f32 = 1.0;
/// The same for differences of neighbours.
const GRADIENT_BEND: f32 = 0.25;
/// Guards the root of a length, in cells squared.
const LENGTH_GUARD: f32 = 1e-4;

/// Weights of the loss's terms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossWeights {
    /// α: differences of neighbours, which give folds their crispness.
    pub gradient: f64,
    /// Lengths between neighbours, which give the cloth its amount.
    pub stretch: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        LossWeights {
            gradient: 2.0,
            stretch: 5.0,
        }
    }
}

/// The terms of a loss, each a mean over what it looks at.
#[derive(Debug, Clone)]
pub struct Loss<B: Backend> {
    /// Weighted sum, `[1]`.
    pub total: Tensor<B, 1>,
    /// Mean softened distance to the truth.
    pub data: Tensor<B, 1>,
    /// Mean softened error of differences along u and v, over pairs that touch the hole.
    pub gradient: Tensor<B, 1>,
    /// Mean squared error of lengths between neighbours, over the same pairs.
    pub stretch: Tensor<B, 1>,
}

/// What a prediction is compared with.
#[derive(Debug, Clone)]
pub struct Target<B: Backend> {
    truth: Tensor<B, 4>,
    weight: Tensor<B, 4>,
    hole: Tensor<B, 4>,
    pairs_u: Tensor<B, 4>,
    pairs_v: Tensor<B, 4>,
}

impl<B: Backend> Target<B> {
    /// The truth of a batch as tensors.
    pub fn of(batch: Batch, device: &B::Device) -> Self {
        let tensor = |values: Vec<f32>, shape: [usize; 4]| {
            Tensor::from_data(TensorData::new(values, shape), device)
        };
        let n = batch.count;
        Target {
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
    target: &Target<B>,
    weights: &LossWeights,
) -> Loss<B> {
    let cells = SIDE as f32;
    let truth = target.truth.clone() * cells;
    let error = predicted * cells - truth.clone();
    let data = mean(softened(error.clone(), DATA_BEND), target.weight.clone());
    // Known cells keep the scan's positions, so only hole cells carry an error into the pairs.
    let error = error * target.hole.clone();
    let composed = truth.clone() + error.clone();
    let (gradient_u, stretch_u) = pair_terms(3, &error, &composed, &truth, &target.pairs_u);
    let (gradient_v, stretch_v) = pair_terms(2, &error, &composed, &truth, &target.pairs_v);
    let gradient = (gradient_u + gradient_v) * 0.5;
    let stretch = (stretch_u + stretch_v) * 0.5;
    let total =
        data.clone() + gradient.clone() * weights.gradient + stretch.clone() * weights.stretch;
    Loss {
        total,
        data,
        gradient,
        stretch,
    }
}

/// Gradient and stretch terms along dimension `dim`.
fn pair_terms<B: Backend>(
    dim: usize,
    error: &Tensor<B, 4>,
    composed: &Tensor<B, 4>,
    truth: &Tensor<B, 4>,
    pairs: &Tensor<B, 4>,
) -> (Tensor<B, 1>, Tensor<B, 1>) {
    let gradient = mean(
        softened(difference(error, dim), GRADIENT_BEND),
        pairs.clone(),
    );
    let length = |x: &Tensor<B, 4>| (squared(difference(x, dim)) + LENGTH_GUARD).sqrt();
    let stretch = mean(
        (length(composed) - length(truth)).powi_scalar(2),
        pairs.clone(),
    );
    (gradient, stretch)
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

/// √(‖x‖² + δ²) − δ: `[b, c, h, w] -> [b, 1, h, w]`.
fn softened<B: Backend>(x: Tensor<B, 4>, bend: f32) -> Tensor<B, 4> {
    (squared(x) + bend * bend).sqrt() - bend
}

/// Mean of `x` under non-negative weights; zero when all weights are.
fn mean<B: Backend>(x: Tensor<B, 4>, weight: Tensor<B, 4>) -> Tensor<B, 1> {
    (x * weight.clone()).sum() / weight.sum().clamp_min(1e-6)
}
