//! Half-edge topology in flat arrays: which half-edge meets which, which corners surround a vertex, which faces hang together.
//!
//! Half-edge `3 * face + corner` runs from that corner's vertex to the next corner's. A face is on the left of its own half-edges.

use super::TriMesh;

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
        Self::with_twins(mesh, twin, non_manifold)
    }

    /// The topology of faces whose half-edges are paired already.
    pub(super) fn with_twins(mesh: &TriMesh, twin: Vec<u32>, non_manifold: Vec<u32>) -> Self {
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

    /// How many vertices the mesh has.
    pub fn vertices(&self) -> usize {
        self.around_start.len() - 1
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
        let mut boundary: Vec<bool> = (0..self.vertices())
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
            if let [(_, g), (_, h)] = *group {
                if ends(g) == ends(h) {
                    join(&[g, h]);
                }
                // A lone pair that runs against each other is a seam, or the two banks of a cut.
                if at(g) == at(h) {
                    unpaired.extend([g, h]);
                }
                continue;
            }
            let mut group: Vec<u32> = group.iter().map(|e| e.1).collect();
            group.sort_unstable_by_key(|&h| (ends(h), h));
            group
                .chunk_by(|&g, &h| ends(g) == ends(h))
                .for_each(&mut join);
            unpaired.extend(group);
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
pub(super) fn bucket_starts(keys: impl Iterator<Item = u32>, count: usize) -> Vec<u32> {
    let mut starts = vec![0; count + 1];
    for key in keys {
        starts[key as usize + 1] += 1;
    }
    for bucket in 0..count {
        starts[bucket + 1] += starts[bucket];
    }
    starts
}

/// Per vertex the first vertex at exactly the same position. Near linear; n log n where an input was made to collide.
pub(super) fn places(mesh: &TriMesh) -> Vec<u32> {
    // Adding +0 turns −0 into 0 and leaves every other number's bits alone.
    let bits = |v: u32| {
        let p = &mesh.positions[v as usize];
        [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits())
    };
    let count = mesh.positions.len().next_power_of_two().max(2);
    let buckets: Vec<u32> = (0..mesh.positions.len() as u32)
        .map(|v| (mixed(bits(v)) >> (64 - count.trailing_zeros())) as u32)
        .collect();
    let starts = bucket_starts(buckets.iter().copied(), count);
    let mut fill = starts.clone();
    let mut sorted = vec![0; buckets.len()];
    for (v, &bucket) in (0..).zip(&buckets) {
        sorted[fill[bucket as usize] as usize] = v;
        fill[bucket as usize] += 1;
    }
    let mut place: Vec<u32> = (0..buckets.len() as u32).collect();
    for s in starts.windows(2).filter(|s| s[1] - s[0] > 1) {
        // Sorted rather than compared pair by pair: no input makes it slow.
        let bucket = &mut sorted[s[0] as usize..s[1] as usize];
        bucket.sort_unstable_by_key(|&v| (bits(v), v));
        for group in bucket.chunk_by(|&a, &b| bits(a) == bits(b)) {
            for &v in group {
                place[v as usize] = group[0];
            }
        }
    }
    place
}

/// Mixes the bits of a position so that the high ones spread evenly over buckets (Fibonacci hashing; the factors are odd and irrational-like).
fn mixed(bits: [u64; 3]) -> u64 {
    let factors = [
        0x9e37_79b9_7f4a_7c15_u64,
        0xc2b2_ae3d_27d4_eb4f,
        0x1656_67b1_9e37_79f9,
    ];
    let sum = (bits.iter().zip(factors)).fold(0u64, |sum, (b, f)| {
        sum.rotate_left(23)
            .wrapping_add((b ^ (b >> 29)).wrapping_mul(f))
    });
    (sum ^ (sum >> 32)).wrapping_mul(factors[0])
}

/// Groups corners into fans: corners at one vertex whose faces are joined by twins. Returns the fan of every corner,
/// numbered by first corner, and how many there are.
pub(super) fn corner_fans(twin: &[u32]) -> (Vec<u32>, usize) {
    let mut fan = vec![NONE; twin.len()];
    let mut count = 0;
    for first in 0..twin.len() as u32 {
        if fan[first as usize] != NONE {
            continue;
        }
        // h runs from its corner to the next; its twin t the other way: the corner of the face beyond is the one after t's.
        let mut h = first;
        while h != NONE && fan[h as usize] == NONE {
            fan[h as usize] = count;
            h = across(twin[h as usize], next);
        }
        // An open fan goes on round the other way.
        let mut h = twin[previous(first) as usize];
        while h != NONE && fan[h as usize] == NONE {
            fan[h as usize] = count;
            h = twin[previous(h) as usize];
        }
        count += 1;
    }
    (fan, count as usize)
}

/// What `step` makes of a half-edge, if there is one.
fn across(half_edge: u32, step: impl Fn(u32) -> u32) -> u32 {
    if half_edge == NONE {
        NONE
    } else {
        step(half_edge)
    }
}

fn face_components(twin: &[u32]) -> (Vec<u32>, usize) {
    let mut component = vec![NONE; twin.len() / 3];
    let (mut count, mut open) = (0, Vec::new());
    for first in 0..component.len() {
        if component[first] != NONE {
            continue;
        }
        component[first] = count;
        open.push(first);
        while let Some(f) = open.pop() {
            for &t in twin[3 * f..3 * f + 3].iter().filter(|&&t| t != NONE) {
                let g = t as usize / 3;
                if component[g] == NONE {
                    component[g] = count;
                    open.push(g);
                }
            }
        }
        count += 1;
    }
    (component, count as usize)
}

/// For every vertex the first of its corners' places, and the corners, ascending.
pub(super) fn corners_by_vertex(origins: &[u32], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let starts = bucket_starts(origins.iter().copied(), vertices);
    let mut fill = starts.clone();
    let mut around = vec![0; origins.len()];
    for (h, &v) in origins.iter().enumerate() {
        around[fill[v as usize] as usize] = h as u32;
        fill[v as usize] += 1;
    }
    (starts, around)
}
