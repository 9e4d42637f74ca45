//! Where cloth that wraps around a tube is cut open: along the far side from a hole.

use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap};

use darn_budget::{Budget, Exhausted, Steps};

use super::growth::Growth;
use super::index::VertexId;
use super::piece::Piece;

/// Edges of the whole mesh that a piece is cut along; the lower end comes first.
pub(super) type CutEdges = BTreeSet<(VertexId, VertexId)>;

/// An edge next to the rim costs this many times as much as one of the same length on the far side.
const NEAR_RIM: f64 = 20.0;
/// Nanoseconds of work an edge that a path is tried along.
const EDGE_WORK: u64 = 100;

/// Adds the edges of a path from one outer loop of a piece to another: short, and far from the rim. `false` when there
/// is no path; it meets neither the rim nor another hole.
///
/// # Errors
/// `Exhausted`.
pub(super) fn add_cut(
    piece: &Piece,
    growth: &Growth,
    cut: &mut CutEdges,
    budget: &Budget,
) -> Result<bool, Exhausted> {
    let region = &piece.region;
    let count = region.mesh.positions.len();
    let Some((first, others)) = piece.rest.split_first() else {
        return Ok(false);
    };
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); count];
    for face in &region.mesh.faces {
        for k in 0..3 {
            neighbours[face[k] as usize].extend([face[(k + 1) % 3], face[(k + 2) % 3]]);
        }
    }
    let mut role = vec![Role::Inside; count];
    let loops = std::iter::once(&region.rim).chain(&region.holes);
    loops
        .flatten()
        .for_each(|v| role[*v as usize] = Role::Closed);
    first.iter().for_each(|v| role[*v as usize] = Role::Start);
    others
        .iter()
        .flatten()
        .for_each(|v| role[*v as usize] = Role::End);
    let from_rim =
        |v: u32| growth.distance[region.vertices[v as usize].index()].min(2.0 * region.reach);
    let farthest = (0..count as u32)
        .map(from_rim)
        .fold(f64::MIN_POSITIVE, f64::max);
    let cost = |a: u32, b: u32| {
        let length = (region.mesh.positions[a as usize] - region.mesh.positions[b as usize]).norm();
        let far = 0.5 * (from_rim(a) + from_rim(b)) / farthest;
        length / far.max(1.0 / NEAR_RIM)
    };
    let mut steps = Steps::of(budget);
    let (mut costs, mut before) = (vec![f64::INFINITY; count], vec![u32::MAX; count]);
    let mut queue = BinaryHeap::new();
    for v in first {
        costs[*v as usize] = 0.0;
        queue.push(Reached {
            cost: 0.0,
            vertex: *v,
        });
    }
    while let Some(Reached { cost: at, vertex }) = queue.pop() {
        if at > costs[vertex as usize] {
            continue;
        }
        if role[vertex as usize] == Role::End {
            let mut v = vertex;
            while before[v as usize] != u32::MAX {
                let ends = [v, before[v as usize]].map(|v| region.vertices[v as usize]);
                cut.insert((ends[0].min(ends[1]), ends[0].max(ends[1])));
                v = before[v as usize];
            }
            return Ok(true);
        }
        steps.take(EDGE_WORK * neighbours[vertex as usize].len() as u64)?;
        for &next in &neighbours[vertex as usize] {
            let through = at + cost(vertex, next);
            let open = matches!(role[next as usize], Role::Inside | Role::End);
            if open && through < costs[next as usize] {
                costs[next as usize] = through;
                before[next as usize] = vertex;
                queue.push(Reached {
                    cost: through,
                    vertex: next,
                });
            }
        }
    }
    Ok(false)
}

/// What a path may do at a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Inside,
    Start,
    End,
    /// On the rim or another hole.
    Closed,
}

/// A vertex that a path reached; the cheapest is the greatest.
struct Reached {
    cost: f64,
    vertex: u32,
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_cost = other.cost.total_cmp(&self.cost);
        by_cost.then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}
