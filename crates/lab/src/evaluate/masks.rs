//! Whether the network trains on holes like those it will see: shares of the grid in training samples and in flattened, holed sheets.

use std::f64::consts::PI;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::cases::{Case, extent};
use crate::scarffolds::scanned::{Hole, scanned};
use crate::scarffolds::sheets::Sheet;
use darn_geometry::flatten::{self, Chart, FlattenLimits};
use darn_geometry::grid::{CELLS, cell_centre};
use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
use darn_geometry::mesh::region::{Region, grow};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2};
use darn_geometry::polygon::inside;

/// How much of the grid's side the service lets a hole take, and when it tries again; as in `mend`.
const SHARE: f64 = 0.5;
const OFF: f64 = 1.3;
/// Vertices along a side of the scanned sheet, as in the quality checks.
pub(super) const SCANNED: usize = 67;

/// What a grid's unknown cells come to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shares {
    /// Unknown cells ÷ all.
    pub unknown: f64,
    /// Cells of the hole ÷ all.
    pub hole: f64,
    /// Larger side of the hole's box ÷ the grid's side.
    pub extent: f64,
    /// Unknown cells outside every hole ÷ all.
    pub outside: f64,
}

/// How the holes of [`of_flattened`] are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// A disk.
    Circle,
    /// A ragged blob.
    Blob,
    /// A long tear.
    Slit,
}

impl Cut {
    /// All of them.
    pub const ALL: [Cut; 3] = [Cut::Circle, Cut::Blob, Cut::Slit];

    /// A hole of the sizes that the quality checks cut.
    pub(super) fn drawn(self, rng: &mut impl Rng) -> Hole {
        let centre = Vec2::new(rng.random_range(0.38..0.62), rng.random_range(0.38..0.62));
        match self {
            Cut::Circle => Hole::Circle {
                centre,
                radius: rng.random_range(0.10..0.22),
            },
            Cut::Blob => Hole::Blob {
                centre,
                radius: rng.random_range(0.10..0.20),
            },
            Cut::Slit => Hole::Slit {
                centre,
                length: rng.random_range(0.18..0.28),
                width: rng.random_range(0.03..0.06),
                angle: rng.random_range(0.0..PI),
            },
        }
    }
}

/// Shares of training samples, as the sampler draws them.
pub fn of_samples(cases: &[Case]) -> Vec<Shares> {
    let shares = |case: &Case| shares_of(&case.sample.known, &case.sample.hole);
    cases.iter().map(shares).collect()
}

/// Shares of grids as the service makes them, from sheets scanned and cut; `None` for a cut that leaves no hole that flattens.
pub fn of_flattened(sheets: &[Sheet], cut: Cut, seed: u64) -> Vec<Option<Shares>> {
    let one = |(k, sheet): (usize, &Sheet)| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(k as u64);
        let hole = cut.drawn(&mut rng);
        flattened(&scanned(sheet, SCANNED, &hole, &mut rng).mesh)
    };
    sheets.iter().enumerate().map(one).collect()
}

fn flattened(mesh: &TriMesh) -> Option<Shares> {
    let topology = Topology::new(mesh);
    let loops = boundary_loops(mesh, &topology);
    let holes = loops.iter().filter(|l| l.kind == LoopKind::Hole);
    let rim = holes.max_by(|a, b| a.length.total_cmp(&b.length))?;
    let lay = |reach: f64| {
        let region = grow(mesh, &topology, &loops, rim.id as usize, reach).ok()?;
        let chart = flatten::flatten(&region, &FlattenLimits::default()).ok()?;
        Some((region, chart))
    };
    let reach = reach_for(rim.length / PI);
    let mut laid = lay(reach)?;
    let wanted = reach_for(hole_extent(&laid.0, &laid.1));
    if (wanted < reach / OFF || (wanted > reach * OFF && laid.0.reach >= reach))
        && let Some(again) = lay(wanted)
    {
        laid = again;
    }
    let (region, chart) = laid;
    let grid = flatten::raster(&region.mesh, &chart);
    let polygon = rim_uv(&region, &chart);
    let open: Vec<bool> = (0..CELLS)
        .map(|k| !grid.known[k] && inside(&polygon, cell_centre(k)))
        .collect();
    Some(shares_of(&grid.known, &open))
}

fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / SHARE - 1.0)
}

fn rim_uv(region: &Region, chart: &Chart) -> Vec<Vec2> {
    region.rim.iter().map(|v| chart.uv(*v)).collect()
}

/// Larger side of the hole's box in the chart, scene units.
fn hole_extent(region: &Region, chart: &Chart) -> f64 {
    let polygon = rim_uv(region, chart);
    let first = polygon.first().copied().unwrap_or_default();
    let bounds = |(low, high): (Vec2, Vec2), uv: &Vec2| (low.inf(uv), high.sup(uv));
    let (low, high) = polygon.iter().fold((first, first), bounds);
    (high - low).max() * chart.frame.side
}

fn shares_of(known: &[bool], hole: &[bool]) -> Shares {
    let share =
        |of: &dyn Fn(usize) -> bool| (0..CELLS).filter(|&k| of(k)).count() as f64 / CELLS as f64;
    Shares {
        unknown: share(&|k| !known[k]),
        hole: share(&|k| hole[k]),
        extent: extent(hole),
        outside: share(&|k| !known[k] && !hole[k]),
    }
}
