//! Prepares a hole: grows the region of cloth around it, lays the region flat, samples the grid and plans the patch.

use std::cell::Cell;
use std::time::Instant;

use crate::edit::{HoleCells, ReachLimit, RimPoint};
use crate::error::MendError;
use crate::hole::{Hole, UneditedCloths};
use crate::mender::Call;
use crate::timings::milliseconds;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted};
use darn_contract::v1;
use darn_geometry::flatten::{self, Chart, FlattenError};
use darn_geometry::grid::{self, CELLS, Grid, Normalisation};
use darn_geometry::mesh::denoise::denoise;
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::layers::layers_near;
use darn_geometry::mesh::region::{self, Region, RegionError};
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_geometry::patch::{self, PatchError, PatchMesh, PatchMetric};
use darn_geometry::polygon::{extent, inside};

/// Share of the grid's side that the hole should take, so that hole and context share the grid as in training.
const HOLE_SHARE: f64 = 0.5;
/// A region is grown again when its reach differs from the suitable one by more than this factor.
const REACH_TOLERANCE: f64 = 1.3;
/// Factor of the reach of each further try, when a region gives no usable chart.
const SHRINK: f64 = 0.6;
/// Reach of the collar that the extent of a hole is first measured on, as a share of the reach that suits a round hole.
const COLLAR: f64 = 0.2;
/// Largest mean stretch of a chart of cloth that was cut open: other surfaces that wrap around than tubes have more, and
/// a smaller region serves them better.
const TUBE_STRETCH: f64 = 1.05;
/// Tries with smaller and smaller regions.
const MAX_TRIES: usize = 4;
/// Nanoseconds of work of a grid and its plates.
const GRID_WORK: u64 = 9_000_000;
/// Nanoseconds of work a face of the scan in the search for other layers near a hole.
const LAYERS_WORK: u64 = 10;

/// Prepares the hole of a loop. Tries smaller and smaller regions when one gives no usable chart, and at last the cloth
/// with the scanner's noise.
///
/// # Errors
/// `Region`, `Flatten`, `TooLittleKnown` or `Patch`, whichever stage fails; of several tries the last one's, of the
/// denoised cloth. `Exhausted`.
pub fn prepare_hole(welded: &WeldedScan, id: u32, call: Call) -> Result<Hole, MendError> {
    let reach = reach_for(estimated_extent(welded, id, call.budget)?);
    let hole = without_noise(call.budget, |denoise| {
        let preparation = Preparation {
            welded,
            id,
            denoise,
            call,
        };
        preparation.hole(reach)
    })?;
    call.budget.hold(hole.bytes())?;
    Ok(hole)
}

/// Takes the scanner's noise off a mesh; `None` where it has none, or where the noise is to stay.
type Denoise<'a> = &'a dyn Fn(&TriMesh) -> Result<Option<TriMesh>, Exhausted>;

/// The result for the cloth without the scanner's noise; where that cannot be used, for the cloth as it was scanned.
fn without_noise<T>(
    budget: &Budget,
    attempt: impl Fn(Denoise) -> Result<T, MendError>,
) -> Result<T, MendError> {
    let noisy = Cell::new(false);
    let denoise = |mesh: &TriMesh| {
        let smooth = denoise(mesh, budget)?;
        noisy.set(noisy.get() || smooth.is_some());
        Ok(smooth)
    };
    match attempt(&denoise) {
        Err(error) if noisy.get() && may_shrink(&error) => {
            attempt(&|_| Ok(None)).map_err(|_| error)
        }
        outcome => outcome,
    }
}

/// A loop to prepare, and how.
struct Preparation<'a> {
    welded: &'a WeldedScan,
    id: u32,
    denoise: Denoise<'a>,
    call: Call<'a>,
}

/// The cloth around a hole, laid flat.
struct FlatRegion {
    region: Region,
    /// The region without the scanner's noise, where there is some.
    smooth: Option<Region>,
    chart: Chart,
    timings: v1::HoleTimings,
}

/// The grid of a hole and what is computed from it.
struct SampledGrid {
    grid: Grid,
    normal: Normalisation,
    cells: HoleCells,
    base: Option<Vec<[f32; 3]>>,
    metric: Option<PatchMetric>,
    milliseconds: f64,
}

impl Preparation<'_> {
    /// The hole, with a region of this reach or a smaller one; the reach is in scene units.
    fn hole(&self, mut reach: f64) -> Result<Hole, MendError> {
        let mut tries = 0;
        loop {
            let outcome = self.flat_region(reach).and_then(|flat| self.sampled(flat));
            tries += 1;
            match outcome {
                Err(error) if tries < MAX_TRIES && may_shrink(&error) => reach *= SHRINK,
                outcome => return outcome,
            }
        }
    }

    /// Grows and flattens the region; once more when the chart shows that the reach did not suit the hole.
    fn flat_region(&self, reach: f64) -> Result<FlatRegion, MendError> {
        let flat = self.flattened(reach)?;
        let suitable = reach_for(extent(&flat.rim_uv()) * flat.chart.frame.side);
        // A larger region only if this one ended at its reach, and not because the cloth ended or wraps around.
        let again = suitable < reach / REACH_TOLERANCE
            || (suitable > reach * REACH_TOLERANCE && flat.region.reach >= reach);
        if !again {
            return Ok(flat);
        }
        let mut again = match self.flattened(suitable) {
            Ok(again) => again,
            Err(MendError::Exhausted(exhausted)) => return Err(exhausted.into()),
            Err(_) => return Ok(flat),
        };
        again.timings.region += flat.timings.region;
        again.timings.flatten += flat.timings.flatten;
        Ok(again)
    }

    /// Grows and flattens a region of this reach. Where it wraps around a tube it is cut open, if it lies flat so.
    fn flattened(&self, reach: f64) -> Result<FlatRegion, MendError> {
        let started = Instant::now();
        let region = grown(self.welded, self.id, reach, self.call.budget);
        let grown_ms = milliseconds(started);
        let wraps = match &region {
            Ok(region) => region.wraps,
            Err(error) => matches!(error, RegionError::NotADisk { .. }),
        };
        if wraps && let Some(open) = self.cut_open(reach)? {
            return Ok(open);
        }
        self.laid_flat(region.map_err(MendError::region(self.id))?, grown_ms)
    }

    /// The region of this reach around a tube, cut open and laid flat; `None` where it does not lie flat.
    fn cut_open(&self, reach: f64) -> Result<Option<FlatRegion>, MendError> {
        let started = Instant::now();
        let (whole, rim) = (self.welded.bounded(), LoopId(self.id));
        let region = region::grow_cut_open(&whole, rim, reach, self.call.budget)
            .map_err(MendError::region(self.id))?;
        let Some(region) = region else {
            return Ok(None);
        };
        match self.laid_flat(region, milliseconds(started)) {
            Ok(flat) if flat.chart.stretch_mean <= TUBE_STRETCH => Ok(Some(flat)),
            Err(MendError::Exhausted(exhausted)) => Err(exhausted.into()),
            _ => Ok(None),
        }
    }

    /// Flattens a region that took so many milliseconds to grow.
    fn laid_flat(&self, region: Region, grown_ms: f64) -> Result<FlatRegion, MendError> {
        let hole = self.id;
        let started = Instant::now();
        let smooth = (self.denoise)(&region.mesh)?.map(|mesh| Region {
            mesh,
            ..region.clone()
        });
        let seen = smooth.as_ref().unwrap_or(&region);
        let chart = flatten::flatten(seen, &self.call.mender.limits.flatten, self.call.budget)
            .map_err(MendError::flatten(hole))?;
        let timings = v1::HoleTimings {
            region: grown_ms,
            flatten: milliseconds(started),
            ..Default::default()
        };
        Ok(FlatRegion {
            region,
            smooth,
            chart,
            timings,
        })
    }

    /// Samples the grid and plans the patch.
    fn sampled(&self, flat: FlatRegion) -> Result<Hole, MendError> {
        let (id, welded, call) = (self.id, self.welded, self.call);
        let seen = flat.smooth.as_ref().unwrap_or(&flat.region);
        let rim_uv = flat.rim_uv();
        let sample = || sample(id, seen, &flat.chart, call.budget);
        let triangulate = || {
            let started = Instant::now();
            let mesh = PatchMesh::in_scan(&welded.surface.mesh, seen, &flat.chart, call);
            mesh.map(|mesh| (mesh, milliseconds(started)))
        };
        let (sampled, mesh) = rayon::join(sample, triangulate);
        let sampled = sampled?;
        let (mesh, triangulate_ms) = mesh.map_err(MendError::patch(id))?;
        let started = Instant::now();
        let plan = (mesh.plan(seen, &flat.chart, sampled.metric.as_ref(), call))
            .and_then(|plan| match &flat.smooth {
                Some(_) => plan.with_region_at(&flat.region.mesh.positions),
                None => Ok(plan),
            })
            .map_err(MendError::patch(id))?;
        // The largest distance that cloth of the hole's extent can have from its rim.
        let beyond = 0.5 * extent(&rim_uv) * flat.chart.frame.side;
        let scan = &welded.surface.mesh;
        call.budget.spend(LAYERS_WORK * scan.faces.len() as u64)?;
        let plan = plan.with_layers(&layers_near(scan, &flat.region, beyond));
        let patch = triangulate_ms + milliseconds(started);
        let timings = v1::HoleTimings {
            raster: sampled.milliseconds,
            patch,
            ..flat.timings
        };
        let denoised = flat.smooth.is_some();
        let FlatRegion { region, chart, .. } = flat;
        let rim = region.rim.iter().map(|v| RimPoint {
            flat: chart.flat[*v as usize],
            position: region.mesh.positions[*v as usize],
        });
        let reach = ReachLimit::new(rim);
        Ok(Hole {
            id,
            plan,
            report: grid_report(&sampled, &rim_uv),
            grid: sampled.grid,
            normal: sampled.normal,
            cells: sampled.cells,
            reach,
            timings,
            base: sampled.base,
            denoised,
            rim_uv,
            unedited: UneditedCloths::default(),
            region,
            chart,
        })
    }
}

impl FlatRegion {
    /// The rim on the chart's unit square.
    fn rim_uv(&self) -> Vec<Vec2> {
        rim_uv(&self.region, &self.chart)
    }
}

fn rim_uv(region: &Region, chart: &Chart) -> Vec<Vec2> {
    region.rim.iter().map(|v| chart.uv(*v)).collect()
}

/// Samples the grid, and continues positions and metric into its unknown cells.
fn sample(
    id: u32,
    seen: &Region,
    chart: &Chart,
    budget: &Budget,
) -> Result<SampledGrid, MendError> {
    let started = Instant::now();
    let rim_uv = rim_uv(seen, chart);
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
    let mut filled = darn_net::plates(&sheets, &grid.known).unwrap_or_default();
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
        base: filled.pop(),
        metric,
        milliseconds: milliseconds(started),
    })
}

fn grid_report(sampled: &SampledGrid, rim_uv: &[Vec2]) -> v1::GridReport {
    let SampledGrid { grid, normal, .. } = sampled;
    let spacing = grid::spacing(&grid.positions, |a, b| grid.known[a] && grid.known[b]);
    v1::GridReport {
        spacing_mean: normal.scale / grid::SIDE as f64,
        spacing_variance: spacing.variance / (spacing.mean * spacing.mean),
        known: grid.known_count() as f64 / CELLS as f64,
        hole: patch::signed_area(rim_uv).abs(),
    }
}

/// The region around a loop, of this reach in scene units.
fn grown(welded: &WeldedScan, id: u32, reach: f64, budget: &Budget) -> Result<Region, RegionError> {
    region::grow(&welded.bounded(), LoopId(id), reach, budget)
}

/// Reach of the region around a hole of this extent; both in scene units.
fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / HOLE_SHARE - 1.0)
}

/// Larger side of the hole's box in a chart of a narrow collar around it; where the collar cannot be laid flat, that of
/// a round hole.
///
/// # Errors
/// `Exhausted`.
fn estimated_extent(welded: &WeldedScan, id: u32, budget: &Budget) -> Result<f64, Exhausted> {
    let round = welded.loops[id as usize].length / std::f64::consts::PI;
    let collar = match grown(welded, id, COLLAR * reach_for(round), budget) {
        Ok(collar) => collar,
        Err(RegionError::Exhausted(exhausted)) => return Err(exhausted),
        Err(_) => return Ok(round),
    };
    match flatten::hole_extent(&collar, budget) {
        Ok(extent) => Ok(extent),
        Err(FlattenError::Exhausted(exhausted)) => Err(exhausted),
        Err(_) => Ok(round),
    }
}

/// Whether a smaller region may succeed after this error.
fn may_shrink(error: &MendError) -> bool {
    match error {
        MendError::Flatten { .. } => true,
        MendError::Patch { source, .. } => *source == PatchError::RimCrosses,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::shapes::{jitter, sheet};

    #[test]
    fn the_cloth_with_its_noise_is_tried_last() {
        let clean = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let noisy = jitter(&clean, 0.3 / 30.0, 7);
        let crosses = || MendError::Patch {
            hole: 1,
            source: PatchError::RimCrosses,
        };
        let tries = Cell::new(0);
        // Fails where noise was taken off.
        let fails_if_denoised = |scan: &TriMesh| {
            tries.set(0);
            without_noise(Budget::unlimited(), |denoise| {
                tries.set(tries.get() + 1);
                match denoise(scan)? {
                    None => Ok("as scanned"),
                    Some(_) => Err(crosses()),
                }
            })
        };
        assert_eq!(fails_if_denoised(&clean).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 1);
        assert_eq!(fails_if_denoised(&noisy).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 2);
        let always_fails = |scan: &TriMesh, error: fn() -> MendError| {
            tries.set(0);
            without_noise(Budget::unlimited(), |denoise| -> Result<(), MendError> {
                tries.set(tries.get() + 1);
                denoise(scan)?;
                Err(error())
            })
        };
        assert!(always_fails(&noisy, crosses).is_err() && tries.get() == 2);
        // A second try would not help cloth that has no noise, nor after another error.
        assert!(always_fails(&clean, crosses).is_err() && tries.get() == 1);
        let other = || MendError::NonManifold { hole: 1 };
        assert!(always_fails(&noisy, other).is_err() && tries.get() == 1);
    }
}
