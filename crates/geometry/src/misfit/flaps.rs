//! Flaps: pieces of cloth that were torn from the hole's edge but for a hinge, and are folded away.
//!
//! Laid flat, a flap lies in the hole it was torn from, close to the edge that it came off. In space the two are far
//! apart. Cloth does not stretch, so nothing joins points of a rim that are farther apart in space than on the chart.
//! Where such pairs end on either side, the tear ends; the shortest line between two ends of the tear is a hinge.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap, HashSet};

use darn_budget::{Budget, Exhausted, Steps};

use crate::flatten::Chart;
use crate::mesh::index::FaceId;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2};
use crate::patch::{Outline, across};

/// Two points of a rim do not belong together when their distance in space exceeds that on the chart by this factor,
const APART: f64 = 1.6;
/// and by this many mean edges of the rim.
const APART_EDGES: f64 = 2.0;
/// Fewer such pairs across a hole are no flap.
const FEWEST: usize = 4;
/// Least length of a flap's border ÷ length of its hinge. A square cut crosswise has flaps of 1.41.
const FREE: f64 = 1.2;
/// Nanoseconds of work an edge in a search for a hinge.
const EDGE_WORK: u64 = 200;

/// The faces of all flaps at a region's rim, ascending; empty where the rim crosses itself on the chart.
///
/// # Errors
/// `Exhausted`.
pub fn flaps(region: &Region, chart: &Chart, budget: &Budget) -> Result<Vec<FaceId>, Exhausted> {
    let count = region.rim.len();
    budget.spend(EDGE_WORK * count as u64)?;
    let flat: Vec<Vec2> = region.rim.iter().map(|v| chart.flat[*v as usize]).collect();
    let apart = pairs_apart(region, &flat);
    if apart.len() < FEWEST {
        return Ok(Vec::new());
    }
    let ends = tear_ends(&apart, count);
    let mut found = Vec::new();
    if ends.len() < 2 {
        return Ok(found);
    }
    for (k, from) in ends.iter().enumerate() {
        let to = ends[(k + 1) % ends.len()];
        if let Some(flap) = flap_between(region, (*from, to), budget)? {
            found.extend(flap.into_iter().map(|f| region.faces[f as usize]));
        }
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// Pairs of rim vertices across the hole that no cloth can join, as indices along the rim, the lower one first.
fn pairs_apart(region: &Region, flat: &[Vec2]) -> Vec<(usize, usize)> {
    let position = |k: usize| region.mesh.positions[region.rim[k] as usize];
    let count = flat.len();
    let edges = (0..count).map(|k| (position((k + 1) % count) - position(k)).norm());
    let slack = APART_EDGES * edges.sum::<f64>() / count.max(1) as f64;
    // The hole is on the right of its rim.
    let reversed: Vec<Vec2> = flat.iter().rev().copied().collect();
    let mut pairs: Vec<(usize, usize)> = (across(&Outline::new(reversed, &[])).into_iter())
        .map(|(a, b)| (count - 1 - a, count - 1 - b))
        .map(|(a, b)| (a.min(b), a.max(b)))
        .filter(|(a, b)| {
            let (space, chart) = (
                (position(*a) - position(*b)).norm(),
                (flat[*a] - flat[*b]).norm(),
            );
            space > APART * chart && space > chart + slack
        })
        .collect();
    pairs.sort_unstable();
    pairs
}

/// The rim vertices where a tear ends: beyond the pairs that have no other pair beyond them, half-way along the rim
/// from one of the pair to the other. Ascending indices along the rim.
fn tear_ends(pairs: &[(usize, usize)], count: usize) -> Vec<usize> {
    // Every pair bounds a stretch of the rim on either side. Indices run twice around, so that no stretch is cut in two.
    let mut stretches: Vec<(usize, usize)> = (pairs.iter())
        .flat_map(|&(a, b)| [(a, b), (b, a + count), (a + count, b + count)])
        .collect();
    stretches.sort_unstable();
    let mut ends: Vec<usize> = Vec::new();
    // Least end of the stretches that start later.
    let mut least = usize::MAX;
    for same in stretches.chunk_by(|x, y| x.0 == y.0).rev() {
        // The shortest of those that start here is the only one without another inside.
        let (from, to) = same[0];
        if to < least {
            ends.push(((from + to) / 2) % count);
            least = to;
        }
    }
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// The faces of the region that the shortest line between two rim vertices cuts off with the stretch of the rim from
/// one to the other; `None` when that stretch is not a flap's.
fn flap_between(
    region: &Region,
    ends: (usize, usize),
    budget: &Budget,
) -> Result<Option<Vec<u32>>, Exhausted> {
    let count = region.rim.len();
    let (from, to) = ends;
    let stretch: Vec<u32> = (0..=(to + count - from) % count)
        .map(|k| region.rim[(from + k) % count])
        .collect();
    let position = |v: u32| region.mesh.positions[v as usize];
    let length = |line: &[u32]| -> f64 {
        let edges = line
            .windows(2)
            .map(|e| (position(e[1]) - position(e[0])).norm());
        edges.sum()
    };
    let Some(hinge) = shortest_line(region, (region.rim[from], region.rim[to]), budget)? else {
        return Ok(None);
    };
    if length(&stretch) < FREE * length(&hinge) {
        return Ok(None);
    }
    budget.spend(EDGE_WORK * region.mesh.faces.len() as u64)?;
    Ok(cut_off(region, &stretch, &hinge))
}

/// The shortest line along inner edges between two rim vertices, scene space, that meets no border in between.
fn shortest_line(
    region: &Region,
    ends: (u32, u32),
    budget: &Budget,
) -> Result<Option<Vec<u32>>, Exhausted> {
    let mesh = &region.mesh;
    let mut closed = vec![false; mesh.positions.len()];
    let borders = region
        .holes
        .iter()
        .flatten()
        .chain(&region.rim)
        .chain(&region.outer);
    borders.for_each(|v| closed[*v as usize] = true);
    let (start, goal) = ends;
    closed[goal as usize] = false;
    let around = neighbours(mesh);
    let mut from: Vec<(f64, u32)> = vec![(f64::INFINITY, u32::MAX); closed.len()];
    from[start as usize].0 = 0.0;
    let mut queue = BinaryHeap::from([Arrival(0.0, start)]);
    let mut steps = Steps::of(budget);
    while let Some(Arrival(distance, v)) = queue.pop() {
        if v == goal {
            let back = |v: &u32| Some(from[*v as usize].1).filter(|w| *w != u32::MAX);
            let mut line: Vec<u32> = std::iter::successors(Some(goal), back).collect();
            line.reverse();
            return Ok(Some(line));
        }
        if distance > from[v as usize].0 {
            continue;
        }
        for &w in &around[v as usize] {
            steps.take(EDGE_WORK)?;
            let edge = (mesh.positions[w as usize] - mesh.positions[v as usize]).norm();
            let border = v == start && w == goal;
            if !closed[w as usize] && !border && distance + edge < from[w as usize].0 {
                from[w as usize] = (distance + edge, v);
                queue.push(Arrival(distance + edge, w));
            }
        }
    }
    Ok(None)
}

/// The vertices joined to every vertex by an edge, ascending.
fn neighbours(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::new(); mesh.positions.len()];
    for [a, b, c] in &mesh.faces {
        for (v, w) in [(a, b), (b, c), (c, a)] {
            around[*v as usize].push(*w);
            around[*w as usize].push(*v);
        }
    }
    for all in &mut around {
        all.sort_unstable();
        all.dedup();
    }
    around
}

/// The faces between a stretch of the rim and a line that joins its ends; `None` when the line does not cut them off.
fn cut_off(region: &Region, stretch: &[u32], line: &[u32]) -> Option<Vec<u32>> {
    let sides = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)];
    let mut at: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (f, face) in (0u32..).zip(&region.mesh.faces) {
        for side in sides(*face) {
            at.insert(side, f);
        }
    }
    let walls: HashSet<(u32, u32)> = (line.windows(2))
        .flat_map(|e| [(e[0], e[1]), (e[1], e[0])])
        .collect();
    let own: HashSet<(u32, u32)> = stretch.windows(2).map(|e| (e[0], e[1])).collect();
    let mut met = vec![false; region.mesh.faces.len()];
    let mut piece: Vec<u32> = Vec::new();
    let mut add = |f: u32, piece: &mut Vec<u32>| {
        if !std::mem::replace(&mut met[f as usize], true) {
            piece.push(f);
        }
    };
    for side in stretch.windows(2).map(|e| (e[0], e[1])) {
        add(*at.get(&side)?, &mut piece);
    }
    let mut next = 0;
    while next < piece.len() {
        for (a, b) in sides(region.mesh.faces[piece[next] as usize]) {
            if walls.contains(&(a, b)) {
                continue;
            }
            match at.get(&(b, a)) {
                Some(f) => add(*f, &mut piece),
                // Another border than that of the stretch.
                None if !own.contains(&(a, b)) => return None,
                None => {}
            }
        }
        next += 1;
    }
    (2 * piece.len() < region.mesh.faces.len()).then_some(piece)
}

/// A vertex and its distance; the nearest is the greatest, the lowest vertex first among equals.
struct Arrival(f64, u32);

impl Ord for Arrival {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Arrival {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Arrival {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Arrival {}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::flatten::{FlattenLimits, flatten};
    use crate::mesh::Vec3;
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{jitter, sheet, tongue, tongue_hinge};
    use crate::mesh::weld::weld;

    fn flaps_of(soup: &TriMesh) -> (Arc<TriMesh>, Vec<FaceId>) {
        let mesh = weld(soup).mesh;
        let region = region_around_hole(&mesh, 0.3);
        let chart =
            flatten(&region, &FlattenLimits::default(), Budget::unlimited()).expect("a chart");
        let found = flaps(&region, &chart, Budget::unlimited()).expect("no limits");
        (mesh, found)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn a_tongue_is_a_flap_up_to_its_hinge(n in 21usize..36, angle in 0.9..2.8f64, down: bool) {
            let sign = if down { -1.0 } else { 1.0 };
            let (mesh, found) = flaps_of(&tongue(n, sign * angle));
            prop_assert!(!found.is_empty());
            let step = 1.0 / n as f64;
            for f in 0..mesh.faces.len() {
                let middle = mesh.triangle(f).iter().sum::<Vec3>() / 3.0;
                let is_flap = found.contains(&FaceId(f as u32));
                if middle.z.abs() > step * angle.sin() {
                    prop_assert!(is_flap, "a face of the tongue at {middle:?} is none of the flap's");
                }
                if is_flap {
                    let near = (middle.x - 0.5).abs() < 0.17 + 2.0 * step && middle.y > tongue_hinge(n) - 3.0 * step;
                    prop_assert!(near || middle.z != 0.0, "the flap has a face of the sheet at {middle:?}");
                }
            }
        }

        #[test]
        fn folded_cloth_round_a_hole_is_no_flap(n in 16usize..30, height in 0.0..0.12f64, noise in 0.0..0.2f64, seed: u64) {
            let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
            let folds = |u: f64, v: f64| Vec3::new(u, v, height * (8.0 * u + v).sin());
            prop_assert_eq!(flaps_of(&jitter(&sheet(n, keep, folds), noise / n as f64, seed)).1, []);
        }

        #[test]
        fn a_tongue_in_the_plane_of_the_cloth_is_part_of_it(n in 15usize..30, angle in 0.0..0.1f64) {
            prop_assert_eq!(flaps_of(&tongue(n, angle)).1, []);
        }
    }

    #[test]
    fn a_tear_ends_beyond_the_outermost_pairs() {
        // A tear between 0 and 10 of a rim of 20: pairs 1–19, 2–18, … 9–11.
        let pairs: Vec<(usize, usize)> = (1..10).map(|k| (k, 20 - k)).collect();
        assert_eq!(tear_ends(&pairs, 20), [0, 10]);
        // A star of three tears.
        assert_eq!(
            tear_ends(&[(2, 4), (8, 10), (14, 16), (1, 5)], 18),
            [3, 9, 15]
        );
    }
}
