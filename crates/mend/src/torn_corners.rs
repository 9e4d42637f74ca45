//! Corners that were torn off: stretches of an outer boundary between hems that meet, prolonged, as those of the piece's other corners do.

use std::ops::Range;

use darn_budget::{Exhausted, Steps};

use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};

use crate::bites::{Bite, LEAST_DEPTH, LEAST_HEM, PAIR_WORK};
use crate::flat_line::FlatLine;

/// Angle between the hems at a corner, radians.
const CORNER: Range<f64> = 0.9..2.2;
/// Largest difference of the angles at the piece's corners, radians.
const ALIKE: f64 = 0.25;
/// Fewest corners that a piece still has.
const FEWEST: usize = 2;
/// Longest stretch of a torn corner, and how far the hems are prolonged at most, as shares of the loop.
const LONGEST: f64 = 0.3;
/// How much of a hem is looked at beside a torn corner, for a tear has straight parts, too: so many times what is looked at beside a whole one.
const HEM_BESIDE_TEAR: f64 = 2.0;
/// The most of a hem that is looked at to prolong it, as a share of the loop.
const MOST_HEM: f64 = 0.1;
/// Largest ratio of length to chord of the hems.
const STRAIGHT: f64 = 1.03;

/// A corner that the piece still has.
struct WholeCorner {
    /// Its vertex, in the first round of the line.
    vertex: usize,
    /// The angle between its hems, radians.
    angle: f64,
}

/// The end of a hem beside a torn corner.
struct TornHem {
    /// Its last vertex, in the line.
    vertex: usize,
    /// From there away from the corner, along the loop (1) or against it (−1).
    way: f64,
    /// How far it is to the corner, scene units.
    prolonged: f64,
}

/// The torn corners of an outer boundary, the tightest first; they may overlap.
///
/// # Errors
/// `Exhausted`.
pub fn torn_corners(
    line: &FlatLine,
    mesh: &TriMesh,
    rim: &BoundaryLoop,
    steps: &mut Steps,
) -> Result<Vec<Bite>, Exhausted> {
    let count = line.samples.len();
    if rim.kind != LoopKind::Outer {
        return Ok(Vec::new());
    }
    steps.take(PAIR_WORK * line.vertices as u64)?;
    let reach = LEAST_HEM * line.length;
    let whole = whole_corners(line, reach);
    let angles = || whole.iter().map(|corner| corner.angle);
    let usual = angles().sum::<f64>() / whole.len().max(1) as f64;
    if whole.len() < FEWEST || angles().any(|angle| (angle - usual).abs() > ALIKE) {
        return Ok(Vec::new());
    }
    let straight = |reach: f64| -> Vec<Option<Vec2>> {
        let hem = |s: usize| line.hem_within(line.sample(s), reach, STRAIGHT);
        (0..2 * count).map(hem).collect()
    };
    let beside = HEM_BESIDE_TEAR * reach;
    let (before, after) = (straight(-beside), straight(beside));
    let mut found: Vec<Bite> = Vec::new();
    for (from, first) in before.iter().enumerate().take(count) {
        for (to, second) in after.iter().enumerate().take(from + count).skip(from + 1) {
            steps.take(PAIR_WORK)?;
            let stretch = from..to;
            let has_whole = |whole: &WholeCorner| {
                let (first, last) = (line.sample(from), line.sample(to));
                let round = (first - whole.vertex).div_ceil(line.vertices);
                whole.vertex + round * line.vertices <= last
            };
            if line.length_of(&stretch) > LONGEST * line.length || whole.iter().any(has_whole) {
                break;
            }
            let (Some(first), Some(second)) = (first, second) else {
                continue;
            };
            if (angle(first, second) - usual).abs() < ALIKE {
                found.extend(bite(line, mesh, rim, stretch, &[*first, *second]));
            }
        }
    }
    found.sort_by(|a, b| a.length.total_cmp(&b.length).then(a.from.cmp(&b.from)));
    Ok(found)
}

/// The angle from one hem to the next, radians; above 0 where the cloth is inside.
fn angle(first: &Vec2, second: &Vec2) -> f64 {
    first.perp(second).atan2(first.dot(second))
}

/// The piece's corners: of those within `reach` of each other the sharpest.
fn whole_corners(line: &FlatLine, reach: f64) -> Vec<WholeCorner> {
    let n = line.vertices;
    let sharp = |vertex: usize| {
        let hem = |reach: f64| line.hem_within(vertex + n, reach, STRAIGHT);
        let angle = angle(&hem(-reach)?, &hem(reach)?);
        CORNER
            .contains(&angle)
            .then_some(WholeCorner { vertex, angle })
    };
    let mut all: Vec<WholeCorner> = (0..n).filter_map(sharp).collect();
    all.sort_by(|a, b| {
        let sharper = b.angle.total_cmp(&a.angle);
        sharper.then(a.vertex.cmp(&b.vertex))
    });
    let mut apart: Vec<WholeCorner> = Vec::new();
    for corner in all {
        let near = |other: &WholeCorner| {
            let between = (line.places[corner.vertex].1 - line.places[other.vertex].1).abs();
            between.min(line.length - between) < reach
        };
        if !apart.iter().any(near) {
            apart.push(corner);
        }
    }
    apart
}

/// The torn corner that a stretch between two hems is, if it is one.
fn bite(
    line: &FlatLine,
    mesh: &TriMesh,
    rim: &BoundaryLoop,
    stretch: Range<usize>,
    hems: &[Vec2; 2],
) -> Option<Bite> {
    let (from, to) = (line.sample(stretch.start), line.sample(stretch.end));
    let (a, b) = (line.places[from].0, line.places[to].0);
    let [first, second] = hems;
    let across = first.perp(second);
    let gap = b - a;
    // a + on · first = b − back · second.
    let (on, back) = (gap.perp(second) / across, first.perp(&gap) / across);
    let prolonged = LEAST_DEPTH * line.edge..LONGEST * line.length;
    if !prolonged.contains(&on) || !prolonged.contains(&back) {
        return None;
    }
    let corner = a + first * on;
    // The cloth lies on the left of both hems.
    let places = || stretch.clone().map(|s| line.places[line.sample(s)].0);
    let inside = |p: Vec2| {
        let least = -0.5 * line.edge;
        first.perp(&(p - a)) >= least && second.perp(&(p - b)) >= least
    };
    if !places().all(inside) {
        return None;
    }
    let middle = (second - first).try_normalize(0.0)?;
    let depth = places().map(|p| middle.dot(&(p - corner)));
    let n = line.vertices;
    let hem = |vertex, way, prolonged| TornHem {
        vertex,
        way,
        prolonged,
    };
    let hems = [hem(from, -1.0, on), hem(to, 1.0, back)];
    Some(Bite {
        from: from % n,
        to: to % n,
        length: line.length_of(&stretch),
        mouth: gap.norm(),
        depth: depth.fold(0.0, f64::max),
        corner: Some(prolonged_to(line, mesh, rim, &hems)),
    })
}

/// Where the hems meet in the scene: each prolonged as it runs there over as much of its length, so that a fold beside the tear does not count for
/// all of it, and the middle of both.
fn prolonged_to(line: &FlatLine, mesh: &TriMesh, rim: &BoundaryLoop, hems: &[TornHem; 2]) -> Vec3 {
    let at = |k: usize| mesh.positions[rim.vertices[k % line.vertices].index()];
    let [from, to] = hems.each_ref().map(|hem| {
        let reach = (hem.prolonged).clamp(LEAST_HEM * line.length, MOST_HEM * line.length);
        let end = at(hem.vertex);
        let along = end - at(line.vertex_after(hem.vertex, hem.way * reach));
        end + along.try_normalize(0.0).unwrap_or_default() * hem.prolonged
    });
    (from + to) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bites::bites;
    use darn_budget::Budget;
    use darn_geometry::mesh::loops::boundary_loops;
    use darn_geometry::mesh::shapes::sheet;
    use darn_geometry::mesh::topology::Topology;
    use darn_geometry::mesh::weld::weld;
    use proptest::prelude::*;

    /// The bites of the outer boundary of a sheet with folds along it, of which a part is kept.
    fn found(keep: impl Fn(f64, f64) -> bool, fold: f64) -> Vec<Bite> {
        let place = |u: f64, v: f64| Vec3::new(u, 0.7 * v, fold * (9.0 * u).sin());
        let mesh = weld(&sheet(60, keep, place)).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        let outer = loops.iter().find(|l| l.kind == LoopKind::Outer);
        let outer = outer.expect("an outer boundary");
        bites(&mesh, &topology, outer, Budget::unlimited()).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn a_torn_corner_is_found_where_it_was(
            wide in 0.12..0.3f64, high in 0.15..0.35f64, lobes in 0.0..0.25f64, fold in 0.0..0.03f64, turned in 0usize..4,
        ) {
            let torn = |u: f64, v: f64| {
                let (x, y) = (u / wide, v / high);
                x + y < 1.0 + lobes * (9.0 * y.atan2(x)).sin()
            };
            let keep = |u: f64, v: f64| !match turned {
                0 => torn(u, v),
                1 => torn(1.0 - u, v),
                2 => torn(1.0 - u, 1.0 - v),
                _ => torn(u, 1.0 - v),
            };
            let bites = found(keep, fold);
            prop_assert_eq!(bites.len(), 1, "{:?}", bites);
            let (u, v) = ([0.0, 1.0, 1.0, 0.0][turned], [0.0, 0.0, 0.7, 0.7][turned]);
            let corner = bites[0].corner.expect("a corner");
            let off = (corner - Vec3::new(u, v, fold * (9.0 * u).sin())).norm();
            prop_assert!(off < 0.03 + 2.0 * fold, "{} {:?}", off, bites);
            prop_assert!(bites[0].depth > 0.05, "{:?}", bites);
        }
    }

    #[test]
    fn two_torn_corners_and_a_bite_are_found() {
        let keep = |u: f64, v: f64| {
            u + v > 0.14 && (1.0 - u) + (1.0 - v) > 0.25 && (u - 0.5).hypot(v) > 0.1
        };
        let bites = found(keep, 0.01);
        let corners = bites.iter().filter(|b| b.corner.is_some()).count();
        assert_eq!((bites.len(), corners), (3, 2), "{bites:?}");
    }

    #[test]
    fn cloth_cut_to_a_shape_has_no_torn_corner() {
        let radius = 0.15;
        let rounded = move |u: f64, v: f64| {
            let (x, y) = (u.min(1.0 - u), v.min(1.0 - v));
            x > radius || y > radius || (radius - x).hypot(radius - y) < radius
        };
        assert!(
            found(|_, _| true, 0.02).is_empty(),
            "{:?}",
            found(|_, _| true, 0.02)
        );
        assert!(found(rounded, 0.0).is_empty());
        // A triangle, an L, a round piece, and one whose corners are all cut off.
        assert!(found(|u, v| u + v > 1.0, 0.0).is_empty());
        assert!(found(|u, v| u < 0.5 || v < 0.5, 0.0).is_empty());
        assert!(found(|u, v| (u - 0.5).hypot(v - 0.5) < 0.45, 0.0).is_empty());
        let cut = |u: f64, v: f64| u.min(1.0 - u) + v.min(1.0 - v) > 0.25;
        assert!(found(cut, 0.0).is_empty());
    }
}
