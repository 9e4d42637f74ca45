//! Stretches of the cloth's own edge, by the places that a request names.

use std::f64::consts::PI;

use crate::point_limit::PointLimit;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::curvature::inner_angle;
use darn_geometry::mesh::loops::BoundaryLoop;

/// Nanoseconds of work a vertex of the loops for two points that are looked for.
const VERTEX_WORK: u64 = 20;
/// Nanoseconds of work a vertex of a loop for its two ways.
const WAY_WORK: u64 = 400;
/// Radians from a bite's turning within which a stretch is one, and by which the longer of two ways must be nearer to it before it is taken.
const SURELY_A_BITE: f64 = 1.5;

/// A stretch of a loop.
#[derive(Clone, Copy)]
pub struct Stretch<'a> {
    /// The loop.
    pub rim: &'a BoundaryLoop,
    /// Its first vertex in the loop.
    pub from: usize,
    /// How many edges it has.
    pub edges: usize,
}

impl<'a> Stretch<'a> {
    /// Its last vertex in the loop.
    pub fn to(&self) -> usize {
        (self.from + self.edges) % self.rim.vertices.len()
    }

    /// The loop's vertices that it lies between and at.
    pub fn vertices(&self) -> impl Iterator<Item = usize> {
        let n = self.rim.vertices.len();
        (self.from..=self.from + self.edges).map(move |k| k % n)
    }

    /// The places of these vertices, scene space.
    pub fn places(&self, whole: &WeldedScan) -> impl Iterator<Item = Vec3> {
        let places = self.from..=self.from + self.edges;
        places.map(|k| whole.rim_position(self.rim, k))
    }

    /// Whether both have a vertex of a loop in common.
    pub fn overlaps(&self, other: &Stretch) -> bool {
        let n = self.rim.vertices.len();
        let within = |s: &Stretch, vertex: usize| (vertex + n - s.from) % n <= s.edges;
        self.rim.id == other.rim.id && (within(self, other.from) || within(other, self.from))
    }

    /// Its length, scene units.
    pub fn length(&self, whole: &WeldedScan) -> f64 {
        let places: Vec<Vec3> = self.places(whole).collect();
        let edges = places.windows(2).map(|ends| (ends[1] - ends[0]).norm());
        edges.sum()
    }

    /// Whether it leads into the cloth and back.
    pub fn is_bite(&self, whole: &WeldedScan) -> bool {
        self.off_a_bite(whole) < SURELY_A_BITE
    }

    /// How far the turning between its ends is from that of a way into the cloth and back, which is −π, radians. What noise adds to the turning of
    /// each vertex is taken off, as much as the loop's own turning shows.
    fn off_a_bite(&self, whole: &WeldedScan) -> f64 {
        let turning = |k: usize| {
            let vertex = self.rim.vertices[k % self.rim.vertices.len()];
            PI - inner_angle(&whole.surface.mesh, &whole.topology, vertex)
        };
        let n = self.rim.vertices.len();
        let noise = ((0..n).map(turning).sum::<f64>() - self.rim.turning) / n as f64;
        let inside = (self.from + 1)..(self.from + self.edges);
        (inside.map(|k| turning(k) - noise).sum::<f64>() + PI).abs()
    }
}

/// Whether of the two ways along a loop the first one is meant: the one that leads into the cloth, the shorter one where that is not sure.
///
/// # Errors
/// `Exhausted`.
pub fn into_cloth(
    whole: &WeldedScan,
    ways: &[Stretch; 2],
    budget: &Budget,
) -> Result<bool, Exhausted> {
    budget.spend(WAY_WORK * ways[0].rim.vertices.len() as u64)?;
    let second_is_longer = ways[0].length(whole) <= ways[1].length(whole);
    let off = [&ways[0], &ways[1]].map(|way| way.off_a_bite(whole));
    let (longer, shorter) = match second_is_longer {
        true => (off[1], off[0]),
        false => (off[0], off[1]),
    };
    let take_longer = longer + SURELY_A_BITE < shorter;
    Ok(take_longer != second_is_longer)
}

/// The loop nearest to two points.
struct Nearest<'a> {
    rim: &'a BoundaryLoop,
    /// Per point the distance of its nearest vertex, and which that is.
    found: [(f64, usize); 2],
    /// The sum of both distances.
    sum: f64,
}

/// Finds the ways along the scan's loops between two points each.
pub struct Places<'a> {
    whole: &'a WeldedScan,
    limit: PointLimit<'a>,
}

impl<'a> Places<'a> {
    /// Looks in a scan.
    pub fn of(whole: &'a WeldedScan) -> Places<'a> {
        Places {
            whole,
            limit: PointLimit::of(&whole.surface.mesh),
        }
    }

    /// The two ways between the vertices nearest to two points along the loop that is nearest to both, the first one from the first point on; or
    /// why there is none.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn ways(
        &self,
        ends: &[Vec3; 2],
        budget: &Budget,
    ) -> Result<Result<[Stretch<'a>; 2], String>, Exhausted> {
        let mut steps = Steps::of(budget);
        let mut best: Option<Nearest<'a>> = None;
        for rim in self.whole.loops.iter().filter(|l| !l.vertices.is_empty()) {
            steps.take(VERTEX_WORK * rim.vertices.len() as u64)?;
            let found = [0, 1].map(|end| {
                let distance = |k: usize| (self.whole.rim_position(rim, k) - ends[end]).norm();
                let all = (0..rim.vertices.len()).map(|k| (distance(k), k));
                all.fold(
                    (f64::INFINITY, 0),
                    |best, one| {
                        if one.0 < best.0 { one } else { best }
                    },
                )
            });
            let sum = found[0].0 + found[1].0;
            if best.as_ref().is_none_or(|nearest| sum < nearest.sum) {
                best = Some(Nearest { rim, found, sum });
            }
        }
        let Some(Nearest { rim, found, .. }) = best else {
            return Ok(Err("the scan's cloth has no edge of its own".to_owned()));
        };
        for (name, (distance, _)) in ["from", "to"].iter().zip(found) {
            if let Err(detail) = self.within_limit(name, distance) {
                return Ok(Err(detail));
            }
        }
        let [from, to] = found.map(|(_, vertex)| vertex);
        if from == to {
            let detail = "`from` and `to` are nearest to the same vertex of the cloth's edge";
            return Ok(Err(detail.to_owned()));
        }
        let way = |from: usize, to: usize| Stretch {
            rim,
            from,
            edges: ahead(rim, from, to),
        };
        Ok(Ok([way(from, to), way(to, from)]))
    }

    /// Why a point that far from the cloth's edge is refused, if it is.
    pub fn within_limit(&self, name: &str, distance: f64) -> Result<(), String> {
        self.limit.check(name, distance, "edge of the cloth")
    }
}

/// Edges of a loop from one vertex on to another.
pub fn ahead(rim: &BoundaryLoop, from: usize, to: usize) -> usize {
    let n = rim.vertices.len();
    (to + n - from) % n
}
