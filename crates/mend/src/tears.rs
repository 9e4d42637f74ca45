//! Tears through cloth: stretches of the edges of two pieces that face each other across a gap.

use darn_budget::{Budget, Exhausted, Steps};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::BoundaryLoop;

use crate::welded_scan::WeldedScan;

/// Loops that are looked at: the longest.
const LOOPS: usize = 32;
/// Points that a loop is looked at in, at most.
const SAMPLES: usize = 256;
/// Fewest edges of a torn edge.
const LEAST_EDGES: usize = 8;
/// Widest gap, as a share of the shorter of the two loops.
const WIDEST: f64 = 0.1;
/// Least length of a torn edge, in widths of the gap.
const LEAST_LENGTH: f64 = 1.5;
/// Least cosine between the direction out of the cloth and the direction to the other edge.
const LEAST_FACING: f64 = 0.5;
/// Edges on each side of a vertex that the direction out of the cloth is taken from.
const BESIDE: usize = 2;
/// Samples in a row that may look elsewhere within a torn edge: a torn edge is ragged.
const RAGGED: usize = 3;
/// Edges beyond such samples in which the corner of a torn edge is looked for.
const CORNER: usize = 4;
/// How far a corner may be from the other edge, in widths of the gap.
const FARTHER: f64 = 1.5;
/// Least share of a torn edge whose nearest points lie on the other.
const LEAST_MUTUAL: f64 = 0.7;
/// Nanoseconds of work a pair of points.
const PAIR_WORK: u64 = 5;

/// Two torn edges that face each other.
pub struct Tear<'a> {
    /// The edges; the first one's loop has the lower id.
    pub edges: [TornSide<'a>; 2],
    /// Mean distance from the one to the other, scene units.
    pub gap: f64,
}

/// A torn edge.
pub struct TornSide<'a> {
    /// Its loop.
    pub rim: &'a BoundaryLoop,
    /// Its first vertex, an index into the loop's.
    pub from: usize,
    /// Its last vertex; before `from` when it runs over the loop's first vertex.
    pub to: usize,
    /// Its length, scene units.
    pub length: f64,
}

/// The tears between different pieces of a scan, of each two loops the longest, in the order of the loops. Of these loops only the
/// longest are looked at.
///
/// # Errors
/// `Exhausted`.
pub fn tears<'a>(
    welded: &WeldedScan,
    rims: &[&'a BoundaryLoop],
    budget: &Budget,
) -> Result<Vec<Tear<'a>>, Exhausted> {
    let mut longest: Vec<&BoundaryLoop> = (rims.iter().copied())
        .filter(|rim| rim.vertices.len() > 2 * LEAST_EDGES)
        .collect();
    longest.sort_by(|a, b| b.length.total_cmp(&a.length).then(a.id.cmp(&b.id)));
    longest.truncate(LOOPS);
    longest.sort_by_key(|rim| rim.id);
    let edges: Vec<Edge> = longest.iter().map(|rim| Edge::of(welded, rim)).collect();
    let mut steps = Steps::of(budget);
    let mut tears = Vec::new();
    for (k, first) in edges.iter().enumerate() {
        for second in &edges[k + 1..] {
            let reach = WIDEST * first.rim.length.min(second.rim.length);
            if first.rim.component != second.rim.component && first.is_near(second, reach) {
                tears.extend(tear(first, second, reach, &mut steps)?);
            }
        }
    }
    Ok(tears)
}

/// The tear between two loops, if there is one.
fn tear<'a>(
    first: &Edge<'a>,
    second: &Edge<'a>,
    reach: f64,
    steps: &mut Steps,
) -> Result<Option<Tear<'a>>, Exhausted> {
    let own = first.run_facing(second, reach, steps)?;
    let other = second.run_facing(first, reach, steps)?;
    let (Some(own), Some(other)) = (own, other) else {
        return Ok(None);
    };
    let gap = (own.gap + other.gap) / 2.0;
    let is_torn = |edge: &Edge, run: &Run, opposite: &Run| {
        let mutual = run.nearest.iter().filter(|k| opposite.has(**k)).count();
        mutual as f64 >= LEAST_MUTUAL * run.nearest.len() as f64
            && run.edges >= LEAST_EDGES
            && edge.length(run) >= LEAST_LENGTH * gap
    };
    if !is_torn(first, &own, &other) || !is_torn(second, &other, &own) {
        return Ok(None);
    }
    Ok(Some(Tear {
        edges: [first.side(&own), second.side(&other)],
        gap,
    }))
}

/// A loop as it is looked at.
struct Edge<'a> {
    rim: &'a BoundaryLoop,
    /// Per vertex its place and the unit direction out of the cloth.
    points: Vec<(Vec3, Vec3)>,
    /// Vertices at about equal steps.
    samples: Vec<usize>,
    low: Vec3,
    high: Vec3,
}

/// A stretch of a loop that faces another loop.
struct Run {
    /// Its first vertex.
    from: usize,
    /// Its edges.
    edges: usize,
    /// Vertices of its loop.
    vertices: usize,
    /// Per sample that faces the other loop, the vertex there that is nearest to it.
    nearest: Vec<usize>,
    /// Mean distance of these, scene units.
    gap: f64,
}

/// A way beyond the end of a run.
struct Walk {
    /// The run's last vertex.
    vertex: usize,
    /// Vertices of a step.
    by: usize,
    /// From the run's other end to this one.
    along: Vec3,
}

impl Run {
    fn has(&self, vertex: usize) -> bool {
        (vertex + self.vertices - self.from) % self.vertices <= self.edges
    }
}

impl<'a> Edge<'a> {
    fn of(welded: &WeldedScan, rim: &'a BoundaryLoop) -> Edge<'a> {
        let n = rim.vertices.len();
        let outward: Vec<Vec3> = (0..n).map(|k| welded.outward(rim, k)).collect();
        let points: Vec<(Vec3, Vec3)> = (0..n)
            .map(|k| {
                let beside = (0..2 * BESIDE).map(|b| outward[(k + b + BESIDE * n - BESIDE) % n]);
                let sum: Vec3 = beside.sum();
                let unit = sum.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
                (welded.rim_position(rim, k), unit)
            })
            .collect();
        let nowhere = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
        let (low, high) =
            (points.iter()).fold(nowhere, |(low, high), (p, _)| (low.inf(p), high.sup(p)));
        let count = n.min(SAMPLES);
        Edge {
            rim,
            points,
            samples: (0..count).map(|s| s * n / count).collect(),
            low,
            high,
        }
    }

    /// Whether the boxes of two loops are nearer than `reach`.
    fn is_near(&self, other: &Edge, reach: f64) -> bool {
        let apart = (self.low - other.high).sup(&(other.low - self.high));
        apart.max() <= reach
    }

    /// The nearest of some vertices of another loop, and its distance, where it is nearer than `reach` and both look at each other.
    fn facing(
        &self,
        vertex: usize,
        other: &Edge,
        among: &[usize],
        reach: f64,
    ) -> Option<(usize, f64)> {
        let (place, outward) = self.points[vertex];
        let distance = |k: &usize| (other.points[*k].0 - place).norm_squared();
        let nearest = *(among.iter()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let (there, back) = other.points[nearest];
        let gap = there - place;
        let length = gap.norm();
        let least = LEAST_FACING * length;
        let faces = length > 0.0 && gap.dot(&outward) >= least && -gap.dot(&back) >= least;
        (faces && length <= reach).then_some((nearest, length))
    }

    /// The longest stretch that faces another loop and has ends.
    fn run_facing(
        &self,
        other: &Edge,
        reach: f64,
        steps: &mut Steps,
    ) -> Result<Option<Run>, Exhausted> {
        let count = self.samples.len();
        let mut facing: Vec<(usize, usize, f64)> = Vec::new();
        for (s, vertex) in self.samples.iter().enumerate() {
            steps.take(PAIR_WORK * other.samples.len() as u64)?;
            let found = self.facing(*vertex, other, &other.samples, reach);
            facing.extend(found.map(|(nearest, gap)| (s, nearest, gap)));
        }
        // Runs end where more samples in a row look elsewhere than a ragged edge has.
        let ahead = |a: usize, b: usize| (b + count - a - 1) % count + 1;
        let next = |k: usize| facing[(k + 1) % facing.len()].0;
        let ends: Vec<usize> = (0..facing.len())
            .filter(|k| ahead(facing[*k].0, next(*k)) > RAGGED + 1)
            .collect();
        let before = ends.iter().cycle().skip(ends.len().saturating_sub(1));
        let runs = before.zip(&ends).map(|(before, end)| {
            let first = (before + 1) % facing.len();
            let length = (end + facing.len() - first) % facing.len() + 1;
            (first, length)
        });
        let Some((first, length)) =
            runs.max_by_key(|(first, length)| (*length, usize::MAX - first))
        else {
            return Ok(None);
        };
        let run: Vec<(usize, usize, f64)> = (facing.iter().cycle().skip(first))
            .take(length)
            .copied()
            .collect();
        let n = self.points.len();
        let gap = run.iter().map(|(.., gap)| gap).sum::<f64>() / length as f64;
        let ends = [run[0].0, run[length - 1].0].map(|s| self.samples[s]);
        let [back, on] =
            [(ends[0], ends[1], n - 1), (ends[1], ends[0], 1)].map(|(vertex, opposite, by)| {
                let along = self.points[vertex].0 - self.points[opposite].0;
                let walk = Walk { vertex, by, along };
                self.corner_ahead(&walk, other, FARTHER * gap, steps)
            });
        let (back, on) = (back?, on?);
        Ok(Some(Run {
            from: (ends[0] + n - back) % n,
            edges: (ends[1] + n - ends[0]) % n + back + on,
            vertices: n,
            gap,
            nearest: run.into_iter().map(|(_, nearest, _)| nearest).collect(),
        }))
    }

    /// How many edges beyond the end of a run its corner lies: where the loop has gone farthest along the run, not farther than `most` from
    /// the other loop.
    fn corner_ahead(
        &self,
        walk: &Walk,
        other: &Edge,
        most: f64,
        steps: &mut Steps,
    ) -> Result<usize, Exhausted> {
        let n = self.points.len();
        let Some(along) = walk.along.try_normalize(f64::MIN_POSITIVE) else {
            return Ok(0);
        };
        let start = self.points[walk.vertex].0;
        let edge = self.rim.length / n as f64;
        let (mut corner, mut farthest) = (0, 0.0);
        for k in 1..=(RAGGED + 1) * n.div_ceil(self.samples.len()) + CORNER {
            steps.take(PAIR_WORK * other.points.len() as u64)?;
            let place = self.points[(walk.vertex + k * walk.by) % n].0;
            let distances = other.points.iter().map(|(p, _)| (p - place).norm());
            if distances.fold(f64::INFINITY, f64::min) > most {
                break;
            }
            let gone = along.dot(&(place - start));
            // A hem that goes on at a right angle goes no farther.
            if gone > farthest + 0.25 * edge {
                (corner, farthest) = (k, gone);
            }
        }
        Ok(corner)
    }

    /// Length of a stretch, scene units.
    fn length(&self, run: &Run) -> f64 {
        let place = |k: usize| self.points[k % self.points.len()].0;
        let edges = (run.from..run.from + run.edges).map(|k| place(k + 1) - place(k));
        edges.map(|edge| edge.norm()).sum()
    }

    fn side(&self, run: &Run) -> TornSide<'a> {
        TornSide {
            rim: self.rim,
            from: run.from,
            to: (run.from + run.edges) % self.points.len(),
            length: self.length(run),
        }
    }
}
