//! The last layer, a 1×1 convolution of the features to three axes, and its adjoint.

use rayon::prelude::*;

use super::feature_map::{FeatureMap, MapPlane};
use super::model::EngineModel;
use super::simd::{Block, Kernel, LANES, Simd};
use crate::config::OUTPUT_SCALE;
use darn_geometry::grid::{CELLS, SIDE};

/// The positions `[n, 3, 64, 64]` that the features of all images give: added to the filled positions in `out`, or written over them,
/// according to the model's [`InputKind`](crate::InputKind).
pub fn last_layer(model: &EngineModel, threads: usize, features: &FeatureMap, out: &mut [f32]) {
    let each = |(plane, out)| {
        model.target.run(LastLayer {
            model,
            features,
            plane,
            out,
        });
    };
    match threads {
        1 => out.chunks_mut(CELLS).enumerate().for_each(each),
        _ => out.par_chunks_mut(CELLS).enumerate().for_each(each),
    }
}

/// One axis of one image's positions.
struct LastLayer<'a> {
    model: &'a EngineModel,
    features: &'a FeatureMap,
    /// Three times the image, plus the axis.
    plane: usize,
    out: &'a mut [f32],
}

impl Kernel for LastLayer<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let model = &self.model.weights;
        let (image, axis) = (self.plane / 3, self.plane % 3);
        let weights = &model.last[axis * model.width..][..model.width];
        for (row, out) in self.out.chunks_mut(SIDE).enumerate() {
            for (column, out) in out.iter_mut().enumerate() {
                let mut sum = s.splat(0.0);
                for (block, weights) in weights.chunks(LANES).enumerate() {
                    let plane = MapPlane { image, block };
                    let place = self.features.index(plane, row + 1, column + 1);
                    let x = s.load(&self.features.cells[place]);
                    sum = s.mul_add(x, s.load(&padded(weights)), sum);
                }
                let mut lanes = Block::ZERO;
                s.store(sum, &mut lanes);
                let x = (lanes.sum() + model.last_bias[axis]) * OUTPUT_SCALE;
                *out = if self.model.input.answers_offsets() {
                    *out + x
                } else {
                    x
                };
            }
        }
    }
}

/// Up to sixteen weights, followed by zeros.
#[inline(always)]
fn padded(weights: &[f32]) -> Block {
    let mut block = Block::ZERO;
    block.0[..weights.len()].copy_from_slice(weights);
    block
}

/// Computes the gradient with respect to one image's features before their ReLU.
pub struct LastLayerAdjoint<'a> {
    pub model: &'a EngineModel,
    pub features: &'a FeatureMap,
    pub image: usize,
    /// With respect to the positions: `[3, 64, 64]`.
    pub cotangent: &'a [f32],
    pub result: &'a mut FeatureMap,
}

impl Kernel for LastLayerAdjoint<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (model, image) = (&self.model.weights, self.image);
        for block in 0..self.features.channel_blocks {
            let plane = MapPlane { image, block };
            let weights = |axis: usize| {
                let row = &model.last[axis * model.width..][..model.width];
                s.load(&padded(
                    &row[block * LANES..model.width.min((block + 1) * LANES)],
                ))
            };
            let weights = [weights(0), weights(1), weights(2)];
            for row in 0..SIDE {
                let saved = self.features.row(plane, row);
                let to = self.result.row_mut(plane, row);
                for (column, (to, saved)) in to.iter_mut().zip(saved).enumerate() {
                    let mut sum = s.splat(0.0);
                    for (axis, weights) in weights.iter().enumerate() {
                        let by = self.cotangent[axis * CELLS + row * SIDE + column] * OUTPUT_SCALE;
                        sum = s.mul_add(s.splat(by), *weights, sum);
                    }
                    s.store(s.where_positive(sum, s.load(saved)), to);
                }
            }
        }
    }
}
