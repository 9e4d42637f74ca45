//! Prepares a hole: grows the region of cloth around it, lays the region flat and plans the patch.

use std::time::Instant;

use crate::edit::{ReachLimit, RimPoint};
use crate::error::MendError;
use crate::flat_region::FlatRegion;
use crate::hole::{Hole, UneditedCloths};
use crate::islands::Islands;
use crate::mender::Call;
use crate::reach::{estimated_extent, reach_for};
use crate::sampled_grid::SampledGrid;
use crate::timings::milliseconds;
use crate::welded_scan::WeldedScan;
use crate::without_noise::{Denoise, without_noise};
use darn_contract::v1;
use darn_geometry::flatten;
use darn_geometry::mesh::blocks::FaceBlocks;
use darn_geometry::mesh::index::{FaceId, LoopId};
use darn_geometry::mesh::layers::Layers;
use darn_geometry::mesh::region::{self, BoundedMesh, Region, RegionError};
use darn_geometry::mesh::sound_hole::SoundHole;
use darn_geometry::mesh::spikes::spikes;
use darn_geometry::misfit::{flaps, lies_flat, overlapping_lip, standing_pieces, stands_out};
use darn_geometry::patch::{FairLayout, FairPatch, Fairness, PatchError, PatchMesh, PatchWork};
use darn_geometry::polygon::extent;

/// A region is grown again when its reach differs from the suitable one by more than this factor.
const REACH_TOLERANCE: f64 = 1.3;
/// Factor of the reach of each further try, when a region gives no usable chart.
const SHRINK: f64 = 0.6;
/// Largest mean stretch of a chart of cloth that was cut open: other surfaces that wrap around than tubes have more, and
/// a smaller region serves them better.
const TUBE_STRETCH: f64 = 1.05;
/// Tries with smaller and smaller regions.
const MAX_TRIES: usize = 4;
/// Tries with more and more of the cloth at the rim left out.
const MISFIT_SEARCHES: usize = 4;
/// Largest mean stretch of a chart with a crossing rim that is worth another try: what does not lie flat crosses itself in any chart.
const WORTH_KEEPING: f64 = 1.15;
/// How much the shapes of triangles count that keep the sides of a hole apart, beside those of the cloth.
const KEEPS_APART: f64 = 0.02;
/// Reach of the region in which pieces that stand out are looked for, as a multiple of that around the hole: the cloth beyond them shows where they
/// should lie.
const BEYOND_PIECES: f64 = 2.0;

/// Why a hole has no chart.
#[derive(Debug)]
pub struct Unprepared {
    /// Why.
    pub error: MendError,
    /// Faces of the scan at the rim that are no part of its cloth, as far as they were found.
    pub left: Vec<FaceId>,
}

impl From<Unprepared> for MendError {
    fn from(unprepared: Unprepared) -> MendError {
        unprepared.error
    }
}

/// Prepares the hole of a loop, from the sound edge of its cloth: pieces at the rim that do not belong to it are left
/// out. Where that gives no hole, from the rim as it was scanned.
///
/// # Errors
/// `Region`, `Flatten`, `TooLittleKnown` or `Patch`, whichever stage fails; of several tries the last one's, of the
/// denoised cloth. `Exhausted`.
pub fn prepare_hole(welded: &WeldedScan, id: u32, call: Call) -> Result<Hole, Unprepared> {
    let mut left = Vec::new();
    prepared(welded, id, &mut left, call).map_err(|error| Unprepared { error, left })
}

/// The same; `left` gets the faces that are no part of the cloth.
fn prepared(
    welded: &WeldedScan,
    id: u32,
    left: &mut Vec<FaceId>,
    call: Call,
) -> Result<Hole, MendError> {
    let scanned = welded.bounded();
    let rim = &welded.loops[id as usize];
    *left = spikes(scanned.mesh, scanned.topology, rim, call.budget)?;
    let mut outcome = None;
    for searches_left in (0..MISFIT_SEARCHES).rev() {
        let sound = SoundHole::without(&scanned, rim, left.clone(), call.budget)?;
        if sound.is_none() && !left.is_empty() {
            break;
        }
        let cloth = (sound.as_ref()).map_or(scanned, |sound| sound.bounded(scanned));
        let cloth = Cloth {
            whole: &cloth,
            blocks: &welded.blocks,
            left: sound.as_ref().map_or(&[], |s| &s.left),
            searches_left,
        };
        match cloth.prepare(id, call) {
            Ok(Prepared::Misfit(misfit)) => left.extend(misfit),
            Ok(Prepared::Hole(hole)) => {
                outcome = Some(Ok(*hole));
                break;
            }
            Err(error) => {
                outcome = Some(Err(error));
                break;
            }
        }
    }
    let scanned = Cloth {
        whole: &scanned,
        blocks: &welded.blocks,
        left: &[],
        searches_left: 0,
    };
    let hole = match outcome {
        Some(Err(MendError::Exhausted(exhausted))) => return Err(exhausted.into()),
        Some(Err(error)) if !left.is_empty() => scanned.hole(id, call).map_err(|_| error),
        Some(outcome) => outcome,
        None => scanned.hole(id, call),
    }?;
    call.budget.hold(hole.bytes())?;
    Ok(hole)
}

/// A scan's cloth without the faces at a hole's rim that do not belong to it.
struct Cloth<'a> {
    whole: &'a BoundedMesh<'a>,
    /// The boxes of blocks of its faces.
    blocks: &'a FaceBlocks,
    /// The faces left out, ascending; they are at no vertex of `whole`.
    left: &'a [FaceId],
    /// How many more searches for such faces may follow.
    searches_left: usize,
}

/// What preparing a hole gives.
enum Prepared {
    /// The hole.
    Hole(Box<Hole>),
    /// Nothing yet: more faces at the rim do not belong to the cloth.
    Misfit(Vec<FaceId>),
}

impl Cloth<'_> {
    /// Prepares the hole of a loop. Tries smaller and smaller regions when one gives no usable chart, and at last the
    /// cloth with the scanner's noise.
    fn prepare(&self, id: u32, call: Call) -> Result<Prepared, MendError> {
        let reach = reach_for(estimated_extent(self.whole, id, call.budget)?);
        without_noise(call.budget, may_shrink, |denoise| {
            let preparation = Preparation {
                cloth: self,
                id,
                denoise,
                call,
            };
            preparation.hole(reach)
        })
    }

    /// The triangles of the patch on the chart.
    fn triangulated(&self, id: u32, flat: &FlatRegion, call: Call) -> Result<TimedMesh, MendError> {
        let started = Instant::now();
        let (mesh, blocks) = (self.whole.mesh, self.blocks);
        let mesh = PatchMesh::in_scan(mesh, blocks, flat.seen(), &flat.chart, call);
        Ok(TimedMesh {
            mesh: mesh.map_err(MendError::patch(id))?,
            milliseconds: milliseconds(started),
        })
    }

    /// The hole of a loop when no search for misfits is left.
    fn hole(&self, id: u32, call: Call) -> Result<Hole, MendError> {
        match self.prepare(id, call)? {
            Prepared::Hole(hole) => Ok(*hole),
            Prepared::Misfit(_) => Err(MendError::patch(id)(PatchError::RimCrosses)),
        }
    }
}

/// A loop to prepare, and how.
struct Preparation<'a> {
    cloth: &'a Cloth<'a>,
    id: u32,
    denoise: Denoise<'a>,
    call: Call<'a>,
}

/// The triangles of a patch, and the time that they took.
struct TimedMesh {
    mesh: PatchMesh,
    milliseconds: f64,
}

impl Preparation<'_> {
    /// The hole, with a region of this reach or a smaller one; the reach is in scene units.
    fn hole(&self, widest: f64) -> Result<Prepared, MendError> {
        let mut reach = widest;
        let mut tries = 0;
        loop {
            let outcome = self.flat_region(reach).and_then(|flat| {
                match self.misfit(|| self.flaps(&flat))? {
                    Some(faces) => Ok(Prepared::Misfit(faces)),
                    None => Ok(Prepared::Hole(Box::new(self.sampled(flat)?))),
                }
            });
            tries += 1;
            match outcome {
                Err(error) if tries < MAX_TRIES && may_shrink(&error) => reach *= SHRINK,
                Err(error) if rim_crosses(&error) => {
                    let flat = self.flat_region(widest)?;
                    let lip = || Ok(overlapping_lip(flat.seen(), &flat.chart, self.call.budget)?);
                    return match self.misfit(lip)? {
                        Some(lip) => Ok(Prepared::Misfit(lip)),
                        None => self.kept_apart(flat, error),
                    };
                }
                outcome => return outcome,
            }
        }
    }

    /// The hole of a region whose rim crosses itself in its chart, laid flat again with triangles in the hole that keep its sides apart.
    ///
    /// # Errors
    /// `crossing`, the error of the first chart, where that gives no hole either; `Exhausted`.
    fn kept_apart(&self, flat: FlatRegion, crossing: MendError) -> Result<Prepared, MendError> {
        let (started, budget) = (Instant::now(), self.call.budget);
        if flat.chart.stretch_mean > WORTH_KEEPING {
            return Err(crossing);
        }
        let work = PatchWork {
            last: None,
            options: &self.call.mender.limits.patch,
            budget,
        };
        let seen = flat.seen();
        let fair = match FairPatch::new(seen, Fairness::Plain, work) {
            Ok(fair) => fair,
            Err(PatchError::Exhausted(exhausted)) => return Err(exhausted.into()),
            Err(_) => return Err(crossing),
        };
        let limits = &self.call.mender.limits.flatten;
        let Some(layout) = FairLayout::of(&fair.patch, seen, KEEPS_APART, limits, budget)? else {
            return Err(crossing);
        };
        let mut apart = FlatRegion {
            chart: layout.region,
            ..flat
        };
        apart.timings.flatten += milliseconds(started);
        match self.sampled(apart) {
            Ok(hole) => Ok(Prepared::Hole(Box::new(hole))),
            Err(MendError::Exhausted(exhausted)) => Err(exhausted.into()),
            Err(_) => Err(crossing),
        }
    }

    /// The faces of flaps at the rim, or of other pieces that stand out.
    fn flaps(&self, flat: &FlatRegion) -> Result<Vec<FaceId>, MendError> {
        let budget = self.call.budget;
        let found = flaps(flat.seen(), &flat.chart, budget)?;
        if !found.is_empty() || !stands_out(flat.seen(), &flat.chart, budget)? {
            return Ok(found);
        }
        let wide = match self.flattened(BEYOND_PIECES * flat.region.reach) {
            Err(MendError::Exhausted(exhausted)) => return Err(exhausted.into()),
            wide => wide.ok().filter(|wide| lies_flat(&wide.chart)),
        };
        let seen = wide.as_ref().unwrap_or(flat);
        Ok(standing_pieces(seen.seen(), &seen.chart, budget)?)
    }

    /// The faces that a search finds; `None` when it finds none, or no search is left.
    fn misfit(
        &self,
        search: impl Fn() -> Result<Vec<FaceId>, MendError>,
    ) -> Result<Option<Vec<FaceId>>, MendError> {
        if self.cloth.searches_left == 0 {
            return Ok(None);
        }
        Ok(Some(search()?).filter(|faces| !faces.is_empty()))
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
        let region = region::grow(self.cloth.whole, LoopId(self.id), reach, self.call.budget);
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
        let (whole, rim) = (self.cloth.whole, LoopId(self.id));
        let region = region::grow_cut_open(whole, rim, reach, self.call.budget)
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
            islands: Vec::new(),
            timings,
        })
    }

    /// Samples the grid and plans the patch, with the islands in the hole where there are any.
    fn sampled(&self, flat: FlatRegion) -> Result<Hole, MendError> {
        let (cloth, id, call) = (self.cloth, self.id, self.call);
        let (sampled, mesh) = rayon::join(
            || SampledGrid::of(id, &flat, call.budget),
            || cloth.triangulated(id, &flat, call),
        );
        let (sampled, mesh) = (sampled?, mesh?);
        let islands = Islands {
            whole: cloth.whole,
            rim: LoopId(id),
            denoise: self.denoise,
            call,
        };
        let Some(joined) = islands.joined(&flat, &sampled)? else {
            return self.planned(flat, sampled, mesh);
        };
        match (
            SampledGrid::of(id, &joined, call.budget),
            cloth.triangulated(id, &joined, call),
        ) {
            (Ok(sampled), Ok(mesh)) => self.planned(joined, sampled, mesh),
            (Err(MendError::Exhausted(exhausted)), _)
            | (_, Err(MendError::Exhausted(exhausted))) => Err(exhausted.into()),
            // Nothing can be laid between island and rim.
            _ => self.planned(flat, sampled, mesh),
        }
    }

    /// Plans the patch.
    fn planned(
        &self,
        flat: FlatRegion,
        sampled: SampledGrid,
        triangles: TimedMesh,
    ) -> Result<Hole, MendError> {
        let (id, call) = (self.id, self.call);
        let seen = flat.seen();
        let rim_uv = flat.rim_uv();
        let started = Instant::now();
        let plan = (triangles
            .mesh
            .plan(seen, &flat.chart, sampled.metric.as_ref(), call))
        .and_then(|plan| match &flat.smooth {
            Some(_) => plan.with_region_at(&flat.region.mesh.positions),
            None => Ok(plan),
        })
        .map_err(MendError::patch(id))?;
        // The largest distance that cloth of the hole's extent can have from its rim.
        let beyond = 0.5 * extent(&rim_uv) * flat.chart.frame.side;
        call.budget.spend(self.cloth.blocks.search_work())?;
        let layers = Layers::near(
            self.cloth.whole,
            self.cloth.blocks,
            &flat.region,
            beyond,
            self.cloth.left,
        );
        let plan = plan.beside(&layers, beyond, call.budget)?;
        let patch = triangles.milliseconds + milliseconds(started);
        let timings = v1::HoleTimings {
            raster: sampled.milliseconds,
            patch,
            ..flat.timings
        };
        let denoised = flat.smooth.is_some();
        let FlatRegion {
            region,
            chart,
            islands,
            ..
        } = flat;
        let rim = region.rim.iter().map(|v| RimPoint {
            flat: chart.flat[*v as usize],
            position: region.mesh.positions[*v as usize],
        });
        let reach = ReachLimit::new(rim);
        Ok(Hole {
            id,
            left: self.cloth.left.to_vec(),
            plan,
            report: sampled.report(&rim_uv),
            grid: sampled.grid,
            normal: sampled.normal,
            cells: sampled.cells,
            reach,
            timings,
            step: sampled.step,
            base: sampled.base,
            denoised,
            islands,
            rim_uv,
            unedited: UneditedCloths::default(),
            textures: Default::default(),
            no_fair: None,
            region,
            chart,
        })
    }
}

/// Whether a smaller region may succeed after this error.
fn may_shrink(error: &MendError) -> bool {
    match error {
        MendError::Flatten { .. } => true,
        error => rim_crosses(error),
    }
}

fn rim_crosses(error: &MendError) -> bool {
    matches!(error, MendError::Patch { source, .. } if *source == PatchError::RimCrosses)
}
