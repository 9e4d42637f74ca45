//! The network's forward pass over maps: room for its activations, and the way through them.

use super::convolve::Work;
use super::map::{Map, panels};
use super::network::{DOWN, Folds, Forward, side};
use super::pack::Layer;
use super::share::Finish;
use super::simd::{Block, Target};

/// Room for a forward pass of some images.
#[derive(Debug)]
pub struct Activations {
    images: usize,
    /// One for each thread that a single image may be shared out to.
    works: Vec<Work>,
    /// How many of them are in use.
    pub threads: usize,
    /// What the network sees: four channels of one panel.
    pub input: Map,
    /// By level: between the two convolutions of a block.
    pub middle: Vec<Map>,
    /// By level: the skip; of the lowest level its result.
    pub skip: Vec<Map>,
    /// By level but the lowest: the largest of every 2×2 cells of the skip.
    pub pooled: Vec<Map>,
    /// By level but the lowest: the weighted skip and the signal.
    pub joined: Vec<Map>,
    /// By level but the lowest: every cell's attention.
    pub open: Vec<Vec<f32>>,
}

/// What an adjoint pass needs beside the activations.
#[derive(Debug)]
pub struct Saved {
    /// By level but the lowest: as `middle`, of the way up.
    pub middle: Vec<Map>,
    /// By level but the lowest: a step's result.
    pub result: Vec<Map>,
    /// By level but the lowest: the gate's joint features.
    pub joint: Vec<Vec<Block>>,
}

/// Maps of one panel count a level: `channels(level)` rounded up.
pub fn levels(images: usize, count: usize, channels: impl Fn(usize) -> usize) -> Vec<Map> {
    (0..count)
        .map(|level| Map::new(images, panels(channels(level)), side(level)))
        .collect()
}

/// All layers of the forward pass.
fn layers(network: &Forward) -> impl Iterator<Item = &Layer> {
    let up = network.up.iter();
    let up = up.flat_map(|up| up.block.iter().chain(std::iter::once(&up.conv)));
    network.down.iter().flatten().chain(up)
}

impl Activations {
    /// Room for so many images, a single one shared out to so many threads.
    pub fn new([images, threads]: [usize; 2], folds: &Folds, network: &Forward) -> Activations {
        let width = folds.width;
        let channels = |level: usize| width << level;
        let half = |level: usize| Map::new(images, panels(channels(level)), side(level + 1));
        let joined = |level: usize| Map::new(images, 2 * panels(channels(level)), side(level));
        Activations {
            images,
            threads,
            works: (0..threads).map(|_| Work::of(layers(network))).collect(),
            input: Map::new(images, 1, side(0)),
            middle: levels(images, DOWN + 1, channels),
            skip: levels(images, DOWN + 1, channels),
            pooled: (0..DOWN).map(half).collect(),
            joined: (0..DOWN).map(joined).collect(),
            open: (0..DOWN)
                .map(|level| vec![0.0; images * side(level) * side(level)])
                .collect(),
        }
    }

    /// Images, and threads for a single one, that there is room for.
    pub fn size(&self) -> [usize; 2] {
        [self.images, self.works.len()]
    }

    /// From `input` to the features before the last layer, which it returns.
    ///
    /// Without `saved` the way up uses the maps of the way down again.
    pub fn run<'a>(
        &'a mut self,
        target: Target,
        images: usize,
        network: &Forward,
        mut saved: Option<&'a mut Saved>,
    ) -> &'a Map {
        let works = &mut self.works[..self.threads];
        for level in 0..=DOWN {
            let [first, second] = &network.down[level];
            let x = match level {
                0 => &self.input,
                _ => &self.pooled[level - 1],
            };
            let middle = &mut self.middle[level];
            first.run(
                (target, works),
                images,
                x.all(),
                middle.whole(),
                Finish::Relu,
            );
            let finish = match self.pooled.get_mut(level) {
                Some(pooled) => Finish::ReluPool(pooled.whole()),
                None => Finish::Relu,
            };
            let skip = &mut self.skip[level];
            second.run((target, works), images, middle.all(), skip.whole(), finish);
        }
        for level in (0..DOWN).rev() {
            let up = &network.up[level];
            let (skips, below) = self.skip.split_at_mut(level + 1);
            let (skip, mut below) = (&mut skips[level], &below[0]);
            if let Some(saved) = saved.as_deref() {
                below = saved.result.get(level + 1).unwrap_or(below);
            }
            let joined = &mut self.joined[level];
            let first = joined.panels / 2;
            let signal = joined.upper(first);
            up.conv
                .run((target, works), images, below.all(), signal, Finish::Relu);
            let open = &mut self.open[level];
            let joint = saved
                .as_deref_mut()
                .map(|saved| saved.joint[level].as_mut_slice());
            up.gate
                .run((target, works), images, (skip, joined), open, joint);
            let (middle, result) = match saved.as_deref_mut() {
                Some(saved) => (&mut saved.middle[level], &mut saved.result[level]),
                None => (&mut self.middle[level], skip),
            };
            let [first, second] = &up.block;
            first.run(
                (target, works),
                images,
                joined.all(),
                middle.whole(),
                Finish::Relu,
            );
            second.run(
                (target, works),
                images,
                middle.all(),
                result.whole(),
                Finish::Relu,
            );
        }
        match saved {
            Some(saved) => &saved.result[0],
            None => &self.skip[0],
        }
    }
}

impl Saved {
    pub fn new(images: usize, folds: &Folds, network: &Forward) -> Saved {
        let channels = |level: usize| folds.width << level;
        let joint = |(level, inner): (usize, usize)| {
            vec![Block::ZERO; images * side(level) * side(level) * inner]
        };
        Saved {
            middle: levels(images, DOWN, channels),
            result: levels(images, DOWN, channels),
            joint: network
                .up
                .iter()
                .map(|up| up.gate.inner)
                .enumerate()
                .map(joint)
                .collect(),
        }
    }
}
