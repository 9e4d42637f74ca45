//! Shares of the grid that holes take, in training samples and in flattened scans with holes: whether the network is trained on holes like
//! those of the service.

use std::f64::consts::PI;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::cases::{EvaluationCase, extent};
use super::hole_kind::{HoleKind, SCAN_SIDE};
use crate::scarffolds::holed_scan::holed_scan;
use crate::scarffolds::sheets::SimulatedSheet;
use darn_budget::Budget;
use darn_geometry::flatten::{self, Chart, FlattenLimits};
use darn_geometry::grid::{CELLS, cell_centre};
use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
use darn_geometry::mesh::region::{BoundedMesh, Region, grow};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2};
use darn_geometry::polygon::inside;

/// Share of the grid's side that a hole should take; as in `mend`.
const HOLE_SHARE: f64 = 0.5;
/// The region is grown again when its reach is wrong by more than this factor; as in `mend`.
const REACH_TOLERANCE: f64 = 1.3;

/// Shares of a grid's cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GridShares {
    /// Unknown cells ÷ all.
    pub unknown: f64,
    /// Cells of the hole ÷ all.
    pub hole: f64,
    /// Larger side of the hole's box ÷ the grid's side.
    pub extent: f64,
    /// Unknown cells outside every hole ÷ all.
    pub outside: f64,
}

/// The shares of training samples.
pub fn of_samples(cases: &[EvaluationCase]) -> Vec<GridShares> {
    let shares = |case: &EvaluationCase| shares_of(&case.sample.known, &case.sample.hole);
    cases.iter().map(shares).collect()
}

/// The shares of grids that the service makes of scanned sheets with a hole; `None` where the hole cannot be flattened.
pub fn of_flattened(
    sheets: &[SimulatedSheet],
    kind: HoleKind,
    seed: u64,
) -> Vec<Option<GridShares>> {
    let one = |(k, sheet): (usize, &SimulatedSheet)| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(k as u64);
        let hole = kind.draw(&mut rng);
        of_mesh(&holed_scan(sheet, SCAN_SIDE, &hole, &mut rng).mesh)
    };
    sheets.iter().enumerate().map(one).collect()
}

/// The shares of the grid of the longest hole.
fn of_mesh(mesh: &TriMesh) -> Option<GridShares> {
    let topology = Topology::new(mesh);
    let loops = boundary_loops(mesh, &topology);
    let holes = loops.iter().filter(|l| l.kind == LoopKind::Hole);
    let rim = holes.max_by(|a, b| a.length.total_cmp(&b.length))?;
    let whole = BoundedMesh {
        mesh,
        topology: &topology,
        loops: &loops,
    };
    let flatten_with = |reach: f64| {
        let region = grow(&whole, rim.id, reach, Budget::unlimited()).ok()?;
        let chart =
            flatten::flatten(&region, &FlattenLimits::default(), Budget::unlimited()).ok()?;
        Some((region, chart))
    };
    let reach = reach_for(rim.length / PI);
    let mut flattened = flatten_with(reach)?;
    let wanted = reach_for(hole_extent(&flattened.0, &flattened.1));
    if (wanted < reach / REACH_TOLERANCE
        || (wanted > reach * REACH_TOLERANCE && flattened.0.reach >= reach))
        && let Some(again) = flatten_with(wanted)
    {
        flattened = again;
    }
    let (region, chart) = flattened;
    let grid = flatten::raster(&region.mesh, &chart);
    let polygon = rim_uv(&region, &chart);
    let open: Vec<bool> = (0..CELLS)
        .map(|k| !grid.known[k] && inside(&polygon, cell_centre(k)))
        .collect();
    Some(shares_of(&grid.known, &open))
}

/// Reach of a region around a hole of an extent, scene units, such that the hole takes [`HOLE_SHARE`] of the grid's side.
fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / HOLE_SHARE - 1.0)
}

fn rim_uv(region: &Region, chart: &Chart) -> Vec<Vec2> {
    region.rim.iter().map(|v| chart.uv(*v)).collect()
}

/// Larger side of the hole's box in the chart, scene units.
fn hole_extent(region: &Region, chart: &Chart) -> f64 {
    let polygon = rim_uv(region, chart);
    let first = polygon.first().copied().unwrap_or_default();
    let low = polygon.iter().fold(first, |low, uv| low.inf(uv));
    let high = polygon.iter().fold(first, |high, uv| high.sup(uv));
    (high - low).max() * chart.frame.side
}

fn shares_of(known: &[bool], hole: &[bool]) -> GridShares {
    let share =
        |of: &dyn Fn(usize) -> bool| (0..CELLS).filter(|&k| of(k)).count() as f64 / CELLS as f64;
    GridShares {
        unknown: share(&|k| !known[k]),
        hole: share(&|k| hole[k]),
        extent: extent(hole),
        outside: share(&|k| !known[k] && !hole[k]),
    }
}
