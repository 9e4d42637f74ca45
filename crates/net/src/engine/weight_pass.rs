//! The gradient with respect to the weights, by name, for training. The statistics of batch norm (`mean`, `variance`) are constants.

use std::ops::Range;

use rayon::prelude::*;

use super::backward::{ActivationGradients, AdjointPass};
use super::error::EngineError;
use super::forward::{Activations, GRIDS_TOGETHER, PassSize, SavedActivations};
use super::input_fill::FillBuffers;
use super::io::{EngineInput, image3};
use super::last_layer::{LastLayerAdjoint, last_layer};
use super::model::EngineModel;
use super::unfuse::by_name;
use super::weight_gradients::WeightGradients;
use crate::config::OUTPUT_SCALE;
use crate::tensors::NamedTensors;
use darn_geometry::grid::CELLS;

/// Reusable buffers for the weight gradients of one network.
#[derive(Debug, Default)]
pub struct WeightGradientBuffers {
    /// One for every [`GRIDS_TOGETHER`] grids of a call.
    groups: Vec<GroupBuffers>,
    predictions: Vec<f32>,
    cotangents: Vec<f32>,
}

/// A training loss. Given the places of some grids in the call and their predictions `[n, 3, 64, 64]`, it writes the derivatives
/// `[n, 3, 64, 64]` with respect to them (zero before) and returns what the caller wants to know. It is called for some grids at a time,
/// on a thread of the pool, where it must not wait for others. The gradient is that of the sum of all calls.
pub type TrainingLoss<'a, T> = dyn Fn(Range<usize>, &[f32], &mut [f32]) -> T + Sync + 'a;

/// Buffers for [`GRIDS_TOGETHER`] grids.
#[derive(Debug)]
struct GroupBuffers {
    forward: Activations,
    saved: SavedActivations,
    adjoint: ActivationGradients,
    weights: WeightGradients,
    fill: FillBuffers,
}

impl GroupBuffers {
    fn new(model: &EngineModel) -> GroupBuffers {
        let size = PassSize {
            images: GRIDS_TOGETHER,
            threads: 1,
        };
        GroupBuffers {
            forward: Activations::new(size, model),
            saved: SavedActivations::new(size.images, model),
            adjoint: ActivationGradients::new(size, model),
            weights: WeightGradients::new(size.images, &model.weights),
            fill: FillBuffers::default(),
        }
    }

    fn predict(&mut self, model: &EngineModel, input: EngineInput, out: &mut [f32]) {
        let map = &mut self.forward.input;
        self.fill.fill_map(model, input, out, map);
        let (layers, saved) = (model.forward(), Some(&mut self.saved));
        let features = self
            .forward
            .run(model.target, input.images(), layers, saved);
        last_layer(model, 1, features, out);
    }

    /// Computes the weight gradients of the grids that were predicted last.
    fn differentiate(&mut self, model: &EngineModel, cotangents: &[f32]) {
        let images = cotangents.len() / (3 * CELLS);
        self.weights.clear();
        let features = &self.saved.result[0];
        for image in 0..images {
            let cotangent = image3(cotangents, image);
            model.target.run(LastLayerAdjoint {
                model,
                features,
                image,
                cotangent,
                result: &mut self.adjoint.result[0],
            });
            let by: Vec<f32> = cotangent.iter().map(|x| x * OUTPUT_SCALE).collect();
            self.weights.add_last(model.target, features, image, &by);
        }
        let pass = AdjointPass {
            model,
            images,
            activations: &self.forward,
            saved: &self.saved,
        };
        self.adjoint.run(&pass, Some(&mut self.weights));
    }
}

/// [`super::Engine::weight_gradients`] with checked lengths.
pub(super) fn weight_gradients<T: Send>(
    model: &EngineModel,
    buffers: &mut WeightGradientBuffers,
    tensors: &NamedTensors,
    input: EngineInput,
    loss: &TrainingLoss<T>,
) -> Result<(NamedTensors, Vec<T>), EngineError> {
    let images = input.images();
    let groups = images.div_ceil(GRIDS_TOGETHER);
    while buffers.groups.len() < groups.max(1) {
        buffers.groups.push(GroupBuffers::new(model));
    }
    buffers.predictions.resize(images * 3 * CELLS, 0.0);
    buffers.cotangents.resize(images * 3 * CELLS, 0.0);
    let size = GRIDS_TOGETHER * 3 * CELLS;
    let parts =
        (buffers.predictions.par_chunks_mut(size)).zip(buffers.cotangents.par_chunks_mut(size));
    let numbered = buffers.groups.par_iter_mut().zip(parts).enumerate();
    let reports = numbered.map(|(place, (group, (out, by)))| {
        let first = place * GRIDS_TOGETHER;
        let grids = first..first + out.len() / (3 * CELLS);
        group.predict(model, input.part(grids.clone()), out);
        by.fill(0.0);
        let report = loss(grids, out, by);
        group.differentiate(model, by);
        report
    });
    let reports = reports.collect();
    let (first, others) = buffers.groups.split_at_mut(1);
    let sums = &mut first[0].weights;
    for other in others.iter().take(groups.saturating_sub(1)) {
        sums.join(&other.weights);
    }
    Ok((by_name(sums.unpack(), tensors)?, reports))
}
