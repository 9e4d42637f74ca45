//! The adjoint pass, from the gradient with respect to the features before the last layer to the one with respect to the input map, and
//! the buffers for its gradients.

use super::convolve::ConvBuffers;
use super::epilogue::{ConvOutput, Epilogue};
use super::feature_map::{FeatureMap, MapPlane, level_side};
use super::forward::{Activations, PassSize, SavedActivations, level_maps, pooled_maps};
use super::gate_adjoint::GateAdjointMaps;
use super::model::EngineModel;
use super::simd::{Kernel, Simd};
use super::split::ConvExec;
use super::weight_gradients::WeightGradients;
use crate::config::DOWN;

/// Buffers for the gradients with respect to activations; each field has the name of its activation.
#[derive(Debug)]
pub struct ActivationGradients {
    /// One per thread.
    buffers: Vec<ConvBuffers>,
    /// How many of `buffers` are in use.
    pub threads: usize,
    pub input: FeatureMap,
    /// By level: between the convolutions of a block, first of the one on the way up, then of the one on the way down.
    middle: Vec<FeatureMap>,
    /// By level: the result of a block before its ReLU.
    pub result: Vec<FeatureMap>,
    pooled: Vec<FeatureMap>,
    joined: Vec<FeatureMap>,
}

/// What an adjoint pass reads.
pub struct AdjointPass<'a> {
    pub model: &'a EngineModel,
    pub images: usize,
    /// Of the forward pass of the same images.
    pub activations: &'a Activations,
    /// Of the forward pass of the same images.
    pub saved: &'a SavedActivations,
}

impl ActivationGradients {
    /// Buffers of a size for a model.
    pub fn new(size: PassSize, model: &EngineModel) -> ActivationGradients {
        let PassSize { images, threads } = size;
        let width = model.weights.width;
        let convs = || model.adjoint().convs();
        ActivationGradients {
            threads,
            buffers: (0..threads).map(|_| ConvBuffers::new(convs())).collect(),
            input: FeatureMap::new(images, 1, level_side(0)),
            middle: level_maps(images, DOWN + 1, width, 1),
            result: level_maps(images, DOWN + 1, width, 1),
            pooled: pooled_maps(images, width),
            joined: level_maps(images, DOWN, width, 2),
        }
    }

    /// What there is room for.
    pub fn size(&self) -> PassSize {
        PassSize {
            images: self.input.images(),
            threads: self.buffers.len(),
        }
    }

    /// From `result[0]` to `input`.
    ///
    /// With `weights`, adds to them the gradient with respect to the weights, and does not compute `input`.
    pub fn run(&mut self, pass: &AdjointPass, mut weights: Option<&mut WeightGradients>) {
        let AdjointPass {
            model,
            images,
            activations,
            saved,
        } = *pass;
        let (target, layers) = (model.target, model.adjoint());
        let mut exec = ConvExec {
            target,
            images,
            buffers: &mut self.buffers[..self.threads],
        };
        for level in 0..DOWN {
            let up = &layers.up[level];
            let [first, second] = &up.block;
            let (result, middle) = (&self.result[level], &mut self.middle[level]);
            let output = ConvOutput {
                map: middle.view_mut(),
                epilogue: Epilogue::ReluAdjoint(&saved.middle[level]),
            };
            second.run(&mut exec, result.view(), output);
            let joined = &activations.joined[level];
            let mut weights = weights.as_deref_mut().map(|weights| &mut weights.up[level]);
            if let Some(weights) = &mut weights {
                let [first, second] = &mut weights.block;
                second.add(target, images, saved.middle[level].view(), result.view());
                first.add(target, images, joined.view(), middle.view());
            }
            let by_joined = &mut self.joined[level];
            let output = ConvOutput {
                map: by_joined.view_mut(),
                epilogue: Epilogue::Plain,
            };
            first.run(&mut exec, middle.view(), output);
            let cells = images * level_side(level) * level_side(level);
            let maps = GateAdjointMaps {
                gate: &model.forward().up[level].gate,
                skip: &activations.skip[level],
                joined,
                attention: &activations.attention[level][..cells],
                joint: &saved.joint[level],
                gradient: by_joined,
                weights: weights.as_deref_mut().map(|weights| &mut weights.gate),
            };
            up.gate.run(target, &mut exec.buffers[0], maps);
            let by_signal = by_joined.view_from(by_joined.channel_blocks / 2);
            let below = saved.result.get(level + 1);
            let below = below.unwrap_or(&activations.skip[level + 1]);
            if let Some(weights) = weights {
                weights.add_up(target, images, below, by_signal);
            }
            let output = ConvOutput {
                map: self.result[level + 1].view_mut(),
                epilogue: Epilogue::ReluAdjoint(below),
            };
            up.conv.run(&mut exec, by_signal, output);
        }
        for level in (0..=DOWN).rev() {
            if level < DOWN {
                target.run(SkipGradient {
                    images,
                    skip: &activations.skip[level],
                    pooled: &activations.pooled[level],
                    by_pooled: &self.pooled[level],
                    by_joined: &self.joined[level],
                    result: &mut self.result[level],
                });
            }
            let [first, second] = &layers.down[level];
            let (result, middle) = (&self.result[level], &mut self.middle[level]);
            let saved = &activations.middle[level];
            let output = ConvOutput {
                map: middle.view_mut(),
                epilogue: Epilogue::ReluAdjoint(saved),
            };
            second.run(&mut exec, result.view(), output);
            if let Some(weights) = weights.as_deref_mut() {
                let [first, second] = &mut weights.down[level];
                let x = match level {
                    0 => &activations.input,
                    _ => &activations.pooled[level - 1],
                };
                second.add(target, images, saved.view(), result.view());
                first.add(target, images, x.view(), middle.view());
                if level == 0 {
                    return;
                }
            }
            let input = match level {
                0 => &mut self.input,
                _ => &mut self.pooled[level - 1],
            };
            let output = ConvOutput {
                map: input.view_mut(),
                epilogue: Epilogue::Plain,
            };
            first.run(&mut exec, middle.view(), output);
        }
    }
}

/// Computes the gradient with respect to a skip before its ReLU. It is the sum of what comes through the gate (the lower channel blocks
/// of `by_joined`) and what comes through the pooling, which goes to the first of the largest of its four cells.
struct SkipGradient<'a> {
    images: usize,
    skip: &'a FeatureMap,
    pooled: &'a FeatureMap,
    by_pooled: &'a FeatureMap,
    by_joined: &'a FeatureMap,
    result: &'a mut FeatureMap,
}

impl Kernel for SkipGradient<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (skip, joined) = (self.skip, self.by_joined);
        let (stride, blocks) = (skip.stride(), skip.channel_blocks);
        let planes = (0..self.images)
            .flat_map(|image| (0..blocks).map(move |block| MapPlane { image, block }));
        for plane in planes {
            for row in 0..skip.side / 2 {
                let largest = self.pooled.row(plane, row);
                let by_largest = self.by_pooled.row(plane, row);
                let at = skip.index(plane, 2 * row + 1, 1);
                let through = joined.index(plane, 2 * row + 1, 1);
                for (column, (largest, by)) in largest.iter().zip(by_largest).enumerate() {
                    let (largest, mut left) = (s.load(largest), s.load(by));
                    for cell in [0, 1, stride, stride + 1] {
                        let cell = 2 * column + cell;
                        let x = s.load(&skip.cells[at + cell]);
                        // No cell is larger than the largest, so where the difference is not positive this cell is it.
                        let others = s.where_positive(left, s.sub(largest, x));
                        let here = s.sub(left, others);
                        left = others;
                        let sum = s.add(s.load(&joined.cells[through + cell]), here);
                        s.store(s.where_positive(sum, x), &mut self.result.cells[at + cell]);
                    }
                }
            }
        }
    }
}
