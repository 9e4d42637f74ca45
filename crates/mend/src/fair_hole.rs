//! A hole that has no chart: what cannot be laid flat gets a fair surface in space, without the network and without
//! constraints.

use std::time::Instant;

use crate::doubts::FEW_CUTS;
use crate::error::MendError;
use crate::fill_hole::PatchDraft;
use crate::mender::Call;
use crate::prepared_hole::HoleRef;
use crate::select::HoleRequest;
use crate::texture::HoleTextures;
use crate::timings::milliseconds;
use crate::welded_scan::WeldedScan;
use darn_contract::{FieldError, v1};
use darn_geometry::mesh::denoise::denoise;
use darn_geometry::mesh::index::{FaceId, LoopId};
use darn_geometry::mesh::layers::Layers;
use darn_geometry::mesh::region::{self, Region};
use darn_geometry::mesh::sound_hole::SoundHole;
use darn_geometry::patch::{FairPatch, Fairness, PatchWork, Untangling};

/// Why a hole has no chart, or none that helps.
pub struct NoChart {
    /// Why, for a person.
    pub reason: String,
    /// Faces of the scan at the rim that were found to be no part of its cloth.
    pub left: Vec<FaceId>,
}

/// A hole without a chart, and the fair surface that closes it.
pub struct FairHole {
    /// The loop's id.
    pub id: u32,
    /// Faces of the scan at the rim that are no part of its cloth: the surface starts at the sound edge beneath them.
    pub left: Vec<FaceId>,
    /// The cloth next to its rim.
    pub region: Region,
    /// What closes it.
    pub fair: FairPatch,
    /// Why there is no chart, for a person.
    pub reason: String,
    /// Milliseconds of preparing the hole.
    pub timings: v1::HoleTimings,
    /// Whether the surface continues the cloth without the scanner's noise.
    pub denoised: bool,
    /// The textures of its patch made so far.
    pub textures: HoleTextures,
}

impl FairHole {
    /// Closes the hole of a loop with a fair surface, from the edge of the cloth without the faces that are left, where that is one line.
    ///
    /// # Errors
    /// `Region` or `Patch`, whichever stage fails; `Exhausted`.
    pub fn new(
        welded: &WeldedScan,
        id: u32,
        no_chart: NoChart,
        untangling: Untangling,
        call: Call,
    ) -> Result<FairHole, MendError> {
        let (started, budget) = (Instant::now(), call.budget);
        let NoChart { reason, left } = no_chart;
        let scanned = welded.bounded();
        let sound = SoundHole::without(&scanned, &welded.loops[id as usize], left, budget)?;
        let whole = (sound.as_ref()).map_or(scanned, |sound| sound.bounded(scanned));
        let left = sound.as_ref().map_or(&[][..], |sound| &sound.left);
        let region =
            region::collar(&whole, LoopId(id), 0.0, budget).map_err(MendError::region(id))?;
        let region_ms = milliseconds(started);
        let started = Instant::now();
        let smooth = denoise(&region.mesh, budget)?.map(|mesh| Region {
            mesh,
            ..region.clone()
        });
        let work = PatchWork {
            last: None,
            options: &call.mender.limits.patch,
            budget,
        };
        let seen = smooth.as_ref().unwrap_or(&region);
        let closed = |fairness: Fairness| -> Result<FairPatch, MendError> {
            let fair = FairPatch::new(seen, fairness, work)
                .and_then(|fair| match &smooth {
                    Some(_) => fair.with_region_at(&region.mesh.positions),
                    None => Ok(fair),
                })
                .map_err(MendError::patch(id))?;
            budget.spend(welded.blocks.search_work())?;
            // No point of the patch is farther from the rim than this.
            let margin = fair.patch.beyond_rim();
            let layers = Layers::near(&whole, &welded.blocks, &region, margin, left);
            Ok(fair.clear_of(&layers, margin, untangling, budget)?)
        };
        let fair = match closed(Fairness::Curved) {
            Ok(curved) if curved.patch.crossings <= FEW_CUTS => curved,
            // Cloth that is a tangle cuts any surface. One that was not pushed apart may be tangled by its own curvature.
            Ok(curved)
                if untangling == Untangling::Always
                    && curved.patch.crossings > curved.patch.faces.len() =>
            {
                curved
            }
            Err(MendError::Exhausted(exhausted)) => return Err(exhausted.into()),
            curved => match (curved, closed(Fairness::Plain)) {
                (_, Err(MendError::Exhausted(exhausted))) => return Err(exhausted.into()),
                (Ok(curved), Ok(plain)) if plain.patch.crossings < curved.patch.crossings => plain,
                (Ok(curved), _) => curved,
                (Err(_), plain) => plain?,
            },
        };
        let hole = FairHole {
            id,
            left: left.to_vec(),
            denoised: smooth.is_some(),
            timings: v1::HoleTimings {
                region: region_ms,
                patch: milliseconds(started),
                ..v1::HoleTimings::default()
            },
            region,
            fair,
            reason,
            textures: HoleTextures::default(),
        };
        budget.hold(hole.bytes())?;
        Ok(hole)
    }

    /// The patch that a request asks for.
    ///
    /// # Errors
    /// `Constraints` for every anchor and gesture of the request: they need a chart.
    pub fn fill(&self, request: &HoleRequest) -> Result<PatchDraft<'_>, MendError> {
        let anchors = request.anchors.iter().map(|a| ("anchors", a.index));
        let edits = request.edits.iter().map(|e| ("edits", e.index));
        let wrong = anchors.chain(edits);
        let wrong: Vec<FieldError> = wrong
            .map(|(list, index)| self.no_chart(format!("/{list}/{index}")))
            .collect();
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        Ok(PatchDraft {
            hole: HoleRef::Fair(self),
            patch: self.fair.patch.clone(),
            network_share: 0.0,
            edited: false,
            constraints: None,
            unedited: None,
            timings: self.timings,
        })
    }

    /// The error of something that needs a chart.
    pub fn no_chart(&self, pointer: impl Into<String>) -> FieldError {
        let detail = format!(
            "hole {} has no chart, so there is no uv on it ({}); it takes no anchors and no gestures",
            self.id, self.reason
        );
        FieldError::new(pointer, detail)
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        24 * self.region.mesh.positions.len()
            + 16 * self.region.mesh.faces.len()
            + 4 * (self.region.vertices.len() + self.left.len())
            + self.fair.bytes()
            + self.textures.bytes()
    }
}
