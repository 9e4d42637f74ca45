//! Gradients with respect to the weights, as sums over cells: what a weight saw times what its result should change by.

use super::map::{Map, Source, panels};
use super::network::{DOWN, Folds, GateFolds, UpFolds, side};
use super::pack::{Folded, Parts};
use super::simd::{Block, Kernel, LANES, Simd, Target};

/// Cells between two visits to the sums in memory, at least, where there are as many.
const RUN: usize = 64;

/// A convolution's sums, laid out as maps are.
#[derive(Debug)]
pub struct Sums {
    /// Channels of output and of input, taps of a kernel.
    shape: [usize; 3],
    /// Of input and of output.
    parts: [Parts; 2],
    /// `[panel of output][panel of input][tap][channel of input]`, each block 16 channels of output.
    kernel: Vec<Block>,
    /// By panel of output.
    bias: Vec<Block>,
}

impl Sums {
    /// Zeros, for a convolution whose channels lie in such parts of input and output.
    pub fn new(conv: &Folded, [from, to]: [Parts; 2]) -> Sums {
        let shape = [conv.to, conv.from, conv.taps()];
        let panels = [from.panels(conv.from), to.panels(conv.to)];
        Sums {
            shape,
            parts: [from, to],
            kernel: vec![Block::ZERO; panels[0] * panels[1] * shape[2] * LANES],
            bias: vec![Block::ZERO; panels[1]],
        }
    }

    /// Adds what a 3×3 convolution of `x` contributes, given the gradient `by` with respect to its result before anything follows it.
    pub fn add(&mut self, target: Target, images: usize, x: Source, by: Source) {
        target.run(Add {
            sums: self,
            images,
            x,
            by,
        });
    }

    /// Panels of input.
    fn from(&self) -> usize {
        self.parts[0].panels(self.shape[1])
    }

    /// The blocks of one pair of panels and one tap, by channel of input.
    #[inline(always)]
    fn blocks(&mut self, [to, from]: [usize; 2], tap: usize) -> &mut [Block; LANES] {
        let at = (to * self.from() + from) * self.shape[2] + tap;
        &mut self.kernel.as_chunks_mut::<LANES>().0[at]
    }

    fn join(&mut self, other: &Sums) {
        join(&mut self.kernel, &other.kernel);
        join(&mut self.bias, &other.bias);
    }

    fn clear(&mut self) {
        self.kernel.fill(Block::ZERO);
        self.bias.fill(Block::ZERO);
    }

    /// The sums by channel.
    fn folded(&self) -> Folded {
        let [to, from, taps] = self.shape;
        let [parts_from, parts_to] = self.parts;
        let mut kernel = Vec::with_capacity(to * from * taps);
        for n in 0..to {
            let n = parts_to.slot(n);
            for k in 0..from {
                let k = parts_from.slot(k);
                let pair = (n / LANES * self.from() + k / LANES) * taps;
                kernel.extend(
                    (0..taps).map(|tap| self.kernel[(pair + tap) * LANES + k % LANES].0[n % LANES]),
                );
            }
        }
        let bias = (0..to).map(|n| parts_to.slot(n));
        Folded {
            to,
            from,
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

/// See [`Sums::add`].
struct Add<'a> {
    sums: &'a mut Sums,
    images: usize,
    x: Source<'a>,
    by: Source<'a>,
}

impl Kernel for Add<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Add {
            sums,
            images,
            x,
            by,
        } = self;
        let side = by.map.side;
        let rows = images * side;
        let at_once = (RUN / side).max(1);
        let channels = sums.shape[1];
        for to in 0..sums.bias.len() {
            let by_row = |row: usize| by.map.row([row / side, by.first + to], row % side);
            let mut bias = s.load(&sums.bias[to]);
            for cell in (0..rows).flat_map(by_row) {
                bias = s.add(bias, s.load(cell));
            }
            s.store(bias, &mut sums.bias[to]);
            for from in 0..sums.from() {
                let lanes = channels.saturating_sub(from * LANES).min(LANES);
                for first in (0..rows).step_by(at_once) {
                    let rows = first..(first + at_once).min(rows);
                    for tap in 0..9 {
                        let cells = rows.clone().map(|row| {
                            let place = [row / side, x.first + from];
                            let at = x.map.index(place, [row % side + tap / 3, tap % 3]);
                            (&x.map.blocks[at..][..side], by_row(row))
                        });
                        products(s, lanes, cells, sums.blocks([to, from], tap));
                    }
                }
            }
        }
    }
}

/// Adds to each channel's block the sum over cells of that channel times a block.
#[inline(always)]
fn products<'a, S: Simd>(
    s: S,
    lanes: usize,
    cells: impl Iterator<Item = (&'a [Block], &'a [Block])> + Clone,
    sums: &mut [Block; LANES],
) {
    if S::ROWS >= 16 {
        some::<S, 16, 0>(s, cells, sums);
    } else if S::ROWS >= 6 {
        some::<S, 6, 0>(s, cells.clone(), sums);
        if lanes > 6 {
            some::<S, 6, 6>(s, cells.clone(), sums);
            some::<S, 4, 12>(s, cells, sums);
        }
    } else {
        some::<S, 4, 0>(s, cells.clone(), sums);
        if lanes > 4 {
            some::<S, 4, 4>(s, cells.clone(), sums);
            some::<S, 4, 8>(s, cells.clone(), sums);
            some::<S, 4, 12>(s, cells, sums);
        }
    }
}

/// The channels from `K` on, `M` of them, in registers.
#[inline(always)]
fn some<'a, S: Simd, const M: usize, const K: usize>(
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

/// A gate's sums.
#[derive(Debug)]
pub struct GateSums {
    pub joint: Sums,
    /// By panel of the joint features.
    pub score: Vec<Block>,
    pub score_bias: f32,
}

/// Cells of a gate, all in runs as long as each other: skip and signal by panel, the gradient with respect to the joint features before
/// their ReLU, those features after it, and the gradient with respect to the score.
pub struct GateCells<'a> {
    /// Of one panel: `skip` first, then as many of `signal`.
    pub seen: &'a dyn Fn(usize) -> &'a [Block],
    /// Of one panel of the joint.
    pub by_joint: &'a dyn Fn(usize) -> &'a [Block],
    /// `[cell][panel of the joint]`.
    pub joint: &'a [Block],
    pub by_score: &'a [f32],
}

impl GateSums {
    pub fn add(&mut self, target: Target, cells: GateCells) {
        target.run(AddGate { sums: self, cells });
    }
}

struct AddGate<'a, 'b> {
    sums: &'a mut GateSums,
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
            for from in 0..sums.joint.from() {
                let pair = std::iter::once(((cells.seen)(from), by));
                products(s, LANES, pair, sums.joint.blocks([to, from], 0));
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

/// One step up.
#[derive(Debug)]
pub struct UpSums {
    pub conv: Sums,
    pub gate: GateSums,
    pub block: [Sums; 2],
    /// The coarser signal at this level's side.
    wide: Map,
}

impl UpSums {
    /// Adds what the convolution after an upsampling contributes: `below` is what is upsampled, `by` as in [`Sums::add`].
    pub fn add_up(&mut self, target: Target, images: usize, below: &Map, by: Source) {
        for plane in (0..images).flat_map(|i| (0..below.panels).map(move |p| [i, p])) {
            for row in 0..self.wide.side {
                let from = below.row(plane, row / 2);
                let to = self.wide.row_mut(plane, row).as_chunks_mut::<2>().0;
                to.iter_mut().zip(from).for_each(|(to, x)| *to = [*x; 2]);
            }
        }
        self.conv.add(target, images, self.wide.all(), by);
    }
}

/// The sums of all layers.
#[derive(Debug)]
pub struct WeightSums {
    pub down: Vec<[Sums; 2]>,
    pub up: Vec<UpSums>,
    /// By coordinate and panel of features.
    last: Vec<Block>,
    last_bias: [f32; 3],
    width: usize,
}

impl WeightSums {
    /// Zeros, with room for so many images.
    pub fn new(images: usize, folds: &Folds) -> WeightSums {
        let block = |[first, second]: &[Folded; 2], parts: usize| {
            let to = Parts(first.to);
            [
                Sums::new(first, [Parts(parts), to]),
                Sums::new(second, [to, to]),
            ]
        };
        let up = |(level, up): (usize, &UpFolds)| {
            let GateFolds { joint, score, .. } = &up.gate;
            UpSums {
                conv: Sums::new(&up.conv, [Parts(up.conv.from), Parts(up.conv.to)]),
                gate: GateSums {
                    joint: Sums::new(joint, [Parts(joint.from / 2), Parts(joint.to)]),
                    score: vec![Block::ZERO; panels(score.len())],
                    score_bias: 0.0,
                },
                block: block(&up.block, up.conv.to),
                wide: Map::new(images, panels(up.conv.from), side(level)),
            }
        };
        let down = folds.down.iter();
        WeightSums {
            down: down.map(|convs| block(convs, convs[0].from)).collect(),
            up: folds.up.iter().take(DOWN).enumerate().map(up).collect(),
            last: vec![Block::ZERO; 3 * panels(folds.width)],
            last_bias: [0.0; 3],
            width: folds.width,
        }
    }

    /// Adds the sums of other cells.
    pub fn join(&mut self, other: &WeightSums) {
        let down = self.down.iter_mut().flatten();
        down.zip(other.down.iter().flatten())
            .for_each(|(sums, other)| sums.join(other));
        for (up, other) in self.up.iter_mut().zip(&other.up) {
            up.conv.join(&other.conv);
            up.gate.joint.join(&other.gate.joint);
            join(&mut up.gate.score, &other.gate.score);
            up.gate.score_bias += other.gate.score_bias;
            let block = up.block.iter_mut().zip(&other.block);
            block.for_each(|(sums, other)| sums.join(other));
        }
        join(&mut self.last, &other.last);
        let bias = self.last_bias.iter_mut().zip(other.last_bias);
        bias.for_each(|(bias, other)| *bias += other);
    }

    pub fn clear(&mut self) {
        for sums in self.down.iter_mut().flatten() {
            sums.clear();
        }
        for up in &mut self.up {
            up.block.iter_mut().for_each(Sums::clear);
            up.conv.clear();
            up.gate.joint.clear();
            up.gate.score.fill(Block::ZERO);
            up.gate.score_bias = 0.0;
        }
        self.last.fill(Block::ZERO);
        self.last_bias = [0.0; 3];
    }

    /// Adds what the last layer contributes: `by` one image's planes, the gradient with respect to that layer's own result.
    pub fn add_last(&mut self, target: Target, (features, image): (&Map, usize), by: &[f32]) {
        target.run(AddLast {
            sums: self,
            features,
            image,
            by,
        });
    }

    /// The gradient by channel, in the shape of the folded weights.
    pub fn folds(&self) -> Folds {
        let last = |axis: usize, channel: usize| {
            let panel = axis * panels(self.width) + channel / LANES;
            self.last[panel].0[channel % LANES]
        };
        let up = |up: &UpSums| UpFolds {
            conv: up.conv.folded(),
            gate: GateFolds {
                joint: up.gate.joint.folded(),
                score: (0..up.gate.joint.shape[0])
                    .map(|c| up.gate.score[c / LANES].0[c % LANES])
                    .collect(),
                score_bias: up.gate.score_bias,
            },
            block: up.block.each_ref().map(Sums::folded),
        };
        Folds {
            width: self.width,
            down: self
                .down
                .iter()
                .map(|convs| convs.each_ref().map(Sums::folded))
                .collect(),
            up: self.up.iter().map(up).collect(),
            last: (0..3)
                .flat_map(|axis| (0..self.width).map(move |channel| last(axis, channel)))
                .collect(),
            last_bias: self.last_bias,
        }
    }
}

struct AddLast<'a> {
    sums: &'a mut WeightSums,
    features: &'a Map,
    image: usize,
    by: &'a [f32],
}

impl Kernel for AddLast<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (side, planes) = (self.features.side, self.features.panels);
        for (axis, by) in self.by.chunks_exact(side * side).enumerate() {
            for panel in 0..planes {
                let to = &mut self.sums.last[axis * planes + panel];
                let mut sum = s.load(to);
                for (row, by) in by.chunks_exact(side).enumerate() {
                    let cells = self.features.row([self.image, panel], row);
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
