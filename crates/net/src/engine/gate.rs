//! The attention gate: two 1×1 convolutions, a score, and the skip weighted by it; and its adjoint. Sixteen cells at a time.

use std::ops::Range;

use super::convolve::{Multiply, Work};
use super::map::{Map, panels};
use super::network::GateFolds;
use super::pack::{Parts, matrix, vector};
use super::simd::{Block, Kernel, Simd, Target};
use super::sums::{GateCells, GateSums};

/// Cells that go through together.
const CELLS: usize = 16;

/// A gate's weights, ready.
#[derive(Debug, Clone)]
pub struct Gate {
    /// Panels of the skip, and as many of the signal.
    panels: usize,
    /// Panels of the joint features.
    pub inner: usize,
    /// `[panel of the joint][channel of skip and signal]`.
    weights: Vec<Block>,
    bias: Vec<Block>,
    score: Vec<Block>,
    score_bias: f32,
}

/// A gate's adjoint, ready: `[panel of skip and signal][channel of the joint]`.
#[derive(Debug, Clone)]
pub struct GateAdjoint {
    weights: Vec<Block>,
}

impl Gate {
    pub fn pack(folds: &GateFolds) -> Gate {
        let (channels, inner) = (folds.joint.from / 2, folds.joint.to);
        Gate {
            panels: panels(channels),
            inner: panels(inner),
            weights: matrix(&folds.joint, [Parts(channels), Parts(inner)]),
            bias: vector(&folds.joint.bias, Parts(inner)),
            score: vector(&folds.score, Parts(inner)),
            score_bias: folds.score_bias,
        }
    }

    /// Weights the skip's cells: `joined` holds the signal in its upper half of panels and receives the weighted skip in its lower half.
    ///
    /// `open` receives every cell's weight, `joint`, if any, its joint features. A single image is shared out to as many threads as there
    /// are works.
    pub fn run(
        &self,
        (target, works): (Target, &mut [Work]),
        images: usize,
        (skip, joined): (&Map, &mut Map),
        open: &mut [f32],
        joint: Option<&mut [Block]>,
    ) {
        let works = if images == 1 { works } else { &mut works[..1] };
        let threads = works.len();
        let area = skip.side * skip.side;
        let open = &mut open[..images * area];
        self.open((target, works), (skip, joined), (0, &mut *open), joint);
        for (image, open) in open.chunks(area).enumerate() {
            let lower =
                joined.index([image, 0], [0, 0])..joined.index([image, self.panels], [0, 0]);
            let weigh = Weigh {
                skip,
                image,
                first: 0,
                open,
                rows: &mut joined.blocks[lower],
            };
            weigh.run_on(target, threads);
        }
    }

    /// Weights of the cells from `first` on, and their joint features.
    fn open(
        &self,
        (target, works): (Target, &mut [Work]),
        (skip, joined): (&Map, &Map),
        (first, open): (usize, &mut [f32]),
        joint: Option<&mut [Block]>,
    ) {
        let (few, others) = works.split_at_mut(works.len() / 2);
        let half = open.len() / CELLS * few.len() / (few.len() + others.len()) * CELLS;
        if half > 0 {
            let (before, after) = open.split_at_mut(half);
            let (joint_before, joint_after) = match joint {
                Some(joint) => {
                    let (before, after) = joint.split_at_mut(half * self.inner);
                    (Some(before), Some(after))
                }
                None => (None, None),
            };
            let (maps, next) = ((skip, joined), first + half);
            rayon::join(
                || self.open((target, few), maps, (first, before), joint_before),
                || self.open((target, others), maps, (next, after), joint_after),
            );
        } else if let Some(work) = others.first_mut() {
            self.open_some((target, work), (skip, joined), (first, open), joint);
        }
    }

    /// The same on one thread.
    fn open_some(
        &self,
        (target, work): (Target, &mut Work),
        (skip, joined): (&Map, &Map),
        (first, open): (usize, &mut [f32]),
        mut joint: Option<&mut [Block]>,
    ) {
        let spans = Spans::new(skip.side);
        for (run, open) in open.chunks_mut(CELLS).enumerate() {
            let (place, count) = (run * CELLS, open.len());
            let cells = first + place..first + place + count;
            for (span, at, image) in spans.of(cells) {
                for panel in 0..self.panels {
                    let from = skip.index([image, panel], at);
                    let to = &mut work.input[panel * CELLS + span..][..spans.length];
                    to.copy_from_slice(&skip.blocks[from..][..spans.length]);
                    let signal = self.panels + panel;
                    let from = joined.index([image, signal], at);
                    let to = &mut work.input[signal * CELLS + span..][..spans.length];
                    to.copy_from_slice(&joined.blocks[from..][..spans.length]);
                }
            }
            target.run(Multiply {
                input: &work.input,
                depth: 2 * self.panels,
                weights: &self.weights,
                frequencies: 1,
                count,
                products: &mut work.products,
            });
            let mut weights = Block::ZERO;
            target.run(Open {
                gate: self,
                products: &mut work.products,
                open: &mut weights,
            });
            open.copy_from_slice(&weights.0[..count]);
            if let Some(joint) = joint.as_deref_mut() {
                for panel in 0..self.inner {
                    for cell in 0..count {
                        joint[(place + cell) * self.inner + panel] =
                            work.products[panel * (CELLS + 1) + cell];
                    }
                }
            }
        }
    }
}

/// Rows of the skip's panels, weighted.
struct Weigh<'a> {
    skip: &'a Map,
    image: usize,
    /// The first row, counted through the panels with their borders.
    first: usize,
    /// All cells' weights of the image.
    open: &'a [f32],
    /// The rows to be written, with their borders.
    rows: &'a mut [Block],
}

impl Weigh<'_> {
    fn run_on(self, target: Target, threads: usize) {
        let stride = self.skip.stride();
        let half = self.rows.len() / stride * (threads / 2) / threads;
        if half == 0 {
            return target.run(self);
        }
        let (before, after) = self.rows.split_at_mut(half * stride);
        let (before, after) = (
            Weigh {
                rows: before,
                ..self
            },
            Weigh {
                rows: after,
                first: self.first + half,
                ..self
            },
        );
        rayon::join(
            || before.run_on(target, threads / 2),
            || after.run_on(target, threads - threads / 2),
        );
    }
}

impl Kernel for Weigh<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (stride, side) = (self.skip.stride(), self.skip.side);
        let rows = (self.first..).zip(self.rows.chunks_exact_mut(stride));
        for (row, to) in rows {
            let (panel, row) = (row / stride, row % stride);
            if row == 0 || row > side {
                continue;
            }
            let from = self.skip.row([self.image, panel], row - 1);
            let open = &self.open[(row - 1) * side..][..side];
            for ((to, from), open) in to[1..].iter_mut().zip(from).zip(open) {
                s.store(s.mul(s.load(from), s.splat(*open)), to);
            }
        }
    }
}

/// Runs of cells of one row, of equal length, at most [`CELLS`].
#[derive(Clone, Copy)]
struct Spans {
    side: usize,
    length: usize,
}

impl Spans {
    fn new(side: usize) -> Spans {
        let length = side.min(CELLS);
        Spans { side, length }
    }

    /// Of each run among some cells of a batch: its offset among them, its row and column counted from the border, and its image.
    #[inline(always)]
    fn of(self, cells: Range<usize>) -> impl Iterator<Item = (usize, [usize; 2], usize)> {
        let area = self.side * self.side;
        cells.clone().step_by(self.length).map(move |cell| {
            let inside = cell % area;
            let place = [inside / self.side + 1, inside % self.side + 1];
            (cell - cells.start, place, cell / area)
        })
    }
}

/// Joint features (in place of the products) and weights of sixteen cells.
struct Open<'a> {
    gate: &'a Gate,
    products: &'a mut [Block],
    open: &'a mut Block,
}

impl Kernel for Open<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        for cell in 0..CELLS {
            let mut sum = s.splat(0.0);
            for panel in 0..self.gate.inner {
                let joint = &mut self.products[panel * (CELLS + 1) + cell];
                let x = s.add(s.load(joint), s.load(&self.gate.bias[panel]));
                let x = s.max(x, s.splat(0.0));
                s.store(x, joint);
                sum = s.mul_add(x, s.load(&self.gate.score[panel]), sum);
            }
            let mut block = Block::ZERO;
            s.store(sum, &mut block);
            self.open.0[cell] = block.sum() + self.gate.score_bias;
        }
        for x in &mut self.open.0 {
            *x = 1.0 / (1.0 + exp(-x.clamp(-80.0, 80.0)));
        }
    }
}

/// eˣ for |x| ≤ 80, within 2e-7 of its value: plain arithmetic, so that it is the same on every CPU and sixteen go at once.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// Adding it rounds to a whole number.
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

impl GateAdjoint {
    pub fn pack(folds: &GateFolds) -> GateAdjoint {
        let (channels, inner) = (folds.joint.from / 2, folds.joint.to);
        GateAdjoint {
            weights: matrix(
                &folds.joint.adjoint(super::pack::Turn::Not),
                [Parts(inner), Parts(channels)],
            ),
        }
    }

    /// `gradient`, with respect to the gate's output and the signal beside it, becomes the one with respect to the skip and to the signal
    /// before its ReLU. `skip`, `joined`, `open` and `joint` are the forward pass's. `sums`, if any, receive what the weights gain.
    pub fn run(
        &self,
        (target, work): (Target, &mut Work),
        gate: &Gate,
        (skip, joined): (&Map, &Map),
        (open, joint): (&[f32], &[Block]),
        (gradient, mut sums): (&mut Map, Option<&mut GateSums>),
    ) {
        for (first, (open, joint)) in open
            .chunks(CELLS)
            .zip(joint.chunks(CELLS * gate.inner))
            .enumerate()
        {
            let mut run = Run {
                gate,
                first: first * CELLS,
                skip,
                joined,
                open,
                gradient,
            };
            let mut slopes = [0.0; CELLS];
            target.run(Enter {
                run: &run,
                joint,
                input: &mut work.input,
                slopes: &mut slopes,
            });
            if let Some(sums) = sums.as_deref_mut() {
                let spans = Spans::new(skip.side);
                for (span, place, image) in spans.of(run.first..run.first + open.len()) {
                    let cells = span..span + spans.length;
                    let map = |panel: usize| if panel < gate.panels { skip } else { joined };
                    sums.add(
                        target,
                        GateCells {
                            seen: &|panel| {
                                let map = map(panel);
                                &map.blocks[map.index([image, panel], place)..][..spans.length]
                            },
                            by_joint: &|panel| &work.input[panel * CELLS..][cells.clone()],
                            joint: &joint[span * gate.inner..],
                            by_score: &slopes[cells.clone()],
                        },
                    );
                }
            }
            target.run(Multiply {
                input: &work.input,
                depth: gate.inner,
                weights: &self.weights,
                frequencies: 1,
                count: open.len(),
                products: &mut work.products,
            });
            target.run(Leave {
                run: &mut run,
                products: &work.products,
            });
        }
    }
}

/// Sixteen cells of a gate's adjoint.
struct Run<'a> {
    gate: &'a Gate,
    first: usize,
    skip: &'a Map,
    joined: &'a Map,
    open: &'a [f32],
    gradient: &'a mut Map,
}

/// The gradient with respect to the joint features before their ReLU.
struct Enter<'a, 'b> {
    run: &'a Run<'b>,
    joint: &'a [Block],
    input: &'a mut [Block],
    /// The gradient with respect to each cell's score.
    slopes: &'a mut [f32; CELLS],
}

impl Kernel for Enter<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Run {
            gate, first, open, ..
        } = *self.run;
        let (skip, gradient) = (self.run.skip, &*self.run.gradient);
        let spans = Spans::new(skip.side);
        for (span, place, image) in spans.of(first..first + open.len()) {
            let mut sums = [s.splat(0.0); CELLS];
            for panel in 0..gate.panels {
                let by = &gradient.blocks[gradient.index([image, panel], place)..][..spans.length];
                let x = &skip.blocks[skip.index([image, panel], place)..][..spans.length];
                for (sum, (by, x)) in sums.iter_mut().zip(by.iter().zip(x)) {
                    *sum = s.mul_add(s.load(by), s.load(x), *sum);
                }
            }
            for (cell, sum) in (span..span + spans.length).zip(sums) {
                let mut block = Block::ZERO;
                s.store(sum, &mut block);
                self.slopes[cell] = block.sum() * open[cell] * (1.0 - open[cell]);
                let slope = s.splat(self.slopes[cell]);
                for (panel, score) in gate.score.iter().enumerate() {
                    let joint = s.load(&self.joint[cell * gate.inner + panel]);
                    let by = s.gate(s.mul(slope, s.load(score)), joint);
                    s.store(by, &mut self.input[panel * CELLS + cell]);
                }
            }
        }
    }
}

/// Adds what came through the joint features.
struct Leave<'a, 'b> {
    run: &'a mut Run<'b>,
    products: &'a [Block],
}

impl Kernel for Leave<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Run {
            gate,
            first,
            joined,
            open,
            ..
        } = *self.run;
        let gradient = &mut *self.run.gradient;
        let spans = Spans::new(joined.side);
        for (span, place, image) in spans.of(first..first + open.len()) {
            for panel in 0..gate.panels {
                let start = gradient.index([image, panel], place);
                let by = &mut gradient.blocks[start..][..spans.length];
                let products = &self.products[panel * (CELLS + 1) + span..][..spans.length];
                for ((by, product), open) in by.iter_mut().zip(products).zip(&open[span..]) {
                    s.store(s.mul_add(s.load(by), s.splat(*open), s.load(product)), by);
                }
                let signal = gate.panels + panel;
                let start = gradient.index([image, signal], place);
                let by = &mut gradient.blocks[start..][..spans.length];
                let saved = &joined.blocks[start..][..spans.length];
                let products = &self.products[signal * (CELLS + 1) + span..][..spans.length];
                for ((by, product), saved) in by.iter_mut().zip(products).zip(saved) {
                    let sum = s.add(s.load(by), s.load(product));
                    s.store(s.gate(sum, s.load(saved)), by);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::exp;

    #[test]
    fn the_exponential_is_the_exponential() {
        for i in -8000..=8000 {
            let x = i as f32 / 100.0;
            let truth = f64::from(x).exp();
            assert!(((f64::from(exp(x)) - truth) / truth).abs() < 4e-7, "{x}");
        }
    }
}
