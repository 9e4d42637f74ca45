//! What an engine reads and writes: grids as planes.

use std::ops::Range;

use rayon::prelude::*;

use super::error::EngineError;
use darn_geometry::grid::CELLS;

/// The derivative of a scalar with respect to a grid's prediction. Given the grid's place in the call and its prediction `[3, 64, 64]`, it
/// writes the derivatives `[3, 64, 64]`. It is called once per grid, on any thread.
pub type Cotangent<'a> = dyn Fn(usize, &[f32], &mut [f32]) + Sync + 'a;

/// Some grids as the network's input, in its units and frame.
#[derive(Debug, Clone, Copy)]
pub struct EngineInput<'a> {
    /// `[n, 3, 64, 64]`.
    pub positions: &'a [f32],
    /// `[n, 1, 64, 64]` in 0..=1.
    pub known: &'a [f32],
    /// `[n, 3, 64, 64]`, for [`InputKind::Plate`](crate::InputKind); zero where there is none.
    pub base: Option<&'a [f32]>,
    /// The up direction, `[n, 3]`, for [`FrameKind::Hanging`](crate::FrameKind); zero where there is none.
    pub up: Option<&'a [f32]>,
}

impl<'a> EngineInput<'a> {
    /// Number of grids.
    pub(super) fn images(&self) -> usize {
        self.known.len() / CELLS
    }

    /// Checks that all slices hold the same number of grids.
    pub(super) fn check(&self) -> Result<(), EngineError> {
        let images = self.images();
        if let Some(up) = self.up {
            check_length("up", up.len(), 3 * images, images)?;
        }
        check_planes("known", self.known, 1, images)?;
        check_planes("positions", self.positions, 3, images)?;
        match self.base {
            Some(base) => check_planes("base", base, 3, images),
            None => Ok(()),
        }
    }

    /// Some of the grids.
    pub(super) fn part(&self, images: Range<usize>) -> EngineInput<'a> {
        let three = images.start * 3 * CELLS..images.end * 3 * CELLS;
        EngineInput {
            positions: &self.positions[three.clone()],
            known: &self.known[images.start * CELLS..images.end * CELLS],
            base: self.base.map(|base| &base[three]),
            up: self.up.map(|up| &up[3 * images.start..3 * images.end]),
        }
    }
}

/// Receives predictions, and the gradients of Σ cotangent · prediction.
pub struct InputGradient<'a> {
    /// `[n, 3, 64, 64]`.
    pub prediction: &'a mut [f32],
    /// `[n, 3, 64, 64]`.
    pub by_positions: &'a mut [f32],
    /// `[n, 1, 64, 64]`.
    pub by_known: &'a mut [f32],
}

impl<'a> InputGradient<'a> {
    /// Number of grids.
    pub(super) fn images(&self) -> usize {
        self.by_known.len() / CELLS
    }

    /// Checks that all slices hold so many grids.
    pub(super) fn check(&self, images: usize) -> Result<(), EngineError> {
        check_planes("prediction", self.prediction, 3, images)?;
        check_planes("by_positions", self.by_positions, 3, images)?;
        check_planes("by_known", self.by_known, 1, images)
    }

    /// Parts of so many grids; the last may have fewer.
    pub(super) fn chunks(self, images: usize) -> impl Iterator<Item = InputGradient<'a>> {
        let three = (self.prediction.chunks_mut(images * 3 * CELLS))
            .zip(self.by_positions.chunks_mut(images * 3 * CELLS));
        three.zip(self.by_known.chunks_mut(images * CELLS)).map(
            |((prediction, by_positions), by_known)| InputGradient {
                prediction,
                by_positions,
                by_known,
            },
        )
    }

    /// [`InputGradient::chunks`] for several threads.
    pub(super) fn par_chunks(
        self,
        images: usize,
    ) -> impl IndexedParallelIterator<Item = InputGradient<'a>> {
        let three = (self.prediction.par_chunks_mut(images * 3 * CELLS))
            .zip(self.by_positions.par_chunks_mut(images * 3 * CELLS));
        three.zip(self.by_known.par_chunks_mut(images * CELLS)).map(
            |((prediction, by_positions), by_known)| InputGradient {
                prediction,
                by_positions,
                by_known,
            },
        )
    }
}

/// Checks that an argument holds so many planes for each of so many grids.
pub fn check_planes(
    what: &'static str,
    slice: &[f32],
    planes: usize,
    images: usize,
) -> Result<(), EngineError> {
    check_length(what, slice.len(), images * planes * CELLS, images)
}

fn check_length(
    what: &'static str,
    found: usize,
    expected: usize,
    images: usize,
) -> Result<(), EngineError> {
    if found == expected {
        return Ok(());
    }
    Err(EngineError::Size {
        what,
        found,
        expected,
        images,
    })
}

/// The three planes of one image.
pub fn image3(planes: &[f32], image: usize) -> &[f32] {
    &planes[image * 3 * CELLS..][..3 * CELLS]
}

/// The three planes of one image.
pub fn image3_mut(planes: &mut [f32], image: usize) -> &mut [f32] {
    &mut planes[image * 3 * CELLS..][..3 * CELLS]
}
