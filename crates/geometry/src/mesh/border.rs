//! Borders that nearly meet: vertices within a tolerance of each other, and vertices on the edges of other faces.
//!
//! Only the ends of half-edges without a twin are looked at, so inner geometry never changes, however fine it is.

use darn_budget::{Budget, Exhausted, Steps};
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};

use super::Vec3;
use super::index::HalfEdgeId;
use super::pairing::{Paired, Twins};

/// Roundings that two vertices which were one may have gone through, in units of the coordinates' precision.
const ROUNDINGS: f64 = 4.0;
/// Tolerance as a share of the shortest border edge: a gap this narrow is no gap in the cloth.
const NARROW: f64 = 1e-3;
/// The tolerance's bound as a share of the shortest border edge, however coarse the coordinates are.
const WIDEST: f64 = 0.1;
/// Vertices near one vertex that are looked at.
const MAX_NEAR: usize = 64;
/// Vertices that one vertex may stand for: as many as may meet at the pole of a ball.
const MAX_CLUSTER: usize = 512;
/// Cosine between two faces at an edge above which one lies on the other: then they are two skins, and no seam.
pub(super) const FOLDED: f64 = 0.95;
/// Nanoseconds of work a border vertex in the search tree, and in a search.
const SEARCH_WORK: u64 = 1500;
/// Nanoseconds of work a vertex found.
const FOUND_WORK: u64 = 100;

/// Faces by places: vertices of the soup of which each stands for all at its place.
#[derive(Clone, Copy)]
pub(super) struct PlacedFaces<'a> {
    /// The soup's positions.
    pub positions: &'a [Vec3],
    /// Per face its places.
    pub faces: &'a [[u32; 3]],
}

impl PlacedFaces<'_> {
    /// The place that a half-edge starts from.
    pub fn from(&self, half_edge: HalfEdgeId) -> u32 {
        self.faces[half_edge.face().index()][half_edge.corner()]
    }

    /// The place that a half-edge runs to.
    pub fn to(&self, half_edge: HalfEdgeId) -> u32 {
        self.from(half_edge.next())
    }

    /// The direction in which a half-edge's face lies: a unit vector across the edge, 0 for a face without area.
    pub fn wing(&self, half_edge: HalfEdgeId) -> Vec3 {
        let [a, b, c] = [half_edge, half_edge.next(), half_edge.previous()]
            .map(|h| self.positions[self.from(h) as usize]);
        let along = (b - a).try_normalize(0.0).unwrap_or_default();
        let across = (c - a) - along * along.dot(&(c - a));
        across.try_normalize(0.0).unwrap_or_default()
    }
}

/// The border of a mesh, searchable.
pub(super) struct Border<'a> {
    placed: PlacedFaces<'a>,
    /// By place, ascending.
    vertices: Vec<BorderVertex>,
    /// The half-edges without a twin, ascending.
    edges: Vec<HalfEdgeId>,
    tree: RTree<GeomWithData<[f64; 3], u32>>,
    /// The coarsest precision among the vertices, scene units.
    coarsest: f64,
    budget: &'a Budget<'a>,
}

/// A vertex on the border.
#[derive(Clone, Copy)]
struct BorderVertex {
    place: u32,
    /// Length of the shortest border edge there, scene units.
    shortest: f64,
    /// Precision of its coordinates, scene units.
    precision: f64,
}

/// A border vertex on the border edge of a face that does not have it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Junction {
    /// The edge.
    pub half_edge: HalfEdgeId,
    /// Where on it, as a share of its length.
    pub along: f64,
    /// The vertex's place.
    pub place: u32,
}

/// Two border vertices within the tolerance.
struct NearPair {
    distance: f64,
    low: u32,
    high: u32,
}

impl<'a> Border<'a> {
    /// The border of faces; `precision` gives that of a place's coordinates in scene units. O(n log n) in the border.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(
        placed: PlacedFaces<'a>,
        twins: &Twins,
        precision: &dyn Fn(u32) -> f64,
        budget: &'a Budget<'a>,
    ) -> Result<Border<'a>, Exhausted> {
        let edges: Vec<HalfEdgeId> = twins.boundary().collect();
        budget.spend_at_once(SEARCH_WORK * edges.len() as u64)?;
        let mut ends: Vec<(u32, f64)> = Vec::with_capacity(2 * edges.len());
        for &h in &edges {
            let (a, b) = (placed.from(h), placed.to(h));
            let length = (placed.positions[b as usize] - placed.positions[a as usize]).norm();
            ends.extend([(a, length), (b, length)]);
        }
        ends.sort_unstable_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)));
        ends.dedup_by_key(|end| end.0);
        let vertices: Vec<BorderVertex> = ends
            .into_iter()
            .map(|(place, shortest)| BorderVertex {
                place,
                shortest,
                precision: precision(place),
            })
            .collect();
        let points = (0u32..)
            .zip(&vertices)
            .map(|(k, v)| GeomWithData::new(placed.positions[v.place as usize].into(), k));
        Ok(Border {
            placed,
            tree: RTree::bulk_load(points.collect()),
            coarsest: vertices.iter().map(|v| v.precision).fold(0.0, f64::max),
            vertices,
            edges,
            budget,
        })
    }

    /// Groups of vertices that lie within the tolerance of each other: per place that is not the lowest of its group,
    /// ascending, that lowest place. Two vertices of one face are never in one group.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn near_places(&self) -> Result<Vec<(u32, u32)>, Exhausted> {
        let pairs = self.near_pairs()?;
        if pairs.is_empty() {
            return Ok(Vec::new());
        }
        let beside = self.sharing_faces(&pairs);
        let mut groups: Vec<Vec<u32>> = (0..self.vertices.len() as u32).map(|k| vec![k]).collect();
        let mut lowest: Vec<u32> = (0..self.vertices.len() as u32).collect();
        let mut steps = Steps::of(self.budget);
        for pair in &pairs {
            let (a, b) = (lowest[pair.low as usize], lowest[pair.high as usize]);
            let (low, high) = (a.min(b), a.max(b));
            let (one, other) = (&groups[low as usize], &groups[high as usize]);
            steps.take(FOUND_WORK * (1 + one.len() * other.len()) as u64)?;
            let share = |x: u32, y: u32| beside.binary_search(&(x.min(y), x.max(y))).is_ok();
            let apart = low == high
                || one.len() + other.len() > MAX_CLUSTER
                || self.distance(low, high) > self.tolerance(low, high)
                || one.iter().any(|x| other.iter().any(|y| share(*x, *y)));
            if apart {
                continue;
            }
            let moved = std::mem::take(&mut groups[high as usize]);
            moved.iter().for_each(|k| lowest[*k as usize] = low);
            groups[low as usize].extend(moved);
        }
        let place = |k: u32| self.vertices[k as usize].place;
        Ok((0..lowest.len() as u32)
            .filter(|&k| lowest[k as usize] != k)
            .map(|k| (place(k), place(lowest[k as usize])))
            .collect())
    }

    /// Pairs of vertices within the tolerance, nearest first.
    fn near_pairs(&self) -> Result<Vec<NearPair>, Exhausted> {
        let mut steps = Steps::of(self.budget);
        let mut pairs = Vec::new();
        for (low, vertex) in (0u32..).zip(&self.vertices) {
            steps.take(SEARCH_WORK)?;
            let reach = bounded(self.coarsest, vertex.shortest);
            // Where squares underflow or overflow, distances tell nothing.
            if !(reach * reach).is_normal() {
                continue;
            }
            let at = self.placed.positions[vertex.place as usize].into();
            let near = self.tree.locate_within_distance(at, reach * reach);
            for high in near.take(MAX_NEAR).map(|point| point.data) {
                steps.take(FOUND_WORK)?;
                let distance = self.distance(low, high);
                if low < high && distance <= self.tolerance(low, high) {
                    pairs.push(NearPair {
                        distance,
                        low,
                        high,
                    });
                }
            }
        }
        pairs.sort_unstable_by(|x, y| {
            let distance = x.distance.total_cmp(&y.distance);
            distance.then((x.low, x.high).cmp(&(y.low, y.high)))
        });
        Ok(pairs)
    }

    /// Pairs of vertices of `pairs` that belong to one face, lower first, sorted.
    fn sharing_faces(&self, pairs: &[NearPair]) -> Vec<(u32, u32)> {
        const NONE: u32 = u32::MAX;
        let mut own = vec![NONE; self.placed.positions.len()];
        for k in pairs.iter().flat_map(|pair| [pair.low, pair.high]) {
            own[self.vertices[k as usize].place as usize] = k;
        }
        let mut beside = Vec::new();
        for face in self.placed.faces {
            let [a, b, c] = face.map(|place| own[place as usize]);
            let sides = [(a, b), (b, c), (c, a)].into_iter();
            let sides = sides.filter(|(x, y)| *x != NONE && *y != NONE);
            beside.extend(sides.map(|(x, y)| (x.min(y), x.max(y))));
        }
        beside.sort_unstable();
        beside.dedup();
        beside
    }

    /// Vertices within the tolerance of border edges whose faces do not have them, by edge and place along it; only
    /// where another border edge runs along there, so that splitting the edge lets faces meet.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn junctions(&self) -> Result<Vec<Junction>, Exhausted> {
        let mut steps = Steps::of(self.budget);
        let mut junctions = Vec::new();
        let by_ends = self.edges_by_ends();
        for &half_edge in &self.edges {
            steps.take(SEARCH_WORK)?;
            let mut on_edge = Vec::new();
            for near in self
                .tree
                .locate_in_envelope_intersecting(&self.around(half_edge))
            {
                steps.take(FOUND_WORK)?;
                on_edge.extend(self.on_edge(half_edge, near.data));
            }
            on_edge.sort_unstable_by(|x: &Junction, y| {
                x.along.total_cmp(&y.along).then(x.place.cmp(&y.place))
            });
            let inner = on_edge.iter().map(|junction| junction.place);
            let stops: Vec<u32> = std::iter::once(self.placed.from(half_edge))
                .chain(inner)
                .chain([self.placed.to(half_edge)])
                .collect();
            let meets: Vec<bool> = stops
                .windows(2)
                .map(|ends| self.runs_along(half_edge, ends, &by_ends))
                .collect();
            let useful = on_edge
                .iter()
                .zip(meets.windows(2))
                .filter(|(_, m)| m[0] || m[1]);
            junctions.extend(useful.map(|(junction, _)| *junction));
        }
        Ok(junctions)
    }

    /// A box around an edge that holds every vertex within the tolerance.
    fn around(&self, half_edge: HalfEdgeId) -> AABB<[f64; 3]> {
        let [a, b] = [self.placed.from(half_edge), self.placed.to(half_edge)]
            .map(|place| self.placed.positions[place as usize]);
        let margin = Vec3::repeat(bounded(self.coarsest, (b - a).norm()));
        AABB::from_corners((a.inf(&b) - margin).into(), (a.sup(&b) + margin).into())
    }

    /// A border vertex as a junction of an edge, if it lies on it between its ends.
    fn on_edge(&self, half_edge: HalfEdgeId, vertex: u32) -> Option<Junction> {
        let placed = &self.placed;
        let own = self.vertices[vertex as usize];
        if placed.faces[half_edge.face().index()].contains(&own.place) {
            return None;
        }
        let [a, b, p] = [placed.from(half_edge), placed.to(half_edge), own.place]
            .map(|place| placed.positions[place as usize]);
        let length = (b - a).norm();
        let tolerance = bounded(own.precision, own.shortest.min(length));
        let along = (p - a).dot(&(b - a)) / (length * length);
        let inside = along * length > tolerance && (1.0 - along) * length > tolerance;
        let beside = (a + (b - a) * along - p).norm();
        (inside && beside <= tolerance).then_some(Junction {
            half_edge,
            along,
            place: own.place,
        })
    }

    /// Whether a border edge of another face joins two places on an edge, and its face does not lie on the edge's.
    fn runs_along(&self, half_edge: HalfEdgeId, ends: &[u32], by_ends: &[BorderEdge]) -> bool {
        let ends = ends.iter().min().zip(ends.iter().max());
        let Some(ends) = ends.map(|(low, high)| (*low, *high)) else {
            return false;
        };
        let first = by_ends.partition_point(|edge| edge.0 < ends);
        let own = self.placed.wing(half_edge);
        let here = by_ends[first..].iter().take_while(|edge| edge.0 == ends);
        here.filter(|edge| edge.1 != half_edge)
            .any(|edge| self.placed.wing(edge.1).dot(&own) < FOLDED)
    }

    /// The border edges by their places, the lower first, sorted.
    fn edges_by_ends(&self) -> Vec<BorderEdge> {
        let ends = |h: HalfEdgeId| {
            let (a, b) = (self.placed.from(h), self.placed.to(h));
            (a.min(b), a.max(b))
        };
        let mut edges: Vec<BorderEdge> = self.edges.iter().map(|&h| (ends(h), h)).collect();
        edges.sort_unstable();
        edges
    }

    fn distance(&self, one: u32, other: u32) -> f64 {
        let [a, b] = [one, other].map(|k| {
            let place = self.vertices[k as usize].place;
            self.placed.positions[place as usize]
        });
        (a - b).norm()
    }

    /// How far apart two vertices may lie and still be one.
    fn tolerance(&self, one: u32, other: u32) -> f64 {
        let [a, b] = [one, other].map(|k| self.vertices[k as usize]);
        bounded(a.precision.max(b.precision), a.shortest.min(b.shortest))
    }
}

/// The places of a border edge, the lower first, and the edge.
type BorderEdge = ((u32, u32), HalfEdgeId);

/// The tolerance for coordinates of this precision at edges of this length; all in scene units.
pub(super) fn bounded(precision: f64, shortest: f64) -> f64 {
    (ROUNDINGS * precision)
        .max(NARROW * shortest)
        .min(WIDEST * shortest)
}
