//! The adjoint pass: from the gradient with respect to the network's last features to the one with respect to its input.

use super::convolve::{Finish, Source, Work};
use super::forward::{Activations, Saved, all, levels, whole};
use super::map::{Map, panels};
use super::network::{DOWN, Folds, Forward, Reverse, side};
use super::pack::Layer;
use super::simd::{Kernel, Simd, Target};
use super::sums::WeightSums;

/// Room for the gradients of some images, by the name of what they are with respect to.
#[derive(Debug)]
pub struct Gradients {
    pub work: Work,
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
    /// Images there is room for.
    pub fn images(&self) -> usize {
        self.input.images()
    }

    pub fn new(images: usize, folds: &Folds, reverse: &Reverse) -> Gradients {
        let width = folds.width;
        let channels = |level: usize| width << level;
        let half = |level: usize| Map::new(images, panels(channels(level)), side(level + 1));
        let joined = |level: usize| Map::new(images, 2 * panels(channels(level)), side(level));
        Gradients {
            work: Work::of(layers(reverse)),
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
        let work = &mut self.work;
        for level in 0..DOWN {
            let up = &reverse.up[level];
            let [first, second] = &up.block;
            let (result, middle) = (&self.result[level], &mut self.middle[level]);
            let gate = Finish::Gate(&saved.middle[level]);
            second.run((target, work), images, all(result), whole(middle), gate);
            let mut sums = sums.as_deref_mut().map(|sums| &mut sums.up[level]);
            if let Some(sums) = &mut sums {
                let [first, second] = &mut sums.block;
                second.add(target, images, all(&saved.middle[level]), all(result));
                first.add(target, images, all(&activations.joined[level]), all(middle));
            }
            let joined = &mut self.joined[level];
            first.run(
                (target, work),
                images,
                all(middle),
                whole(joined),
                Finish::Plain,
            );
            let cells = images * side(level) * side(level);
            up.gate.run(
                (target, work),
                &network.up[level].gate,
                (&activations.skip[level], &activations.joined[level]),
                (&activations.open[level][..cells], &saved.joint[level]),
                (joined, sums.as_deref_mut().map(|sums| &mut sums.gate)),
            );
            let signal = Source {
                first: joined.panels / 2,
                map: joined,
            };
            let below = saved.result.get(level + 1);
            let below = below.unwrap_or(&activations.skip[level + 1]);
            if let Some(sums) = sums {
                sums.add_up(target, images, below, signal);
            }
            let below = Finish::Gate(below);
            let result = &mut self.result[level + 1];
            up.conv
                .run((target, work), images, signal, whole(result), below);
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
            second.run((target, work), images, all(result), whole(middle), gate);
            if let Some(sums) = sums.as_deref_mut() {
                let [first, second] = &mut sums.down[level];
                let x = match level {
                    0 => &activations.input,
                    _ => &activations.pooled[level - 1],
                };
                second.add(target, images, all(&activations.middle[level]), all(result));
                first.add(target, images, all(x), all(middle));
                if level == 0 {
                    return;
                }
            }
            let input = match level {
                0 => &mut self.input,
                _ => &mut self.pooled[level - 1],
            };
            first.run(
                (target, work),
                images,
                all(middle),
                whole(input),
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
