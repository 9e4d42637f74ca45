//! The attention gate: 1×1 convolutions of skip and signal to joint features, a score of each cell, and the skip weighted by the score's
//! sigmoid, the attention. Sixteen cells at a time.

use std::ops::Range;

use super::convolve::{ConvBuffers, Multiply, PRODUCT_STRIDE, TILES};
use super::feature_map::{FeatureMap, MapPlane, channel_blocks};
use super::fuse::FusedGate;
use super::pack::{ChannelRuns, layout, pack_matrix, pack_vector};
use super::simd::{Block, Kernel, Simd, TargetIsa};
use super::split::ConvExec;

/// Cells that are computed together; the products take as many as of tiles.
pub const RUN_CELLS: usize = TILES;

/// A gate's weights, laid out for the kernels.
#[derive(Debug, Clone)]
pub struct PackedGate {
    /// Channel blocks of the skip, and as many of the signal.
    pub channel_blocks: usize,
    /// Channel blocks of the joint features.
    pub joint_blocks: usize,
    /// `[channel block of the joint features][channel of skip and signal]`.
    weights: Vec<Block>,
    bias: Vec<Block>,
    /// By channel block of the joint features.
    pub score: Vec<Block>,
    score_bias: f32,
}

/// What a gate reads and writes.
pub struct GateMaps<'a> {
    pub skip: &'a FeatureMap,
    /// Its upper half of channel blocks holds the signal; its lower half receives the weighted skip.
    pub joined: &'a mut FeatureMap,
    /// Receives the attention of every cell.
    pub attention: &'a mut [f32],
    /// Receives the joint features where an adjoint pass will need them: `[cell][channel block]`.
    pub joint: Option<&'a mut [Block]>,
}

impl PackedGate {
    /// Lays out a fused gate.
    pub fn pack(gate: &FusedGate) -> PackedGate {
        let (channels, inner) = (gate.joint.in_channels / 2, gate.joint.out_channels);
        PackedGate {
            channel_blocks: channel_blocks(channels),
            joint_blocks: channel_blocks(inner),
            weights: pack_matrix(&gate.joint, layout(channels, inner)),
            bias: pack_vector(&gate.joint.bias, ChannelRuns(inner)),
            score: pack_vector(&gate.score, ChannelRuns(inner)),
            score_bias: gate.score_bias,
        }
    }

    /// Weights the cells of the skip.
    pub fn run(&self, exec: &mut ConvExec, maps: GateMaps) {
        let GateMaps {
            skip,
            joined,
            attention,
            joint,
        } = maps;
        let area = skip.side * skip.side;
        let attention = &mut attention[..exec.images * area];
        let target = exec.target;
        let buffers = exec.active();
        let threads = buffers.len();
        let cells = AttentionCells {
            skip,
            joined,
            first: 0,
            attention: &mut *attention,
            joint,
        };
        self.attention_split(target, buffers, cells);
        for (image, attention) in attention.chunks(area).enumerate() {
            let start = |block| joined.index(MapPlane { image, block }, 0, 0);
            let lower = start(0)..start(self.channel_blocks);
            let apply = ApplyAttention {
                skip,
                image,
                first: 0,
                attention,
                rows: &mut joined.cells[lower],
            };
            apply.run_on(target, threads);
        }
    }

    /// Computes the attention of some cells on as many threads as there are buffers.
    fn attention_split(
        &self,
        target: TargetIsa,
        buffers: &mut [ConvBuffers],
        cells: AttentionCells,
    ) {
        let (few, others) = buffers.split_at_mut(buffers.len() / 2);
        let threads = few.len() + others.len();
        let half = cells.attention.len() / RUN_CELLS * few.len() / threads * RUN_CELLS;
        if half > 0 {
            let [before, after] = cells.split(half, self.joint_blocks);
            rayon::join(
                || self.attention_split(target, few, before),
                || self.attention_split(target, others, after),
            );
        } else if let Some(buffers) = others.first_mut() {
            self.attention_part(target, buffers, cells);
        }
    }

    /// Computes the attention of some cells on this thread.
    fn attention_part(&self, target: TargetIsa, buffers: &mut ConvBuffers, cells: AttentionCells) {
        let AttentionCells {
            skip,
            joined,
            first,
            attention,
            mut joint,
        } = cells;
        let spans = Spans::new(skip.side);
        for (run, attention) in attention.chunks_mut(RUN_CELLS).enumerate() {
            let (place, count) = (run * RUN_CELLS, attention.len());
            for span in spans.of(first + place..first + place + count) {
                for block in 0..self.channel_blocks {
                    let from = span.index(skip, block);
                    let to = block * RUN_CELLS + span.offset;
                    let to = &mut buffers.input[to..][..spans.length];
                    to.copy_from_slice(&skip.cells[from..][..spans.length]);
                    let signal = self.channel_blocks + block;
                    let from = span.index(joined, signal);
                    let to = signal * RUN_CELLS + span.offset;
                    let to = &mut buffers.input[to..][..spans.length];
                    to.copy_from_slice(&joined.cells[from..][..spans.length]);
                }
            }
            target.run(Multiply {
                input: &buffers.input,
                depth: 2 * self.channel_blocks,
                weights: &self.weights,
                frequencies: 1,
                count,
                products: &mut buffers.products,
            });
            let mut weights = Block::ZERO;
            target.run(Attention {
                gate: self,
                products: &mut buffers.products,
                attention: &mut weights,
            });
            attention.copy_from_slice(&weights.0[..count]);
            if let Some(joint) = joint.as_deref_mut() {
                for block in 0..self.joint_blocks {
                    for cell in 0..count {
                        joint[(place + cell) * self.joint_blocks + block] =
                            buffers.products[block * PRODUCT_STRIDE + cell];
                    }
                }
            }
        }
    }
}

/// A run of cells, counted through all images, whose attention is computed.
struct AttentionCells<'a> {
    skip: &'a FeatureMap,
    joined: &'a FeatureMap,
    /// The first cell.
    first: usize,
    /// As long as the run.
    attention: &'a mut [f32],
    /// The joint features of the run, where they are wanted.
    joint: Option<&'a mut [Block]>,
}

impl<'a> AttentionCells<'a> {
    /// The first `count` cells, and the rest.
    fn split(self, count: usize, joint_blocks: usize) -> [AttentionCells<'a>; 2] {
        let AttentionCells {
            skip,
            joined,
            first,
            attention,
            joint,
        } = self;
        let (attention_before, attention_after) = attention.split_at_mut(count);
        let (joint_before, joint_after) = joint
            .map(|joint| joint.split_at_mut(count * joint_blocks))
            .unzip();
        let part = |first, attention, joint| AttentionCells {
            skip,
            joined,
            first,
            attention,
            joint,
        };
        [
            part(first, attention_before, joint_before),
            part(first + count, attention_after, joint_after),
        ]
    }
}

/// Rows of the skip, each cell times its attention.
struct ApplyAttention<'a> {
    skip: &'a FeatureMap,
    image: usize,
    /// The first row, counted through the channel blocks with their borders.
    first: usize,
    /// Of all cells of the image.
    attention: &'a [f32],
    /// The rows to be written, with their borders.
    rows: &'a mut [Block],
}

impl ApplyAttention<'_> {
    fn run_on(self, target: TargetIsa, threads: usize) {
        let stride = self.skip.stride();
        let half = self.rows.len() / stride * (threads / 2) / threads;
        if half == 0 {
            return target.run(self);
        }
        let (before, after) = self.rows.split_at_mut(half * stride);
        let before = ApplyAttention {
            rows: before,
            ..self
        };
        let after = ApplyAttention {
            rows: after,
            first: self.first + half,
            ..self
        };
        rayon::join(
            || before.run_on(target, threads / 2),
            || after.run_on(target, threads - threads / 2),
        );
    }
}

impl Kernel for ApplyAttention<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (stride, side, image) = (self.skip.stride(), self.skip.side, self.image);
        let rows = (self.first..).zip(self.rows.chunks_exact_mut(stride));
        for (row, to) in rows {
            let (block, row) = (row / stride, row % stride);
            if row == 0 || row > side {
                continue;
            }
            let from = self.skip.row(MapPlane { image, block }, row - 1);
            let attention = &self.attention[(row - 1) * side..][..side];
            for ((to, from), attention) in to[1..].iter_mut().zip(from).zip(attention) {
                s.store(s.mul(s.load(from), s.splat(*attention)), to);
            }
        }
    }
}

/// Cuts a run of cells into spans: cells of one row, all of one length, at most [`RUN_CELLS`].
#[derive(Clone, Copy)]
pub struct Spans {
    side: usize,
    /// Cells of a span.
    pub length: usize,
}

/// Consecutive cells of one row.
#[derive(Clone, Copy)]
pub struct CellRange {
    /// Of its first cell in the run.
    pub offset: usize,
    image: usize,
    /// Row and column of its first cell; 0 is the border.
    row: usize,
    column: usize,
}

impl CellRange {
    /// Index of the first cell in a channel block of a map.
    #[inline(always)]
    pub fn index(self, map: &FeatureMap, block: usize) -> usize {
        let image = self.image;
        map.index(MapPlane { image, block }, self.row, self.column)
    }
}

impl Spans {
    /// For maps of a side.
    pub fn new(side: usize) -> Spans {
        let length = side.min(RUN_CELLS);
        Spans { side, length }
    }

    /// The spans of a run of cells, counted through all images.
    #[inline(always)]
    pub fn of(self, cells: Range<usize>) -> impl Iterator<Item = CellRange> {
        let area = self.side * self.side;
        cells.clone().step_by(self.length).map(move |cell| {
            let inside = cell % area;
            CellRange {
                offset: cell - cells.start,
                image: cell / area,
                row: inside / self.side + 1,
                column: inside % self.side + 1,
            }
        })
    }
}

/// Turns the products of sixteen cells into joint features, in place, and computes the cells' attention.
struct Attention<'a> {
    gate: &'a PackedGate,
    products: &'a mut [Block],
    attention: &'a mut Block,
}

impl Kernel for Attention<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        for cell in 0..RUN_CELLS {
            let mut sum = s.splat(0.0);
            for block in 0..self.gate.joint_blocks {
                let joint = &mut self.products[block * PRODUCT_STRIDE + cell];
                let x = s.add(s.load(joint), s.load(&self.gate.bias[block]));
                let x = s.max(x, s.splat(0.0));
                s.store(x, joint);
                sum = s.mul_add(x, s.load(&self.gate.score[block]), sum);
            }
            let mut lanes = Block::ZERO;
            s.store(sum, &mut lanes);
            self.attention.0[cell] = lanes.sum() + self.gate.score_bias;
        }
        for x in &mut self.attention.0 {
            *x = 1.0 / (1.0 + exp(-x.clamp(-80.0, 80.0)));
        }
    }
}

/// eˣ for |x| ≤ 80, with a relative error below 4e-7. Plain arithmetic gives the same result on every CPU and vectorises.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// Adding and subtracting it rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    /// ln 2 as a number of few bits and the rest.
    const LN2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    let whole = (x * std::f32::consts::LOG2_E + ROUND) - ROUND;
    let r = x - whole * LN2[0] - whole * LN2[1];
    let mut sum = 1.0 / 5040.0;
    for c in [
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        sum = sum * r + c;
    }
    // |whole| ≤ 116, so the exponent stays in range.
    let power = ((whole as i32 + 127) << 23) as u32;
    sum * f32::from_bits(power)
}

#[cfg(test)]
mod tests {
    use super::exp;

    #[test]
    fn exp_matches_the_exponential_in_f64() {
        for i in -8000..=8000 {
            let x = i as f32 / 100.0;
            let truth = f64::from(x).exp();
            assert!(((f64::from(exp(x)) - truth) / truth).abs() < 4e-7, "{x}");
        }
    }
}
