//! Which faces belong to a region of a given reach: faces near the rim, without islands, with the pockets they enclose.

use darn_budget::{Budget, Exhausted};

use super::geodesic::geodesic_distance;
use super::index::{FaceId, HalfEdgeId, LoopId, VertexId};
use super::loops::BoundaryLoop;
use super::region::BoundedMesh;
use super::sparse::SparseValues;

/// The smallest reach tried, in mean edge lengths of the rim's faces.
const NARROWEST: f64 = 3.0;
/// A pocket whose depth exceeds this many reaches stays outside.
const POCKET: f64 = 1.5;
/// Rounds of dropping, filling and trimming. Each round settles only what the one before changed.
const ROUNDS: usize = 8;
/// Nanoseconds of work a face near the rim in one pass over them.
const FACE_WORK: u64 = 15;

/// What stays the same while the reach shrinks.
pub(super) struct Growth<'a> {
    /// The whole mesh.
    pub whole: BoundedMesh<'a>,
    /// The loop that the region surrounds.
    pub rim: &'a BoundaryLoop,
    /// Per vertex its distance from the rim, scene units; infinite beyond the deepest pocket.
    pub distance: SparseValues<f64>,
    /// The smallest reach to try, scene units.
    pub narrowest: f64,
    /// The half-edges of loops near the rim, ascending, each with its loop.
    on_loops: Vec<(HalfEdgeId, LoopId)>,
    /// Faces that may belong to the region, ascending: all whose distance from the rim is known, and those that touch it.
    near: Vec<FaceId>,
    /// Per face whether it touches the rim; such faces always belong to the region.
    touching: SparseValues<bool>,
}

impl<'a> Growth<'a> {
    /// Measures the cloth around `rim` as far as regions of up to `reach` (scene units) need it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn new(
        whole: BoundedMesh<'a>,
        rim: &'a BoundaryLoop,
        reach: f64,
        budget: &Budget,
    ) -> Result<Self, Exhausted> {
        let BoundedMesh {
            mesh,
            topology,
            loops,
        } = whole;
        let mut near: Vec<FaceId> = (rim.vertices.iter())
            .flat_map(|&v| topology.faces_at(v))
            .collect();
        near.sort_unstable();
        near.dedup();
        let mut touching = SparseValues::new(mesh.faces.len(), false);
        let (mut length, mut count) = (0.0, 0.0);
        for f in &near {
            touching[f.index()] = true;
            let [a, b, c] = mesh.triangle(f.index());
            length += (b - a).norm() + (c - b).norm() + (a - c).norm();
            count += 3.0;
        }
        let narrowest = NARROWEST * length / f64::max(count, 1.0);
        let limit = POCKET * reach.max(narrowest);
        let distance = geodesic_distance(mesh, topology, &rim.vertices, limit, budget)?;
        let is_near = |v: &VertexId| distance[v.index()].is_finite();
        let vertices = distance.written().map(|v| VertexId(v as u32));
        near.extend((vertices.filter(is_near)).flat_map(|v| topology.faces_at(v)));
        budget.spend(FACE_WORK * near.len() as u64)?;
        near.sort_unstable();
        near.dedup();
        let mut on_loops: Vec<(HalfEdgeId, LoopId)> = (loops.iter())
            .filter(|l| l.vertices.iter().any(is_near))
            .flat_map(|l| l.half_edges.iter().map(|h| (*h, l.id)))
            .collect();
        on_loops.sort_unstable();
        Ok(Self {
            whole,
            rim,
            distance,
            narrowest,
            on_loops,
            near,
            touching,
        })
    }

    /// Per face of the whole mesh whether it belongs to the region of a reach.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn inside(&self, reach: f64, budget: &Budget) -> Result<SparseValues<bool>, Exhausted> {
        let round_work = FACE_WORK * self.near.len() as u64;
        budget.spend(round_work)?;
        let mut inside = self.no_face();
        for f in self.faces() {
            inside[f.index()] = self.touching[f.index()] || self.depth(f) <= reach;
        }
        for _ in 0..ROUNDS {
            budget.spend(round_work)?;
            self.drop_islands(&mut inside);
            self.fill_pockets(&mut inside, POCKET * reach);
            if !self.trim_bow_ties(&mut inside) {
                break;
            }
        }
        self.drop_islands(&mut inside);
        Ok(inside)
    }

    /// The loop a half-edge lies on, if any. Only loops near the rim are known.
    pub fn loop_at(&self, half_edge: HalfEdgeId) -> Option<&'a BoundaryLoop> {
        let at = (self.on_loops).binary_search_by_key(&half_edge, |(h, _)| *h);
        let (_, id) = self.on_loops[at.ok()?];
        self.whole.loops.get(id.index())
    }

    /// The faces that may belong to the region, ascending. All others are farther away than the deepest pocket.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> {
        self.near.iter().copied()
    }

    /// Distance of the farthest corner of a face from the rim.
    fn depth(&self, face: FaceId) -> f64 {
        self.whole.mesh.faces[face.index()]
            .iter()
            .map(|&v| self.distance[v as usize])
            .fold(0.0, f64::max)
    }

    /// None of the faces of the whole mesh.
    fn no_face(&self) -> SparseValues<bool> {
        SparseValues::new(self.whole.mesh.faces.len(), false)
    }

    /// The faces across the edges of a face.
    fn beside(&self, face: FaceId) -> impl Iterator<Item = FaceId> {
        let twins = face.half_edges().map(|h| self.whole.topology.twin(h));
        twins.into_iter().flatten().map(HalfEdgeId::face)
    }

    /// Keeps only the faces that are connected with those at the rim.
    fn drop_islands(&self, inside: &mut SparseValues<bool>) {
        let mut keep = self.no_face();
        let mut stack: Vec<FaceId> = self.rim.half_edges.iter().map(|h| h.face()).collect();
        stack.retain(|f| inside[f.index()]);
        while let Some(f) = stack.pop() {
            if !std::mem::replace(&mut keep[f.index()], true) {
                stack.extend(self.beside(f).filter(|g| inside[g.index()]));
            }
        }
        *inside = keep;
    }

    /// Takes in pockets: connected pieces of the rest that are no deeper than `limit` and bounded by the region and
    /// holes alone.
    fn fill_pockets(&self, inside: &mut SparseValues<bool>, limit: f64) {
        let mut seen = inside.clone();
        // A piece is given up at its first face that stays outside; the rest of the piece is given up when it meets
        // such a face.
        let mut outside = self.no_face();
        for f in self.faces() {
            let at_border = !seen[f.index()] && self.beside(f).any(|g| inside[g.index()]);
            if !at_border {
                continue;
            }
            let (mut piece, mut next, mut lost) = (vec![f], 0, false);
            seen[f.index()] = true;
            while next < piece.len() && !lost {
                let g = piece[next];
                next += 1;
                lost = outside[g.index()] || self.stays_outside(g, limit);
                for n in self.beside(g) {
                    lost |= outside[n.index()];
                    if !std::mem::replace(&mut seen[n.index()], true) {
                        piece.push(n);
                    }
                }
            }
            for g in &piece {
                inside[g.index()] = !lost;
                outside[g.index()] = lost;
            }
        }
    }

    /// Whether a piece of the rest that contains this face is no pocket: too deep, or at a loop that cloth does not surround.
    fn stays_outside(&self, face: FaceId, limit: f64) -> bool {
        let at_open_loop = |h: HalfEdgeId| (self.loop_at(h)).is_some_and(|l| !l.is_surrounded());
        self.depth(face) > limit || face.half_edges().into_iter().any(at_open_loop)
    }

    /// At vertices where the region touches itself in a point, takes out all fans of faces but one; true when it took
    /// any.
    ///
    /// A fan with a face at the rim is kept before others, then the largest. Faces at the rim are never taken out.
    fn trim_bow_ties(&self, inside: &mut SparseValues<bool>) -> bool {
        let across = |h: HalfEdgeId| {
            let twin = self.whole.topology.twin(h);
            twin.filter(|t| inside[t.face().index()])
        };
        let on_border = |h: HalfEdgeId| inside[h.face().index()] && across(h).is_none();
        // Every open fan has one half-edge of the region's boundary that leaves its vertex.
        let mut leaving = SparseValues::new(self.whole.mesh.positions.len(), 0u8);
        let mut ties = Vec::new();
        for h in self.faces().flat_map(FaceId::half_edges) {
            if on_border(h) {
                let v = self.whole.topology.origin(h);
                let count = &mut leaving[v.index()];
                *count = count.saturating_add(1);
                if *count == 2 {
                    ties.push(v);
                }
            }
        }
        ties.sort_unstable();
        let mut taken: Vec<FaceId> = Vec::new();
        for v in ties {
            let mut fans: Vec<Vec<FaceId>> = Vec::new();
            for h in self.whole.topology.leaving(v) {
                if on_border(h) {
                    let around = |e: &HalfEdgeId| across(e.previous());
                    let mut fan: Vec<FaceId> = std::iter::successors(Some(h), around)
                        .map(HalfEdgeId::face)
                        .collect();
                    fan.sort_unstable();
                    fans.push(fan);
                }
            }
            // By smallest face, so that the choice among equals depends on the mesh alone.
            fans.sort_unstable_by_key(|fan| fan.first().copied());
            let weight = |fan: &Vec<FaceId>| {
                let touching = fan.iter().any(|f| self.touching[f.index()]);
                (touching, fan.len())
            };
            let largest = fans.iter().map(weight).max();
            let kept = fans.iter().position(|fan| Some(weight(fan)) == largest);
            for (k, fan) in fans.iter().enumerate() {
                if Some(k) != kept {
                    taken.extend(fan.iter().filter(|f| !self.touching[f.index()]));
                }
            }
        }
        for f in &taken {
            inside[f.index()] = false;
        }
        !taken.is_empty()
    }
}
