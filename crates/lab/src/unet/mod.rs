//! The paper's attention U-Net (Oktay et al. 2018, "Attention U-Net: Learning Where to Look for the Pancreas"), in burn.
//! Five scales, blocks of two 3×3 convolutions with batch norm and ReLU, additive attention gates on the four skips.

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

use convolve::Conv;
use norm::Norm;

pub use convolve::Convolve;
pub use fill::over;
pub use runtime::{BackendKind, Settings, load_network};
pub use tensors::{build, export, import, load};

/// Standard deviation of the last layer's initial weights; near zero, so that training starts at the input fill.
const LAST_LAYER: f64 = 1e-3;
impl<B: Convolve> Unet<B> {
    /// A network with random weights and a last layer near zero.
    pub fn init(config: &UnetConfig, device: &B::Device) -> Unet<B> {
        let channels: Vec<usize> = (0..=DOWN).map(|level| config.width << level).collect();
        let mut down = vec![Block::new([config.frame.channels(), channels[0]], device)];
        down.extend(
            channels
                .windows(2)
                .map(|c| Block::new([c[0], c[1]], device)),
        );
        let up = channels
            .windows(2)
            .map(|c| Up::new([c[1], c[0]], device))
            .collect();
        Unet {
            down,
            up,
            last: Conv::output([config.width, 3], LAST_LAYER, device),
        }
    }
}

/// What some grids show the network.
#[derive(Debug, Clone)]
pub struct Sight<B: Backend> {
    /// `[batch, 3, 64, 64]`; those of unknown cells are not looked at.
    pub positions: Tensor<B, 4>,
    /// `[batch, 1, 64, 64]` in 0..=1.
    pub known: Tensor<B, 4>,
    /// The fill of [`InputKind::Plate`], `[batch, 3, 64, 64]`; zero where there is none.
    pub base: Option<Tensor<B, 4>>,
    /// Where up is, `[batch, 3]`, for [`FrameKind::Hanging`] and for no other.
    pub up: Option<Tensor<B, 2>>,
}

/// The network: `[batch, 4, 64, 64] -> [batch, 3, 64, 64]`; seven channels instead of four where it is told where up is.
#[derive(Module, Debug)]
pub struct Unet<B: Backend> {
    down: Vec<Block<B>>,
    up: Vec<Up<B>>,
    last: Conv<B>,
}

/// Two 3×3 convolutions, each followed by batch norm and ReLU.
#[derive(Module, Debug)]
struct Block<B: Backend> {
    conv0: Conv<B>,
    norm0: Norm<B>,
    conv1: Conv<B>,
    norm1: Norm<B>,
}

/// One step up: upsample, 3×3 convolution, attention on the skip, block over both.
#[derive(Module, Debug)]
struct Up<B: Backend> {
    conv: Conv<B>,
    norm: Norm<B>,
    gate: Gate<B>,
    block: Block<B>,
}

/// Additive attention: how much of each skip cell passes, judged with the coarser signal.
#[derive(Module, Debug)]
struct Gate<B: Backend> {
    skip: Conv<B>,
    skip_norm: Norm<B>,
    signal: Conv<B>,
    signal_norm: Norm<B>,
    score: Conv<B>,
}

impl<B: Convolve> Unet<B> {
    /// Predicts all cells from the known ones, in the network's units: `[batch, 3, 64, 64]`.
    ///
    /// Differentiable in all that is seen. The prediction is the network's own for every cell, known ones too.
    pub fn predict(&self, input: InputKind, sight: Sight<B>) -> Tensor<B, 4> {
        let Sight {
            positions,
            known,
            base,
            up,
        } = sight;
        match input {
            InputKind::Zeros => self.residual(positions * known.clone(), known, up),
            InputKind::Membrane | InputKind::Plate => {
                let filled = fill::over(base, positions, known.clone());
                self.residual(filled.clone(), known, up) + filled
            }
        }
    }

    /// What the network adds to a filled grid: `[batch, 3, 64, 64]`, `[batch, 1, 64, 64]`, up as [`Sight`]'s `-> [batch, 3, 64, 64]`.
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

    /// The bare network: `[batch, 4 or 7, 64, 64] -> [batch, 3, 64, 64]`, both O(1).
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

impl<B: Convolve> Block<B> {
    fn new([from, to]: [usize; 2], device: &B::Device) -> Self {
        Block {
            conv0: Conv::three([from, to], device),
            norm0: Norm::new(to, device),
            conv1: Conv::three([to, to], device),
            norm1: Norm::new(to, device),
        }
    }

    /// `[batch, from, h, w] -> [batch, to, h, w]`.
    fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let x = relu(self.norm0.forward(self.conv0.forward(x)));
        relu(self.norm1.forward(self.conv1.forward(x)))
    }
}

impl<B: Convolve> Up<B> {
    fn new([from, to]: [usize; 2], device: &B::Device) -> Self {
        Up {
            conv: Conv::three([from, to], device),
            norm: Norm::new(to, device),
            gate: Gate::new(to, device),
            block: Block::new([2 * to, to], device),
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

impl<B: Convolve> Gate<B> {
    fn new(channels: usize, device: &B::Device) -> Self {
        let inner = (channels / 2).max(1);
        Gate {
            skip: Conv::one([channels, inner], device),
            skip_norm: Norm::new(inner, device),
            signal: Conv::one([channels, inner], device),
            signal_norm: Norm::new(inner, device),
            score: Conv::output([inner, 1], (1.0 / inner as f64).sqrt(), device),
        }
    }

    /// `[batch, channels, h, w]` twice `-> [batch, channels, h, w]`: the skip, weighted cell by cell.
    fn forward(&self, skip: Tensor<B, 4>, signal: Tensor<B, 4>) -> Tensor<B, 4> {
        let joint = self.skip_norm.forward(self.skip.forward(skip.clone()))
            + self.signal_norm.forward(self.signal.forward(signal));
        // Repeated rather than broadcast: the backends multiply equal shapes fast.
        let [_, channels, ..] = skip.dims();
        skip * sigmoid(self.score.forward(relu(joint))).repeat_dim(1, channels)
    }
}
