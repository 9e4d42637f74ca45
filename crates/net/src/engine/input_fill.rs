//! From a grid to the network's input map: unknown cells are filled, positions scaled, and planes laid out as channels; and the adjoint.

use super::feature_map::{FeatureMap, MapPlane};
use super::io::{EngineInput, image3_mut};
use super::membrane::{MembraneGradient, MembraneGrid, Pyramid, membrane, membrane_adjoint};
use super::model::EngineModel;
use super::simd::TargetIsa;
use crate::config::INPUT_SCALE;
use crate::fill::InputKind;
use darn_geometry::grid::{CELLS, SIDE};

/// Reusable buffers for filling one grid.
#[derive(Debug, Default)]
pub struct FillBuffers {
    pyramid: Pyramid,
    /// Planes of the grid's distance from its base.
    off_base: Vec<f32>,
}

/// One grid's positions `[3, 64, 64]` as a network of this kind sees them, before they are scaled.
pub fn input_positions(kind: InputKind, grid: EngineInput) -> Vec<f32> {
    let mut filled = vec![0.0; grid.positions.len()];
    let buffers = &mut FillBuffers::default();
    buffers.fill(kind, TargetIsa::best(), grid, &mut filled);
    filled
}

impl FillBuffers {
    /// Writes the network's input for some grids to `map`, and their filled positions, to which its answer is added, to `filled`.
    pub fn fill_map(
        &mut self,
        model: &EngineModel,
        input: EngineInput,
        filled: &mut [f32],
        map: &mut FeatureMap,
    ) {
        for image in 0..input.images() {
            let grid = input.part(image..image + 1);
            let filled = image3_mut(filled, image);
            self.fill(model.input, model.target, grid, filled);
            write_channels(filled, grid, image, map);
        }
    }

    /// Writes one grid's positions as the network sees them, before they are scaled.
    fn fill(&mut self, kind: InputKind, target: TargetIsa, grid: EngineInput, filled: &mut [f32]) {
        match kind {
            InputKind::Membrane | InputKind::Plate => {
                let positions = off_base(grid, &mut self.off_base);
                let zero = |(k, x): (usize, &f32)| x * grid.known[k % CELLS] == 0.0;
                if positions.iter().enumerate().all(zero) {
                    // Without anchors the base agrees with all known cells, and the membrane over it is zero.
                    filled.fill(0.0);
                } else {
                    let known = grid.known;
                    let grid = MembraneGrid { positions, known };
                    membrane(target, &mut self.pyramid, grid, filled);
                }
                for (to, base) in filled.iter_mut().zip(grid.base.unwrap_or_default()) {
                    *to += base;
                }
            }
            InputKind::Zeros => {
                for (at, to) in filled.iter_mut().enumerate() {
                    *to = grid.positions[at] * grid.known[at % CELLS];
                }
            }
        }
    }

    /// Adds the gradients with respect to one grid's positions and mask, given the one with respect to its filled positions. Those with
    /// respect to positions are zero before.
    pub fn fill_adjoint(
        &mut self,
        model: &EngineModel,
        grid: EngineInput,
        by_filled: &[f32],
        by: MembraneGradient,
    ) {
        match model.input {
            InputKind::Zeros => {
                for (at, by_filled) in by_filled.iter().enumerate() {
                    by.by_positions[at] = by_filled * grid.known[at % CELLS];
                    by.by_known[at % CELLS] += by_filled * grid.positions[at];
                }
            }
            InputKind::Membrane | InputKind::Plate => {
                let positions = off_base(grid, &mut self.off_base);
                let known = grid.known;
                let grid = MembraneGrid { positions, known };
                membrane_adjoint(model.target, &mut self.pyramid, grid, by_filled, by);
            }
        }
    }
}

/// A grid's positions less its base, where it has one; `buffer` may receive them.
fn off_base<'a>(grid: EngineInput<'a>, buffer: &'a mut Vec<f32>) -> &'a [f32] {
    let Some(base) = grid.base else {
        return grid.positions;
    };
    buffer.clear();
    buffer.extend(grid.positions.iter().zip(base).map(|(x, base)| x - base));
    buffer
}

/// Three planes, scaled, the mask and the up direction as the channels of the first channel block.
fn write_channels(filled: &[f32], grid: EngineInput, image: usize, map: &mut FeatureMap) {
    let up = grid.up.and_then(<[f32]>::first_chunk).unwrap_or(&[0.0; 3]);
    let plane = MapPlane { image, block: 0 };
    for row in 0..SIDE {
        for (column, to) in map.row_mut(plane, row).iter_mut().enumerate() {
            let cell = row * SIDE + column;
            for axis in 0..3 {
                to.0[axis] = filled[axis * CELLS + cell] * INPUT_SCALE;
            }
            to.0[3] = grid.known[cell];
            to.0[4..7].copy_from_slice(up);
        }
    }
}

/// The adjoint of writing the channels of one image: gradients with respect to the filled positions and the mask.
pub fn read_channels(map: &FeatureMap, image: usize, by_filled: &mut [f32], by_known: &mut [f32]) {
    let plane = MapPlane { image, block: 0 };
    for row in 0..SIDE {
        for (column, from) in map.row(plane, row).iter().enumerate() {
            let cell = row * SIDE + column;
            for axis in 0..3 {
                by_filled[axis * CELLS + cell] = from.0[axis] * INPUT_SCALE;
            }
            by_known[cell] = from.0[3];
        }
    }
}
