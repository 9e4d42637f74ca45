//! Half-edge topology in flat arrays: which half-edge meets which, which corners surround a vertex, which faces hang together.
//!
//! Half-edge `3 * face + corner` runs from that corner's vertex to the next corner's. A face is on the left of its own half-edges.

use super::{TriMesh, Vec3};

/// "No such half-edge": the twin of a half-edge on the boundary.
pub const NONE: u32 = u32::MAX;

/// The half-edge that follows `half_edge` round its face.
pub fn next(half_edge: u32) -> u32 {
    if half_edge % 3 == 2 {
        half_edge - 2
    } else {
        half_edge + 1
    }
}

/// The half-edge that precedes `half_edge` round its face.
pub fn previous(half_edge: u32) -> u32 {
    if half_edge.is_multiple_of(3) {
        half_edge + 2
    } else {
        half_edge - 1
    }
}

/// How the faces of a mesh hang together.
#[derive(Debug, Clone, PartialEq)]
pub struct Topology {
    /// Per half-edge the opposite one, [`NONE`] on the boundary. An involution: `twin[twin[h]] == h`.
    pub twin: Vec<u32>,
    /// Boundary half-edges, ascending, that share both end positions with faces they could not be joined to: three or more
    /// faces at one edge, or two that run along it in the same direction.
    pub non_manifold: Vec<u32>,
    /// Per face the edge-connected component it belongs to, numbered by first face.
    pub component: Vec<u32>,
    /// How many components there are.
    pub components: usize,
    origins: Vec<u32>,
    around_start: Vec<u32>,
    around: Vec<u32>,
}

impl Topology {
    /// Pairs the half-edges of `mesh`. Meant for welded meshes; near linear.
    ///
    /// Two half-edges are twins when they are the only two on their vertex pair and run against each other. Where more meet
    /// (or two run the same way) none of them is joined, and they are listed in `non_manifold`. [`weld`](super::weld::weld)
    /// gives sheets that merely touch along an edge vertices of their own there; each sheet is then whole, and only what ends at the shared edge is listed.
    ///
    /// # Panics
    /// When a face names a vertex that does not exist.
    pub fn new(mesh: &TriMesh) -> Self {
        let (twin, non_manifold) = pair_half_edges(&mesh.faces, &places(mesh));
        let origins = mesh.faces.as_flattened().to_vec();
        let (component, components) = face_components(&twin);
        let (around_start, around) = corners_by_vertex(&origins, mesh.positions.len());
        Self {
            twin,
            non_manifold,
            component,
            components,
            origins,
            around_start,
            around,
        }
    }

    /// The vertex `half_edge` starts from.
    pub fn from(&self, half_edge: u32) -> u32 {
        self.origins[half_edge as usize]
    }

    /// The vertex `half_edge` runs to.
    pub fn to(&self, half_edge: u32) -> u32 {
        self.origins[next(half_edge) as usize]
    }

    /// The half-edges that leave `vertex`, one per face at it, in face order (not in cyclic order).
    pub fn leaving(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.around[self.around_start[v] as usize..self.around_start[v + 1] as usize]
    }

    /// The faces at `vertex`, ascending.
    pub fn faces_at(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        self.leaving(vertex).iter().map(|h| h / 3)
    }

    /// The vertices joined to `vertex` by an edge, ascending, each once.
    pub fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let mut ring: Vec<u32> = self
            .leaving(vertex)
            .iter()
            .flat_map(|&h| [self.to(h), self.from(previous(h))])
            .collect();
        ring.sort_unstable();
        ring.dedup();
        ring
    }

    /// Per vertex whether it lies on a boundary (or on no face at all).
    pub fn boundary_vertices(&self) -> Vec<bool> {
        let vertices = self.around_start.len() - 1;
        let mut boundary: Vec<bool> = (0..vertices)
            .map(|v| self.around_start[v] == self.around_start[v + 1])
            .collect();
        for h in (0..self.twin.len() as u32).filter(|&h| self.twin[h as usize] == NONE) {
            boundary[self.from(h) as usize] = true;
            boundary[self.to(h) as usize] = true;
        }
        boundary
    }

    /// Every undirected edge once, as the lower-numbered of its half-edges, ascending.
    pub fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.twin.len() as u32).filter(|&h| h < self.twin[h as usize])
    }
}

/// Pairs half-edges: twins share both vertices with each other alone and run against each other. `place` says which vertices are in one
/// place. Also returns, ascending, the boundary half-edges that [`Topology::non_manifold`] lists.
pub(super) fn pair_half_edges(faces: &[[u32; 3]], place: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let origins = faces.as_flattened();
    let from = |h: u32| origins[h as usize];
    let ends = |h: u32| (from(h).min(from(next(h))), from(h).max(from(next(h))));
    let at = |h: u32| place[from(h) as usize];
    let mut twin = vec![NONE; origins.len()];
    let mut unpaired = Vec::new();
    let mut join = |pair: &[u32]| {
        if let [g, h] = *pair
            && from(g) != from(h)
        {
            twin[g as usize] = h;
            twin[h as usize] = g;
        }
    };
    let (starts, edges) = edges_by_place(origins, place);
    for bucket in starts
        .windows(2)
        .map(|s| &edges[s[0] as usize..s[1] as usize])
    {
        for group in bucket.chunk_by(|x, y| x.0 == y.0).filter(|g| g.len() > 1) {
            let mut group: Vec<u32> = group.iter().map(|e| e.1).collect();
            group.sort_unstable_by_key(|&h| (ends(h), h));
            group
                .chunk_by(|&g, &h| ends(g) == ends(h))
                .for_each(&mut join);
            // A lone pair that runs against each other is a seam, or the two banks of a cut.
            if group.len() > 2 || at(group[0]) == at(group[1]) {
                unpaired.extend(group);
            }
        }
    }
    unpaired.retain(|&h| twin[h as usize] == NONE);
    unpaired.sort_unstable();
    (twin, unpaired)
}

/// All half-edges in buckets by the lower place of their ends, each bucket sorted by (higher place, half-edge): the starts of
/// the buckets, and the buckets.
fn edges_by_place(origins: &[u32], place: &[u32]) -> (Vec<u32>, Vec<(u32, u32)>) {
    let ends = |h: usize| {
        let (a, b) = (
            place[origins[h] as usize],
            place[origins[next(h as u32) as usize] as usize],
        );
        (a.min(b), a.max(b))
    };
    let starts = bucket_starts((0..origins.len()).map(|h| ends(h).0), place.len());
    let mut fill = starts.clone();
    let mut edges = vec![(0, 0); origins.len()];
    for h in 0..origins.len() {
        let (low, high) = ends(h);
        edges[fill[low as usize] as usize] = (high, h as u32);
        fill[low as usize] += 1;
    }
    for s in starts.windows(2) {
        edges[s[0] as usize..s[1] as usize].sort_unstable();
    }
    (starts, edges)
}

/// Where each of `count` buckets starts when `keys` are sorted into them, and where the last ends.
fn bucket_starts(keys: impl Iterator<Item = u32>, count: usize) -> Vec<u32> {
    let mut starts = vec![0; count + 1];
    for key in keys {
        starts[key as usize + 1] += 1;
    }
    for bucket in 0..count {
        starts[bucket + 1] += starts[bucket];
    }
    starts
}

/// Per vertex the first vertex at exactly the same position.
pub(super) fn places(mesh: &TriMesh) -> Vec<u32> {
    // Adding +0 turns −0 into 0 and leaves every other number's bits alone.
    let bits = |p: &Vec3| [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits());
    // Sorted rather than hashed: no input makes it slow.
    let mut keys: Vec<([u64; 3], u32)> = mesh
        .positions
        .iter()
        .enumerate()
        .map(|(v, p)| (bits(p), v as u32))
        .collect();
    keys.sort_unstable();
    let mut place = vec![0; keys.len()];
    for group in keys.chunk_by(|a, b| a.0 == b.0) {
        for (_, v) in group {
            place[*v as usize] = group[0].1;
        }
    }
    place
}

/// Groups corners into fans: corners at one vertex whose faces are joined by twins. Returns the fan of every corner,
/// numbered by first corner, and how many there are.
pub(super) fn corner_fans(twin: &[u32]) -> (Vec<u32>, usize) {
    let mut sets = Sets::new(twin.len());
    for (h, &t) in twin.iter().enumerate().filter(|&(_, &t)| t != NONE) {
        // h runs from its corner to the next; t the other way: h's corner is the one after t's.
        sets.join(h as u32, next(t));
    }
    sets.numbered()
}

fn face_components(twin: &[u32]) -> (Vec<u32>, usize) {
    let mut sets = Sets::new(twin.len() / 3);
    for (h, &t) in twin.iter().enumerate().filter(|&(_, &t)| t != NONE) {
        sets.join(h as u32 / 3, t / 3);
    }
    sets.numbered()
}

fn corners_by_vertex(origins: &[u32], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let starts = bucket_starts(origins.iter().copied(), vertices);
    let mut fill = starts.clone();
    let mut around = vec![0; origins.len()];
    for (h, &v) in origins.iter().enumerate() {
        around[fill[v as usize] as usize] = h as u32;
        fill[v as usize] += 1;
    }
    (starts, around)
}

/// Disjoint sets of numbers; the smallest member stands for its set, so nothing depends on the order of joining.
pub(super) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// `count` sets of one.
    pub(super) fn new(count: usize) -> Self {
        Self {
            parent: (0..count as u32).collect(),
        }
    }

    /// The smallest member of the set of `x`.
    pub(super) fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            let above = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = above;
            x = above;
        }
        x
    }

    /// Makes one set of the sets of `x` and `y`.
    pub(super) fn join(&mut self, x: u32, y: u32) {
        let (a, b) = (self.find(x), self.find(y));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Per member the number of its set, counted by smallest member, and how many sets there are.
    pub(super) fn numbered(mut self) -> (Vec<u32>, usize) {
        let mut count = 0;
        let mut number = vec![0; self.parent.len()];
        for x in 0..self.parent.len() as u32 {
            let root = self.find(x);
            if root == x {
                number[x as usize] = count;
                count += 1;
            } else {
                number[x as usize] = number[root as usize];
            }
        }
        (number, count as usize)
    }
}
