//! The cloth around a hole and its patch in one plane, for a texture of the patch's own: the hole's chart, or, where it has none, a layout
//! of both together.

use std::borrow::Cow;

use crate::addition::{DressedPatch, PatchSource};
use crate::error::MendError;
use crate::fair_hole::FairHole;
use crate::prepared_hole::HoleRef;
use crate::welded_scan::SourceFace;
use darn_geometry::flatten::FlattenLimits;
use darn_geometry::mesh::Vec2;
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::region::{self, Region, RegionError};
use darn_geometry::patch::FairLayout;

/// How far the cloth around a fair patch is laid out with it, in square roots of the patch's area: the widest that can be laid out is taken.
const REACHES: [f64; 3] = [1.0, 0.5, 0.25];
/// Bytes of memory a vertex of a region that is laid out: itself, its faces and its place.
const VERTEX: usize = 160;

/// Cloth and patch in one plane, scene units.
pub struct LaidCloth<'a> {
    /// The cloth.
    pub region: Cow<'a, Region>,
    /// Per vertex of the cloth its place.
    pub flat: Cow<'a, [Vec2]>,
    /// Per face of the cloth the scan's face that it was made of.
    pub sources: Cow<'a, [Option<SourceFace>]>,
    /// Per vertex of the patch its place.
    pub patch_flat: Cow<'a, [Vec2]>,
}

impl<'a> LaidCloth<'a> {
    /// Lays out a hole's cloth and patch; `None` where that cannot be done.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(
        hole: HoleRef<'a>,
        dressed: &'a DressedPatch,
        source: &PatchSource,
    ) -> Result<Option<LaidCloth<'a>>, MendError> {
        match hole {
            HoleRef::Charted(hole) => Ok(Some(LaidCloth {
                region: Cow::Borrowed(&hole.region),
                flat: Cow::Borrowed(&hole.chart.flat),
                sources: Cow::Borrowed(&dressed.sources),
                patch_flat: Cow::Borrowed(dressed.patch_flat),
            })),
            HoleRef::Fair(hole) => Self::around_fair(hole, source),
        }
    }

    fn around_fair(
        hole: &FairHole,
        source: &PatchSource,
    ) -> Result<Option<LaidCloth<'a>>, MendError> {
        let PatchSource {
            scan,
            welded,
            budget,
            ..
        } = *source;
        let patch = &hole.fair.patch;
        let size = face_areas(&patch.mesh()).iter().sum::<f64>().sqrt();
        for share in REACHES {
            let whole = welded.bounded();
            let region = match region::collar(&whole, LoopId(hole.id), share * size, budget) {
                Ok(region) => region,
                Err(RegionError::Exhausted(exhausted)) => return Err(exhausted.into()),
                Err(_) => return Ok(None),
            };
            let bytes = VERTEX * (region.vertices.len() + patch.positions.len());
            budget.hold(bytes)?;
            let layout = FairLayout::of(patch, &region, 1.0, &FlattenLimits::default(), budget)?;
            budget.release(bytes);
            if let Some(layout) = layout {
                let sources = region.faces.iter().map(|f| welded.source(scan, *f));
                return Ok(Some(LaidCloth {
                    sources: sources.collect(),
                    region: Cow::Owned(region),
                    flat: Cow::Owned(layout.region.flat),
                    patch_flat: Cow::Owned(layout.patch),
                }));
            }
        }
        Ok(None)
    }
}
