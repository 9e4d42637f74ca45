//! darn's own engine: the attention U-Net of the weights files on the CPU, its forward pass and its gradients.
//!
//! Weights come as named tensors, grids as planes; it knows neither files nor losses. The files, from the lowest up: `simd`, `winograd`,
//! `feature_map`; `fuse` and `pack` prepare weights, `layers` and `model` hold them; `convolve`, `split`, `gate`, `membrane`, `input_fill`
//! and `last_layer` compute; `forward`, `backward` and `weight_gradients` put them together; `scratch` and `weight_pass` share a call's
//! grids among threads.

mod backward;
mod convolve;
mod epilogue;
mod error;
mod feature_map;
mod forward;
mod fuse;
mod gate;
mod gate_adjoint;
mod input_fill;
mod io;
mod last_layer;
mod layers;
mod membrane;
mod model;
mod pack;
mod scratch;
mod simd;
mod split;
mod tiles;
mod unfuse;
mod weight_gradients;
mod weight_pass;
mod winograd;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod weight_pass_tests;

use crate::config::UnetConfig;
use crate::tensors::NamedTensors;

use fuse::FusedWeights;
use model::EngineModel;
use scratch::GradientCall;
use simd::TargetIsa;

pub use error::EngineError;
pub use input_fill::input_positions;
pub use io::{Cotangent, EngineInput, InputGradient};
pub use scratch::Scratch;
pub use simd::{Isa, UnknownIsa};
pub use weight_pass::{TrainingLoss, WeightGradientBuffers};

/// Supported widths.
const WIDTHS: std::ops::RangeInclusive<usize> = 1..=256;

/// How an engine computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EngineOptions {
    /// The instruction set; `None` for the fastest of this CPU.
    pub isa: Option<Isa>,
    /// Threads that share the grids of a call, and split the layers of each if there are fewer grids than threads.
    pub threads: usize,
}

impl Default for EngineOptions {
    fn default() -> Self {
        EngineOptions {
            isa: None,
            threads: 1,
        }
    }
}

/// A network. Threads share it; each call needs a [`Scratch`] of its own.
#[derive(Debug)]
pub struct Engine {
    model: EngineModel,
    threads: usize,
}

impl Engine {
    /// Fuses batch norm into the weights. They are laid out for the kernels at the first prediction, or by [`Engine::prepare`].
    ///
    /// # Errors
    /// A tensor that is missing or has another shape, a width outside 1..=256, an instruction set that this CPU lacks.
    pub fn new(
        tensors: &NamedTensors,
        config: &UnetConfig,
        options: EngineOptions,
    ) -> Result<Engine, EngineError> {
        let width = config.width;
        if !WIDTHS.contains(&width) {
            return Err(EngineError::Width { width });
        }
        let target = match options.isa {
            Some(isa) => TargetIsa::new(isa).ok_or(EngineError::Isa { isa })?,
            None => TargetIsa::best(),
        };
        let weights = FusedWeights::read(tensors, width, config.frame.channels())?;
        Ok(Engine {
            model: EngineModel::new(config.input, target, weights),
            threads: options.threads.max(1),
        })
    }

    /// The instruction set in use.
    pub fn isa(&self) -> Isa {
        self.model.target.isa()
    }

    /// Predicts all cells of some grids, `out: [n, 3, 64, 64]`, in the network's units and frame.
    ///
    /// A grid's prediction is the same to the bit, whatever the other grids and the number of threads. Allocates only if the scratch has
    /// not seen as many grids before.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids.
    pub fn predict(
        &self,
        scratch: &mut Scratch,
        input: EngineInput,
        out: &mut [f32],
    ) -> Result<(), EngineError> {
        input.check()?;
        io::check_planes("out", out, 3, input.images())?;
        scratch.predict(&self.model, self.threads, input, out);
        Ok(())
    }

    /// As [`Engine::predict`], and differentiates Σ cotangent · prediction with respect to positions and mask; see [`Cotangent`].
    ///
    /// The first call also lays out the adjoint weights.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids.
    pub fn gradient(
        &self,
        scratch: &mut Scratch,
        input: EngineInput,
        cotangent: &Cotangent,
        out: InputGradient,
    ) -> Result<(), EngineError> {
        input.check()?;
        out.check(input.images())?;
        let call = GradientCall {
            input,
            cotangent,
            first: 0,
        };
        scratch.gradient(&self.model, self.threads, call, out);
        Ok(())
    }

    /// The gradient of a loss with respect to the weights, by name, and what the loss returned, in the order of its grids.
    ///
    /// `tensors` are those that the engine was made from. The statistics of batch norm (`mean`, `variance`) are constants and have no
    /// gradient. The result is the same on any number of threads.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids; tensors of another network.
    pub fn weight_gradients<T: Send>(
        &self,
        buffers: &mut WeightGradientBuffers,
        tensors: &NamedTensors,
        input: EngineInput,
        loss: &TrainingLoss<T>,
    ) -> Result<(NamedTensors, Vec<T>), EngineError> {
        input.check()?;
        weight_pass::weight_gradients(&self.model, buffers, tensors, input, loss)
    }

    /// Lays out the weights for the forward pass now instead of at the first prediction.
    pub fn prepare(&self) {
        self.model.forward();
    }
}
