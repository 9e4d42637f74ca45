//! The adjoint pass: from the gradient with respect to the network's last features to the one with respect to its input.

use super::convolve::Work;
use super::forward::{Activations, Saved, levels};
use super::map::{Map, panels};
use super::network::{DOWN, Folds, Forward, Reverse, side};
use super::pack::Layer;
use super::share::Finish;
use super::simd::{Kernel, Simd, Target};
use super::sums::WeightSums;

/// Room for the gradients of some images, by the name of what they are with respect to.
#[derive(Debug)]
pub struct Gradients {
    /// As those of the activations.
    works: Vec<Work>,
    pub threads: usize,
    pub input: Map,
    /// By level: between the convolutions of a block, first of the one up, then of the one down.
    middle: Vec<Map>,
    /// By level: a block's result, before its ReLU.
    pub result: Vec<Map>,
    pooled: Vec<Map>,
    joined: Vec<Map>,
}

/// All layers of the adjoint pass.
fn layers(reverse: &Reverse) -> impl Iterator<Item = &Layer> {
    let up = reverse.up.iter();
    let up = up.flat_map(|up| up.block.iter().chain(std::iter::once(&up.conv)));
    reverse.down.iter().flatten().chain(up)
}

impl Gradients {
    /// As [`Activations::size`].
    pub fn size(&self) -> [usize; 2] {
        [self.input.images(), self.works.len()]
    }

    /// Room for so many images, a single one shared out to so many threads.
    pub fn new([images, threads]: [usize; 2], folds: &Folds, reverse: &Reverse) -> Gradients {
        let width = folds.width;
        let channels = |level: usize| width << level;
        let half = |level: usize| Map::new(images, panels(channels(level)), side(level + 1));
        let joined = |level: usize| Map::new(images, 2 * panels(channels(level)), side(level));
        Gradients {
            threads,
            works: (0..threads).map(|_| Work::of(layers(reverse))).collect(),
            input: Map::new(images, 1, side(0)),
            middle: levels(images, DOWN + 1, channels),
            result: levels(images, DOWN + 1, channels),
            pooled: (0..DOWN).map(half).collect(),
            joined: (0..DOWN).map(joined).collect(),
        }
    }

    /// From `result[0]` to `input`; the activations are those of the forward pass of the same images. `sums`, if any, receive what the
    /// weights gain, and `input` nothing then.
    pub fn run(
        &mut self,
        target: Target,
        images: usize,
        (network, reverse): (&Forward, &Reverse),
        (activations, saved): (&Activations, &Saved),
        mut sums: Option<&mut WeightSums>,
    ) {
        let works = &mut self.works[..self.threads];
        for level in 0..DOWN {
            let up = &reverse.up[level];
            let [first, second] = &up.block;
            let (result, middle) = (&self.result[level], &mut self.middle[level]);
            let gate = Finish::Gate(&saved.middle[level]);
            second.run((target, works), images, result.all(), middle.whole(), gate);
            let mut sums = sums.as_deref_mut().map(|sums| &mut sums.up[level]);
            if let Some(sums) = &mut sums {
                let [first, second] = &mut sums.block;
                second.add(target, images, saved.middle[level].all(), result.all());
                first.add(
                    target,
                    images,
                    activations.joined[level].all(),
                    middle.all(),
                );
            }
            let joined = &mut self.joined[level];
            first.run(
                (target, works),
                images,
                middle.all(),
                joined.whole(),
                Finish::Plain,
            );
            let cells = images * side(level) * side(level);
            up.gate.run(
                (target, &mut works[0]),
                &network.up[level].gate,
                (&activations.skip[level], &activations.joined[level]),
                (&activations.open[level][..cells], &saved.joint[level]),
                (joined, sums.as_deref_mut().map(|sums| &mut sums.gate)),
            );
            let signal = joined.from(joined.panels / 2);
            let below = saved.result.get(level + 1);
            let below = below.unwrap_or(&activations.skip[level + 1]);
            if let Some(sums) = sums {
                sums.add_up(target, images, below, signal);
            }
            let below = Finish::Gate(below);
            let result = &mut self.result[level + 1];
            up.conv
                .run((target, works), images, signal, result.whole(), below);
        }
        for level in (0..=DOWN).rev() {
            if level < DOWN {
                let skip = &activations.skip[level];
                let pooled = (&activations.pooled[level], &self.pooled[level]);
                target.run(Join {
                    images,
                    skip,
                    pooled,
                    joined: &self.joined[level],
                    result: &mut self.result[level],
                });
            }
            let [first, second] = &reverse.down[level];
            let (result, middle) = (&self.result[level], &mut self.middle[level]);
            let gate = Finish::Gate(&activations.middle[level]);
            second.run((target, works), images, result.all(), middle.whole(), gate);
            if let Some(sums) = sums.as_deref_mut() {
                let [first, second] = &mut sums.down[level];
                let x = match level {
                    0 => &activations.input,
                    _ => &activations.pooled[level - 1],
                };
                second.add(
                    target,
                    images,
                    activations.middle[level].all(),
                    result.all(),
                );
                first.add(target, images, x.all(), middle.all());
                if level == 0 {
                    return;
                }
            }
            let input = match level {
                0 => &mut self.input,
                _ => &mut self.pooled[level - 1],
            };
            first.run(
                (target, works),
                images,
                middle.all(),
                input.whole(),
                Finish::Plain,
            );
        }
    }
}

/// The gradient with respect to a skip before its ReLU: what came through the gate (the lower panels of `joined`), and what came through
/// the pooling, which goes to the first of the largest of its four cells.
struct Join<'a> {
    images: usize,
    skip: &'a Map,
    /// The largest, and the gradient with respect to them.
    pooled: (&'a Map, &'a Map),
    joined: &'a Map,
    result: &'a mut Map,
}

impl Kernel for Join<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (skip, joined) = (self.skip, self.joined);
        let stride = skip.stride();
        for (image, panel) in (0..self.images).flat_map(|i| (0..skip.panels).map(move |p| (i, p))) {
            for row in 0..skip.side / 2 {
                let largest = self.pooled.0.row([image, panel], row);
                let by_largest = self.pooled.1.row([image, panel], row);
                let at = skip.index([image, panel], [2 * row + 1, 1]);
                let through = joined.index([image, panel], [2 * row + 1, 1]);
                for (column, (largest, by)) in largest.iter().zip(by_largest).enumerate() {
                    let (largest, mut left) = (s.load(largest), s.load(by));
                    for cell in [0, 1, stride, stride + 1] {
                        let cell = 2 * column + cell;
                        let x = s.load(&skip.blocks[at + cell]);
                        // Nothing is larger than the largest: what is not smaller is it.
                        let others = s.gate(left, s.sub(largest, x));
                        let here = s.sub(left, others);
                        left = others;
                        let sum = s.add(s.load(&joined.blocks[through + cell]), here);
                        s.store(s.gate(sum, x), &mut self.result.blocks[at + cell]);
                    }
                }
            }
        }
    }
}
