//! A rim that crosses itself in the plane, made simple: vertices near a crossing are smoothed along the rim until none is left.
//!
//! Noise crumples the narrow teeth of a ragged rim, and then the angles of the cloth around a rim vertex add up to more than a full turn:
//! laid flat, neighbouring teeth overlap. The patch needs the polygon for its triangles and rest lengths only, so moving a few corners by
//! a fraction of an edge costs nothing that could be seen.

use robust::{Coord, orient2d};
use rstar::RTree;
use rstar::primitives::{GeomWithData, Line};

use crate::mesh::Vec2;

/// Most rounds of smoothing; each reaches one vertex further along the rim than the one before.
const ROUNDS: usize = 40;

/// The polygon without crossings, or `None` when smoothing near them does not help (the cloth overlaps itself on a larger scale).
pub fn untangled(polygon: &[Vec2]) -> Option<Vec<Vec2>> {
    let mut polygon = polygon.to_vec();
    for reach in 0..ROUNDS {
        let tangled = crossed_edges(&polygon);
        if tangled.is_empty() {
            return Some(polygon);
        }
        polygon = smoothed(&polygon, &near(&tangled, polygon.len(), reach));
    }
    None
}

/// Edges (k to k + 1) that cross or touch another edge than their neighbours, or fold back onto a neighbour.
fn crossed_edges(polygon: &[Vec2]) -> Vec<usize> {
    let count = polygon.len();
    let ends = |k: usize| (polygon[k], polygon[(k + 1) % count]);
    let line = |k: usize| {
        let (a, b) = ends(k);
        GeomWithData::new(Line::new([a.x, a.y], [b.x, b.y]), k)
    };
    let tree = RTree::bulk_load((0..count).map(line).collect());
    let meets = |k: &usize| {
        use rstar::RTreeObject;
        let (a, b) = ends(*k);
        tree.locate_in_envelope_intersecting(&line(*k).envelope())
            .any(|other| {
                let (c, d) = ends(other.data);
                match (other.data + count - k) % count {
                    0 => false,
                    1 => folds_back(a, b, d),
                    after if after == count - 1 => folds_back(b, a, c),
                    _ => touch((a, b), (c, d)),
                }
            })
    };
    (0..count).filter(meets).collect()
}

/// Whether the edge from `b` to `c` lies on the edge from `b` to `a`.
fn folds_back(a: Vec2, b: Vec2, c: Vec2) -> bool {
    side(a, b, c) == 0.0 && (a - b).dot(&(c - b)) > 0.0
}

/// Whether two closed segments have a point in common.
fn touch((a, b): (Vec2, Vec2), (c, d): (Vec2, Vec2)) -> bool {
    let (abc, abd, cda, cdb) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    if [abc, abd, cda, cdb].iter().all(|s| *s == 0.0) {
        // On one line: they meet if their boxes do, which the search has seen to.
        return true;
    }
    // Signs, not products: a product of tiny orientations could underflow to zero.
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0) || (x < 0.0 && y < 0.0);
    !apart(abc, abd) && !apart(cda, cdb)
}

/// Sign of the turn from a over b to c, exact.
fn side(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let at = |p: Vec2| Coord { x: p.x, y: p.y };
    orient2d(at(a), at(b), at(c))
}

/// Marks the ends of the edges and all vertices within `reach` steps of them.
fn near(edges: &[usize], count: usize, reach: usize) -> Vec<bool> {
    let mut marked = vec![false; count];
    for edge in edges {
        for step in 0..(2 * reach + 2).min(count) {
            marked[(edge + count * (reach / count + 1) + step - reach) % count] = true;
        }
    }
    marked
}

/// Marked vertices halfway to the middle of their neighbours, twice.
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

    /// A circle of `n` corners with teeth.
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
    fn a_simple_polygon_is_left_alone() {
        assert_eq!(untangled(&gear(40)), Some(gear(40)));
    }

    #[test]
    fn a_tooth_pushed_over_its_neighbours_is_taken_back() {
        let mut polygon = gear(40);
        polygon[7] = polygon[10];
        polygon[8] = polygon[5] * 1.01;
        assert!(!crossed_edges(&polygon).is_empty());
        let simple = untangled(&polygon).unwrap();
        assert!(crossed_edges(&simple).is_empty());
        assert_eq!(
            simple[25], polygon[25],
            "far from the crossing nothing moves"
        );
    }

    #[test]
    fn a_spike_folded_onto_itself_is_seen() {
        let spike = [(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| Vec2::new(x, y));
        assert!(!crossed_edges(&spike).is_empty());
    }
}
