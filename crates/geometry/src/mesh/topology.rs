//! Half-edge topology in flat arrays: which half-edge is opposite which, which corners surround a vertex, which faces
//! are connected.

use std::collections::BTreeMap;
use std::sync::Arc;

use smallvec::SmallVec;

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::pairing::{Buckets, Paired, Twins, corners_by_vertex, pair_half_edges, places};

/// How the faces of a mesh are connected.
#[derive(Debug, Clone)]
pub struct Topology {
    /// Boundary half-edges, ascending, that share both ends with faces they were not joined to: three or more faces at
    /// one edge, or two that cannot face the same way.
    pub non_manifold: Vec<HalfEdgeId>,
    /// How many edge-connected components there are.
    pub components: usize,
    /// Per face its component; empty where all faces are of one.
    component: Arc<Vec<u32>>,
    twins: Arc<Twins>,
    /// The mesh, for its faces alone.
    mesh: Arc<TriMesh>,
    leaving: Arc<Leaving>,
    /// What it does not have.
    without: Without,
}

/// The half-edges that leave each vertex.
#[derive(Debug)]
enum Leaving {
    /// All of them, ascending.
    All(Buckets<HalfEdgeId>),
    /// The first; twins lead from it to the others, since the faces at a vertex are one fan.
    First(Arc<Vec<HalfEdgeId>>),
}

/// The half-edges that leave a vertex; most vertices have six.
pub type LeavingHalfEdges = SmallVec<[HalfEdgeId; 8]>;

/// What welding knows of a mesh's topology.
pub(super) struct Fans {
    /// The twins of its half-edges.
    pub twins: Arc<Twins>,
    /// Per vertex the first half-edge that leaves it. The faces at a vertex are one fan.
    pub first: Arc<Vec<HalfEdgeId>>,
    /// What [`Topology::non_manifold`] lists.
    pub non_manifold: Vec<HalfEdgeId>,
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
        let origins = mesh.faces.as_flattened();
        let leaving = corners_by_vertex(origins, mesh.positions.len());
        let faces_alone = TriMesh {
            positions: Vec::new(),
            faces: mesh.faces.clone(),
        };
        Self {
            leaving: Leaving::All(leaving).into(),
            ..Self::with_fans(
                faces_alone.into(),
                Fans {
                    twins: pairing.twins.into(),
                    first: Arc::default(),
                    non_manifold: pairing.non_manifold,
                },
            )
        }
    }

    /// The topology of a welded mesh, which it shares.
    pub(super) fn with_fans(mesh: Arc<TriMesh>, fans: Fans) -> Self {
        let (mut component, components) = face_components(&*fans.twins);
        if components <= 1 {
            component = Vec::new();
        }
        Self {
            non_manifold: fans.non_manifold,
            component: component.into(),
            components,
            twins: fans.twins,
            mesh,
            leaving: Leaving::First(fans.first).into(),
            without: Without::default(),
        }
    }

    /// The edge-connected component that a face belongs to; components are numbered by first face.
    #[inline]
    pub fn component(&self, face: FaceId) -> u32 {
        self.component.get(face.index()).copied().unwrap_or(0)
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
        VertexId(self.mesh.faces[half_edge.face().index()][half_edge.corner()])
    }

    /// The vertex `half_edge` runs to.
    #[inline]
    pub fn target(&self, half_edge: HalfEdgeId) -> VertexId {
        self.origin(half_edge.next())
    }

    /// The half-edges that leave `vertex`, one per face at it, in face order (not in cyclic order).
    pub fn leaving(&self, vertex: VertexId) -> LeavingHalfEdges {
        match self.without.leaving.get(&vertex) {
            Some(leaving) => SmallVec::from_slice(leaving),
            None => self.leaving_whole(vertex),
        }
    }

    /// The half-edges that leave a vertex of the mesh with all its faces.
    fn leaving_whole(&self, vertex: VertexId) -> LeavingHalfEdges {
        let first = match &*self.leaving {
            Leaving::All(all) => return SmallVec::from_slice(all.get(vertex.index())),
            Leaving::First(first) => first[vertex.index()],
        };
        let mut fan = SmallVec::from_slice(&[first]);
        let on = |h: HalfEdgeId| self.twins.twin(h).map(HalfEdgeId::next);
        let ahead = std::iter::successors(on(first), |h| on(*h));
        fan.extend(ahead.take_while(|h| *h != first));
        // A fan that ends on the boundary goes on in the other direction.
        if fan.last().is_some_and(|last| on(*last).is_none()) {
            let back = |h: HalfEdgeId| self.twins.twin(h.previous());
            fan.extend(std::iter::successors(back(first), |h| back(*h)));
        }
        fan.sort_unstable();
        fan
    }

    /// How many vertices the mesh has.
    pub(super) fn vertex_count(&self) -> usize {
        match &*self.leaving {
            Leaving::All(all) => all.len(),
            Leaving::First(first) => first.len(),
        }
    }

    /// The faces at `vertex`, ascending.
    pub fn faces_at(&self, vertex: VertexId) -> impl Iterator<Item = FaceId> + use<> {
        self.leaving(vertex).into_iter().map(HalfEdgeId::face)
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
        let leaving = self.leaving(vertex).into_iter();
        leaving.flat_map(|h| [self.target(h), self.origin(h.previous())])
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
            let others = self.leaving_whole(vertex).into_iter();
            (vertex, others.filter(kept).collect())
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
        let is_bare = |v: u32| match &*self.leaving {
            Leaving::All(all) => all.get(v as usize).is_empty(),
            Leaving::First(_) => false,
        };
        let gone = |v: u32| self.without.leaving.get(&VertexId(v)).map(Vec::is_empty);
        let vertices = 0..self.vertex_count() as u32;
        let mut boundary: Vec<bool> = vertices
            .map(|v| gone(v).unwrap_or_else(|| is_bare(v)))
            .collect();
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
