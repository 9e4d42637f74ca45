//! Half-edge topology in flat arrays: which half-edge is opposite which, which corners surround a vertex, which faces
//! are connected.

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::pairing::{Twins, bucket_starts, pair_half_edges, places};

/// How the faces of a mesh are connected.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    /// Boundary half-edges, ascending, that share both ends with faces they were not joined to: three or more faces at
    /// one edge, or two that cannot face the same way.
    pub non_manifold: Vec<HalfEdgeId>,
    /// Per face the edge-connected component it belongs to, numbered by first face.
    pub component: Vec<u32>,
    /// How many components there are.
    pub components: usize,
    twins: Twins,
    origins: Vec<u32>,
    leaving_start: Vec<u32>,
    leaving: Vec<HalfEdgeId>,
}

impl Topology {
    /// Pairs the half-edges of `mesh`. Meant for welded meshes; near linear.
    ///
    /// Two half-edges are twins when they are the only two on their vertex pair and run against each other. Where
    /// more meet (or two run the same way) none of them is joined, and `non_manifold` lists them.
    /// A welded mesh knows more about such edges: see
    /// [`WeldedMesh::topology`](super::weld::WeldedMesh::topology).
    ///
    /// # Panics
    /// When a face names a vertex that does not exist.
    pub fn new(mesh: &TriMesh) -> Self {
        let pairing = pair_half_edges(&mesh.faces, &places(mesh));
        Self::with_twins(mesh, pairing.twins, pairing.non_manifold)
    }

    /// The topology of faces whose half-edges are paired already.
    pub(super) fn with_twins(mesh: &TriMesh, twins: Twins, non_manifold: Vec<HalfEdgeId>) -> Self {
        let origins = mesh.faces.as_flattened().to_vec();
        let (component, components) = face_components(&twins);
        let (leaving_start, leaving) = corners_by_vertex(&origins, mesh.positions.len());
        Self {
            non_manifold,
            component,
            components,
            twins,
            origins,
            leaving_start,
            leaving,
        }
    }

    /// The half-edge across the edge of `half_edge`; `None` on the boundary.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId> {
        self.twins.of(half_edge)
    }

    /// The twins of all half-edges.
    pub(super) fn twins(&self) -> &Twins {
        &self.twins
    }

    /// The vertex `half_edge` starts from.
    #[inline]
    pub fn origin(&self, half_edge: HalfEdgeId) -> VertexId {
        VertexId(self.origins[half_edge.index()])
    }

    /// The vertex `half_edge` runs to.
    #[inline]
    pub fn target(&self, half_edge: HalfEdgeId) -> VertexId {
        self.origin(half_edge.next())
    }

    /// The half-edges that leave `vertex`, one per face at it, in face order (not in cyclic order).
    #[inline]
    pub fn leaving(&self, vertex: VertexId) -> &[HalfEdgeId] {
        let v = vertex.index();
        &self.leaving[self.leaving_start[v] as usize..self.leaving_start[v + 1] as usize]
    }

    /// How many vertices the mesh has.
    pub(super) fn vertex_count(&self) -> usize {
        self.leaving_start.len() - 1
    }

    /// The faces at `vertex`, ascending.
    pub fn faces_at(&self, vertex: VertexId) -> impl Iterator<Item = FaceId> {
        self.leaving(vertex).iter().map(|h| h.face())
    }

    /// The vertices joined to `vertex` by an edge, ascending, each once.
    pub fn neighbours(&self, vertex: VertexId) -> Vec<VertexId> {
        let mut neighbours: Vec<VertexId> = self.face_neighbours(vertex).collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        neighbours
    }

    /// The two other vertices of every face at `vertex`, in face order; a vertex with two common faces comes twice.
    pub(super) fn face_neighbours(&self, vertex: VertexId) -> impl Iterator<Item = VertexId> {
        let leaving = self.leaving(vertex).iter();
        leaving.flat_map(|&h| [self.target(h), self.origin(h.previous())])
    }

    /// The same mesh as if it did not have the given faces, with the numbers of all others.
    ///
    /// The faces are at no vertex, and what they were joined to has a boundary there. `non_manifold` and `component`
    /// stay as they are.
    pub(super) fn without(&self, faces: &[FaceId]) -> Self {
        let mut gone = vec![false; self.component.len()];
        faces.iter().for_each(|f| gone[f.index()] = true);
        let kept = |h: &HalfEdgeId| !gone[h.face().index()];
        let twin = |h: HalfEdgeId| {
            let twin = self.twin(h).filter(kept);
            twin.filter(|_| kept(&h))
        };
        let mut leaving_start = vec![0];
        let mut leaving = Vec::with_capacity(self.leaving.len());
        for v in (0..self.vertex_count() as u32).map(VertexId) {
            leaving.extend(self.leaving(v).iter().copied().filter(kept));
            leaving_start.push(leaving.len() as u32);
        }
        Self {
            non_manifold: self.non_manifold.clone(),
            component: self.component.clone(),
            components: self.components,
            twins: (0..self.twins.len() as u32)
                .map(|h| twin(HalfEdgeId(h)))
                .collect(),
            origins: self.origins.clone(),
            leaving_start,
            leaving,
        }
    }

    /// Per face the edge-connected component it belongs to as its twins are now, numbered by first face, and how many
    /// there are.
    pub(super) fn connected(&self) -> (Vec<u32>, usize) {
        face_components(&self.twins)
    }

    /// Per vertex whether it lies on a boundary (or on no face at all).
    pub fn boundary_vertices(&self) -> Vec<bool> {
        let mut boundary: Vec<bool> = (0..self.vertex_count())
            .map(|v| self.leaving_start[v] == self.leaving_start[v + 1])
            .collect();
        for h in self.twins.boundary() {
            boundary[self.origin(h).index()] = true;
            boundary[self.target(h).index()] = true;
        }
        boundary
    }
}

/// Per face its edge-connected component, numbered by first face, and how many there are.
pub(super) fn face_components(twins: &Twins) -> (Vec<u32>, usize) {
    const OPEN: u32 = u32::MAX;
    let mut component = vec![OPEN; twins.len() / 3];
    let (mut count, mut stack) = (0, Vec::new());
    for first in (0..component.len() as u32).map(FaceId) {
        if component[first.index()] != OPEN {
            continue;
        }
        component[first.index()] = count;
        stack.push(first);
        while let Some(f) = stack.pop() {
            for g in f.half_edges().into_iter().filter_map(|h| twins.of(h)) {
                let g = g.face();
                if component[g.index()] == OPEN {
                    component[g.index()] = count;
                    stack.push(g);
                }
            }
        }
        count += 1;
    }
    (component, count as usize)
}

/// For every vertex where its half-edges start in the list, and the list of half-edges by origin, ascending at each
/// vertex.
pub(super) fn corners_by_vertex(origins: &[u32], vertices: usize) -> (Vec<u32>, Vec<HalfEdgeId>) {
    let starts = bucket_starts(origins.iter().copied(), vertices);
    let mut fill = starts.clone();
    let mut leaving = vec![HalfEdgeId(0); origins.len()];
    for (h, &v) in (0u32..).zip(origins) {
        leaving[fill[v as usize] as usize] = HalfEdgeId(h);
        fill[v as usize] += 1;
    }
    (starts, leaving)
}
