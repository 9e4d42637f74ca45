//! Held-out cases: clean samples with the shape and size of their holes, and noise for those who want it.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::scarffolds::masks::Shape;
use crate::scarffolds::samples::{Sample, Sampler, bounds};
use darn_geometry::grid::{CELLS, Grid, SIDE};
use darn_geometry::mesh::Vec3;

/// How large a hole is: the larger side of its box, as a share of the grid's side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// Below 0.4.
    Small,
    /// From 0.4.
    Middle,
    /// From 0.55.
    Large,
    /// From 0.7.
    Huge,
}

impl Size {
    /// All sizes, ascending.
    pub const ALL: [Size; 4] = [Size::Small, Size::Middle, Size::Large, Size::Huge];

    /// The size of a share.
    pub fn of(extent: f64) -> Size {
        match extent {
            x if x < 0.4 => Size::Small,
            x if x < 0.55 => Size::Middle,
            x if x < 0.7 => Size::Large,
            _ => Size::Huge,
        }
    }

    /// Its bounds, for a table.
    pub fn name(self) -> &'static str {
        match self {
            Size::Small => "extent < 0.40",
            Size::Middle => "extent 0.40-0.55",
            Size::Large => "extent 0.55-0.70",
            Size::Huge => "extent > 0.70",
        }
    }
}

/// A clean sample and what its hole is like.
#[derive(Debug, Clone)]
pub struct Case {
    /// The sample; truth in the network's units, without noise.
    pub sample: Sample,
    /// Shape of its first hole.
    pub shape: Shape,
    /// Its size.
    pub size: Size,
}

/// The first `count` cases of a seed: case `k` is cut from sheet `k` modulo their number and depends on nothing but the seed and `k`.
pub fn draw(sampler: &Sampler, count: usize, seed: u64) -> Vec<Case> {
    (0..count)
        .map(|k| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(k as u64);
            let (shape, sample) = sampler.clean_sample_of(k % sampler.sheets(), &mut rng);
            let size = Size::of(extent(&sample.hole));
            Case {
                sample,
                shape,
                size,
            }
        })
        .collect()
}

/// Larger side of a mask's box, as a share of the grid's side.
pub(super) fn extent(mask: &[bool]) -> f64 {
    let sides = bounds(mask).map(|[first, last]| (last + 1).saturating_sub(first));
    sides[0].max(sides[1]) as f64 / SIDE as f64
}

impl Case {
    /// The case as a scan would give it: known cells with Gaussian noise of `sigma` cells on every coordinate, drawn from `seed`.
    pub fn seen(&self, sigma: f64, seed: u64) -> Grid {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut grid = Grid::unknown();
        for k in (0..CELLS).filter(|&k| self.sample.known[k]) {
            let noise = Vec3::from_fn(|_, _| gaussian(&mut rng)) * (sigma / SIDE as f64);
            grid.known[k] = true;
            grid.positions[k] = self.truth(k) + noise;
        }
        grid
    }

    /// Where a cell is.
    pub fn truth(&self, cell: usize) -> Vec3 {
        Vec3::from(self.sample.truth[cell].map(f64::from))
    }

    /// Everything known, with the truth in the hole.
    pub fn answer(&self, seen: &Grid) -> Vec<Vec3> {
        let at = |k: usize| {
            if self.sample.hole[k] {
                self.truth(k)
            } else {
                seen.positions[k]
            }
        };
        (0..CELLS).map(at).collect()
    }
}

/// A standard normal number (Box–Muller).
pub(super) fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
