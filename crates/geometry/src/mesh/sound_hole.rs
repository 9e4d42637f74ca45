//! A hole without the pieces at its rim that do not belong to the cloth's edge: its sound rim runs along inner edges
//! of the mesh there.

use std::cmp::Reverse;
use std::collections::VecDeque;

use darn_budget::{Budget, Exhausted, Steps};

use super::index::{FaceId, HalfEdgeId, VertexId};
use super::loops::BoundaryLoop;
use super::pairing::Paired;
use super::region::BoundedMesh;
use super::sparse::SparseValues;
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

/// Nanoseconds of work a face whose neighbours are looked at.
const FACE_WORK: u64 = 60;

impl SoundHole {
    /// The mesh that it is a hole of, as if it did not have the faces left out.
    pub fn bounded<'a>(&'a self, whole: BoundedMesh<'a>) -> BoundedMesh<'a> {
        BoundedMesh {
            topology: &self.topology,
            loops: &self.loops,
            ..whole
        }
    }

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
        let Some(rim) = whole.loops.get(rim.id.index()) else {
            return Ok(None);
        };
        let mut left = faces;
        left.sort_unstable();
        left.dedup();
        if left.is_empty() {
            return Ok(None);
        }
        let Some(topology) = whole_cloth_without(whole, &mut left, budget)? else {
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
/// component. `None` when there is no other face beside them.
///
/// # Errors
/// `Exhausted`.
fn whole_cloth_without(
    whole: &BoundedMesh,
    left: &mut Vec<FaceId>,
    budget: &Budget,
) -> Result<Option<Topology>, Exhausted> {
    let topology = whole.topology.without(left);
    let is_left = |f: &FaceId| left.binary_search(f).is_ok();
    let across = left.iter().flat_map(|f| f.half_edges());
    let across = across.filter_map(|h| Some(whole.topology.twin(h)?.face()));
    let mut beside: Vec<FaceId> = across.filter(|f| !is_left(f)).collect();
    beside.sort_unstable();
    beside.dedup();
    if beside.is_empty() {
        return Ok(None);
    }
    let off = cut_off(&topology, &beside, budget)?;
    if off.is_empty() {
        return Ok(Some(topology));
    }
    left.extend(off);
    left.sort_unstable();
    Ok(Some(whole.topology.without(left)))
}

/// The faces of all pieces that have one of the faces `beside`, but for the largest, of equals the one with the first
/// face.
///
/// The pieces grow side by side, and the last one only until it is the largest: a small piece costs its own size,
/// whatever the mesh's.
///
/// # Errors
/// `Exhausted`.
fn cut_off(
    topology: &Topology,
    beside: &[FaceId],
    budget: &Budget,
) -> Result<Vec<FaceId>, Exhausted> {
    let mut steps = Steps::of(budget);
    let mut pieces = GrowingPieces::new(topology, beside);
    let mut growing: Vec<usize> = (0..beside.len()).collect();
    let mut largest_whole = 0;
    loop {
        growing.retain(|&k| pieces.all[k].joined.is_none());
        match growing[..] {
            [] => break,
            [last] if pieces.all[last].faces.len() > largest_whole => break,
            _ => {}
        }
        for &k in &growing {
            steps.take(FACE_WORK)?;
            pieces.grow(k);
        }
        growing.retain(|&k| {
            let piece = &pieces.all[k];
            let is_whole = piece.open.is_empty();
            if is_whole {
                largest_whole = largest_whole.max(piece.faces.len());
            }
            !is_whole
        });
    }
    let whole = pieces.all.iter().filter(|p| p.joined.is_none());
    let size = |p: &GrowingPiece| (p.faces.len(), Reverse(p.faces.iter().min().copied()));
    let largest = whole.clone().map(size).max();
    let off = whole.filter(|p| Some(size(p)) != largest);
    Ok(off.flat_map(|p| p.faces.iter().copied()).collect())
}

/// Pieces of cloth that are explored.
struct GrowingPieces<'t> {
    topology: &'t Topology,
    all: Vec<GrowingPiece>,
    /// Per face the piece that it was found by.
    found_by: SparseValues<usize>,
}

/// A piece of cloth that is explored.
#[derive(Default)]
struct GrowingPiece {
    /// Its faces so far.
    faces: Vec<FaceId>,
    /// Those of them whose neighbours were not looked at.
    open: VecDeque<FaceId>,
    /// The piece that it turned out to belong to.
    joined: Option<usize>,
}

/// "No piece has the face yet."
const NO_PIECE: usize = usize::MAX;

impl<'t> GrowingPieces<'t> {
    /// One piece for each of some faces.
    fn new(topology: &'t Topology, faces: &[FaceId]) -> Self {
        let mut found_by = SparseValues::new(topology.half_edges() / 3, NO_PIECE);
        let mut all = Vec::with_capacity(faces.len());
        for (piece, face) in faces.iter().enumerate() {
            found_by[face.index()] = piece;
            all.push(GrowingPiece {
                faces: vec![*face],
                open: VecDeque::from([*face]),
                joined: None,
            });
        }
        GrowingPieces {
            topology,
            all,
            found_by,
        }
    }

    /// The piece that a piece belongs to.
    fn root(&self, mut piece: usize) -> usize {
        while let Some(joined) = self.all[piece].joined {
            piece = joined;
        }
        piece
    }

    /// Looks at the neighbours of one face of a piece.
    fn grow(&mut self, piece: usize) {
        let mut own = self.root(piece);
        let Some(face) = self.all[own].open.pop_front() else {
            return;
        };
        let twins = face.half_edges().map(|h| self.topology.twin(h));
        for other in twins.into_iter().flatten().map(HalfEdgeId::face) {
            match self.found_by[other.index()] {
                NO_PIECE => {
                    self.found_by[other.index()] = own;
                    self.all[own].faces.push(other);
                    self.all[own].open.push_back(other);
                }
                known => own = self.joined(own, self.root(known)),
            }
        }
    }

    /// Makes the smaller of two pieces part of the larger; returns the whole.
    fn joined(&mut self, a: usize, b: usize) -> usize {
        if a == b {
            return a;
        }
        let size = |k: usize| (self.all[k].faces.len(), Reverse(k));
        let (into, from) = if size(a) > size(b) { (a, b) } else { (b, a) };
        let part = std::mem::take(&mut self.all[from]);
        self.all[from].joined = Some(into);
        self.all[into].faces.extend(part.faces);
        self.all[into].open.extend(part.open);
        into
    }
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
    let after = |h: &HalfEdgeId| topology.fan_after(*h).last();
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::loops::boundary_loops;
    use crate::mesh::shapes::sheet;
    use crate::mesh::topology::face_components;

    proptest! {
        #[test]
        fn what_is_left_is_the_largest_piece(n in 2usize..9, picks in prop::collection::vec(any::<prop::sample::Index>(), 1..40)) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            let topology = Topology::new(&mesh);
            let whole = BoundedMesh { mesh: &mesh, topology: &topology, loops: &boundary_loops(&mesh, &topology) };
            let mut left: Vec<FaceId> = picks.iter().map(|p| FaceId(p.index(mesh.faces.len()) as u32)).collect();
            left.sort_unstable();
            left.dedup();
            let (piece, pieces) = face_components(&topology.without(&left));
            let mut sizes = vec![0usize; pieces];
            let faces = || (0u32..).map(FaceId).zip(&piece);
            let kept = faces().filter(|(f, _)| !left.contains(f));
            kept.for_each(|(_, p)| sizes[*p as usize] += 1);
            let largest = (0..pieces as u32).rev().max_by_key(|p| sizes[*p as usize]);
            let mut expected: Vec<FaceId> = faces().filter(|(_, p)| Some(**p) != largest).map(|(f, _)| f).collect();
            expected.sort_unstable();
            let found = whole_cloth_without(&whole, &mut left, Budget::unlimited()).unwrap();
            prop_assert_eq!(found.is_some(), sizes.iter().any(|size| *size > 0));
            if let Some(found) = found {
                prop_assert_eq!(&left, &expected);
                let expected = topology.without(&expected);
                for h in (0..found.half_edges() as u32).map(HalfEdgeId) {
                    prop_assert_eq!(found.twin(h), expected.twin(h));
                }
                for v in (0..mesh.positions.len() as u32).map(VertexId) {
                    prop_assert_eq!(found.leaving(v), expected.leaving(v));
                }
            }
        }
    }
}
