//! Makes a rim that crosses itself in the plane a simple polygon: corners near a crossing are smoothed along the rim
//! until none is left.
//!
//! Noise deforms the narrow teeth of a ragged rim. The angles around a rim vertex can then add up to more than a full
//! turn, and neighbouring teeth overlap in the plane. The patch needs the polygon for its triangles and rest lengths
//! only, so to move a few corners by a fraction of an edge has no visible effect.

use darn_budget::{Budget, Exhausted, Steps};
use robust::{Coord, orient2d};
use rstar::RTree;
use rstar::primitives::{GeomWithData, Line};

use crate::mesh::Vec2;

/// Most rounds of smoothing; each reaches one corner further along the rim than the one before.
const ROUNDS: usize = 40;
/// Nanoseconds of work an edge in a round.
const EDGE_WORK: u64 = 500;
/// Nanoseconds of work a pair of edges whose boxes meet.
const PAIR_WORK: u64 = 50;

/// The polygon with corners near crossings moved so that none is left, scene units. `None` when that does not help,
/// because the polygon overlaps itself on a larger scale.
///
/// # Errors
/// `Exhausted`.
pub(super) fn untangle(polygon: &[Vec2], budget: &Budget) -> Result<Option<Vec<Vec2>>, Exhausted> {
    let mut polygon = polygon.to_vec();
    for reach in 0..ROUNDS {
        let tangled = crossed_edges(&polygon, budget)?;
        if tangled.is_empty() {
            return Ok(Some(polygon));
        }
        polygon = smoothed(&polygon, &near(&tangled, polygon.len(), reach));
    }
    Ok(None)
}

/// Edges (k: from corner k to k + 1) that cross or touch another edge, or fold back onto a neighbour; to share a corner
/// is no touch.
///
/// # Errors
/// `Exhausted`.
fn crossed_edges(polygon: &[Vec2], budget: &Budget) -> Result<Vec<usize>, Exhausted> {
    let count = polygon.len();
    let ends = |k: usize| (polygon[k], polygon[(k + 1) % count]);
    let line = |k: usize| {
        let (a, b) = ends(k);
        GeomWithData::new(Line::new([a.x, a.y], [b.x, b.y]), k)
    };
    let tree = RTree::bulk_load((0..count).map(line).collect());
    let meets = |k: usize, other: usize| {
        let ((a, b), (c, d)) = (ends(k), ends(other));
        match (other + count - k) % count {
            0 => false,
            1 => folds_back(a, b, d),
            after if after == count - 1 => folds_back(b, a, c),
            _ => segments_touch(a, b, c, d),
        }
    };
    let mut steps = Steps::of(budget);
    let mut crossed = Vec::new();
    for k in 0..count {
        use rstar::RTreeObject;
        steps.take(EDGE_WORK)?;
        for other in tree.locate_in_envelope_intersecting(&line(k).envelope()) {
            steps.take(PAIR_WORK)?;
            if meets(k, other.data) {
                crossed.push(k);
                break;
            }
        }
    }
    Ok(crossed)
}

/// Whether the edge from `b` to `c` lies on the edge from `b` to `a`.
fn folds_back(a: Vec2, b: Vec2, c: Vec2) -> bool {
    side(a, b, c) == 0.0 && (a - b).dot(&(c - b)) > 0.0
}

/// Whether the closed segments from `a` to `b` and from `c` to `d`, whose boxes meet, have a point in common.
fn segments_touch(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let (abc, abd, cda, cdb) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    if [abc, abd, cda, cdb].iter().all(|s| *s == 0.0) {
        // On one line they meet if their boxes do.
        return true;
    }
    // Compares signs: a product of tiny orientations could underflow to zero.
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0) || (x < 0.0 && y < 0.0);
    !apart(abc, abd) && !apart(cda, cdb)
}

/// Sign of the turn from a over b to c, exact (Shewchuk's predicate).
fn side(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let at = |p: Vec2| Coord { x: p.x, y: p.y };
    orient2d(at(a), at(b), at(c))
}

/// Marks the ends of the edges and all corners within `reach` steps of them.
fn near(edges: &[usize], count: usize, reach: usize) -> Vec<bool> {
    let mut marked = vec![false; count];
    for edge in edges {
        for step in 0..(2 * reach + 2).min(count) {
            marked[(edge + count * (reach / count + 1) + step - reach) % count] = true;
        }
    }
    marked
}

/// Moves marked corners halfway to the middle of their neighbours, twice.
fn smoothed(polygon: &[Vec2], marked: &[bool]) -> Vec<Vec2> {
    let count = polygon.len();
    let step = |p: &[Vec2]| -> Vec<Vec2> {
        let middle = |k: usize| (p[(k + count - 1) % count] + p[(k + 1) % count]) * 0.5;
        (0..count)
            .map(|k| {
                if marked[k] {
                    (p[k] + middle(k)) * 0.5
                } else {
                    p[k]
                }
            })
            .collect()
    };
    step(&step(polygon))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of `n` corners, every second one farther out.
    fn gear(n: usize) -> Vec<Vec2> {
        let turn = std::f64::consts::TAU / n as f64;
        (0..n)
            .map(|k| {
                Vec2::new((turn * k as f64).cos(), (turn * k as f64).sin())
                    * if k % 2 == 0 { 1.0 } else { 1.2 }
            })
            .collect()
    }

    #[test]
    fn a_simple_polygon_stays_as_it_is() {
        assert_eq!(untangle(&gear(40), Budget::unlimited()), Ok(Some(gear(40))));
    }

    #[test]
    fn a_corner_moved_past_its_neighbours_is_moved_back() {
        let mut polygon = gear(40);
        polygon[7] = polygon[10];
        polygon[8] = polygon[5] * 1.01;
        assert!(
            !crossed_edges(&polygon, Budget::unlimited())
                .unwrap()
                .is_empty()
        );
        let simple = untangle(&polygon, Budget::unlimited()).unwrap().unwrap();
        assert!(
            crossed_edges(&simple, Budget::unlimited())
                .unwrap()
                .is_empty()
        );
        assert_eq!(
            simple[25], polygon[25],
            "corners far from the crossing stay"
        );
    }

    #[test]
    fn a_spike_folded_onto_itself_counts_as_crossing() {
        let spike = [(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| Vec2::new(x, y));
        assert!(
            !crossed_edges(&spike, Budget::unlimited())
                .unwrap()
                .is_empty()
        );
    }
}
