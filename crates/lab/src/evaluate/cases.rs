//! Held-out cases: samples without noise, with the shape and size of their holes; noise is added on request.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::scarffolds::masks::MaskShape;
use crate::scarffolds::samples::{CellSpan, Sampler, TrainingSample, spans};
use darn_geometry::grid::{CELLS, Grid, SIDE};
use darn_geometry::mesh::Vec3;

/// Size of a hole: the longer side of its bounding box, as a share of the grid's side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HoleSize {
    /// Below 0.4.
    Small,
    /// From 0.4.
    Middle,
    /// From 0.55.
    Large,
    /// From 0.7.
    Huge,
}

impl HoleSize {
    /// All sizes, ascending.
    pub const ALL: [HoleSize; 4] = [
        HoleSize::Small,
        HoleSize::Middle,
        HoleSize::Large,
        HoleSize::Huge,
    ];

    /// The size of an extent, a share of the grid's side.
    pub fn of(extent: f64) -> HoleSize {
        match extent {
            x if x < 0.4 => HoleSize::Small,
            x if x < 0.55 => HoleSize::Middle,
            x if x < 0.7 => HoleSize::Large,
            _ => HoleSize::Huge,
        }
    }

    /// Its limits, for tables.
    pub fn name(self) -> &'static str {
        match self {
            HoleSize::Small => "extent < 0.40",
            HoleSize::Middle => "extent 0.40-0.55",
            HoleSize::Large => "extent 0.55-0.70",
            HoleSize::Huge => "extent > 0.70",
        }
    }
}

/// A sample without noise, and its hole.
#[derive(Debug, Clone)]
pub struct EvaluationCase {
    /// The sample; the truth is in the network's units.
    pub sample: TrainingSample,
    /// Shape of its first hole.
    pub shape: MaskShape,
    /// Size of its holes.
    pub size: HoleSize,
}

/// The first `count` cases of a seed. Case `k` is cut from sheet `k` modulo the number of sheets and depends on the seed and `k` only.
pub fn draw(sampler: &Sampler, count: usize, seed: u64) -> Vec<EvaluationCase> {
    (0..count)
        .map(|k| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(k as u64);
            let (shape, sample) = sampler.clean_sample_of(k % sampler.sheets(), &mut rng);
            let size = HoleSize::of(extent(&sample.hole));
            EvaluationCase {
                sample,
                shape,
                size,
            }
        })
        .collect()
}

/// The longer side of a mask's bounding box, as a share of the grid's side.
pub(super) fn extent(mask: &[bool]) -> f64 {
    let sides = spans(mask).map(CellSpan::length);
    sides[0].max(sides[1]) as f64 / SIDE as f64
}

impl EvaluationCase {
    /// The case as a scan would show it: known cells with Gaussian noise of `sigma` cells on every coordinate, drawn from `seed`.
    pub fn observed(&self, sigma: f64, seed: u64) -> Grid {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut grid = Grid::unknown();
        for k in (0..CELLS).filter(|&k| self.sample.known[k]) {
            let noise = Vec3::from_fn(|_, _| gaussian(&mut rng)) * (sigma / SIDE as f64);
            grid.known[k] = true;
            grid.positions[k] = self.truth(k) + noise;
        }
        grid
    }

    /// True position of a cell.
    pub fn truth(&self, cell: usize) -> Vec3 {
        Vec3::from(self.sample.truth[cell].map(f64::from))
    }

    /// The observed positions, with the truth in the hole.
    pub fn answer(&self, observed: &Grid) -> Vec<Vec3> {
        let at = |k: usize| {
            if self.sample.hole[k] {
                self.truth(k)
            } else {
                observed.positions[k]
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
