//! A hole without the pieces at its rim that do not belong to the cloth's edge: its sound rim runs along inner edges
//! of the mesh there.

use darn_budget::{Budget, Exhausted};

use super::index::{FaceId, HalfEdgeId, VertexId};
use super::loops::BoundaryLoop;
use super::region::BoundedMesh;
use super::topology::Topology;

/// A hole of a mesh as if some faces at its rim did not exist.
#[derive(Debug, Clone)]
pub struct SoundHole {
    /// The mesh's topology without these faces.
    pub topology: Topology,
    /// All loops of the mesh; the hole's own runs along its sound rim.
    pub loops: Vec<BoundaryLoop>,
    /// The faces left out, ascending.
    pub left: Vec<FaceId>,
}

/// Nanoseconds of work a face of the whole mesh.
const FACE_WORK: u64 = 60;

impl SoundHole {
    /// The hole of loop `rim` without `faces`, and without what they alone join to the rest of the cloth.
    ///
    /// `None` when there is no such loop, when nothing is left out, or when the faces do not open the hole to one
    /// larger hole: they close the rim off in several loops, or do not touch it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn without(
        whole: &BoundedMesh,
        rim: &BoundaryLoop,
        faces: Vec<FaceId>,
        budget: &Budget,
    ) -> Result<Option<SoundHole>, Exhausted> {
        budget.spend(FACE_WORK * whole.mesh.faces.len() as u64)?;
        let Some(rim) = whole.loops.get(rim.id.index()) else {
            return Ok(None);
        };
        let mut left = faces;
        left.sort_unstable();
        left.dedup();
        let Some(topology) = whole_cloth_without(whole, rim, &mut left) else {
            return Ok(None);
        };
        let Some(half_edges) = sound_rim(whole, rim, &topology, &left) else {
            return Ok(None);
        };
        let mut loops = whole.loops.to_vec();
        loops[rim.id.index()] = rim.along(whole.mesh, &topology, half_edges);
        Ok(Some(SoundHole {
            topology,
            loops,
            left,
        }))
    }
}

/// The topology without the faces `left`. Adds to them what is no longer joined to the largest piece of the rim's
/// component. `None` without faces, or when there is no largest piece.
fn whole_cloth_without(
    whole: &BoundedMesh,
    rim: &BoundaryLoop,
    left: &mut Vec<FaceId>,
) -> Option<Topology> {
    if left.is_empty() {
        return None;
    }
    let topology = whole.topology.without(left);
    let (piece, pieces) = topology.connected();
    let mut sizes = vec![0usize; pieces];
    let of_cloth = |f: usize| whole.topology.component[f] == rim.component;
    let faces = || (0..piece.len()).filter(|f| of_cloth(*f));
    faces().for_each(|f| sizes[piece[f] as usize] += 1);
    // The first of equals.
    let largest = (0..pieces).rev().max_by_key(|p| sizes[*p])? as u32;
    let off: Vec<FaceId> = (faces().filter(|f| piece[*f] != largest))
        .map(|f| FaceId(f as u32))
        .collect();
    if off == *left {
        return Some(topology);
    }
    *left = off;
    Some(whole.topology.without(left))
}

/// The half-edges of the one loop that the rim becomes; `None` when it becomes several.
fn sound_rim(
    whole: &BoundedMesh,
    rim: &BoundaryLoop,
    topology: &Topology,
    left: &[FaceId],
) -> Option<Vec<HalfEdgeId>> {
    let is_left = |f: FaceId| left.binary_search(&f).is_ok();
    let kept = rim.half_edges.iter().filter(|h| !is_left(h.face()));
    // Where a face left out was joined to the cloth, the cloth ends now.
    let opened = left.iter().flat_map(|f| f.half_edges());
    let opened = opened.filter_map(|h| whole.topology.twin(h));
    let opened = opened.filter(|h| !is_left(h.face()));
    let mut ends: Vec<HalfEdgeId> = kept.copied().chain(opened).collect();
    ends.sort_unstable();
    let first = *ends.first()?;
    let after = |h: &HalfEdgeId| topology.twins().fan_after(*h).last();
    let around = std::iter::successors(Some(first), after).skip(1);
    let mut cycle = vec![first];
    cycle.extend(around.take_while(|h| *h != first));
    if cycle.len() != ends.len() {
        return None;
    }
    let start = cycle.iter().enumerate();
    let start = start.min_by_key(|(_, h)| (topology.origin(**h), **h));
    let start = start.map_or(0, |(k, _)| k);
    cycle.rotate_left(start);
    // A cycle that returns to a vertex would be two holes that touch there.
    let mut corners: Vec<VertexId> = cycle.iter().map(|h| topology.origin(*h)).collect();
    corners.sort_unstable();
    corners.dedup();
    (corners.len() == cycle.len() && cycle.len() > 2).then_some(cycle)
}
