//! The network's own engine: exactly the attention U-Net of [`crate::Unet`], its forward pass and its gradients, on the CPU.
//! Weights come as named tensors, grids as planes; burn is the reference it is tested against.
//! No burn, no files, no losses; and no `unsafe` but in `simd.rs`.

mod backward;
mod convolve;
mod forward;
mod gate;
mod learn;
mod map;
mod membrane;
mod network;
mod pack;
mod scheme;
mod scratch;
mod share;
mod simd;
mod sums;

#[cfg(test)]
mod learn_tests;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::OnceLock;

use crate::weights::NamedTensors;
use crate::{InputKind, UnetConfig};
use darn_geometry::grid::CELLS;

use network::{Folds, Forward, Reverse};
use simd::Target;

pub use learn::{Lesson, Lessons};
pub use scratch::Scratch;
pub use simd::{Isa, UnknownIsa};

/// A tensor as weights files give it.
type Tensor = (Vec<usize>, Vec<f32>);

/// Widths that can be built.
const WIDTHS: std::ops::RangeInclusive<usize> = 1..=256;

/// Why an engine could not be built, or not be asked.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error("tensor `{name}` is missing")]
    MissingTensor { name: String },
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        name: String,
        found: Vec<usize>,
        expected: Vec<usize>,
    },
    #[error("width {width} is outside 1..=256")]
    Width { width: usize },
    #[error("this CPU has no {}", isa.name())]
    Isa { isa: Isa },
    #[error("`{what}` holds {found} values, expected {expected} for {images} grid(s)")]
    Size {
        what: &'static str,
        found: usize,
        expected: usize,
        images: usize,
    },
}

/// How an engine computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EngineOptions {
    /// The instruction set; the CPU's best where there is none.
    pub isa: Option<Isa>,
    /// Threads that share a call's grids, and the layers of each where there are fewer grids than threads.
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

/// One grid as a network of this input sees it: positions, planes `[3, 64, 64]`.
pub fn seen(kind: InputKind, grid: Input) -> Vec<f32> {
    let mut filled = vec![0.0; grid.positions.len()];
    let room = &mut scratch::Room::default();
    scratch::enter((Target::best(), kind), (room, false), grid, &mut filled);
    filled
}

/// A network, ready to be asked; shared between threads, each with a [`Scratch`] of its own.
#[derive(Debug)]
pub struct Engine {
    config: UnetConfig,
    target: Target,
    threads: usize,
    folds: Folds,
    forward: OnceLock<Forward>,
    reverse: OnceLock<Reverse>,
}

/// What a scalar gains by each number of a grid's prediction: given the grid's place in the call and its prediction `[3, 64, 64]`, fills in
/// the derivatives `[3, 64, 64]`. Called once a grid, on any thread.
pub type Cotangent<'a> = dyn Fn(usize, &[f32], &mut [f32]) + Sync + 'a;

/// What some grids show the network.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// `[n, 3, 64, 64]`.
    pub positions: &'a [f32],
    /// `[n, 1, 64, 64]` in 0..=1.
    pub known: &'a [f32],
    /// `[n, 3, 64, 64]`, for [`InputKind::Plate`](crate::InputKind); zero where there is none.
    pub base: Option<&'a [f32]>,
    /// Where up is, `[n, 3]`, for [`FrameKind::Hanging`](crate::FrameKind); zero where there is none.
    pub up: Option<&'a [f32]>,
}

/// Gradients of a prediction's planes times a cotangent, and the prediction.
pub struct Gradient<'a> {
    /// `[n, 3, 64, 64]`.
    pub prediction: &'a mut [f32],
    /// `[n, 3, 64, 64]`.
    pub by_positions: &'a mut [f32],
    /// `[n, 1, 64, 64]`.
    pub by_known: &'a mut [f32],
}

impl Engine {
    /// Folds batch norm into the weights; they are laid out for the kernels when first wanted, or by [`Engine::prepare`].
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
            Some(isa) => Target::new(isa).ok_or(EngineError::Isa { isa })?,
            None => Target::best(),
        };
        let folds = Folds::read(tensors, width, config.frame.channels())?;
        Ok(Engine {
            config: *config,
            target,
            threads: options.threads.max(1),
            folds,
            forward: OnceLock::new(),
            reverse: OnceLock::new(),
        })
    }

    /// The instruction set in use.
    pub fn isa(&self) -> Isa {
        self.target.isa()
    }

    /// Predicts all cells of some grids, in the network's units: what `Unet::predict` does.
    ///
    /// `out [n, 3, 64, 64]`. A grid's answer is the same to the bit in any company and on any number of threads. Allocates only when the
    /// scratch has not seen as many grids before.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids.
    pub fn predict(
        &self,
        scratch: &mut Scratch,
        input: Input,
        out: &mut [f32],
    ) -> Result<(), EngineError> {
        input.check()?;
        check(input.images(), [("out", out.len(), 3)])?;
        scratch.predict(self, input, out);
        Ok(())
    }

    /// Predicts, and differentiates Σ cotangent · prediction with respect to positions and mask; see [`Cotangent`].
    ///
    /// The rest as [`Engine::predict`]. The first call prepares the adjoint weights.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids.
    pub fn gradient(
        &self,
        scratch: &mut Scratch,
        input: Input,
        cotangent: &Cotangent,
        out: Gradient,
    ) -> Result<(), EngineError> {
        input.check()?;
        check(
            input.images(),
            [
                ("prediction", out.prediction.len(), 3),
                ("by_positions", out.by_positions.len(), 3),
                ("by_known", out.by_known.len(), 1),
            ],
        )?;
        scratch.gradient(self, input, cotangent, out);
        Ok(())
    }

    /// Lays out the weights for the forward pass, so that the first prediction need not.
    pub fn prepare(&self) {
        self.forward();
    }

    /// The layers, prepared when first wanted.
    fn forward(&self) -> &Forward {
        self.forward.get_or_init(|| Forward::pack(&self.folds))
    }

    /// The adjoint layers, prepared when first wanted.
    fn reverse(&self) -> &Reverse {
        self.reverse.get_or_init(|| Reverse::pack(&self.folds))
    }
}

impl<'a> Input<'a> {
    /// How many grids there are.
    fn images(&self) -> usize {
        self.known.len() / CELLS
    }

    fn check(&self) -> Result<(), EngineError> {
        let base = self.base.map_or(self.positions.len(), <[f32]>::len);
        let (images, up) = (self.images(), self.up.map(<[f32]>::len));
        if let Some(found) = up.filter(|found| *found != 3 * images) {
            return Err(EngineError::Size {
                what: "up",
                found,
                expected: 3 * images,
                images,
            });
        }
        check(
            images,
            [
                ("known", self.known.len(), 1),
                ("positions", self.positions.len(), 3),
                ("base", base, 3),
            ],
        )
    }

    /// Some of the grids.
    fn part(&self, images: Range<usize>) -> Input<'a> {
        let three = images.start * 3 * CELLS..images.end * 3 * CELLS;
        Input {
            positions: &self.positions[three.clone()],
            known: &self.known[images.start * CELLS..images.end * CELLS],
            base: self.base.map(|base| &base[three]),
            up: self.up.map(|up| &up[3 * images.start..3 * images.end]),
        }
    }
}

fn check<const N: usize>(
    images: usize,
    slices: [(&'static str, usize, usize); N],
) -> Result<(), EngineError> {
    for (what, found, planes) in slices {
        let expected = images * planes * CELLS;
        if found != expected {
            return Err(EngineError::Size {
                what,
                found,
                expected,
                images,
            });
        }
    }
    Ok(())
}
