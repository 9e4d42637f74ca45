//! The forward pass, from the input map to the features before the last layer, and the buffers for its activations.

use super::convolve::ConvBuffers;
use super::epilogue::{ConvOutput, Epilogue};
use super::feature_map::{FeatureMap, channel_blocks, level_side};
use super::gate::GateMaps;
use super::layers::ForwardLayers;
use super::model::EngineModel;
use super::simd::{Block, TargetIsa};
use super::split::ConvExec;
use crate::config::DOWN;

/// The most grids that go through the layers together. More share the reading of the weights; fewer stay in the cache.
pub const GRIDS_TOGETHER: usize = 4;

/// What buffers have room for.
#[derive(Debug, Clone, Copy, Default)]
pub struct PassSize {
    pub images: usize,
    /// Threads that a single image may be split among.
    pub threads: usize,
}

/// Buffers for the activations of a forward pass.
#[derive(Debug)]
pub struct Activations {
    size: PassSize,
    /// One per thread.
    buffers: Vec<ConvBuffers>,
    /// How many of `buffers` are in use.
    pub threads: usize,
    /// The network's input: up to seven channels of one channel block.
    pub input: FeatureMap,
    /// By level: between the two convolutions of a block.
    pub middle: Vec<FeatureMap>,
    /// By level: the skip; at the coarsest level the result.
    pub skip: Vec<FeatureMap>,
    /// By level but the coarsest: the largest of every 2×2 cells of the skip.
    pub pooled: Vec<FeatureMap>,
    /// By level but the coarsest: the weighted skip and the signal.
    pub joined: Vec<FeatureMap>,
    /// By level but the coarsest: the attention of every cell.
    pub attention: Vec<Vec<f32>>,
}

/// Buffers for what an adjoint pass needs beside the activations.
#[derive(Debug)]
pub struct SavedActivations {
    /// By level but the coarsest: between the two convolutions of the block on the way up.
    pub middle: Vec<FeatureMap>,
    /// By level but the coarsest: the result of the step up.
    pub result: Vec<FeatureMap>,
    /// By level but the coarsest: the joint features of the gate.
    pub joint: Vec<Vec<Block>>,
}

/// Maps for the first `count` levels, with the channels of their level times `copies`.
pub fn level_maps(images: usize, count: usize, width: usize, copies: usize) -> Vec<FeatureMap> {
    (0..count)
        .map(|level| {
            let blocks = copies * channel_blocks(width << level);
            FeatureMap::new(images, blocks, level_side(level))
        })
        .collect()
}

/// Maps for the pooled skips.
pub fn pooled_maps(images: usize, width: usize) -> Vec<FeatureMap> {
    (0..DOWN)
        .map(|level| {
            let blocks = channel_blocks(width << level);
            FeatureMap::new(images, blocks, level_side(level + 1))
        })
        .collect()
}

impl Activations {
    /// Buffers of a size for a model.
    pub fn new(size: PassSize, model: &EngineModel) -> Activations {
        let PassSize { images, threads } = size;
        let width = model.weights.width;
        let convs = || model.forward().convs();
        let attention = |level| vec![0.0; images * level_side(level) * level_side(level)];
        Activations {
            size,
            threads,
            buffers: (0..threads).map(|_| ConvBuffers::new(convs())).collect(),
            input: FeatureMap::new(images, 1, level_side(0)),
            middle: level_maps(images, DOWN + 1, width, 1),
            skip: level_maps(images, DOWN + 1, width, 1),
            pooled: pooled_maps(images, width),
            joined: level_maps(images, DOWN, width, 2),
            attention: (0..DOWN).map(attention).collect(),
        }
    }

    /// What there is room for.
    pub fn size(&self) -> PassSize {
        self.size
    }

    /// From `input` to the features before the last layer, which it returns.
    ///
    /// Without `saved`, the way up overwrites the maps of the way down.
    pub fn run<'a>(
        &'a mut self,
        target: TargetIsa,
        images: usize,
        layers: &ForwardLayers,
        mut saved: Option<&'a mut SavedActivations>,
    ) -> &'a FeatureMap {
        let mut exec = ConvExec {
            target,
            images,
            buffers: &mut self.buffers[..self.threads],
        };
        for level in 0..=DOWN {
            let [first, second] = &layers.down[level];
            let x = match level {
                0 => &self.input,
                _ => &self.pooled[level - 1],
            };
            let middle = &mut self.middle[level];
            let output = ConvOutput {
                map: middle.view_mut(),
                epilogue: Epilogue::Relu,
            };
            first.run(&mut exec, x.view(), output);
            let epilogue = match self.pooled.get_mut(level) {
                Some(pooled) => Epilogue::ReluMaxPool(pooled.view_mut()),
                None => Epilogue::Relu,
            };
            let output = ConvOutput {
                map: self.skip[level].view_mut(),
                epilogue,
            };
            second.run(&mut exec, middle.view(), output);
        }
        for level in (0..DOWN).rev() {
            let up = &layers.up[level];
            let (skips, below) = self.skip.split_at_mut(level + 1);
            let (skip, mut below) = (&mut skips[level], &below[0]);
            if let Some(saved) = saved.as_deref() {
                below = saved.result.get(level + 1).unwrap_or(below);
            }
            let joined = &mut self.joined[level];
            let signal = ConvOutput {
                map: joined.view_mut_from(joined.channel_blocks / 2),
                epilogue: Epilogue::Relu,
            };
            up.conv.run(&mut exec, below.view(), signal);
            let maps = GateMaps {
                skip,
                joined,
                attention: &mut self.attention[level],
                joint: saved
                    .as_deref_mut()
                    .map(|saved| saved.joint[level].as_mut_slice()),
            };
            up.gate.run(&mut exec, maps);
            let (middle, result) = match saved.as_deref_mut() {
                Some(saved) => (&mut saved.middle[level], &mut saved.result[level]),
                None => (&mut self.middle[level], skip),
            };
            let [first, second] = &up.block;
            let output = ConvOutput {
                map: middle.view_mut(),
                epilogue: Epilogue::Relu,
            };
            first.run(&mut exec, joined.view(), output);
            let output = ConvOutput {
                map: result.view_mut(),
                epilogue: Epilogue::Relu,
            };
            second.run(&mut exec, middle.view(), output);
        }
        match saved {
            Some(saved) => &saved.result[0],
            None => &self.skip[0],
        }
    }
}

impl SavedActivations {
    /// Buffers for so many images of a model.
    pub fn new(images: usize, model: &EngineModel) -> SavedActivations {
        let width = model.weights.width;
        let joint = |(level, blocks): (usize, usize)| {
            vec![Block::ZERO; images * level_side(level) * level_side(level) * blocks]
        };
        let up = model.forward().up.iter();
        SavedActivations {
            middle: level_maps(images, DOWN, width, 1),
            result: level_maps(images, DOWN, width, 1),
            joint: up
                .map(|up| up.gate.joint_blocks)
                .enumerate()
                .map(joint)
                .collect(),
        }
    }
}
