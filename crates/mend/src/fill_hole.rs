//! Fills one hole: the patch that a request's constraints and the network give it.

use std::sync::Arc;
use std::time::Instant;

use crate::constraints::HoleConstraints;
use crate::context::{HoleContext, Pace};
use crate::error::MendError;
use crate::hole::{PatchPulls, UneditedCloth};
use crate::prepared_hole::HoleRef;
use crate::select::HoleRequest;
use crate::timings::milliseconds;
use darn_contract::v1;
use darn_geometry::mesh::Vec3;
use darn_geometry::patch::{Patch, Pull, quality, stretch_limit};

/// How often a smaller share of the network's movement is tried before the pulls alone move the unedited cloth.
const MAX_TRIES: usize = 2;

/// A hole's patch before it is measured and reported.
pub struct PatchDraft<'a> {
    /// The hole.
    pub hole: HoleRef<'a>,
    /// The triangles.
    pub patch: Patch,
    /// The share of the network's folds that was kept.
    pub network_share: f32,
    /// Whether anchors or gestures move the cloth.
    pub edited: bool,
    /// What the patch should keep to; `None` for a hole without a chart.
    pub constraints: Option<HoleConstraints<'a>>,
    /// The hole's cloth without constraints; `None` for a hole without a chart.
    pub unedited: Option<Arc<UneditedCloth>>,
    /// Milliseconds so far.
    pub timings: v1::HoleTimings,
}

impl<'a> HoleContext<'a> {
    /// Fills the hole as a request asks.
    ///
    /// # Errors
    /// Constraints that do not fit the hole, hard anchors out of reach, a hole that cannot be meshed; a failure of the
    /// network.
    pub fn fill(&self, request: &HoleRequest) -> Result<PatchDraft<'a>, MendError> {
        let (hole, unedited) = (self.hole, &self.unedited);
        let constraints = self.constraints(request)?;
        let mut timings = hole.timings;
        timings.net += unedited.net_ms;
        timings.patch += unedited.patch_ms;

        let pulls = constraints.pulls();
        let patch = if pulls.is_empty() {
            unedited.patch.clone()
        } else if let Some(last) = unedited.pulled.of(&pulls, self.pace) {
            last
        } else {
            let started = Instant::now();
            let moved = self.moved_fill(&constraints.moves())?;
            timings.net += milliseconds(started);
            let started = Instant::now();
            let patch = self.constrained_patch(&moved, &pulls)?;
            timings.patch += milliseconds(started);
            unedited.pulled.keep(pulls, self.pace, &patch);
            patch
        };
        Ok(PatchDraft {
            hole: HoleRef::Charted(hole),
            patch,
            network_share: unedited.network_share,
            edited: request.is_edited(),
            constraints: Some(constraints),
            unedited: Some(Arc::clone(unedited)),
            timings,
        })
    }

    /// The patch of moved cloth, with as much of the network's movement as the cloth bears: the network's answer to
    /// targets that lie far away is itself stretched.
    fn constrained_patch(&self, moved: &[Vec3], pulls: &[Pull]) -> Result<Patch, MendError> {
        let (hole, unedited) = (self.hole, &self.unedited);
        let usual = quality::stretch(&unedited.patch).max;
        let most = stretch_limit(usual);
        let pulls = PatchPulls {
            pulls,
            last: match self.pace {
                Pace::Anew => None,
                Pace::Dragged => Some(&unedited.strain),
            },
        };
        let patch =
            |filled: &[Vec3]| hole.pulled_patch(filled, pulls, unedited.network_share, self.call);
        let mut share = 1.0;
        for _ in 0..MAX_TRIES {
            let each = unedited.filled.iter().zip(moved);
            let filled: Vec<Vec3> = each.map(|(from, to)| from.lerp(to, share)).collect();
            let tried = patch(&filled)?;
            let found = quality::stretch(&tried).max;
            if found <= most {
                return Ok(tried);
            }
            share *= (most - usual) / (found - usual);
        }
        patch(&unedited.filled)
    }
}
