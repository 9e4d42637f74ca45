//! A caller's room for calls, and a call's way: input planes to maps, the network, maps to planes; grids shared out to threads.

use rayon::prelude::*;

use super::backward::Gradients;
use super::forward::{Activations, Saved};
use super::map::Map;
use super::membrane::{Pyramid, adjoint, membrane};
use super::simd::{Block, Kernel, LANES, Simd, Target};
use super::{Cotangent, Engine, Gradient, Input};
use crate::InputKind;
use crate::config::{INPUT_SCALE, OUTPUT_SCALE};
use darn_geometry::grid::{CELLS, SIDE};

/// Grids that go through the layers together: more share the reading of the weights, fewer stay in the cache.
pub const TOGETHER: usize = 4;

/// Room for the calls of one thread, for one engine; it grows to what is asked and is kept.
#[derive(Debug, Default)]
pub struct Scratch {
    lanes: Vec<Lane>,
}

/// One thread's room.
#[derive(Debug, Default)]
struct Lane {
    forward: Option<Activations>,
    backward: Option<(Saved, Gradients)>,
    fill: Room,
    /// Planes of one grid.
    planes: Vec<f32>,
    /// By the prediction's planes, grid after grid.
    cotangents: Vec<f32>,
}

/// Room for what the network sees of one grid.
#[derive(Debug, Default)]
pub struct Room {
    pyramid: Pyramid,
    /// Planes of the grid's distance from its base.
    off: Vec<f32>,
}

impl Scratch {
    pub(super) fn predict(&mut self, engine: &Engine, input: Input, out: &mut [f32]) {
        let (share, threads) = self.share(engine, input.images());
        let work = |lane: &mut Lane, first: usize, out: &mut [f32]| {
            let numbered = (first..).step_by(TOGETHER);
            for (first, out) in numbered.zip(out.chunks_mut(TOGETHER * 3 * CELLS)) {
                let images = first..first + out.len() / (3 * CELLS);
                lane.predict((engine, threads), input.part(images), out);
            }
        };
        if share >= input.images() {
            if let Some(lane) = self.lanes.first_mut() {
                on_pool(threads, || work(lane, 0, out));
            }
            return;
        }
        let lanes = self.lanes.par_iter_mut().enumerate();
        lanes
            .zip(out.par_chunks_mut(share * 3 * CELLS))
            .for_each(|((place, lane), out)| work(lane, place * share, out));
    }

    pub(super) fn gradient(
        &mut self,
        engine: &Engine,
        input: Input,
        cotangent: &Cotangent,
        out: Gradient,
    ) {
        let (share, threads) = self.share(engine, input.images());
        let work = |lane: &mut Lane, first: usize, out: Gradient| {
            let outs = (out.prediction.chunks_mut(TOGETHER * 3 * CELLS))
                .zip(out.by_positions.chunks_mut(TOGETHER * 3 * CELLS))
                .zip(out.by_known.chunks_mut(TOGETHER * CELLS));
            let numbered = (first..).step_by(TOGETHER);
            for (first, ((prediction, by_positions), by_known)) in numbered.zip(outs) {
                let images = first..first + by_known.len() / CELLS;
                let out = Gradient {
                    prediction,
                    by_positions,
                    by_known,
                };
                lane.gradient(
                    (engine, threads),
                    input.part(images),
                    (first, cotangent),
                    out,
                );
            }
        };
        if share >= input.images() {
            if let Some(lane) = self.lanes.first_mut() {
                on_pool(threads, || work(lane, 0, out));
            }
            return;
        }
        let outs = (out.prediction.par_chunks_mut(share * 3 * CELLS))
            .zip(out.by_positions.par_chunks_mut(share * 3 * CELLS))
            .zip(out.by_known.par_chunks_mut(share * CELLS));
        let lanes = self.lanes.par_iter_mut().enumerate();
        lanes
            .zip(outs)
            .for_each(|((place, lane), ((prediction, by_positions), by_known))| {
                let out = Gradient {
                    prediction,
                    by_positions,
                    by_known,
                };
                work(lane, place * share, out);
            });
    }

    /// Grids a lane takes, and threads that share one out where it takes one; makes sure that there are lanes for all.
    fn share(&mut self, engine: &Engine, images: usize) -> (usize, usize) {
        let share = images.div_ceil(engine.threads).max(1);
        let lanes = images.div_ceil(share).max(1);
        if self.lanes.len() < lanes {
            self.lanes.resize_with(lanes, Lane::default);
        }
        (share, (engine.threads / lanes).max(1))
    }
}

/// Runs on a thread of the pool where the work will be shared out: from outside it every sharing would cost a waking.
fn on_pool(threads: usize, work: impl FnOnce() + Send) {
    match threads {
        0 | 1 => work(),
        _ => rayon::scope(|_| work()),
    }
}

impl Lane {
    /// Predicts at most [`TOGETHER`] grids.
    fn predict(&mut self, (engine, threads): (&Engine, usize), input: Input, all: &mut [f32]) {
        let images = input.images();
        let (target, network) = (engine.target, engine.forward());
        let room = Lane::room(&mut self.forward, engine, [images, threads]);
        let fill = (&mut self.fill, false);
        show(engine, fill, input, (all, &mut room.input));
        let features = room.run(target, images, network, None);
        say((engine, threads), features, all);
    }

    /// Predicts and differentiates at most [`TOGETHER`] grids.
    fn gradient(
        &mut self,
        (engine, threads): (&Engine, usize),
        input: Input,
        (first, cotangent): (usize, &Cotangent),
        out: Gradient,
    ) {
        let images = input.images();
        let (target, network, reverse) = (engine.target, engine.forward(), engine.reverse());
        let room = Lane::room(&mut self.forward, engine, [images, threads]);
        let old = self
            .backward
            .as_ref()
            .map(|(_, gradients)| gradients.size());
        let (saved, gradients) = place(&mut self.backward, old, [images, threads], |size| {
            let saved = Saved::new(size[0], &engine.folds, network);
            (saved, Gradients::new(size, &engine.folds, reverse))
        });
        gradients.threads = threads;
        self.planes.resize(3 * CELLS, 0.0);
        self.cotangents.resize(images * 3 * CELLS, 0.0);
        let shown = (&mut *out.prediction, &mut room.input);
        show(engine, (&mut self.fill, true), input, shown);
        let features = room.run(target, images, network, Some(saved));
        say((engine, threads), features, out.prediction);
        for image in 0..images {
            let by_prediction = image3_mut(&mut self.cotangents, image);
            cotangent(first + image, image3(out.prediction, image), by_prediction);
            target.run(LastAdjoint {
                engine,
                features,
                image,
                cotangent: by_prediction,
                result: &mut gradients.result[0],
            });
        }
        gradients.run(target, images, (network, reverse), (room, saved), None);
        for image in 0..images {
            let grid = input.part(image..image + 1);
            let by_positions = image3_mut(out.by_positions, image);
            let by_known = &mut out.by_known[image * CELLS..][..CELLS];
            by_positions.fill(0.0);
            take_out(&gradients.input, image, (&mut self.planes, by_known));
            match engine.config.input {
                InputKind::Zeros => {
                    for (at, by) in self.planes.iter().enumerate() {
                        by_positions[at] = by * grid.known[at % CELLS];
                        by_known[at % CELLS] += by * grid.positions[at];
                    }
                }
                InputKind::Membrane | InputKind::Plate => {
                    for (by, direct) in self.planes.iter_mut().zip(image3(&self.cotangents, image))
                    {
                        *by += direct;
                    }
                    let by = (by_positions, by_known);
                    let Room { pyramid, off } = &mut self.fill;
                    let x = (off_base(grid, off), grid.known);
                    adjoint(target, pyramid, x, &self.planes, by);
                }
            }
        }
    }

    /// Room for a forward pass of so many grids, a single one shared out to so many threads.
    fn room<'a>(
        room: &'a mut Option<Activations>,
        engine: &Engine,
        size: [usize; 2],
    ) -> &'a mut Activations {
        let old = room.as_ref().map(Activations::size);
        let made = place(room, old, size, |size| {
            Activations::new(size, &engine.folds, engine.forward())
        });
        made.threads = size[1];
        made
    }
}

/// What is in a place, made anew where its size is too small; it never shrinks.
fn place<T>(
    place: &mut Option<T>,
    old: Option<[usize; 2]>,
    size: [usize; 2],
    make: impl FnOnce([usize; 2]) -> T,
) -> &mut T {
    let old = old.unwrap_or_default();
    if old[0] < size[0] || old[1] < size[1] {
        *place = None;
    }
    place.get_or_insert_with(|| make([old[0].max(size[0]), old[1].max(size[1])]))
}

pub fn image3(planes: &[f32], image: usize) -> &[f32] {
    &planes[image * 3 * CELLS..][..3 * CELLS]
}

fn image3_mut(planes: &mut [f32], image: usize) -> &mut [f32] {
    &mut planes[image * 3 * CELLS..][..3 * CELLS]
}

/// Lays out what the network sees of some grids; in `filled`, as planes, what its answer is added to. `again` when the fill's adjoint will
/// be asked for.
pub fn show(
    engine: &Engine,
    (fill, again): (&mut Room, bool),
    input: Input,
    (filled, map): (&mut [f32], &mut Map),
) {
    for image in 0..input.images() {
        let grid = input.part(image..image + 1);
        let filled = image3_mut(filled, image);
        let how = (engine.target, engine.config.input);
        enter(how, (fill, again), grid, filled);
        lay_out((filled, grid), image, map);
    }
}

/// The last layer's answer for all grids, added to what [`show`] left in `all`, or put in its place.
pub fn say((engine, threads): (&Engine, usize), features: &Map, all: &mut [f32]) {
    let each = |(plane, out)| {
        engine.target.run(Last {
            engine,
            features,
            plane,
            out,
        });
    };
    match threads {
        1 => all.chunks_mut(CELLS).enumerate().for_each(each),
        _ => all.par_chunks_mut(CELLS).enumerate().for_each(each),
    }
}

/// One grid's positions as the network sees them, but for their scale.
pub(super) fn enter(
    (target, kind): (Target, InputKind),
    (Room { pyramid, off }, again): (&mut Room, bool),
    grid: Input,
    filled: &mut [f32],
) {
    match kind {
        InputKind::Membrane | InputKind::Plate => {
            let off = off_base(grid, off);
            let none = |(k, x): (usize, &f32)| x * grid.known[k % CELLS] == 0.0;
            if !again && off.iter().enumerate().all(none) {
                // Without anchors a base goes through all that is known, and the membrane over it is zero.
                filled.fill(0.0);
            } else {
                membrane(target, pyramid, (off, grid.known), filled);
            }
            for (to, base) in filled.iter_mut().zip(grid.base.unwrap_or_default()) {
                *to += base;
            }
        }
        InputKind::Zeros => {
            for (at, to) in filled.iter_mut().enumerate() {
                *to = grid.positions[at] * grid.known[at % CELLS];
            }
        }
    }
}

/// How far a grid's positions are from its base, where it has one; in `off`, or the positions themselves.
fn off_base<'a>(grid: Input<'a>, off: &'a mut Vec<f32>) -> &'a [f32] {
    let Some(base) = grid.base else {
        return grid.positions;
    };
    off.clear();
    off.extend(grid.positions.iter().zip(base).map(|(x, base)| x - base));
    off
}

/// Three planes, scaled, the mask, and where up is as the channels of one panel.
fn lay_out((filled, grid): (&[f32], Input), image: usize, input: &mut Map) {
    let up = grid.up.and_then(<[f32]>::first_chunk).unwrap_or(&[0.0; 3]);
    for row in 0..SIDE {
        for (column, to) in input.row_mut([image, 0], row).iter_mut().enumerate() {
            let cell = row * SIDE + column;
            for axis in 0..3 {
                to.0[axis] = filled[axis * CELLS + cell] * INPUT_SCALE;
            }
            to.0[3] = grid.known[cell];
            to.0[4..7].copy_from_slice(up);
        }
    }
}

/// The adjoint of [`lay_out`].
fn take_out(input: &Map, image: usize, (by_filled, by_known): (&mut [f32], &mut [f32])) {
    for row in 0..SIDE {
        for (column, from) in input.row([image, 0], row).iter().enumerate() {
            let cell = row * SIDE + column;
            for axis in 0..3 {
                by_filled[axis * CELLS + cell] = from.0[axis] * INPUT_SCALE;
            }
            by_known[cell] = from.0[3];
        }
    }
}

/// The last layer: features to one axis of one grid's positions, added to the membrane in `out` or put in its place.
struct Last<'a> {
    engine: &'a Engine,
    features: &'a Map,
    /// Three times the grid, and the axis.
    plane: usize,
    out: &'a mut [f32],
}

impl Kernel for Last<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let folds = &self.engine.folds;
        let (image, axis) = (self.plane / 3, self.plane % 3);
        let weights = &folds.last[axis * folds.width..][..folds.width];
        for (row, out) in self.out.chunks_mut(SIDE).enumerate() {
            for (column, out) in out.iter_mut().enumerate() {
                let mut sum = s.splat(0.0);
                for (panel, weights) in weights.chunks(LANES).enumerate() {
                    let place = self.features.index([image, panel], [row + 1, column + 1]);
                    let x = s.load(&self.features.blocks[place]);
                    sum = s.mul_add(x, s.load(&padded(weights)), sum);
                }
                let mut block = Block::ZERO;
                s.store(sum, &mut block);
                let x = (block.sum() + folds.last_bias[axis]) * OUTPUT_SCALE;
                *out = match self.engine.config.input {
                    InputKind::Membrane | InputKind::Plate => *out + x,
                    InputKind::Zeros => x,
                };
            }
        }
    }
}

/// Up to sixteen weights, zeros after them.
#[inline(always)]
fn padded(weights: &[f32]) -> Block {
    let mut block = Block::ZERO;
    block.0[..weights.len()].copy_from_slice(weights);
    block
}

/// The gradient with respect to the features before their ReLU.
pub struct LastAdjoint<'a> {
    pub engine: &'a Engine,
    pub features: &'a Map,
    pub image: usize,
    pub cotangent: &'a [f32],
    pub result: &'a mut Map,
}

impl Kernel for LastAdjoint<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let folds = &self.engine.folds;
        for panel in 0..self.features.panels {
            let weights = |axis: usize| {
                let row = &folds.last[axis * folds.width..][..folds.width];
                s.load(&padded(
                    &row[panel * LANES..folds.width.min((panel + 1) * LANES)],
                ))
            };
            let weights = [weights(0), weights(1), weights(2)];
            for row in 0..SIDE {
                let saved = self.features.row([self.image, panel], row);
                let to = self.result.row_mut([self.image, panel], row);
                for (column, (to, saved)) in to.iter_mut().zip(saved).enumerate() {
                    let mut sum = s.splat(0.0);
                    for (axis, weights) in weights.iter().enumerate() {
                        let by = self.cotangent[axis * CELLS + row * SIDE + column] * OUTPUT_SCALE;
                        sum = s.mul_add(s.splat(by), *weights, sum);
                    }
                    s.store(s.gate(sum, s.load(saved)), to);
                }
            }
        }
    }
}
