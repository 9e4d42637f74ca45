//! How far the region around a hole reaches: so far that hole and cloth share the grid as in training.

use darn_budget::{Budget, Exhausted};
use darn_geometry::flatten::{self, FlattenError};
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::region::{self, BoundedMesh, RegionError};

/// Share of the grid's side that the hole should take, so that hole and context share the grid as in training.
const HOLE_SHARE: f64 = 0.5;
/// Reach of the collar that the extent of a hole is first measured on, as a share of the reach that suits a round hole.
const COLLAR: f64 = 0.2;

/// Reach of the region around a hole of this extent; both in scene units.
pub fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / HOLE_SHARE - 1.0)
}

/// Larger side of the hole's box in a chart of a narrow collar around it; where the collar cannot be laid flat, that of
/// a round hole.
///
/// # Errors
/// `Exhausted`.
pub fn estimated_extent(whole: &BoundedMesh, id: u32, budget: &Budget) -> Result<f64, Exhausted> {
    let round = whole.loops[id as usize].length / std::f64::consts::PI;
    let collar = match region::grow(whole, LoopId(id), COLLAR * reach_for(round), budget) {
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
