//! Loose pieces of the scan that lie in a hole as part of its cloth: the patch meets them as it meets the rim.

use crate::error::MendError;
use crate::flat_region::FlatRegion;
use crate::mender::Call;
use crate::sampled_grid::SampledGrid;
use crate::without_noise::Denoise;
use darn_geometry::flatten::{self, FlattenError};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::island::loose_piece;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::region::{BoundedMesh, Region};
use darn_geometry::misfit::{FilledChart, place_island};

/// Most loose pieces that are looked at for one hole.
const MAX_LOOKED_AT: usize = 64;
/// Nanoseconds of work a loop of the scan.
const LOOP_WORK: u64 = 20;

/// Finds the islands in a hole.
pub struct Islands<'a> {
    /// The scan's cloth.
    pub whole: &'a BoundedMesh<'a>,
    /// The hole.
    pub rim: LoopId,
    /// Takes the scanner's noise off.
    pub denoise: Denoise<'a>,
    /// The call.
    pub call: Call<'a>,
}

impl Islands<'_> {
    /// The region around the hole with the islands in it; `None` without any.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn joined(
        &self,
        flat: &FlatRegion,
        sampled: &SampledGrid,
    ) -> Result<Option<FlatRegion>, MendError> {
        let budget = self.call.budget;
        budget.spend(LOOP_WORK * self.whole.loops.len() as u64)?;
        let Some(base) = &sampled.base else {
            return Ok(None);
        };
        let mut loose = self.loose_pieces(flat).peekable();
        if loose.peek().is_none() {
            return Ok(None);
        }
        let filled: Vec<Vec3> = base.iter().map(|q| sampled.normal.to_scene(q)).collect();
        let mut joined = flat.clone();
        for border in loose.take(MAX_LOOKED_AT) {
            if let Some(island) = loose_piece(self.whole, border.id, budget)? {
                let hole = FilledChart {
                    region: joined.seen(),
                    chart: &joined.chart,
                    filled: &filled,
                    hole: sampled.cells.indices(),
                };
                if let Some(next) = self.with_island(&hole, &joined, island)? {
                    joined = next;
                    joined.islands.push(border.id);
                }
            }
        }
        Ok(Some(joined).filter(|joined| !joined.islands.is_empty()))
    }

    /// The outer boundaries of other components whose middle lies in the box of the hole's rim.
    fn loose_pieces(&self, flat: &FlatRegion) -> impl Iterator<Item = &BoundaryLoop> {
        let rim = || {
            let rim = flat.region.rim.iter();
            rim.map(|v| flat.region.mesh.positions[*v as usize])
        };
        let low = rim().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(&p));
        let high = rim().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(&p));
        let reach = Vec3::repeat(0.5 * (high - low).max());
        let (low, high) = (low - reach, high + reach);
        let component = self.whole.loops[self.rim.index()].component;
        self.whole.loops.iter().filter(move |l| {
            let near = (0..3).all(|k| (low[k]..=high[k]).contains(&l.centroid[k]));
            l.kind == LoopKind::Outer && l.component != component && near
        })
    }

    /// The region with one more island; `None` where the piece is none.
    fn with_island(
        &self,
        hole: &FilledChart,
        flat: &FlatRegion,
        island: Region,
    ) -> Result<Option<FlatRegion>, MendError> {
        let smooth = (self.denoise)(&island.mesh)?.map(|mesh| Region {
            mesh,
            ..island.clone()
        });
        let limits = &self.call.mender.limits.flatten;
        let seen = smooth.as_ref().unwrap_or(&island);
        let own = match flatten::flatten(seen, limits, self.call.budget) {
            Ok(own) => own,
            Err(FlattenError::Exhausted(exhausted)) => return Err(exhausted.into()),
            Err(_) => return Ok(None),
        };
        let Some(placed) = place_island(hole, seen, &own) else {
            return Ok(None);
        };
        let mut joined = flat.clone();
        joined.chart.flat.extend(placed);
        if joined.smooth.is_some() || smooth.is_some() {
            joined.smooth = Some(flat.seen().clone().with_island(seen));
        }
        joined.region = joined.region.with_island(&island);
        Ok(Some(joined))
    }
}
