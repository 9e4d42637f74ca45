//! What of a hole does not depend on constraints: region, chart, grid, plan of the patch; and its cloth as it is without any.

use std::cell::Cell;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::cloth::Cloth;
use super::inpainter::{Inpainter, Voice};
use super::{MendError, MendLimits, milliseconds};
use crate::edit::{HoleCells, Reach};
use darn_contract::v1;
use darn_geometry::flatten::{self, Chart};
use darn_geometry::grid::{self, CELLS, Grid, NormalGrid, Normalisation};
use darn_geometry::mesh::denoise::denoise;
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::layers::layers_near;
use darn_geometry::mesh::region::{self, Region};
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_geometry::patch::{self, Patch, PatchError, PatchPlan};
use darn_net::Averaging;

/// How much of the grid's side the hole should take, so that hole and context share it as in training.
const SHARE: f64 = 0.5;
/// A region is grown again when its reach is off by more than this factor.
const OFF: f64 = 1.3;
/// Reach of each further try, when a region gives no usable chart.
const SMALLER: f64 = 0.6;
/// Reach of the collar that the extent of a hole is first read off, as a share of what suits a round one.
const COLLAR: f64 = 0.2;
/// Tries with smaller and smaller regions.
const TRIES: usize = 4;
/// Unedited fills that are kept, one for each network and up direction; a session rarely asks for a second.
const VOICES: usize = 4;

/// A hole ready to be filled.
pub struct Prepared {
    /// The loop's id.
    pub id: u32,
    /// The cloth around it.
    pub region: Region,
    /// The same laid flat.
    pub chart: Chart,
    /// How it will be meshed.
    pub plan: PatchPlan,
    /// What the grid knows of the scan.
    pub grid: Grid,
    /// Brings the grid to the network's units and back.
    pub normal: Normalisation,
    /// The grid's cells that are in the hole.
    pub cells: HoleCells,
    /// What holds the cloth in it.
    pub reach: Reach,
    /// The grid in numbers.
    pub report: v1::GridReport,
    /// Milliseconds of preparing it.
    pub timings: v1::HoleTimings,
    /// A smooth fill of the grid, network's units.
    base: Option<Vec<[f32; 3]>>,
    /// Whether the scanner's noise was taken off the cloth that the network saw.
    pub denoised: bool,
    polygon: Vec<Vec2>,
    unedited: Mutex<Vec<(Voice, Arc<Unedited>)>>,
}

/// A hole's cloth without constraints.
pub struct Unedited {
    /// The network's answer for every cell, scene space.
    pub predicted: Vec<Vec3>,
    /// The scan's positions where they are known, the network's elsewhere.
    pub filled: Vec<Vec3>,
    /// The patch made of it.
    pub patch: Patch,
    /// Milliseconds of the network.
    pub net_ms: f64,
    /// Milliseconds of meshing.
    pub patch_ms: f64,
}

impl Prepared {
    /// Prepares a hole; with smaller and smaller regions when one gives no usable chart, and at last with the scanner's noise.
    pub fn new(cloth: &Cloth, id: u32, limits: &MendLimits) -> Result<Prepared, MendError> {
        let reach = reach_for(extent_at_a_glance(cloth, id));
        without_noise(|smoothed| Self::within((reach, smoothed), cloth, id, limits))
    }

    fn within(
        (mut reach, smoothed): (f64, Smoothing),
        cloth: &Cloth,
        id: u32,
        limits: &MendLimits,
    ) -> Result<Prepared, MendError> {
        let mut tries = 0;
        loop {
            let outcome = Laid::out(cloth, id, (reach, smoothed), limits)
                .and_then(|laid| laid.sampled(cloth, id, limits));
            tries += 1;
            match outcome {
                Err(error) if tries < TRIES && may_shrink(&error) => reach *= SMALLER,
                outcome => return outcome,
            }
        }
    }

    /// The grid as the network takes it, without anchors.
    pub fn normal_grid(&self) -> NormalGrid {
        NormalGrid {
            base: self.base.clone(),
            ..self.grid.normalised(&self.normal)
        }
    }

    /// Whether a uv lies in the hole.
    pub fn holds(&self, uv: Vec2) -> bool {
        inside(&self.polygon, uv)
    }

    /// Larger side of the hole's box in the chart, scene units.
    pub fn extent(&self) -> f64 {
        extent(&self.polygon) * self.chart.frame.side
    }

    /// Scene units per cell.
    pub fn cell(&self) -> f64 {
        self.normal.scale / grid::SIDE as f64
    }

    /// The hole's cloth without constraints; made when it is first asked for.
    pub fn unedited(
        &self,
        inpainter: &Inpainter,
        limits: &MendLimits,
    ) -> Result<Arc<Unedited>, MendError> {
        // Nothing that is done under the lock can panic half-way.
        let lock = || self.unedited.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = lock()
            .iter()
            .find(|(voice, _)| voice == inpainter.voice())
            .map(|(_, u)| Arc::clone(u));
        if let Some(kept) = kept {
            return Ok(kept);
        }
        let made = Arc::new(self.fill(inpainter, limits)?);
        let mut all = lock();
        if all.len() >= VOICES {
            all.remove(0);
        }
        all.push((inpainter.voice().clone(), Arc::clone(&made)));
        Ok(made)
    }

    fn fill(&self, inpainter: &Inpainter, limits: &MendLimits) -> Result<Unedited, MendError> {
        let started = Instant::now();
        let answers =
            inpainter.fill(std::slice::from_ref(&self.normal_grid()), Averaging::Flips)?;
        let predicted = self.in_scene(answers.first().map_or(&[], Vec::as_slice));
        let net_ms = milliseconds(started);
        let started = Instant::now();
        let filled = self.filled(&predicted);
        let patch = self.patch(&filled, &[], limits)?;
        Ok(Unedited {
            predicted,
            filled,
            patch,
            net_ms,
            patch_ms: milliseconds(started),
        })
    }

    /// A network's answer in scene space; all cells.
    pub fn in_scene(&self, answer: &[[f32; 3]]) -> Vec<Vec3> {
        let mut positions: Vec<Vec3> = answer.iter().map(|q| self.normal.to_scene(q)).collect();
        positions.resize(CELLS, self.normal.centre);
        positions
    }

    /// The scan's positions where they are known, `imagined` ones elsewhere.
    pub fn filled(&self, imagined: &[Vec3]) -> Vec<Vec3> {
        let each = self.grid.positions.iter().zip(&self.grid.known);
        each.zip(imagined)
            .map(|((own, known), new)| if *known { *own } else { *new })
            .collect()
    }

    /// Meshes a filled grid.
    pub fn patch(
        &self,
        filled: &[Vec3],
        pulls: &[patch::Pull],
        limits: &MendLimits,
    ) -> Result<Patch, MendError> {
        self.plan
            .patch(&self.chart, filled, pulls, &limits.patch)
            .map_err(|source| MendError::Patch {
                hole: self.id,
                source,
            })
    }

    /// Bytes of memory it holds, about.
    pub fn bytes(&self) -> usize {
        let mesh = |m: &TriMesh| 24 * m.positions.len() + 12 * m.faces.len();
        let region = mesh(&self.region.mesh)
            + 4 * (self.region.vertices.len() + self.region.faces.len())
            + 16 * self.chart.flat.len();
        // Known flag, position, place among the hole's cells, base.
        let grid = CELLS * (24 + 1 + 9 + 12);
        let lock = self.unedited.lock().unwrap_or_else(PoisonError::into_inner);
        let each = |u: &Arc<Unedited>| {
            2 * 24 * CELLS + 40 * u.patch.positions.len() + 12 * u.patch.faces.len()
        };
        region + grid + self.plan.bytes() + lock.iter().map(|(_, u)| each(u)).sum::<usize>()
    }
}

/// A mesh without the scanner's noise; none where it has none.
type Smoothing<'a> = &'a dyn Fn(&TriMesh) -> Option<TriMesh>;

/// What comes of cloth without the scanner's noise; where that cannot be used, of the cloth as it was scanned.
fn without_noise<T>(attempt: impl Fn(Smoothing) -> Result<T, MendError>) -> Result<T, MendError> {
    let noisy = Cell::new(false);
    let smoothed = |mesh: &TriMesh| {
        let smooth = denoise(mesh);
        noisy.set(noisy.get() || smooth.is_some());
        smooth
    };
    match attempt(&smoothed) {
        Err(error) if noisy.get() && may_shrink(&error) => attempt(&|_| None).map_err(|_| error),
        outcome => outcome,
    }
}

/// Cloth around a hole, laid flat.
struct Laid {
    region: Region,
    /// The region without the scanner's noise, where there is some.
    smooth: Option<Region>,
    chart: Chart,
    timings: v1::HoleTimings,
}

impl Laid {
    /// Grows and flattens the region; once more when the chart shows that the reach did not suit the hole.
    fn out(
        cloth: &Cloth,
        hole: u32,
        (reach, smoothed): (f64, Smoothing),
        limits: &MendLimits,
    ) -> Result<Laid, MendError> {
        let laid = Self::with_reach(cloth, hole, (reach, smoothed), limits)?;
        let wanted = reach_for(extent(&laid.rim_uv()) * laid.chart.frame.side);
        // Only outwards if the region stopped because it was asked to, not because the cloth ended or wraps around.
        let off = wanted < reach / OFF || (wanted > reach * OFF && laid.region.reach >= reach);
        if !off {
            return Ok(laid);
        }
        let mut again = match Self::with_reach(cloth, hole, (wanted, smoothed), limits) {
            Ok(again) => again,
            Err(_) => return Ok(laid),
        };
        again.timings.region += laid.timings.region;
        again.timings.flatten += laid.timings.flatten;
        Ok(again)
    }

    fn with_reach(
        cloth: &Cloth,
        hole: u32,
        (reach, smoothed): (f64, Smoothing),
        limits: &MendLimits,
    ) -> Result<Laid, MendError> {
        let started = Instant::now();
        let region = region::grow(
            &cloth.welded.mesh,
            &cloth.topology,
            &cloth.loops,
            LoopId(hole),
            reach,
        )
        .map_err(|source| MendError::Region { hole, source })?;
        let grown = milliseconds(started);
        let started = Instant::now();
        let smooth = smoothed(&region.mesh).map(|mesh| Region {
            mesh,
            ..region.clone()
        });
        let seen = smooth.as_ref().unwrap_or(&region);
        let chart = flatten::flatten(seen, &limits.flatten)
            .map_err(|source| MendError::Flatten { hole, source })?;
        let timings = v1::HoleTimings {
            region: grown,
            flatten: milliseconds(started),
            ..Default::default()
        };
        Ok(Laid {
            region,
            smooth,
            chart,
            timings,
        })
    }

    /// The rim as a polygon in uv.
    fn rim_uv(&self) -> Vec<Vec2> {
        let uv = |v: &u32| self.chart.uv(*v);
        self.region.rim.iter().map(uv).collect()
    }

    /// Samples the grid and plans the patch.
    fn sampled(self, cloth: &Cloth, id: u32, limits: &MendLimits) -> Result<Prepared, MendError> {
        let seen = self.smooth.as_ref().unwrap_or(&self.region);
        let polygon = self.rim_uv();
        let sample = || {
            let started = Instant::now();
            let grid = flatten::raster(&seen.mesh, &self.chart);
            let normal = grid.normalisation().ok_or(MendError::TooLittleKnown {
                hole: id,
                known: grid.known_count(),
            })?;
            let cells =
                HoleCells::new(|k| !grid.known[k] && inside(&polygon, grid::cell_centre(k)));
            let base = darn_net::plate(&grid.normalised(&normal).positions, &grid.known);
            Ok::<_, MendError>((grid, normal, cells, base, milliseconds(started)))
        };
        let plan = || {
            let started = Instant::now();
            // As far as cloth of the hole's extent can be from its rim.
            let beyond = 0.5 * extent(&polygon) * self.chart.frame.side;
            let others = layers_near(&cloth.welded.mesh, &self.region, beyond);
            let plan = patch::plan_in(&cloth.welded.mesh, seen, &self.chart, &limits.patch)
                .and_then(|plan| match &self.smooth {
                    Some(_) => plan.with_region_at(&self.region.mesh.positions),
                    None => Ok(plan),
                })
                .map_err(|source| MendError::Patch { hole: id, source })?;
            Ok::<_, MendError>((plan.with_layers(&others), milliseconds(started)))
        };
        let (sampled, planned) = rayon::join(sample, plan);
        let (grid, normal, cells, base, raster) = sampled?;
        let (plan, patch) = planned?;
        let report = grid_report(&grid, &normal, &polygon);
        let timings = v1::HoleTimings {
            raster,
            patch,
            ..self.timings
        };
        let denoised = self.smooth.is_some();
        let Laid { region, chart, .. } = self;
        let rim = region.rim.iter().map(|v| {
            let at = *v as usize;
            (chart.flat[at], region.mesh.positions[at])
        });
        let reach = Reach::new(rim);
        Ok(Prepared {
            id,
            plan,
            grid,
            normal,
            cells,
            reach,
            report,
            timings,
            base,
            denoised,
            polygon,
            unedited: Mutex::default(),
            region,
            chart,
        })
    }
}

fn grid_report(grid: &Grid, normal: &Normalisation, polygon: &[Vec2]) -> v1::GridReport {
    let spacing = grid::spacing(&grid.positions, |a, b| grid.known[a] && grid.known[b]);
    v1::GridReport {
        spacing_mean: normal.scale / grid::SIDE as f64,
        spacing_variance: spacing.variance / (spacing.mean * spacing.mean),
        known: grid.known_count() as f64 / CELLS as f64,
        hole: patch::signed_area(polygon).abs(),
    }
}

/// Larger side of a polygon's box.
fn extent(polygon: &[Vec2]) -> f64 {
    let low = polygon.iter().fold(Vec2::repeat(f64::MAX), |m, p| m.inf(p));
    let high = polygon.iter().fold(Vec2::repeat(f64::MIN), |m, p| m.sup(p));
    (high - low).max()
}

/// Reach of a region around a hole of this extent.
fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / SHARE - 1.0)
}

/// Larger side of the hole's box in a chart of a narrow collar around it; where that cannot be laid flat, that of a round hole.
fn extent_at_a_glance(cloth: &Cloth, id: u32) -> f64 {
    let round = cloth.loops[id as usize].length / std::f64::consts::PI;
    let collar = region::grow(
        &cloth.welded.mesh,
        &cloth.topology,
        &cloth.loops,
        LoopId(id),
        COLLAR * reach_for(round),
    );
    match collar.map(|collar| flatten::hole_extent(&collar)) {
        Ok(Ok(extent)) => extent,
        _ => round,
    }
}

/// Whether a smaller region may do better.
fn may_shrink(error: &MendError) -> bool {
    match error {
        MendError::Flatten { .. } => true,
        MendError::Patch { source, .. } => *source == PatchError::RimCrosses,
        _ => false,
    }
}

/// Whether a point lies in a polygon (even–odd rule).
fn inside(polygon: &[Vec2], p: Vec2) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = edges.filter(|(a, b)| {
        (a.y <= p.y) != (b.y <= p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) > p.x
    });
    crossed.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::shapes::{jitter, sheet};

    #[test]
    fn a_noisy_scan_is_the_last_resort() {
        let clean = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let noisy = jitter(&clean, 0.3 / 30.0, 7);
        let crosses = || MendError::Patch {
            hole: 1,
            source: PatchError::RimCrosses,
        };
        let tries = Cell::new(0);
        // Fails where the cloth was smoothed, and with it off where `stubborn`.
        let attempt = |scan: &TriMesh, stubborn: bool| {
            tries.set(0);
            without_noise(|smoothed| {
                tries.set(tries.get() + 1);
                match smoothed(scan) {
                    None if !stubborn => Ok("as scanned"),
                    _ => Err(crosses()),
                }
            })
        };
        assert_eq!(attempt(&clean, false).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 1);
        assert_eq!(attempt(&noisy, false).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 2);
        assert!(attempt(&noisy, true).is_err() && tries.get() == 2);
        // Nothing else would come of cloth that had no noise, or of another error.
        assert!(attempt(&clean, true).is_err() && tries.get() == 1);
        let unlike = |smoothed: Smoothing| -> Result<(), MendError> {
            tries.set(tries.get() + 1);
            smoothed(&noisy);
            Err(MendError::NonManifold { hole: 1 })
        };
        tries.set(0);
        assert!(without_noise(unlike).is_err() && tries.get() == 1);
    }
}
