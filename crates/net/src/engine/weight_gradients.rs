//! Gradients with respect to the weights: sums over cells of an input value times the gradient with respect to the result.

use super::feature_map::{FeatureMap, MapPlane, MapView, channel_blocks, level_side};
use super::fuse::{FusedConv, FusedGate, FusedUpStep, FusedWeights};
use super::pack::{ConvLayout, layout};
use super::simd::{Block, Kernel, LANES, Simd, TargetIsa};

/// The fewest cells whose products are summed in registers before they are added to the sums in memory, where a map has as many.
const RUN: usize = 64;

/// The gradient with respect to the weights of a convolution, laid out as feature maps are.
#[derive(Debug)]
pub struct ConvWeightGradient {
    in_channels: usize,
    out_channels: usize,
    /// Taps of the kernel.
    taps: usize,
    layout: ConvLayout,
    /// `[channel block of the output][channel block of the input][tap][channel of the input]`; each block holds 16 output channels.
    kernel: Vec<Block>,
    /// By channel block of the output.
    bias: Vec<Block>,
}

impl ConvWeightGradient {
    /// Zeros, for a convolution whose channels lie as in `layout`.
    pub fn new(conv: &FusedConv, layout: ConvLayout) -> ConvWeightGradient {
        let out_blocks = layout.output.blocks(conv.out_channels);
        let pairs = layout.input.blocks(conv.in_channels) * out_blocks;
        ConvWeightGradient {
            in_channels: conv.in_channels,
            out_channels: conv.out_channels,
            taps: conv.taps(),
            layout,
            kernel: vec![Block::ZERO; pairs * conv.taps() * LANES],
            bias: vec![Block::ZERO; out_blocks],
        }
    }

    /// Adds what a 3×3 convolution of `x` contributes; `by` is the gradient with respect to its result before the epilogue.
    pub fn add(&mut self, target: TargetIsa, images: usize, x: MapView, by: MapView) {
        target.run(AddConv {
            sums: self,
            images,
            x,
            by,
        });
    }

    /// Channel blocks of the input.
    fn in_blocks(&self) -> usize {
        self.layout.input.blocks(self.in_channels)
    }

    /// The sums of a channel block of the output, one of the input and a tap, by channel of the input.
    #[inline(always)]
    fn sums(&mut self, out_block: usize, in_block: usize, tap: usize) -> &mut [Block; LANES] {
        let at = (out_block * self.in_blocks() + in_block) * self.taps + tap;
        &mut self.kernel.as_chunks_mut::<LANES>().0[at]
    }

    fn join(&mut self, other: &ConvWeightGradient) {
        join(&mut self.kernel, &other.kernel);
        join(&mut self.bias, &other.bias);
    }

    fn clear(&mut self) {
        self.kernel.fill(Block::ZERO);
        self.bias.fill(Block::ZERO);
    }

    /// The gradient by channel.
    fn unpack(&self) -> FusedConv {
        let ConvLayout { input, output } = self.layout;
        let taps = self.taps;
        let mut kernel = Vec::with_capacity(self.out_channels * self.in_channels * taps);
        for n in 0..self.out_channels {
            let n = output.slot(n);
            for k in 0..self.in_channels {
                let k = input.slot(k);
                let pair = (n / LANES * self.in_blocks() + k / LANES) * taps;
                kernel.extend(
                    (0..taps).map(|tap| self.kernel[(pair + tap) * LANES + k % LANES].0[n % LANES]),
                );
            }
        }
        let bias = (0..self.out_channels).map(|n| output.slot(n));
        FusedConv {
            out_channels: self.out_channels,
            in_channels: self.in_channels,
            kernel,
            bias: bias.map(|n| self.bias[n / LANES].0[n % LANES]).collect(),
        }
    }
}

fn join(sums: &mut [Block], others: &[Block]) {
    for (sum, other) in sums.iter_mut().zip(others) {
        let lanes = sum.0.iter_mut().zip(other.0);
        lanes.for_each(|(sum, x)| *sum += x);
    }
}

/// See [`ConvWeightGradient::add`].
struct AddConv<'a> {
    sums: &'a mut ConvWeightGradient,
    images: usize,
    x: MapView<'a>,
    by: MapView<'a>,
}

impl Kernel for AddConv<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let AddConv {
            sums,
            images,
            x,
            by,
        } = self;
        let side = by.map.side;
        let rows = images * side;
        let at_once = (RUN / side).max(1);
        let channels = sums.in_channels;
        for to in 0..sums.bias.len() {
            let by_row = |row: usize| {
                let plane = MapPlane {
                    image: row / side,
                    block: by.first + to,
                };
                by.map.row(plane, row % side)
            };
            let mut bias = s.load(&sums.bias[to]);
            for cell in (0..rows).flat_map(by_row) {
                bias = s.add(bias, s.load(cell));
            }
            s.store(bias, &mut sums.bias[to]);
            for from in 0..sums.in_blocks() {
                let lanes = channels.saturating_sub(from * LANES).min(LANES);
                for first in (0..rows).step_by(at_once) {
                    let rows = first..(first + at_once).min(rows);
                    for tap in 0..9 {
                        let cells = rows.clone().map(|row| {
                            let plane = MapPlane {
                                image: row / side,
                                block: x.first + from,
                            };
                            let at = x.map.index(plane, row % side + tap / 3, tap % 3);
                            (&x.map.cells[at..][..side], by_row(row))
                        });
                        add_products(s, lanes, cells, sums.sums(to, from, tap));
                    }
                }
            }
        }
    }
}

/// Adds to the block of each input channel the sum, over cells, of that channel of `x` times the block `by`.
#[inline(always)]
fn add_products<'a, S: Simd>(
    s: S,
    lanes: usize,
    cells: impl Iterator<Item = (&'a [Block], &'a [Block])> + Clone,
    sums: &mut [Block; LANES],
) {
    if S::ROWS >= 16 {
        add_some_products::<S, 16, 0>(s, cells, sums);
    } else if S::ROWS >= 6 {
        add_some_products::<S, 6, 0>(s, cells.clone(), sums);
        if lanes > 6 {
            add_some_products::<S, 6, 6>(s, cells.clone(), sums);
            add_some_products::<S, 4, 12>(s, cells, sums);
        }
    } else {
        add_some_products::<S, 4, 0>(s, cells.clone(), sums);
        if lanes > 4 {
            add_some_products::<S, 4, 4>(s, cells.clone(), sums);
            add_some_products::<S, 4, 8>(s, cells.clone(), sums);
            add_some_products::<S, 4, 12>(s, cells, sums);
        }
    }
}

/// [`add_products`] of the `M` channels from `K` on, summed in registers.
#[inline(always)]
fn add_some_products<'a, S: Simd, const M: usize, const K: usize>(
    s: S,
    cells: impl Iterator<Item = (&'a [Block], &'a [Block])>,
    sums: &mut [Block; LANES],
) {
    let mut held = [s.splat(0.0); M];
    for (held, sum) in held.iter_mut().zip(&sums[K..]) {
        *held = s.load(sum);
    }
    for (x, by) in cells {
        for (x, by) in x.iter().zip(by) {
            let by = s.load(by);
            for (held, x) in held.iter_mut().zip(&x.0[K..]) {
                *held = s.mul_add(s.splat(*x), by, *held);
            }
        }
    }
    for (held, sum) in held.into_iter().zip(&mut sums[K..]) {
        s.store(held, sum);
    }
}

/// The gradient with respect to the weights of a gate.
#[derive(Debug)]
pub struct GateWeightGradient {
    joint: ConvWeightGradient,
    /// By channel block of the joint features.
    score: Vec<Block>,
    score_bias: f32,
}

/// Consecutive cells of a gate, and the gradients there.
pub struct GateCells<'a> {
    /// The cells of one channel block of the input: those of the skip first, then as many of the signal.
    pub input: &'a dyn Fn(usize) -> &'a [Block],
    /// The gradient with respect to one channel block of the joint features before their ReLU.
    pub by_joint: &'a dyn Fn(usize) -> &'a [Block],
    /// The joint features: `[cell][channel block]`.
    pub joint: &'a [Block],
    /// The gradient with respect to the score of each cell.
    pub by_score: &'a [f32],
}

impl GateWeightGradient {
    /// Zeros.
    fn new(gate: &FusedGate) -> GateWeightGradient {
        let joint = &gate.joint;
        let layout = layout(joint.in_channels / 2, joint.out_channels);
        GateWeightGradient {
            joint: ConvWeightGradient::new(joint, layout),
            score: vec![Block::ZERO; channel_blocks(gate.score.len())],
            score_bias: 0.0,
        }
    }

    /// Adds what some cells contribute.
    pub fn add(&mut self, target: TargetIsa, cells: GateCells) {
        target.run(AddGate { sums: self, cells });
    }

    fn join(&mut self, other: &GateWeightGradient) {
        self.joint.join(&other.joint);
        join(&mut self.score, &other.score);
        self.score_bias += other.score_bias;
    }

    fn clear(&mut self) {
        self.joint.clear();
        self.score.fill(Block::ZERO);
        self.score_bias = 0.0;
    }

    /// The gradient by channel.
    fn unpack(&self) -> FusedGate {
        let score = (0..self.joint.out_channels).map(|c| self.score[c / LANES].0[c % LANES]);
        FusedGate {
            joint: self.joint.unpack(),
            score: score.collect(),
            score_bias: self.score_bias,
        }
    }
}

struct AddGate<'a, 'b> {
    sums: &'a mut GateWeightGradient,
    cells: GateCells<'b>,
}

impl Kernel for AddGate<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let AddGate { sums, cells } = self;
        for to in 0..sums.score.len() {
            let by = (cells.by_joint)(to);
            let mut bias = s.load(&sums.joint.bias[to]);
            for by in by {
                bias = s.add(bias, s.load(by));
            }
            s.store(bias, &mut sums.joint.bias[to]);
            for from in 0..sums.joint.in_blocks() {
                let pair = std::iter::once(((cells.input)(from), by));
                add_products(s, LANES, pair, sums.joint.sums(to, from, 0));
            }
            let joint = cells.joint.iter().skip(to).step_by(sums.score.len());
            let mut score = s.load(&sums.score[to]);
            for (joint, by) in joint.zip(cells.by_score) {
                score = s.mul_add(s.splat(*by), s.load(joint), score);
            }
            s.store(score, &mut sums.score[to]);
        }
        sums.score_bias += cells.by_score.iter().sum::<f32>();
    }
}

/// The gradient with respect to the weights of one step up.
#[derive(Debug)]
pub struct UpWeightGradient {
    conv: ConvWeightGradient,
    pub gate: GateWeightGradient,
    pub block: [ConvWeightGradient; 2],
    /// The coarser map, upsampled to this level's side.
    upsampled: FeatureMap,
}

impl UpWeightGradient {
    /// Zeros, with room for so many images.
    fn new(images: usize, level: usize, up: &FusedUpStep) -> UpWeightGradient {
        let blocks = channel_blocks(up.conv.in_channels);
        let layout = layout(up.conv.in_channels, up.conv.out_channels);
        UpWeightGradient {
            conv: ConvWeightGradient::new(&up.conv, layout),
            gate: GateWeightGradient::new(&up.gate),
            block: block_zeros(&up.block, up.conv.out_channels),
            upsampled: FeatureMap::new(images, blocks, level_side(level)),
        }
    }

    /// Adds what the convolution after the upsampling contributes: `below` is the map that is upsampled, `by` as in
    /// [`ConvWeightGradient::add`].
    pub fn add_up(&mut self, target: TargetIsa, images: usize, below: &FeatureMap, by: MapView) {
        let blocks = below.channel_blocks;
        for image in 0..images {
            for plane in (0..blocks).map(|block| MapPlane { image, block }) {
                for row in 0..self.upsampled.side {
                    let from = below.row(plane, row / 2);
                    let to = self.upsampled.row_mut(plane, row).as_chunks_mut::<2>().0;
                    to.iter_mut().zip(from).for_each(|(to, x)| *to = [*x; 2]);
                }
            }
        }
        self.conv.add(target, images, self.upsampled.view(), by);
    }

    fn join(&mut self, other: &UpWeightGradient) {
        self.conv.join(&other.conv);
        self.gate.join(&other.gate);
        let block = self.block.iter_mut().zip(&other.block);
        block.for_each(|(sums, other)| sums.join(other));
    }

    fn clear(&mut self) {
        self.block.iter_mut().for_each(ConvWeightGradient::clear);
        self.conv.clear();
        self.gate.clear();
    }

    /// The gradient by channel.
    fn unpack(&self) -> FusedUpStep {
        FusedUpStep {
            conv: self.conv.unpack(),
            gate: self.gate.unpack(),
            block: self.block.each_ref().map(ConvWeightGradient::unpack),
        }
    }
}

/// Zeros for the two convolutions of a block, whose input channels lie in runs of `run`.
fn block_zeros(block: &[FusedConv; 2], run: usize) -> [ConvWeightGradient; 2] {
    let [first, second] = block;
    let inner = first.out_channels;
    [
        ConvWeightGradient::new(first, layout(run, inner)),
        ConvWeightGradient::new(second, layout(inner, inner)),
    ]
}

/// The gradient with respect to the weights of all layers.
#[derive(Debug)]
pub struct WeightGradients {
    pub down: Vec<[ConvWeightGradient; 2]>,
    pub up: Vec<UpWeightGradient>,
    /// By axis and channel block of the features.
    last: Vec<Block>,
    last_bias: [f32; 3],
    width: usize,
}

impl WeightGradients {
    /// Zeros, with room for so many images.
    pub fn new(images: usize, weights: &FusedWeights) -> WeightGradients {
        let down = weights.down.iter();
        let up = weights.up.iter().enumerate();
        WeightGradients {
            down: down
                .map(|convs| block_zeros(convs, convs[0].in_channels))
                .collect(),
            up: up
                .map(|(level, up)| UpWeightGradient::new(images, level, up))
                .collect(),
            last: vec![Block::ZERO; 3 * channel_blocks(weights.width)],
            last_bias: [0.0; 3],
            width: weights.width,
        }
    }

    /// Adds the gradient of other images.
    pub fn join(&mut self, other: &WeightGradients) {
        let down = self.down.iter_mut().flatten();
        down.zip(other.down.iter().flatten())
            .for_each(|(sums, other)| sums.join(other));
        let up = self.up.iter_mut().zip(&other.up);
        up.for_each(|(sums, other)| sums.join(other));
        join(&mut self.last, &other.last);
        let bias = self.last_bias.iter_mut().zip(other.last_bias);
        bias.for_each(|(bias, other)| *bias += other);
    }

    /// Sets everything to zero.
    pub fn clear(&mut self) {
        let down = self.down.iter_mut().flatten();
        down.for_each(ConvWeightGradient::clear);
        self.up.iter_mut().for_each(UpWeightGradient::clear);
        self.last.fill(Block::ZERO);
        self.last_bias = [0.0; 3];
    }

    /// Adds what the last layer contributes for one image: `by`, `[3, 64, 64]`, is the gradient with respect to that layer's result.
    pub fn add_last(&mut self, target: TargetIsa, features: &FeatureMap, image: usize, by: &[f32]) {
        target.run(AddLast {
            sums: self,
            features,
            image,
            by,
        });
    }

    /// The gradient by channel.
    pub fn unpack(&self) -> FusedWeights {
        let last = |axis: usize, channel: usize| {
            let block = axis * channel_blocks(self.width) + channel / LANES;
            self.last[block].0[channel % LANES]
        };
        FusedWeights {
            width: self.width,
            down: self
                .down
                .iter()
                .map(|convs| convs.each_ref().map(ConvWeightGradient::unpack))
                .collect(),
            up: self.up.iter().map(UpWeightGradient::unpack).collect(),
            last: (0..3)
                .flat_map(|axis| (0..self.width).map(move |channel| last(axis, channel)))
                .collect(),
            last_bias: self.last_bias,
        }
    }
}

struct AddLast<'a> {
    sums: &'a mut WeightGradients,
    features: &'a FeatureMap,
    image: usize,
    by: &'a [f32],
}

impl Kernel for AddLast<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (side, blocks) = (self.features.side, self.features.channel_blocks);
        let image = self.image;
        for (axis, by) in self.by.chunks_exact(side * side).enumerate() {
            for block in 0..blocks {
                let to = &mut self.sums.last[axis * blocks + block];
                let mut sum = s.load(to);
                for (row, by) in by.chunks_exact(side).enumerate() {
                    let cells = self.features.row(MapPlane { image, block }, row);
                    for (x, by) in cells.iter().zip(by) {
                        sum = s.mul_add(s.splat(*by), s.load(x), sum);
                    }
                }
                s.store(sum, to);
            }
            self.sums.last_bias[axis] += by.iter().sum::<f32>();
        }
    }
}
