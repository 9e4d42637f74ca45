//! Batch normalisation (Ioffe & Szegedy 2015) as one affine map with a factor and an offset for each channel. burn's layer makes about twice
//! as many passes over memory, which at 64×64 cells cost more than the convolutions.

use burn::module::{Module, Param, RunningState};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

/// Keeps the division finite for a channel that is constant over the batch.
const EPSILON: f64 = 1e-5;
/// Share of a batch's statistics in the running ones.
const MOMENTUM: f64 = 0.05;

/// Batch normalisation over the channels of `[batch, channels, height, width]`.
#[derive(Module, Debug)]
pub struct BatchNorm<B: Backend> {
    scale: Param<Tensor<B, 1>>,
    shift: Param<Tensor<B, 1>>,
    mean: RunningState<Tensor<B, 1>>,
    variance: RunningState<Tensor<B, 1>>,
}

impl<B: Backend> BatchNorm<B> {
    /// A layer for `channels` channels that starts as the identity.
    pub fn new(channels: usize, device: &B::Device) -> Self {
        BatchNorm {
            scale: Param::from_tensor(Tensor::ones([channels], device)),
            shift: Param::from_tensor(Tensor::zeros([channels], device)),
            mean: RunningState::new(Tensor::zeros([channels], device)),
            variance: RunningState::new(Tensor::ones([channels], device)),
        }
    }

    /// `[batch, channels, height, width] -> [batch, channels, height, width]`.
    ///
    /// While its parameters are trained, it uses the statistics of the batch and updates the running ones; otherwise it uses the running ones.
    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let [batch, channels, height, width] = x.dims();
        // One row for each channel of an image: the backends are fast with a factor for each row, not with one for each channel.
        let rows = x.reshape([batch * channels, height * width]);
        let scale = self.scale.val();
        let (mean, variance) = if B::ad_enabled(&rows.device()) && scale.is_require_grad() {
            let over_batch = |rows: Tensor<B, 2>| {
                rows.mean_dim(1)
                    .reshape([batch, channels])
                    .mean_dim(0)
                    .reshape([channels])
            };
            let mean = over_batch(rows.clone());
            let variance = over_batch(rows.clone().mul(rows.clone()))
                .sub(mean.clone().mul(mean.clone()))
                .clamp_min(0.0);
            remember(&self.mean, mean.clone().detach());
            remember(&self.variance, variance.clone().detach());
            (mean, variance)
        } else {
            (self.mean.value(), self.variance.value())
        };
        let factor = scale.div(variance.add_scalar(EPSILON).sqrt());
        let offset = self.shift.val().sub(mean.mul(factor.clone()));
        let by_row = |x: Tensor<B, 1>| {
            x.reshape([1, channels])
                .repeat_dim(0, batch)
                .reshape([batch * channels, 1])
        };
        rows.mul(by_row(factor))
            .add(by_row(offset))
            .reshape([batch, channels, height, width])
    }
}

/// Moves a running statistic towards a batch's.
fn remember<B: Backend>(state: &RunningState<Tensor<B, 1>>, batch: Tensor<B, 1>) {
    let old = state.value_sync();
    state.update(
        old.mul_scalar(1.0 - MOMENTUM)
            .add(batch.mul_scalar(MOMENTUM))
            .detach(),
    );
}
