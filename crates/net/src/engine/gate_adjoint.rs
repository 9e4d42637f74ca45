//! The adjoint of the attention gate, sixteen cells at a time.

use super::convolve::{ConvBuffers, Multiply, PRODUCT_STRIDE};
use super::feature_map::FeatureMap;
use super::fuse::FusedGate;
use super::gate::{PackedGate, RUN_CELLS, Spans};
use super::pack::{layout, pack_matrix};
use super::simd::{Block, Kernel, Simd, TargetIsa};
use super::weight_gradients::{GateCells, GateWeightGradient};

/// The transposed weights of a gate, laid out for the kernels: `[channel block of skip and signal][channel of the joint features]`.
#[derive(Debug, Clone)]
pub struct PackedGateAdjoint {
    weights: Vec<Block>,
}

/// What the adjoint of a gate reads and writes; `gate` to `joint` are those of the forward pass.
pub struct GateAdjointMaps<'a> {
    pub gate: &'a PackedGate,
    pub skip: &'a FeatureMap,
    pub joined: &'a FeatureMap,
    pub attention: &'a [f32],
    pub joint: &'a [Block],
    /// With respect to the weighted skip and the signal; becomes the one with respect to the skip and to the signal before its ReLU.
    pub gradient: &'a mut FeatureMap,
    /// Receives the gradient with respect to the gate's weights, where it is wanted.
    pub weights: Option<&'a mut GateWeightGradient>,
}

impl PackedGateAdjoint {
    /// Lays out the adjoint of a fused gate.
    pub fn pack(gate: &FusedGate) -> PackedGateAdjoint {
        let (channels, inner) = (gate.joint.in_channels / 2, gate.joint.out_channels);
        PackedGateAdjoint {
            weights: pack_matrix(&gate.joint.transposed(), layout(inner, channels)),
        }
    }

    /// Computes the gradient of a batch on this thread.
    pub fn run(&self, target: TargetIsa, buffers: &mut ConvBuffers, maps: GateAdjointMaps) {
        let GateAdjointMaps {
            gate,
            skip,
            joined,
            attention,
            joint,
            gradient,
            mut weights,
        } = maps;
        let spans = Spans::new(skip.side);
        for (run, (attention, joint)) in attention
            .chunks(RUN_CELLS)
            .zip(joint.chunks(RUN_CELLS * gate.joint_blocks))
            .enumerate()
        {
            let mut run = GateRun {
                gate,
                first: run * RUN_CELLS,
                skip,
                joined,
                attention,
                gradient,
            };
            let mut by_score = [0.0; RUN_CELLS];
            target.run(JointGradient {
                run: &run,
                joint,
                input: &mut buffers.input,
                by_score: &mut by_score,
            });
            if let Some(weights) = weights.as_deref_mut() {
                for span in spans.of(run.first..run.first + attention.len()) {
                    let cells = span.offset..span.offset + spans.length;
                    let map = |block: usize| {
                        if block < gate.channel_blocks {
                            skip
                        } else {
                            joined
                        }
                    };
                    let cells = GateCells {
                        input: &|block| {
                            let map = map(block);
                            &map.cells[span.index(map, block)..][..spans.length]
                        },
                        by_joint: &|block| &buffers.input[block * RUN_CELLS..][cells.clone()],
                        joint: &joint[span.offset * gate.joint_blocks..],
                        by_score: &by_score[cells.clone()],
                    };
                    weights.add(target, cells);
                }
            }
            target.run(Multiply {
                input: &buffers.input,
                depth: gate.joint_blocks,
                weights: &self.weights,
                frequencies: 1,
                count: attention.len(),
                products: &mut buffers.products,
            });
            target.run(InputGradients {
                run: &mut run,
                products: &buffers.products,
            });
        }
    }
}

/// Sixteen cells of a gate's adjoint.
struct GateRun<'a> {
    gate: &'a PackedGate,
    /// The first cell, counted through all images.
    first: usize,
    skip: &'a FeatureMap,
    joined: &'a FeatureMap,
    attention: &'a [f32],
    gradient: &'a mut FeatureMap,
}

/// Computes the gradient with respect to the joint features before their ReLU.
struct JointGradient<'a, 'b> {
    run: &'a GateRun<'b>,
    joint: &'a [Block],
    /// Receives the gradient: `[channel block][cell]`.
    input: &'a mut [Block],
    /// Receives the gradient with respect to the score of each cell.
    by_score: &'a mut [f32; RUN_CELLS],
}

impl Kernel for JointGradient<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let GateRun {
            gate,
            first,
            attention,
            ..
        } = *self.run;
        let (skip, gradient) = (self.run.skip, &*self.run.gradient);
        let spans = Spans::new(skip.side);
        for span in spans.of(first..first + attention.len()) {
            let mut sums = [s.splat(0.0); RUN_CELLS];
            for block in 0..gate.channel_blocks {
                let by = &gradient.cells[span.index(gradient, block)..][..spans.length];
                let x = &skip.cells[span.index(skip, block)..][..spans.length];
                for (sum, (by, x)) in sums.iter_mut().zip(by.iter().zip(x)) {
                    *sum = s.mul_add(s.load(by), s.load(x), *sum);
                }
            }
            for (cell, sum) in (span.offset..span.offset + spans.length).zip(sums) {
                let mut lanes = Block::ZERO;
                s.store(sum, &mut lanes);
                self.by_score[cell] = lanes.sum() * attention[cell] * (1.0 - attention[cell]);
                let slope = s.splat(self.by_score[cell]);
                for (block, score) in gate.score.iter().enumerate() {
                    let joint = s.load(&self.joint[cell * gate.joint_blocks + block]);
                    let by = s.where_positive(s.mul(slope, s.load(score)), joint);
                    s.store(by, &mut self.input[block * RUN_CELLS + cell]);
                }
            }
        }
    }
}

/// Computes the gradients with respect to skip and signal, given what comes through the joint features.
struct InputGradients<'a, 'b> {
    run: &'a mut GateRun<'b>,
    products: &'a [Block],
}

impl Kernel for InputGradients<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let GateRun {
            gate,
            first,
            joined,
            attention,
            ..
        } = *self.run;
        let gradient = &mut *self.run.gradient;
        let spans = Spans::new(joined.side);
        for span in spans.of(first..first + attention.len()) {
            for block in 0..gate.channel_blocks {
                let start = span.index(gradient, block);
                let by = &mut gradient.cells[start..][..spans.length];
                let products = &self.products[block * PRODUCT_STRIDE + span.offset..];
                let attention = &attention[span.offset..];
                let products = products[..spans.length].iter().zip(attention);
                for (by, (product, attention)) in by.iter_mut().zip(products) {
                    let sum = s.mul_add(s.load(by), s.splat(*attention), s.load(product));
                    s.store(sum, by);
                }
                let signal = gate.channel_blocks + block;
                let start = span.index(gradient, signal);
                let by = &mut gradient.cells[start..][..spans.length];
                let saved = &joined.cells[start..][..spans.length];
                let products = &self.products[signal * PRODUCT_STRIDE + span.offset..];
                let products = products[..spans.length].iter().zip(saved);
                for (by, (product, saved)) in by.iter_mut().zip(products) {
                    let sum = s.add(s.load(by), s.load(product));
                    s.store(s.where_positive(sum, s.load(saved)), by);
                }
            }
        }
    }
}
