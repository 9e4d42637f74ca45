//! How half-edges are paired across edges, and what follows from the pairs alone: fans around vertices and boundary
//! cycles.

use super::TriMesh;
use super::index::{HalfEdgeId, VertexId};

/// "No twin".
const NONE: HalfEdgeId = HalfEdgeId(u32::MAX);

/// Per half-edge the opposite one, if it has one. An involution: the twin of the twin of `h` is `h`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Twins(Vec<HalfEdgeId>);

impl Twins {
    /// So many half-edges, none of which has a twin.
    pub fn unpaired(len: usize) -> Twins {
        Twins(vec![NONE; len])
    }

    /// Makes two half-edges twins.
    pub fn join(&mut self, g: HalfEdgeId, h: HalfEdgeId) {
        self.0[g.index()] = h;
        self.0[h.index()] = g;
    }

    /// How many half-edges there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The half-edge across the edge of `half_edge`; `None` on the boundary.
    #[inline]
    pub fn of(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId> {
        Some(self.0[half_edge.index()]).filter(|&twin| twin != NONE)
    }

    /// The half-edges without a twin, ascending.
    pub fn boundary(&self) -> impl Iterator<Item = HalfEdgeId> {
        (0..self.len() as u32)
            .map(HalfEdgeId)
            .filter(|&h| self.of(h).is_none())
    }

    /// The half-edges that leave the end of a boundary half-edge, from its own face to the next boundary half-edge.
    pub fn fan_after(&self, boundary: HalfEdgeId) -> impl Iterator<Item = HalfEdgeId> {
        std::iter::successors(Some(boundary.next()), |&h| Some(self.of(h)?.next()))
    }

    /// The boundary as cycles of half-edges, each from its smallest vertex on; `origin` is the vertex a half-edge
    /// starts from.
    pub fn boundary_cycles(&self, origin: impl Fn(HalfEdgeId) -> VertexId) -> Vec<Vec<HalfEdgeId>> {
        let mut seen = vec![false; self.len()];
        let mut cycles = Vec::new();
        for first in self.boundary() {
            let mut cycle = Vec::new();
            let mut h = first;
            while !seen[h.index()] {
                seen[h.index()] = true;
                cycle.push(h);
                // The fan never returns to its start: its first half-edge follows one without a twin.
                h = self.fan_after(h).last().unwrap_or(h);
            }
            let start = (0..cycle.len()).min_by_key(|&i| (origin(cycle[i]), cycle[i]));
            if let Some(start) = start {
                cycle.rotate_left(start);
                cycles.push(cycle);
            }
        }
        cycles
    }

    /// Groups corners into fans: corners at one vertex whose faces are joined by twins. Returns the fan of every
    /// corner, numbered by first corner, and how many there are.
    pub fn corner_fans(&self) -> (Vec<u32>, usize) {
        const OPEN: u32 = u32::MAX;
        let mut fan = vec![OPEN; self.len()];
        let mut count = 0;
        for first in (0..self.len() as u32).map(HalfEdgeId) {
            if fan[first.index()] != OPEN {
                continue;
            }
            // The twin of h runs to h's corner: the corner of the face beyond is the one after the twin's.
            let mut at = Some(first);
            while let Some(h) = at.filter(|h| fan[h.index()] == OPEN) {
                fan[h.index()] = count;
                at = self.of(h).map(HalfEdgeId::next);
            }
            // A fan that reached the boundary continues in the other direction.
            let mut at = self.of(first.previous());
            while let Some(h) = at.filter(|h| fan[h.index()] == OPEN) {
                fan[h.index()] = count;
                at = self.of(h.previous());
            }
            count += 1;
        }
        (fan, count as usize)
    }
}

impl FromIterator<Option<HalfEdgeId>> for Twins {
    fn from_iter<I: IntoIterator<Item = Option<HalfEdgeId>>>(twins: I) -> Self {
        Twins(twins.into_iter().map(|t| t.unwrap_or(NONE)).collect())
    }
}

/// The half-edges of a mesh, paired.
pub(super) struct Pairing {
    /// The pairs.
    pub twins: Twins,
    /// What [`Topology::non_manifold`](super::topology::Topology::non_manifold) lists.
    pub non_manifold: Vec<HalfEdgeId>,
}

/// Pairs half-edges: twins share both vertices with each other alone and run against each other. `place` tells which
/// vertices share a position; see [`places`].
pub(super) fn pair_half_edges(faces: &[[u32; 3]], place: &[u32]) -> Pairing {
    let origins = faces.as_flattened();
    let from = |h: HalfEdgeId| origins[h.index()];
    let ends = |h: HalfEdgeId| {
        let (a, b) = (from(h), from(h.next()));
        (a.min(b), a.max(b))
    };
    let at = |h: HalfEdgeId| place[from(h) as usize];
    let mut twins = vec![NONE; origins.len()];
    let mut unpaired = Vec::new();
    let mut join = |pair: &[HalfEdgeId]| {
        if let [g, h] = *pair
            && from(g) != from(h)
        {
            twins[g.index()] = h;
            twins[h.index()] = g;
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
                // A lone pair that runs against each other is a seam, or the two sides of a cut.
                if at(g) == at(h) {
                    unpaired.extend([g, h]);
                }
                continue;
            }
            let mut group: Vec<HalfEdgeId> = group.iter().map(|e| e.1).collect();
            group.sort_unstable_by_key(|&h| (ends(h), h));
            group
                .chunk_by(|&g, &h| ends(g) == ends(h))
                .for_each(&mut join);
            unpaired.extend(group);
        }
    }
    unpaired.retain(|&h| twins[h.index()] == NONE);
    unpaired.sort_unstable();
    Pairing {
        twins: Twins(twins),
        non_manifold: unpaired,
    }
}

/// All half-edges in buckets by the lower place of their ends, each bucket sorted by (higher place, half-edge): the
/// starts of the buckets, and the buckets.
pub(super) fn edges_by_place(origins: &[u32], place: &[u32]) -> (Vec<u32>, Vec<(u32, HalfEdgeId)>) {
    let half_edges = || (0..origins.len() as u32).map(HalfEdgeId);
    let ends = |h: HalfEdgeId| {
        let [a, b] = [h, h.next()].map(|h| place[origins[h.index()] as usize]);
        (a.min(b), a.max(b))
    };
    let starts = bucket_starts(half_edges().map(|h| ends(h).0), place.len());
    let mut fill = starts.clone();
    let mut edges = vec![(0, NONE); origins.len()];
    for h in half_edges() {
        let (low, high) = ends(h);
        edges[fill[low as usize] as usize] = (high, h);
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

/// Per vertex its place: the first vertex at exactly the same position (−0 equals 0). Near linear, at worst n log n.
pub(super) fn places(mesh: &TriMesh) -> Vec<u32> {
    // Adding +0 turns −0 into 0 and leaves every other number's bits alone.
    let bits = |v: u32| {
        let p = &mesh.positions[v as usize];
        [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits())
    };
    let count = mesh.positions.len().next_power_of_two().max(2);
    let buckets: Vec<u32> = (0..mesh.positions.len() as u32)
        .map(|v| (hash(bits(v)) >> (64 - count.trailing_zeros())) as u32)
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
        // Sorted, not compared pair by pair: an input made to collide costs n log n, not n².
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

/// A hash of a position whose high bits spread evenly over buckets (Fibonacci hashing, Knuth vol. 3, 6.4).
fn hash(bits: [u64; 3]) -> u64 {
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
