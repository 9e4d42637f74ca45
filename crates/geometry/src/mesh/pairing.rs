//! How half-edges are paired across edges, and what follows from the pairs alone: fans around vertices and boundary
//! cycles.

use std::ops::Range;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;

use super::TriMesh;
use super::index::{HalfEdgeId, VertexId};
use super::sparse::SparseValues;

/// "No twin".
const NONE: HalfEdgeId = HalfEdgeId(u32::MAX);
/// Buckets or values of buckets that one thread takes at once.
const PART: usize = 1 << 14;

/// Per half-edge the opposite one, if it has one.
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
}

impl Paired for Twins {
    #[inline]
    fn half_edges(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn twin(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId> {
        Some(self.0[half_edge.index()]).filter(|&twin| twin != NONE)
    }
}

/// Half-edges some of which have an opposite one.
pub(super) trait Paired {
    /// How many half-edges there are.
    fn half_edges(&self) -> usize;

    /// The half-edge across the edge of `half_edge`; `None` on the boundary. An involution.
    fn twin(&self, half_edge: HalfEdgeId) -> Option<HalfEdgeId>;

    /// The half-edges without a twin, ascending.
    fn boundary(&self) -> impl Iterator<Item = HalfEdgeId> {
        (0..self.half_edges() as u32)
            .map(HalfEdgeId)
            .filter(|&h| self.twin(h).is_none())
    }

    /// The half-edges that leave the end of a boundary half-edge, from its own face to the next boundary half-edge.
    fn fan_after(&self, boundary: HalfEdgeId) -> impl Iterator<Item = HalfEdgeId> {
        std::iter::successors(Some(boundary.next()), |&h| Some(self.twin(h)?.next()))
    }

    /// The boundary as cycles of half-edges, each from its smallest vertex on; `origin` is the vertex a half-edge
    /// starts from.
    fn boundary_cycles(&self, origin: impl Fn(HalfEdgeId) -> VertexId) -> Vec<Vec<HalfEdgeId>> {
        let mut seen = SparseValues::new(self.half_edges(), false);
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
    /// corner of each face, numbered by first corner, and how many there are.
    fn corner_fans(&self) -> (Vec<[u32; 3]>, usize) {
        const OPEN: u32 = u32::MAX;
        let mut fans = vec![[OPEN; 3]; self.half_edges() / 3];
        let fan = fans.as_flattened_mut();
        let mut count = 0;
        for first in (0..self.half_edges() as u32).map(HalfEdgeId) {
            if fan[first.index()] != OPEN {
                continue;
            }
            // The twin of h runs to h's corner: the corner of the face beyond is the one after the twin's.
            let mut at = Some(first);
            while let Some(h) = at.filter(|h| fan[h.index()] == OPEN) {
                fan[h.index()] = count;
                at = self.twin(h).map(HalfEdgeId::next);
            }
            // A fan that reached the boundary continues in the other direction.
            let mut at = self.twin(first.previous());
            while let Some(h) = at.filter(|h| fan[h.index()] == OPEN) {
                fan[h.index()] = count;
                at = self.twin(h.previous());
            }
            count += 1;
        }
        (fans, count as usize)
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
    // Each is set once, by the thread that has its edge.
    let twins: Vec<AtomicU32> = (0..origins.len()).map(|_| NONE.0.into()).collect();
    let join = |pair: &[HalfEdgeId]| {
        if let [g, h] = *pair
            && from(g) != from(h)
        {
            twins[g.index()].store(h.0, Relaxed);
            twins[h.index()].store(g.0, Relaxed);
        }
    };
    let unpaired = |group: &[HalfEdgeId]| -> Vec<HalfEdgeId> {
        if let [g, h] = *group {
            if ends(g) == ends(h) {
                join(&[g, h]);
            }
            // A lone pair that runs against each other is a seam, or the two sides of a cut.
            return match at(g) == at(h) {
                true => vec![g, h],
                false => Vec::new(),
            };
        }
        let mut group = group.to_vec();
        group.sort_unstable_by_key(|&h| (ends(h), h));
        group.chunk_by(|&g, &h| ends(g) == ends(h)).for_each(join);
        group
    };
    let edges = EdgesByPlace::new(origins, place);
    let parts = edges.parts().into_par_iter();
    let unpaired = parts.map(|part| edges.groups_in(part).flat_map(unpaired).collect::<Vec<_>>());
    let mut unpaired = unpaired.collect::<Vec<_>>().concat();
    let twins: Vec<HalfEdgeId> = twins
        .into_iter()
        .map(|twin| HalfEdgeId(twin.into_inner()))
        .collect();
    unpaired.retain(|&h| twins[h.index()] == NONE);
    unpaired.sort_unstable();
    Pairing {
        twins: Twins(twins),
        non_manifold: unpaired,
    }
}

/// All half-edges of a mesh by the edge they run along.
pub(super) struct EdgesByPlace<'a> {
    origins: &'a [u32],
    place: &'a [u32],
    /// By the lower place of their ends, each bucket sorted by (higher place, half-edge).
    buckets: Buckets<HalfEdgeId>,
}

impl<'a> EdgesByPlace<'a> {
    /// Sorts half-edges; `origins` holds the vertex that each starts from, `place` the place of every vertex.
    pub fn new(origins: &'a [u32], place: &'a [u32]) -> Self {
        let half_edges = || (0..origins.len() as u32).map(HalfEdgeId);
        let ends = |h: HalfEdgeId| {
            let [a, b] = [h, h.next()].map(|h| place[origins[h.index()] as usize]);
            (a.min(b), a.max(b))
        };
        let mut buckets = Buckets::new(place.len(), || half_edges().map(|h| (ends(h).0, h)));
        buckets.sort_each_by_key(|&h| (ends(h).1, h));
        EdgesByPlace {
            origins,
            place,
            buckets,
        }
    }

    /// The half-edges of each edge that has more than one, ascending.
    pub fn groups(&self) -> impl Iterator<Item = &[HalfEdgeId]> {
        self.groups_in(0..self.buckets.len())
    }

    /// The buckets in parts for one thread each.
    fn parts(&self) -> Vec<Range<usize>> {
        let firsts = (0..self.buckets.len()).step_by(PART);
        let end = |first: usize| self.buckets.len().min(first + PART);
        firsts.map(|first| first..end(first)).collect()
    }

    /// [`EdgesByPlace::groups`] of some buckets.
    fn groups_in(&self, buckets: Range<usize>) -> impl Iterator<Item = &[HalfEdgeId]> {
        // In a bucket the lower places are the same.
        let high = |h: HalfEdgeId| {
            let [a, b] = [h, h.next()].map(|h| self.place[self.origins[h.index()] as usize]);
            a.max(b)
        };
        let edges = buckets.flat_map(move |bucket| {
            let bucket = self.buckets.get(bucket);
            bucket.chunk_by(move |&g, &h| high(g) == high(h))
        });
        edges.filter(|group| group.len() > 1)
    }
}

/// Per vertex the half-edges that leave it, ascending.
pub(super) fn corners_by_vertex(origins: &[u32], vertices: usize) -> Buckets<HalfEdgeId> {
    let entries = || (0u32..).zip(origins).map(|(h, v)| (*v, HalfEdgeId(h)));
    Buckets::new(vertices, entries)
}

/// Values in buckets.
#[derive(Debug, Clone)]
pub(super) struct Buckets<T> {
    /// Where each bucket starts, and where the last ends.
    starts: Vec<u32>,
    values: Vec<T>,
}

impl<T: Copy + Send + Sync> Buckets<T> {
    /// Puts values into the buckets of their keys, in the order they come in; `entries` gives the same keys, below
    /// `count`, and values each time. Two threads take half of the buckets each.
    pub fn new<I: Iterator<Item = (u32, T)>>(count: usize, entries: impl Fn() -> I + Sync) -> Self {
        // One ahead: filling moves each start to where the next bucket starts.
        let mut starts = vec![0u32; count + 2];
        let half = count / 2;
        let counted = |counts: &mut [u32], first: usize| {
            for (key, _) in entries() {
                // Keys below the first wrap around to beyond the last.
                if let Some(count) = counts.get_mut((key as usize).wrapping_sub(first)) {
                    *count += 1;
                }
            }
        };
        let (low, high) = starts[2..].split_at_mut(half);
        rayon::join(|| counted(low, 0), || counted(high, half));
        for bucket in 0..count {
            starts[bucket + 2] += starts[bucket + 1];
        }
        let mut values: Vec<T> = Vec::new();
        if let Some((_, any)) = entries().next() {
            values.resize(starts[count + 1] as usize, any);
        }
        let filled = |places: &mut [u32], first: usize, values: &mut [T], before: u32| {
            for (key, value) in entries() {
                if let Some(at) = places.get_mut((key as usize).wrapping_sub(first)) {
                    values[(*at - before) as usize] = value;
                    *at += 1;
                }
            }
        };
        let before = starts[half + 1];
        let (low, high) = starts[1..=count].split_at_mut(half);
        let (first, second) = values.split_at_mut(before as usize);
        rayon::join(
            || filled(low, 0, first, 0),
            || filled(high, half, second, before),
        );
        starts.pop();
        Buckets { starts, values }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// What is in a bucket.
    #[inline]
    pub fn get(&self, bucket: usize) -> &[T] {
        &self.values[self.starts[bucket] as usize..self.starts[bucket + 1] as usize]
    }

    /// Sorts each bucket.
    pub fn sort_each_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K + Sync) {
        sort_each(&self.starts, &mut self.values, &key);
    }
}

/// Sorts each bucket of `values`; `starts` are the buckets' starts, the last one's end after them, all ahead of `values`
/// by the first.
fn sort_each<T: Send, K: Ord>(starts: &[u32], values: &mut [T], key: &(impl Fn(&T) -> K + Sync)) {
    let before = starts[0];
    if values.len() > PART && starts.len() > 2 {
        let half = starts.len() / 2;
        let (low, high) = values.split_at_mut((starts[half] - before) as usize);
        rayon::join(
            || sort_each(&starts[..=half], low, key),
            || sort_each(&starts[half..], high, key),
        );
        return;
    }
    for bucket in starts.windows(2).filter(|s| s[1] - s[0] > 1) {
        let [from, to] = [bucket[0], bucket[1]].map(|at| (at - before) as usize);
        values[from..to].sort_unstable_by_key(key);
    }
}

/// Per vertex its place: the first vertex at exactly the same position (−0 equals 0). Near linear, at worst n log n.
pub(super) fn places(mesh: &TriMesh) -> Vec<u32> {
    // Adding +0 turns −0 into 0 and leaves every other number's bits alone.
    let bits = |v: u32| {
        let p = &mesh.positions[v as usize];
        [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits())
    };
    let vertices = 0..mesh.positions.len() as u32;
    // The high half of the hash, then the vertex. Sorted, not put into a table: an input made to collide costs n log n,
    // not n².
    let keys = vertices.clone().into_par_iter();
    let mut keys: Vec<u64> = keys
        .map(|v| (hash(bits(v)) >> 32 << 32) | u64::from(v))
        .collect();
    keys.par_sort_unstable();
    let mut place: Vec<u32> = vertices.collect();
    let alike = keys.chunk_by(|a, b| a >> 32 == b >> 32);
    for alike in alike.filter(|alike| alike.len() > 1) {
        let mut alike: Vec<u32> = alike.iter().map(|key| *key as u32).collect();
        alike.sort_unstable_by_key(|&v| (bits(v), v));
        for group in alike.chunk_by(|&a, &b| bits(a) == bits(b)) {
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
