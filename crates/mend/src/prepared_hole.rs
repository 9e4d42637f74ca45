//! A hole ready to be filled: with a chart, or with a fair surface where it has none.

use darn_budget::{Budget, Exhausted};

use crate::doubts::doubts;
use crate::error::MendError;
use crate::fair_hole::{FairHole, NoChart};
use crate::hole::Hole;
use crate::inpainter::Inpainter;
use crate::mender::Call;
use crate::prepare::{Unprepared, prepare_hole};
use crate::texture::HoleTextures;
use crate::welded_scan::WeldedScan;
use darn_geometry::mesh::TriMesh;
use darn_geometry::mesh::region::{Region, RegionError};
use darn_geometry::patch::attributes::AttributeMap;
use darn_geometry::patch::{Patch, Untangling};

/// A hole ready to be filled.
pub enum PreparedHole {
    /// The cloth around it lies flat.
    Charted(Box<Hole>),
    /// It does not.
    Fair(Box<FairHole>),
}

/// A hole that a patch closes.
#[derive(Clone, Copy)]
pub enum HoleRef<'a> {
    /// With a chart.
    Charted(&'a Hole),
    /// Without one.
    Fair(&'a FairHole),
}

impl PreparedHole {
    /// Prepares the hole of a loop: with a chart if the cloth around it can be laid flat, otherwise with a fair surface.
    ///
    /// # Errors
    /// Why it has no chart, when it can get no fair surface either; `Exhausted`.
    pub fn new(welded: &WeldedScan, id: u32, call: Call) -> Result<PreparedHole, MendError> {
        let fair = |reason| FairHole::new(welded, id, reason, Untangling::Always, call);
        let boxed = |hole| PreparedHole::Fair(Box::new(hole));
        if !welded.loops[id as usize].is_surrounded() {
            let reason = "it is no hole in a sheet but an end of the cloth".to_owned();
            let left = Vec::new();
            return fair(NoChart { reason, left }).map(boxed);
        }
        let Unprepared { error, left } = match prepare_hole(welded, id, call) {
            Ok(hole) => return Ok(PreparedHole::Charted(Box::new(hole))),
            Err(unprepared) => unprepared,
        };
        let Some(reason) = why_no_chart(&error) else {
            return Err(error);
        };
        match fair(NoChart { reason, left }) {
            Ok(hole) => Ok(boxed(hole)),
            Err(MendError::Exhausted(exhausted)) => Err(exhausted.into()),
            Err(_) => Err(error),
        }
    }

    /// The hole with a fair surface instead, where its patch on the chart is no plausible cloth and the fair surface is.
    ///
    /// # Errors
    /// A failure of the network; `Exhausted`.
    pub fn or_fair(
        self,
        welded: &WeldedScan,
        inpainter: &Inpainter,
        call: Call,
    ) -> Result<PreparedHole, MendError> {
        let PreparedHole::Charted(mut hole) = self else {
            return Ok(self);
        };
        let found = match hole.unedited(inpainter, call) {
            Ok(unedited) => doubts(&unedited.patch, &hole.region),
            Err(MendError::Patch { source, .. }) => vec![source.to_string()],
            Err(error) => return Err(error),
        };
        if found.is_empty() {
            return Ok(PreparedHole::Charted(hole));
        }
        let reason = format!(
            "laid in its chart, its patch is no plausible cloth: {}",
            found.join("; ")
        );
        let no_chart = NoChart {
            reason,
            left: hole.left.clone(),
        };
        // A fair surface that is a tangle is dropped: there is no need to push it apart.
        let fair = FairHole::new(welded, hole.id, no_chart, Untangling::UnlessTangled, call);
        let why_not = match fair {
            Ok(fair) => match HoleRef::Fair(&fair).doubts(&fair.fair.patch) {
                none if none.is_empty() => return Ok(PreparedHole::Fair(Box::new(fair))),
                some => some.join("; "),
            },
            Err(MendError::Exhausted(exhausted)) => return Err(exhausted.into()),
            Err(error) => error.to_string(),
        };
        hole.no_fair = Some(why_not);
        Ok(PreparedHole::Charted(hole))
    }

    /// The loop's id.
    pub fn id(&self) -> u32 {
        match self {
            PreparedHole::Charted(hole) => hole.id,
            PreparedHole::Fair(hole) => hole.id,
        }
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        match self {
            PreparedHole::Charted(hole) => hole.bytes(),
            PreparedHole::Fair(hole) => hole.bytes(),
        }
    }
}

impl<'a> HoleRef<'a> {
    /// The loop's id.
    pub fn id(self) -> u32 {
        match self {
            HoleRef::Charted(hole) => hole.id,
            HoleRef::Fair(hole) => hole.id,
        }
    }

    /// The cloth around it.
    pub fn region(self) -> &'a Region {
        match self {
            HoleRef::Charted(hole) => &hole.region,
            HoleRef::Fair(hole) => &hole.region,
        }
    }

    /// The textures of its patch made so far.
    pub fn textures(self) -> &'a HoleTextures {
        match self {
            HoleRef::Charted(hole) => &hole.textures,
            HoleRef::Fair(hole) => &hole.textures,
        }
    }

    /// How many faces of the scan at the rim are no part of its cloth.
    pub fn left_faces(self) -> usize {
        match self {
            HoleRef::Charted(hole) => hole.left.len(),
            HoleRef::Fair(hole) => hole.left.len(),
        }
    }

    /// Whether the cloth around it was seen without the scanner's noise.
    pub fn denoised(self) -> bool {
        match self {
            HoleRef::Charted(hole) => hole.denoised,
            HoleRef::Fair(hole) => hole.denoised,
        }
    }

    /// The hole, when it has a chart.
    pub fn charted(self) -> Option<&'a Hole> {
        match self {
            HoleRef::Charted(hole) => Some(hole),
            HoleRef::Fair(_) => None,
        }
    }

    /// How attributes are continued into its patch.
    pub fn attribute_map(self) -> AttributeMap<'a> {
        match self {
            HoleRef::Charted(hole) => hole.plan.attribute_map(&hole.chart),
            HoleRef::Fair(hole) => hole.fair.attribute_map(),
        }
    }

    /// Separates its patch from a mesh beside it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn separate(
        self,
        patch: &mut Patch,
        others: &TriMesh,
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        match self {
            HoleRef::Charted(hole) => hole.plan.separate(patch, others, budget),
            HoleRef::Fair(hole) => hole.fair.separate(patch, others, budget),
        }
    }
}

/// Why a hole has no chart, for a person; `None` when the error is about something else.
fn why_no_chart(error: &MendError) -> Option<String> {
    match error {
        MendError::Region {
            source: source @ RegionError::NotADisk { .. },
            ..
        } => Some(source.to_string()),
        MendError::Flatten { source, .. } => Some(source.to_string()),
        MendError::Patch { source, .. } => Some(source.to_string()),
        MendError::TooLittleKnown { known, .. } => Some(format!(
            "the cloth around it covers {known} cells of the grid"
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{mender, scan_of};
    use darn_geometry::mesh::loops::LoopKind;
    use darn_geometry::mesh::shapes::{holed_sheet, tube};

    fn prepared(mesh: &TriMesh, kind: LoopKind) -> PreparedHole {
        let welded = WeldedScan::of(&scan_of(mesh), Budget::unlimited()).unwrap();
        let rim = welded
            .loops
            .iter()
            .find(|l| l.kind == kind)
            .expect("a loop");
        PreparedHole::new(&welded, rim.id.0, mender().into()).expect("a hole")
    }

    #[test]
    fn a_patch_that_is_crumpled_where_its_cloth_is_not_is_doubted() {
        let PreparedHole::Charted(hole) = prepared(&holed_sheet(24, 0.15), LoopKind::Hole) else {
            panic!("flat cloth has a chart");
        };
        let inpainter = Inpainter::choose(&mender().networks, None, None).unwrap();
        let sound = hole.unedited(&inpainter, mender().into()).unwrap();
        assert_eq!(doubts(&sound.patch, &hole.region), Vec::<String>::new());
        let mut taut = sound.patch.clone();
        taut.flat.iter_mut().for_each(|p| *p *= 0.7);
        let found = doubts(&taut, &hole.region);
        assert!(found[0].contains("in the mean (limit 1.3)"), "{found:?}");
        let rough = |k: usize| 0.02 * ((k * 7919 % 11) as f64 / 5.0 - 1.0);
        let mut crumpled = sound.patch.clone();
        let rim = crumpled.rim.len();
        let inner = crumpled.positions[rim..].iter_mut().enumerate();
        inner.for_each(|(k, p)| p.z += rough(k));
        let found = doubts(&crumpled, &hole.region);
        assert!(
            found.iter().any(|doubt| doubt.contains("crumpled")),
            "{found:?}"
        );
        // Cloth that is as rough around it may go on so.
        let mut around = hole.region.clone();
        let all = around.mesh.positions.iter_mut().enumerate();
        all.for_each(|(k, p)| p.z += rough(k));
        assert_eq!(doubts(&crumpled, &around), Vec::<String>::new());
    }

    #[test]
    fn flat_cloth_has_a_chart_and_the_end_of_a_tube_a_fair_surface() {
        let flat = prepared(&holed_sheet(24, 0.15), LoopKind::Hole);
        assert!(matches!(flat, PreparedHole::Charted(_)));
        let PreparedHole::Fair(end) = prepared(&tube(24, |_, v| v < 0.5), LoopKind::TubeEnd) else {
            panic!("the end of a tube has no chart");
        };
        assert_eq!(end.fair.patch.crossings, 0);
    }
}
