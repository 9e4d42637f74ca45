//! A hole ready to be filled: everything about it that does not depend on constraints, and its cloth without any.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use crate::confidence::{FillEvidence, smooth_deviations};
use crate::edit::{HoleCells, ReachLimit};
use crate::error::MendError;
use crate::inpainter::{FillKey, Inpainter};
use crate::last_pulled::LastPulled;
use crate::mender::Call;
use crate::moved_fill::LastHeldFill;
use crate::network_share::WidenedHole;
use crate::texture::HoleTextures;
use crate::timings::milliseconds;
use darn_contract::v1;
use darn_geometry::flatten::Chart;
use darn_geometry::grid::{self, CELLS, Grid, NormalGrid, Normalisation};
use darn_geometry::mesh::index::{FaceId, LoopId};
use darn_geometry::mesh::region::Region;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_geometry::patch::{LastStrain, Patch, PatchPlan, PatchWork, Pull};
use darn_geometry::polygon;
use darn_net::Averaging;

/// Unedited cloths that a hole keeps, one for each network and up direction; a session rarely asks for a second.
const MAX_UNEDITED: usize = 4;

/// Nanoseconds of work of the network for one hole.
const FILL_WORK: u64 = 20_000_000;
/// The same for one of the other plausible fills, beside the likeliest.
const ALTERNATIVE_WORK: u64 = 2 * FILL_WORK;

/// A hole ready to be filled.
pub struct Hole {
    /// The loop's id.
    pub id: u32,
    /// Faces of the scan at the rim that are no part of its cloth: the patch starts at the sound edge beneath them.
    pub left: Vec<FaceId>,
    /// The cloth around it.
    pub region: Region,
    /// The region laid flat.
    pub chart: Chart,
    /// How the hole is meshed.
    pub plan: PatchPlan,
    /// The scan's positions on the grid's cells.
    pub grid: Grid,
    /// Converts between scene space and the network's units.
    pub normal: Normalisation,
    /// The grid's cells that lie in the hole.
    pub cells: HoleCells,
    /// How far the hole's cloth reaches.
    pub reach: ReachLimit,
    /// The grid in numbers.
    pub report: v1::GridReport,
    /// Milliseconds of preparing the hole.
    pub timings: v1::HoleTimings,
    /// Whether the network is given the cloth without the scanner's noise.
    pub denoised: bool,
    /// The borders of the islands in the hole: loose pieces of the scan that the patch meets.
    pub islands: Vec<LoopId>,
    /// The rim on the chart's unit square.
    pub rim_uv: Vec<Vec2>,
    /// Cells from one to the next where smooth fills of the grid are solved.
    pub step: usize,
    /// A smooth fill of the grid, network's units.
    pub base: Option<Vec<[f32; 3]>>,
    /// The unedited cloths made so far.
    pub unedited: UneditedCloths,
    /// The textures of its patch made so far.
    pub textures: HoleTextures,
    /// Why a fair surface is no better, where the patch without constraints is no plausible cloth.
    pub no_fair: Option<String>,
}

/// A hole's unedited cloths, by what decides them; the oldest is dropped first.
#[derive(Default)]
pub struct UneditedCloths(Mutex<Vec<(FillKey, Arc<UneditedCloth>)>>);

/// A hole's cloth without constraints.
pub struct UneditedCloth {
    /// The share of the network's movement from a smooth surface that was kept, 0 to 1.
    pub network_share: f32,
    /// The network's answer for every cell, scene space.
    pub predicted: Vec<Vec3>,
    /// For every cell the scan's position where it is known, the network's elsewhere; scene space.
    pub filled: Vec<Vec3>,
    /// Which of the plausible fills it is, 0 the likeliest.
    pub alternative: u8,
    /// How far every cell may be off, a standard deviation in the network's units; `None` for weights that were not calibrated.
    pub deviations: Option<Vec<f64>>,
    /// What the network says of the cells that were moved last.
    pub held: LastHeldFill,
    /// Where the last patch of a drag lay.
    pub strain: LastStrain,
    /// The last patch that anything pulled at.
    pub pulled: LastPulled,
    /// The patch made of it.
    pub patch: Patch,
    /// Milliseconds of the network.
    pub net_ms: f64,
    /// Milliseconds of meshing.
    pub patch_ms: f64,
}

/// A fill of the grid, in the network's units.
struct GridFill {
    /// One position per cell.
    positions: Vec<[f32; 3]>,
    /// The share of the network's movement in it.
    network_share: f32,
    /// Which of the plausible fills it is.
    alternative: u8,
    /// As in [`UneditedCloth`].
    deviations: Option<Vec<f64>>,
}

/// What pulls at a patch.
#[derive(Clone, Copy, Default)]
pub struct PatchPulls<'a> {
    /// The pulls.
    pub pulls: &'a [Pull],
    /// The last patch of a drag, to start from.
    pub last: Option<&'a LastStrain>,
}

impl Hole {
    /// The grid as the network takes it, without constraints.
    pub fn normal_grid(&self) -> NormalGrid {
        NormalGrid {
            base: self.base.clone(),
            ..self.grid.normalised(&self.normal)
        }
    }

    /// Whether a uv lies in the hole.
    pub fn contains(&self, uv: Vec2) -> bool {
        polygon::inside(&self.rim_uv, uv)
    }

    /// Larger side of the hole's box in the chart, scene units.
    pub fn extent(&self) -> f64 {
        polygon::extent(&self.rim_uv) * self.chart.frame.side
    }

    /// Width of a cell, scene units.
    pub fn cell_width(&self) -> f64 {
        self.normal.scale / grid::SIDE as f64
    }

    /// The hole's cloth without constraints; made when it is first asked for.
    ///
    /// # Errors
    /// A failure of the network, or a hole that cannot be meshed.
    pub fn unedited(
        &self,
        inpainter: &Inpainter,
        call: Call,
    ) -> Result<Arc<UneditedCloth>, MendError> {
        if let Some(kept) = self.unedited.get(inpainter.key()) {
            return Ok(kept);
        }
        let cloth = Arc::new(self.fill(inpainter, call)?);
        self.unedited.keep(inpainter.key().clone(), &cloth);
        Ok(cloth)
    }

    fn fill(&self, inpainter: &Inpainter, call: Call) -> Result<UneditedCloth, MendError> {
        let started = Instant::now();
        let GridFill {
            positions,
            network_share,
            alternative,
            deviations,
        } = self.answer(inpainter, call)?;
        let predicted = self.in_scene(&positions);
        let net_ms = milliseconds(started);
        let started = Instant::now();
        let filled = self.filled(&predicted);
        let patch = self.patch(&filled, network_share, call)?;
        Ok(UneditedCloth {
            network_share,
            predicted,
            filled,
            alternative,
            deviations,
            held: LastHeldFill::default(),
            strain: LastStrain::default(),
            pulled: LastPulled::default(),
            patch,
            net_ms,
            patch_ms: milliseconds(started),
        })
    }

    /// The fill of all cells.
    fn answer(&self, inpainter: &Inpainter, call: Call) -> Result<GridFill, MendError> {
        let widened = WidenedHole::new(self, call.budget)?;
        let errors = inpainter.card().errors.as_ref();
        if widened.is_smooth()
            && let Some(fair) = widened.fair_fill(call.budget)?
        {
            let off = widened.plate_error().unwrap_or(0.0);
            return Ok(GridFill {
                positions: fair,
                network_share: 0.0,
                alternative: 0,
                deviations: errors.map(|_| smooth_deviations(&self.grid.known, off)),
            });
        }
        call.budget.spend(FILL_WORK)?;
        let grid = self.normal_grid();
        let (answers, network_share) = rayon::join(
            || inpainter.fill(std::slice::from_ref(&grid), Averaging::Flips),
            || widened.network_share(inpainter, call.budget),
        );
        let (answers, network_share) = (answers?, network_share?);
        let Some(mut answer) = answers.into_iter().next() else {
            return Ok(GridFill {
                positions: Vec::new(),
                network_share,
                alternative: 0,
                deviations: None,
            });
        };
        let evidence = FillEvidence {
            grid: &grid,
            spread: &answer.spread,
            network_share: network_share.into(),
            plate_error: widened.plate_error(),
        };
        let deviations = errors.map(|errors| evidence.deviations(errors));
        let mut alternative = 0;
        // Cloth that is all smooth surface has no folds that could be deeper.
        if inpainter.key().alternative > 0 && network_share > 0.0 {
            call.budget.spend(ALTERNATIVE_WORK)?;
            if let Some(other) = inpainter.alternative(&grid)? {
                (answer.positions, alternative) = (other, inpainter.key().alternative);
            }
        }
        if network_share < 1.0
            && let Some(fair) = widened.fair_fill(call.budget)?
        {
            for (network, fair) in answer.positions.iter_mut().zip(&fair) {
                (0..3).for_each(|d| network[d] = fair[d] + network_share * (network[d] - fair[d]));
            }
        }
        Ok(GridFill {
            positions: answer.positions,
            network_share,
            alternative,
            deviations,
        })
    }

    /// A network's answer for all cells, in scene space.
    pub fn in_scene(&self, answer: &[[f32; 3]]) -> Vec<Vec3> {
        let mut positions: Vec<Vec3> = answer.iter().map(|q| self.normal.to_scene(q)).collect();
        positions.resize(CELLS, self.normal.centre);
        positions
    }

    /// For every cell the scan's position where it is known, the `predicted` one elsewhere.
    pub fn filled(&self, predicted: &[Vec3]) -> Vec<Vec3> {
        let each = self.grid.positions.iter().zip(&self.grid.known);
        each.zip(predicted)
            .map(|((own, known), new)| if *known { *own } else { *new })
            .collect()
    }

    /// Meshes a filled grid that has this share of the network's movement. Fair cloth may be strained: in a hole without folds, nothing but the plate
    /// says what area the cloth has.
    ///
    /// # Errors
    /// `Patch` when that is not possible.
    pub fn patch(
        &self,
        filled: &[Vec3],
        network_share: f32,
        call: Call,
    ) -> Result<Patch, MendError> {
        self.pulled_patch(filled, PatchPulls::default(), network_share, call)
    }

    /// The same with pulls.
    ///
    /// # Errors
    /// As [`Hole::patch`].
    pub fn pulled_patch(
        &self,
        filled: &[Vec3],
        pulls: PatchPulls,
        network_share: f32,
        call: Call,
    ) -> Result<Patch, MendError> {
        let mut options = call.mender.limits.patch;
        options.strain.max_strain += f64::from(1.0 - network_share);
        let work = PatchWork {
            options: &options,
            budget: call.budget,
            last: pulls.last,
        };
        self.plan
            .patch(&self.chart, filled, pulls.pulls, work)
            .map_err(MendError::patch(self.id))
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        let mesh = |m: &TriMesh| 24 * m.positions.len() + 12 * m.faces.len();
        let region = mesh(&self.region.mesh)
            + 4 * (self.region.vertices.len() + self.region.faces.len() + self.left.len())
            + 16 * self.chart.flat.len();
        // Position, known flag, entry in the hole's cells, base.
        let grid = CELLS * (24 + 1 + 9 + 12);
        region + grid + self.plan.bytes() + self.unedited.bytes() + self.textures.bytes()
    }
}

impl UneditedCloths {
    fn get(&self, key: &FillKey) -> Option<Arc<UneditedCloth>> {
        let kept = self.lock();
        let mut each = kept.iter();
        each.find(|(k, _)| k == key).map(|(_, u)| Arc::clone(u))
    }

    fn keep(&self, key: FillKey, cloth: &Arc<UneditedCloth>) {
        let mut kept = self.lock();
        if kept.len() >= MAX_UNEDITED {
            kept.remove(0);
        }
        kept.push((key, Arc::clone(cloth)));
    }

    fn bytes(&self) -> usize {
        let kept = self.lock();
        let each = kept.iter().map(|(_, u)| {
            let patch = 40 * u.patch.positions.len() + 12 * u.patch.faces.len();
            (3 * 24 + 8) * CELLS + patch + u.strain.bytes() + u.pulled.bytes()
        });
        each.sum()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<(FillKey, Arc<UneditedCloth>)>> {
        // No change under the lock can panic half-way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
