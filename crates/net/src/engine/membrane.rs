//! The membrane (see [`crate::fill`]) and its adjoint: a push–pull pyramid with Jacobi sweeps at every level.

use super::simd::{Kernel, Simd, TargetIsa};
use crate::fill::{NOTHING, SATURATION, SWEEPS};
use darn_geometry::grid::{CELLS, SIDE};

/// Levels of the pyramid, of sides 64 to 1.
const LEVELS: usize = SIDE.ilog2() as usize + 1;

/// Reusable buffers for the pyramid of one image.
#[derive(Debug)]
pub struct Pyramid {
    levels: Vec<Level>,
    /// By level: the planes before each sweep; empty until the first adjoint.
    history: Vec<Vec<f32>>,
    mean: Vec<f32>,
}

/// One level; planes of `side²` cells.
#[derive(Debug)]
struct Level {
    side: usize,
    sweeps: usize,
    /// Known positions times `weight`: three planes.
    values: Vec<f32>,
    /// How far a cell is known.
    weight: Vec<f32>,
    /// How far a cell follows its own value; the rest comes from its neighbours.
    share: Vec<f32>,
    /// Value ÷ weight × share: three planes.
    given: Vec<f32>,
    /// The fill, or the gradient with respect to it: three planes.
    filled: Vec<f32>,
    /// The fill after the sweep that is being computed.
    next: Vec<f32>,
    by_values: Vec<f32>,
    by_weight: Vec<f32>,
    by_share: Vec<f32>,
}

impl Default for Pyramid {
    fn default() -> Self {
        let level = |level: usize| {
            let side = SIDE >> level;
            let planes = |count: usize| vec![0.0; count * side * side];
            Level {
                side,
                sweeps: SWEEPS.get(level).copied().unwrap_or(0),
                values: planes(3),
                weight: planes(1),
                share: planes(1),
                given: planes(3),
                filled: planes(3),
                next: planes(3),
                by_values: planes(3),
                by_weight: planes(1),
                by_share: planes(1),
            }
        };
        Pyramid {
            levels: (0..LEVELS).map(level).collect(),
            history: Vec::new(),
            mean: vec![0.0; CELLS],
        }
    }
}

/// A grid whose unknown cells are to be filled.
#[derive(Clone, Copy)]
pub struct MembraneGrid<'a> {
    /// `[3, 64, 64]`.
    pub positions: &'a [f32],
    /// `[1, 64, 64]` in 0..=1.
    pub known: &'a [f32],
}

/// Receives gradients with respect to a grid; see [`MembraneGrid`] for their shapes.
pub struct MembraneGradient<'a> {
    pub by_positions: &'a mut [f32],
    pub by_known: &'a mut [f32],
}

/// Fills the unknown cells of one grid: `filled` receives `[3, 64, 64]`.
pub fn membrane(target: TargetIsa, pyramid: &mut Pyramid, grid: MembraneGrid, filled: &mut [f32]) {
    target.run(Fill { pyramid, grid });
    filled.copy_from_slice(&pyramid.levels[0].filled);
}

/// Adds the gradients of Σ cotangent · filled.
pub fn membrane_adjoint(
    target: TargetIsa,
    pyramid: &mut Pyramid,
    grid: MembraneGrid,
    cotangent: &[f32],
    by: MembraneGradient,
) {
    if pyramid.history.is_empty() {
        let size = |level: &Level| level.filled.len() * level.sweeps;
        pyramid.history = pyramid
            .levels
            .iter()
            .map(|level| vec![0.0; size(level)])
            .collect();
    }
    target.run(Adjoint {
        pyramid,
        grid,
        cotangent,
        by,
    });
}

/// [`membrane`], compiled for the target.
struct Fill<'a> {
    pyramid: &'a mut Pyramid,
    grid: MembraneGrid<'a>,
}

impl Kernel for Fill<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        self.pyramid.set_grid(self.grid);
        for level in (0..LEVELS).rev() {
            self.pyramid.start(level);
            for _ in 0..self.pyramid.levels[level].sweeps {
                self.pyramid.levels[level].sweep();
            }
        }
    }
}

/// [`membrane_adjoint`], compiled for the target. It runs the forward pass again to record its sweeps.
struct Adjoint<'a> {
    pyramid: &'a mut Pyramid,
    grid: MembraneGrid<'a>,
    cotangent: &'a [f32],
    by: MembraneGradient<'a>,
}

impl Kernel for Adjoint<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let pyramid = self.pyramid;
        pyramid.set_grid(self.grid);
        for level in (0..LEVELS).rev() {
            pyramid.start(level);
            let fine = &mut pyramid.levels[level];
            for step in pyramid.history[level].chunks_mut(fine.filled.len()) {
                step.copy_from_slice(&fine.filled);
                fine.sweep();
            }
        }
        for level in 0..LEVELS {
            pyramid.sweeps_adjoint(level, self.cotangent);
            pyramid.levels[level].shares_adjoint(level);
        }
        for level in (1..LEVELS).rev() {
            let (finer, coarser) = pyramid.levels.split_at_mut(level);
            let (finer, coarser) = (&mut finer[level - 1], &coarser[0]);
            halve_adjoint(coarser.side, &coarser.by_values, &mut finer.by_values);
            halve_adjoint(coarser.side, &coarser.by_weight, &mut finer.by_weight);
        }
        let finest = &pyramid.levels[0];
        for plane in 0..3 {
            let plane = plane * CELLS..(plane + 1) * CELLS;
            let by_values = &finest.by_values[plane.clone()];
            let positions = &self.grid.positions[plane.clone()];
            let by_positions = &mut self.by.by_positions[plane];
            for cell in 0..CELLS {
                by_positions[cell] += by_values[cell] * self.grid.known[cell];
                self.by.by_known[cell] += by_values[cell] * positions[cell];
            }
        }
        for (by, weight) in self.by.by_known.iter_mut().zip(&finest.by_weight) {
            *by += weight;
        }
    }
}

impl Pyramid {
    /// Computes values, weights, shares and given parts of all levels.
    #[inline(always)]
    fn set_grid(&mut self, grid: MembraneGrid) {
        let MembraneGrid { positions, known } = grid;
        let finest = &mut self.levels[0];
        finest.weight.copy_from_slice(known);
        for (values, positions) in finest.values.chunks_mut(CELLS).zip(positions.chunks(CELLS)) {
            for ((value, x), known) in values.iter_mut().zip(positions).zip(known) {
                *value = x * known;
            }
        }
        for level in 1..LEVELS {
            let (finer, coarser) = self.levels.split_at_mut(level);
            let (finer, coarser) = (&finer[level - 1], &mut coarser[0]);
            halve(coarser.side, &finer.values, &mut coarser.values);
            halve(coarser.side, &finer.weight, &mut coarser.weight);
        }
        for (index, level) in self.levels.iter_mut().enumerate() {
            for (share, weight) in level.share.iter_mut().zip(&level.weight) {
                *share = if index == 0 {
                    *weight
                } else {
                    (weight * SATURATION).min(1.0)
                };
            }
            let cells = level.side * level.side;
            let planes = level.given.chunks_mut(cells);
            for (given, values) in planes.zip(level.values.chunks(cells)) {
                for (i, given) in given.iter_mut().enumerate() {
                    *given = values[i] / (level.weight[i] + NOTHING) * level.share[i];
                }
            }
        }
    }

    /// A level's start: its given part, and the coarser level's fill for the rest.
    #[inline(always)]
    fn start(&mut self, level: usize) {
        let (finer, coarser) = self.levels.split_at_mut(level + 1);
        let level = &mut finer[level];
        let Some(coarser) = coarser.first() else {
            level.filled.copy_from_slice(&level.given);
            return;
        };
        double(coarser.side, &coarser.filled, &mut level.filled);
        let cells = level.side * level.side;
        for (filled, given) in level
            .filled
            .chunks_mut(cells)
            .zip(level.given.chunks(cells))
        {
            for ((filled, given), share) in filled.iter_mut().zip(given).zip(&level.share) {
                *filled = given + *filled * (1.0 - share);
            }
        }
    }

    /// Gradients with respect to a level's given part (left in `by_values`), its share, and the coarser level's fill.
    #[inline(always)]
    fn sweeps_adjoint(&mut self, level: usize, cotangent: &[f32]) {
        let (finer, coarser) = self.levels.split_at_mut(level + 1);
        let fine = &mut finer[level];
        let cells = fine.side * fine.side;
        if level == 0 {
            fine.filled.copy_from_slice(cotangent);
        }
        fine.by_values.copy_from_slice(&fine.filled);
        fine.by_share.fill(0.0);
        let size = fine.filled.len();
        let mean = &mut self.mean[..cells];
        for sweep in (0..fine.sweeps).rev() {
            let before = &self.history[level][sweep * size..][..size];
            for (plane, before) in before.chunks(cells).enumerate() {
                let gradient = &mut fine.filled[plane * cells..][..cells];
                neighbours(fine.side, before, mean);
                for i in 0..cells {
                    fine.by_share[i] -= gradient[i] * mean[i];
                    gradient[i] *= 1.0 - fine.share[i];
                }
                // The mean of neighbours is self-adjoint.
                neighbours(fine.side, gradient, mean);
                gradient.copy_from_slice(mean);
                let by_given = &mut fine.by_values[plane * cells..][..cells];
                for (by, x) in by_given.iter_mut().zip(gradient) {
                    *by += *x;
                }
            }
        }
        let Some(coarser) = coarser.first_mut() else {
            return;
        };
        double(coarser.side, &coarser.filled, &mut fine.next);
        for plane in 0..3 {
            for i in 0..cells {
                let at = plane * cells + i;
                fine.by_share[i] -= fine.filled[at] * fine.next[at];
                fine.filled[at] *= 1.0 - fine.share[i];
            }
        }
        coarser.filled.fill(0.0);
        double_adjoint(coarser.side, &fine.filled, &mut coarser.filled);
    }
}

impl Level {
    /// One Jacobi sweep over the three planes.
    #[inline(always)]
    fn sweep(&mut self) {
        let cells = self.side * self.side;
        for plane in 0..3 {
            let plane = plane * cells..(plane + 1) * cells;
            let next = &mut self.next[plane.clone()];
            neighbours(self.side, &self.filled[plane.clone()], next);
            for ((next, given), share) in next.iter_mut().zip(&self.given[plane]).zip(&self.share) {
                *next = given + *next * (1.0 - share);
            }
        }
        std::mem::swap(&mut self.filled, &mut self.next);
    }

    /// Turns the gradients with respect to the given part (in `by_values`) and the share into those with respect to values and weight.
    #[inline(always)]
    fn shares_adjoint(&mut self, level: usize) {
        let cells = self.side * self.side;
        for i in 0..cells {
            let inverse = 1.0 / (self.weight[i] + NOTHING);
            let (mut by_weight, mut by_share) = (0.0, self.by_share[i]);
            for plane in 0..3 {
                let at = plane * cells + i;
                let (by_given, value) = (self.by_values[at], self.values[at]);
                by_share += by_given * value * inverse;
                by_weight -= by_given * value * inverse * inverse * self.share[i];
                self.by_values[at] = by_given * inverse * self.share[i];
            }
            by_weight += match level {
                0 => by_share,
                // Exactly at saturation the slope is the left one, as in burn.
                _ if self.weight[i] * SATURATION <= 1.0 => by_share * SATURATION,
                _ => 0.0,
            };
            self.by_weight[i] = by_weight;
        }
    }
}

/// Mean of the four neighbours of every cell; outside the border the cell itself counts instead.
#[inline(always)]
fn neighbours(side: usize, x: &[f32], mean: &mut [f32]) {
    for (j, to) in mean.chunks_mut(side).enumerate() {
        let row = |j: usize| &x[j * side..(j + 1) * side];
        let (above, here, below) = (row(j.saturating_sub(1)), row(j), row((j + 1).min(side - 1)));
        let last = side - 1;
        let cell = |i: usize, left: usize, right: usize| {
            0.25 * ((above[i] + below[i]) + (here[left] + here[right]))
        };
        to[0] = cell(0, 0, 1);
        to[last] = cell(last, last - 1, last);
        let inner = to[1..last].iter_mut().zip(here.windows(3));
        for ((to, here), (above, below)) in inner.zip(above[1..].iter().zip(&below[1..])) {
            *to = 0.25 * ((above + below) + (here[0] + here[2]));
        }
    }
}

/// Means of 2×2 cells, from planes of (2 · `side`)² to planes of `side²`.
#[inline(always)]
fn halve(side: usize, fine: &[f32], coarse: &mut [f32]) {
    for (two, to) in fine.chunks(4 * side).zip(coarse.chunks_mut(side)) {
        let (upper, lower) = two.split_at(2 * side);
        for (i, to) in to.iter_mut().enumerate() {
            *to = 0.25 * ((upper[2 * i] + upper[2 * i + 1]) + (lower[2 * i] + lower[2 * i + 1]));
        }
    }
}

/// Adds the adjoint of [`halve`].
#[inline(always)]
fn halve_adjoint(side: usize, coarse: &[f32], fine: &mut [f32]) {
    for (two, from) in fine.chunks_mut(4 * side).zip(coarse.chunks(side)) {
        for row in two.chunks_mut(2 * side) {
            for (pair, from) in row.chunks_mut(2).zip(from) {
                pair[0] += 0.25 * from;
                pair[1] += 0.25 * from;
            }
        }
    }
}

/// The farther of the two coarse cells that a fine cell is interpolated from along one axis. The nearer one is `fine / 2`, with weight ¾.
#[inline(always)]
fn farther(side: usize, fine: usize) -> usize {
    match fine % 2 {
        0 => (fine / 2).saturating_sub(1),
        _ => (fine / 2 + 1).min(side - 1),
    }
}

/// Bilinear interpolation of planes of `side²` to twice the side.
#[inline(always)]
fn double(side: usize, coarse: &[f32], fine: &mut [f32]) {
    let planes = coarse.chunks(side * side);
    for (coarse, fine) in planes.zip(fine.chunks_mut(4 * side * side)) {
        for (j, to) in fine.chunks_mut(2 * side).enumerate() {
            let (near, far) = (&coarse[j / 2 * side..], &coarse[farther(side, j) * side..]);
            let mut across = [0.0; SIDE];
            for i in 0..side {
                across[i] = 0.75 * near[i] + 0.25 * far[i];
            }
            for (i, to) in to.iter_mut().enumerate() {
                *to = 0.75 * across[i / 2] + 0.25 * across[farther(side, i)];
            }
        }
    }
}

/// Adds the adjoint of [`double`].
#[inline(always)]
fn double_adjoint(side: usize, fine: &[f32], coarse: &mut [f32]) {
    let planes = coarse.chunks_mut(side * side);
    for (coarse, fine) in planes.zip(fine.chunks(4 * side * side)) {
        for (j, from) in fine.chunks(2 * side).enumerate() {
            let mut across = [0.0; SIDE];
            for (i, pair) in from.chunks(2).enumerate() {
                across[i] += 0.75 * (pair[0] + pair[1]);
                across[farther(side, 2 * i)] += 0.25 * pair[0];
                across[farther(side, 2 * i + 1)] += 0.25 * pair[1];
            }
            let far = farther(side, j) * side;
            for i in 0..side {
                coarse[j / 2 * side + i] += 0.75 * across[i];
                coarse[far + i] += 0.25 * across[i];
            }
        }
    }
}
