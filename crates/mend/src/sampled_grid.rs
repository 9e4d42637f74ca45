//! The grid of a hole: the cloth around it sampled on the chart, and what is computed from that.

use std::time::Instant;

use crate::edit::HoleCells;
use crate::error::MendError;
use crate::flat_region::FlatRegion;
use crate::timings::milliseconds;
use darn_budget::Budget;
use darn_contract::v1;
use darn_geometry::flatten::{self, Chart};
use darn_geometry::grid::{self, CELLS, Grid, Normalisation};
use darn_geometry::mesh::region::Region;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::{self, PatchMetric};
use darn_geometry::polygon::inside;

/// Nanoseconds of work of a grid and its plates.
const GRID_WORK: u64 = 9_000_000;

/// The grid of a hole and what is computed from it.
pub struct SampledGrid {
    /// The grid.
    pub grid: Grid,
    /// Converts between scene space and the network's units.
    pub normal: Normalisation,
    /// The grid's cells that lie in the hole.
    pub cells: HoleCells,
    /// Cells from one to the next where smooth fills are solved.
    pub step: usize,
    /// A smooth fill of the grid, network's units.
    pub base: Option<Vec<[f32; 3]>>,
    /// The lengths that cloth in the hole should have.
    pub metric: Option<PatchMetric>,
    /// Milliseconds that sampling took.
    pub milliseconds: f64,
}

impl SampledGrid {
    /// Samples the grid, and continues positions and metric into its unknown cells.
    ///
    /// # Errors
    /// `TooLittleKnown`; `Exhausted`.
    pub fn of(id: u32, flat: &FlatRegion, budget: &Budget) -> Result<SampledGrid, MendError> {
        let started = Instant::now();
        let (seen, chart) = (flat.seen(), &flat.chart);
        let rim_uv = flat.rim_uv();
        budget.spend(GRID_WORK)?;
        let grid = flatten::raster(&seen.mesh, chart);
        let normal = grid.normalisation().ok_or(MendError::TooLittleKnown {
            hole: id,
            known: grid.known_count(),
        })?;
        let cells = HoleCells::new(|k| !grid.known[k] && inside(&rim_uv, grid::cell_centre(k)));
        let strained = patch::log_stretch(seen, chart);
        let strained: Vec<[f32; 3]> = strained.iter().map(|s| s.cast::<f32>().into()).collect();
        let sheets = [&grid.normalised(&normal).positions[..], &strained];
        let step = step(seen, chart);
        let mut filled = darn_net::plates(&sheets, &grid.known, step).unwrap_or_default();
        let metric = (filled.len() == sheets.len())
            .then(|| filled.pop())
            .flatten();
        let metric = metric.map(|cells| {
            let wide = cells.iter().map(|s| Vec3::from(s.map(f64::from)));
            PatchMetric::of_log_stretch(wide.collect())
        });
        Ok(SampledGrid {
            grid,
            normal,
            cells,
            step,
            base: filled.pop(),
            metric,
            milliseconds: milliseconds(started),
        })
    }

    /// The grid in the contract's words; `rim_uv` is the hole's rim on it.
    pub fn report(&self, rim_uv: &[Vec2]) -> v1::GridReport {
        let SampledGrid { grid, normal, .. } = self;
        let spacing = grid::spacing(&grid.positions, |a, b| grid.known[a] && grid.known[b]);
        v1::GridReport {
            spacing_mean: normal.scale / grid::SIDE as f64,
            spacing_variance: spacing.variance / (spacing.mean * spacing.mean),
            known: grid.known_count() as f64 / CELLS as f64,
            hole: patch::signed_area(rim_uv).abs(),
        }
    }
}

/// The largest step of smooth fills that is no longer than the scan's edges: the cloth has no finer shape.
fn step(region: &Region, chart: &Chart) -> usize {
    let edge = patch::median_edge(region, chart) * grid::SIDE as f64 / chart.frame.side;
    let shorter = |step: &usize| *step as f64 <= edge;
    [8, 4, 2].into_iter().find(shorter).unwrap_or(1)
}
