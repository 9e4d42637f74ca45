//! Half-edge topology in flat arrays: which half-edge is opposite which, which corners surround a vertex, which faces
//! are connected.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::pairing::{Buckets, Paired, Twins, corners_by_vertex, pair_half_edges, places};

/// How the faces of a mesh are connected.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    /// Boundary half-edges, ascending, that share both ends with faces they were not joined to: three or more faces at
    /// one edge, or two that cannot face the same way.
    pub non_manifold: Vec<HalfEdgeId>,
    /// Per face the edge-connected component it belongs to, numbered by first face.
    pub component: Arc<Vec<u32>>,
    /// How many components there are.
    pub components: usize,
    twins: Arc<Twins>,
    origins: Arc<Vec<u32>>,
    /// Per vertex the half-edges that leave it, ascending.
    leaving: Arc<Buckets<HalfEdgeId>>,
    /// What it does not have.
    without: Without,
}

/// Faces that a topology does not have.
#[derive(Debug, Clone, Default, PartialEq)]
struct Without {
    /// Ascending.
    faces: Vec<FaceId>,
    /// The half-edges that leave the vertices of these faces.
    leaving: BTreeMap<VertexId, Vec<HalfEdgeId>>,
}

impl Without {
    #[inline]
    fn has(&self, face: FaceId) -> bool {
        !self.faces.is_empty() && self.faces.binary_search(&face).is_ok()
    }
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
        Self::with_twins(mesh, pairing.twins.into(), pairing.non_manifold)
    }

    /// The topology of faces whose half-edges are paired already.
    pub(super) fn with_twins(
        mesh: &TriMesh,
        twins: Arc<Twins>,
        non_manifold: Vec<HalfEdgeId>,
    ) -> Self {
        let origins = mesh.faces.as_flattened().to_vec();
        let ((component, components), leaving) = rayon::join(
            || face_components(&*twins),
            || corners_by_vertex(&origins, mesh.positions.len()),
        );
        Self {
            non_manifold,
            component: component.into(),
            components,
            twins,
            origins: origins.into(),
            leaving: leaving.into(),
            without: Without::default(),
        }
    }

    /// The half-edge across the edge of `half_edge`; `None` on the boundary.
    #[inline]
    pub fn twin(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId> {
        let twin = self.twins.twin(half_edge)?;
        let gone = self.without.has(half_edge.face()) || self.without.has(twin.face());
        (!gone).then_some(twin)
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
        match self.without.leaving.get(&vertex) {
            Some(leaving) => leaving,
            None => self.leaving.get(vertex.index()),
        }
    }

    /// How many vertices the mesh has.
    pub(super) fn vertex_count(&self) -> usize {
        self.leaving.len()
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

    /// The same mesh as if it did not have the given faces, with the numbers of all others. Costs no pass over the mesh.
    ///
    /// The faces are at no vertex, and what they were joined to has a boundary there. `non_manifold` and `component`
    /// stay as they are.
    pub(super) fn without(&self, faces: &[FaceId]) -> Self {
        let mut gone = [&self.without.faces, faces].concat();
        gone.sort_unstable();
        gone.dedup();
        let kept = |h: &HalfEdgeId| gone.binary_search(&h.face()).is_err();
        let corners = gone.iter().flat_map(|f| f.half_edges());
        let leaving = corners.map(|h| {
            let vertex = self.origin(h);
            let others = self.leaving.get(vertex.index()).iter();
            (vertex, others.copied().filter(kept).collect())
        });
        let without = Without {
            leaving: leaving.collect(),
            faces: gone,
        };
        Self {
            without,
            ..self.clone()
        }
    }

    /// Per vertex whether it lies on a boundary (or on no face at all).
    pub fn boundary_vertices(&self) -> Vec<bool> {
        let vertices = (0..self.vertex_count() as u32).map(VertexId);
        let mut boundary: Vec<bool> = vertices.map(|v| self.leaving(v).is_empty()).collect();
        for h in self.boundary() {
            boundary[self.origin(h).index()] = true;
            boundary[self.target(h).index()] = true;
        }
        boundary
    }
}

impl Paired for Topology {
    fn half_edges(&self) -> usize {
        self.twins.half_edges()
    }

    #[inline]
    fn twin(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId> {
        self.twin(half_edge)
    }
}

/// Per face its edge-connected component, numbered by first face, and how many there are. Disjoint sets: near linear,
/// and in the order of the faces, which lie side by side in most files.
pub(super) fn face_components(twins: &impl Paired) -> (Vec<u32>, usize) {
    // Each set's root is its first face.
    let mut parent: Vec<u32> = (0..(twins.half_edges() / 3) as u32).collect();
    let root = |parent: &mut [u32], mut f: u32| {
        while parent[f as usize] != f {
            // Halves the path for the next search.
            parent[f as usize] = parent[parent[f as usize] as usize];
            f = parent[f as usize];
        }
        f
    };
    for h in (0..twins.half_edges() as u32).map(HalfEdgeId) {
        if let Some(twin) = twins.twin(h).filter(|twin| *twin < h) {
            let a = root(&mut parent, h.face().0);
            let b = root(&mut parent, twin.face().0);
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    // A face's parent comes before it, so it has its number by now.
    let mut count = 0;
    for f in 0..parent.len() {
        let of = parent[f] as usize;
        parent[f] = if of == f {
            count += 1;
            count - 1
        } else {
            parent[of]
        };
    }
    (parent, count as usize)
}
