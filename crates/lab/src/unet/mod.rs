//! The paper's attention U-Net (Oktay et al. 2018, "Attention U-Net: Learning Where to Look for the Pancreas") in burn: five scales, blocks of
//! two 3×3 convolutions with batch norm and ReLU, additive attention gates on the four skips.
//!
//! The network is written four times, and each proves something:
//!
//! | where | what for |
//! |---|---|
//! | here, in burn | the definition: it names the tensors of weights files, trains from random weights, and runs as `--backend flex` or `ndarray` |
//! | `darn_net::engine` | the product: hand-written kernels; tests hold its predictions and gradients against burn and against f64 |
//! | `darn_net::reference`, f64 | precise enough for finite differences, so it proves gradients, which two f32 programs cannot do for each other |
//! | `scripts/gpu/network.py`, PyTorch | trained the weights that ship; `scripts/gpu/check.py` holds it against this program |

use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::{relu, sigmoid};
use burn::tensor::backend::Backend;
use burn::tensor::module::{interpolate, max_pool2d};
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};
use darn_net::config::{DOWN, INPUT_SCALE, OUTPUT_SCALE};
use darn_net::{InputKind, UnetConfig};

mod anchor;
mod convolve;
mod fill;
mod norm;
mod runtime;
mod tensors;

#[cfg(test)]
mod anchor_tests;
#[cfg(test)]
mod tests;

use convolve::ConvLayer;
use norm::BatchNorm;

pub use convolve::Convolve;
pub use fill::fill_over_base;
pub use runtime::{BackendKind, BackendSettings, load_network};
pub use tensors::{build, export};

/// Standard deviation of the initial weights of the last layer; near zero, so that training starts at the input fill.
const LAST_LAYER: f64 = 1e-3;

impl<B: Convolve> Unet<B> {
    /// A network with random weights and a last layer near zero.
    pub fn init(config: &UnetConfig, device: &B::Device) -> Unet<B> {
        let channels: Vec<usize> = (0..=DOWN).map(|level| config.width << level).collect();
        let mut down = vec![ConvBlock::new(config.frame.channels(), channels[0], device)];
        down.extend(
            channels
                .windows(2)
                .map(|c| ConvBlock::new(c[0], c[1], device)),
        );
        let up = channels
            .windows(2)
            .map(|c| UpStep::new(c[1], c[0], device))
            .collect();
        Unet {
            down,
            up,
            last: ConvLayer::output(config.width, 3, LAST_LAYER, device),
        }
    }
}

/// The network's input for some grids.
#[derive(Debug, Clone)]
pub struct InputTensors<B: Backend> {
    /// `[batch, 3, 64, 64]`; those of unknown cells are ignored.
    pub positions: Tensor<B, 4>,
    /// `[batch, 1, 64, 64]` in 0..=1.
    pub known: Tensor<B, 4>,
    /// The fill of [`InputKind::Plate`], `[batch, 3, 64, 64]`; zero where there is none.
    pub base: Option<Tensor<B, 4>>,
    /// The up direction, `[batch, 3]`, only for [`FrameKind::Hanging`](darn_net::FrameKind::Hanging).
    pub up: Option<Tensor<B, 2>>,
}

/// The network: `[batch, 4, 64, 64] -> [batch, 3, 64, 64]`; seven channels instead of four when it is given the up direction.
#[derive(Module, Debug)]
pub struct Unet<B: Backend> {
    down: Vec<ConvBlock<B>>,
    up: Vec<UpStep<B>>,
    last: ConvLayer<B>,
}

/// Two 3×3 convolutions, each followed by batch norm and ReLU.
#[derive(Module, Debug)]
struct ConvBlock<B: Backend> {
    conv0: ConvLayer<B>,
    norm0: BatchNorm<B>,
    conv1: ConvLayer<B>,
    norm1: BatchNorm<B>,
}

/// One step up: upsample, 3×3 convolution, attention on the skip, block over both.
#[derive(Module, Debug)]
struct UpStep<B: Backend> {
    conv: ConvLayer<B>,
    norm: BatchNorm<B>,
    gate: AttentionGate<B>,
    block: ConvBlock<B>,
}

/// Additive attention: the share of each skip cell that passes, computed from the skip and the coarser signal.
#[derive(Module, Debug)]
struct AttentionGate<B: Backend> {
    skip: ConvLayer<B>,
    skip_norm: BatchNorm<B>,
    signal: ConvLayer<B>,
    signal_norm: BatchNorm<B>,
    score: ConvLayer<B>,
}

impl<B: Convolve> Unet<B> {
    /// Predicts all cells, known ones too, from the known ones, in the network's units: `[batch, 3, 64, 64]`. Differentiable in all inputs.
    pub fn predict(&self, kind: InputKind, input: InputTensors<B>) -> Tensor<B, 4> {
        let InputTensors {
            positions,
            known,
            base,
            up,
        } = input;
        match kind {
            InputKind::Zeros => self.residual(positions * known.clone(), known, up),
            InputKind::Membrane | InputKind::Plate => {
                let filled = fill::fill_over_base(base, positions, known.clone());
                self.residual(filled.clone(), known, up) + filled
            }
        }
    }

    /// What the network adds to a filled grid: `[batch, 3, 64, 64]`, `[batch, 1, 64, 64]`, the up direction as in [`InputTensors`] `-> [batch, 3, 64, 64]`.
    pub fn residual(
        &self,
        filled: Tensor<B, 4>,
        known: Tensor<B, 4>,
        up: Option<Tensor<B, 2>>,
    ) -> Tensor<B, 4> {
        let [batch, _, height, width] = filled.dims();
        let mut channels = vec![filled * INPUT_SCALE, known];
        channels.extend(up.map(|up| {
            let up = up.reshape([batch, 3, 1, 1]);
            up.repeat_dim(2, height).repeat_dim(3, width)
        }));
        self.forward(Tensor::cat(channels, 1)) * OUTPUT_SCALE
    }

    /// The layers alone: `[batch, 4 or 7, 64, 64] -> [batch, 3, 64, 64]`, both of order 1.
    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let mut skips = Vec::with_capacity(self.down.len());
        let mut x = x;
        for (level, block) in self.down.iter().enumerate() {
            if level > 0 {
                x = max_pool2d(x, [2, 2], [2, 2], [0, 0], [1, 1], false);
            }
            x = block.forward(x);
            skips.push(x.clone());
        }
        skips.pop();
        for (up, skip) in self.up.iter().zip(skips).rev() {
            x = up.forward(x, skip);
        }
        self.last.forward(x)
    }
}

impl<B: Convolve> ConvBlock<B> {
    fn new(from: usize, to: usize, device: &B::Device) -> Self {
        ConvBlock {
            conv0: ConvLayer::three(from, to, device),
            norm0: BatchNorm::new(to, device),
            conv1: ConvLayer::three(to, to, device),
            norm1: BatchNorm::new(to, device),
        }
    }

    /// `[batch, from, h, w] -> [batch, to, h, w]`.
    fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let x = relu(self.norm0.forward(self.conv0.forward(x)));
        relu(self.norm1.forward(self.conv1.forward(x)))
    }
}

impl<B: Convolve> UpStep<B> {
    fn new(from: usize, to: usize, device: &B::Device) -> Self {
        UpStep {
            conv: ConvLayer::three(from, to, device),
            norm: BatchNorm::new(to, device),
            gate: AttentionGate::new(to, device),
            block: ConvBlock::new(2 * to, to, device),
        }
    }

    /// `[batch, from, h, w]`, skip `[batch, to, 2h, 2w] -> [batch, to, 2h, 2w]`.
    fn forward(&self, x: Tensor<B, 4>, skip: Tensor<B, 4>) -> Tensor<B, 4> {
        let [_, _, height, width] = skip.dims();
        let x = interpolate(
            x,
            [height, width],
            InterpolateOptions::new(InterpolateMode::Nearest),
        );
        let x = relu(self.norm.forward(self.conv.forward(x)));
        let skip = self.gate.forward(skip, x.clone());
        self.block.forward(Tensor::cat(vec![skip, x], 1))
    }
}

impl<B: Convolve> AttentionGate<B> {
    fn new(channels: usize, device: &B::Device) -> Self {
        let inner = (channels / 2).max(1);
        AttentionGate {
            skip: ConvLayer::one(channels, inner, device),
            skip_norm: BatchNorm::new(inner, device),
            signal: ConvLayer::one(channels, inner, device),
            signal_norm: BatchNorm::new(inner, device),
            score: ConvLayer::output(inner, 1, (1.0 / inner as f64).sqrt(), device),
        }
    }

    /// `[batch, channels, h, w]` twice `-> [batch, channels, h, w]`: the skip, weighted cell by cell.
    fn forward(&self, skip: Tensor<B, 4>, signal: Tensor<B, 4>) -> Tensor<B, 4> {
        let joint = self.skip_norm.forward(self.skip.forward(skip.clone()))
            + self.signal_norm.forward(self.signal.forward(signal));
        // Repeated and not broadcast: the backends are fast with equal shapes.
        let [_, channels, ..] = skip.dims();
        skip * sigmoid(self.score.forward(relu(joint))).repeat_dim(1, channels)
    }
}
