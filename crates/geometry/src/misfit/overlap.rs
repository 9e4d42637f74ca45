//! Lips that overlap: on the chart, the cloth on one side of a tear covers cloth on its other side.

use std::collections::VecDeque;

use darn_budget::{Budget, Exhausted, Steps};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::flatten::Chart;
use crate::mesh::index::FaceId;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// Edges by which the faces left out reach beyond the overlap.
const WIDER: usize = 1;
/// Faces of two lips that lie on each other are not farther apart than this many edges, centre from centre. Others cover each other in the chart only:
/// no chart shows curved cloth as it is.
const NEAR: f64 = 1.25;
/// Nanoseconds of work a face or a pair of faces.
const PAIR_WORK: u64 = 300;

/// The faces of one lip that the other covers on the chart and in space, and those beside them, ascending: of each two, the lip with
/// the fewer such faces. Without them the rim does not cross itself, nor come so close to itself that a patch would have
/// to be thin. Empty where nothing at the rim overlaps.
///
/// # Errors
/// `Exhausted`.
pub fn overlapping_lip(
    region: &Region,
    chart: &Chart,
    budget: &Budget,
) -> Result<Vec<FaceId>, Exhausted> {
    let over = overlaps(region, chart, budget)?;
    let mut on_rim = vec![false; region.mesh.positions.len()];
    region.rim.iter().for_each(|v| on_rim[*v as usize] = true);
    let at_rim = |f: &u32| {
        region.mesh.faces[*f as usize]
            .iter()
            .any(|v| on_rim[*v as usize])
    };
    // Faces that cover each other lie on different lips: 1 and 2, 0 for faces not met.
    let mut lip = vec![0u8; region.mesh.faces.len()];
    let mut found = Vec::new();
    for first in 0..lip.len() as u32 {
        if lip[first as usize] != 0 || over[first as usize].is_empty() {
            continue;
        }
        let mut lips = [Vec::new(), Vec::new()];
        let mut queue = VecDeque::from([first]);
        lip[first as usize] = 1;
        while let Some(f) = queue.pop_front() {
            let own = lip[f as usize];
            lips[usize::from(own - 1)].push(f);
            for g in &over[f as usize] {
                if lip[*g as usize] == 0 {
                    lip[*g as usize] = 3 - own;
                    queue.push_back(*g);
                }
            }
        }
        if lips.iter().all(|lip| lip.iter().any(at_rim)) {
            let [a, b] = lips;
            found.extend(if b.len() < a.len() { b } else { a });
        }
    }
    for _ in 0..WIDER {
        found = with_faces_beside(region, &found);
    }
    let mut found: Vec<FaceId> = found.iter().map(|f| region.faces[*f as usize]).collect();
    found.sort_unstable();
    Ok(found)
}

/// The faces that have a vertex with one of these in common; with these themselves.
fn with_faces_beside(region: &Region, faces: &[u32]) -> Vec<u32> {
    let mut met = vec![false; region.mesh.positions.len()];
    let corners = faces.iter().flat_map(|f| region.mesh.faces[*f as usize]);
    corners.for_each(|v| met[v as usize] = true);
    let beside = |f: &u32| {
        region.mesh.faces[*f as usize]
            .iter()
            .any(|v| met[*v as usize])
    };
    (0..region.mesh.faces.len() as u32).filter(beside).collect()
}

/// Per face the faces that cover a part of it on the chart and lie near it in space, ascending.
fn overlaps(region: &Region, chart: &Chart, budget: &Budget) -> Result<Vec<Vec<u32>>, Exhausted> {
    let faces = &region.mesh.faces;
    let triangle = |f: usize| faces[f].map(|v| chart.flat[v as usize]);
    let envelope = |f: usize| {
        let [a, b, c] = triangle(f);
        let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        AABB::from_corners([low.x, low.y], [high.x, high.y])
    };
    budget.spend(PAIR_WORK * faces.len() as u64)?;
    // Centre and longest edge.
    let places: Vec<(Vec3, f64)> = (0..faces.len())
        .map(|f| {
            let [a, b, c] = region.mesh.triangle(f);
            let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
            ((a + b + c) / 3.0, longest)
        })
        .collect();
    let is_near = |f: usize, g: usize| {
        let ((a, own), (b, other)) = (places[f], places[g]);
        (a - b).norm() <= NEAR * own.max(other)
    };
    let boxed = |f: usize| GeomWithData::new(Rectangle::from_aabb(envelope(f)), f as u32);
    let tree = RTree::bulk_load((0..faces.len()).map(boxed).collect());
    let mut steps = Steps::of(budget);
    let mut over = vec![Vec::new(); faces.len()];
    for f in 0..faces.len() {
        for g in tree.locate_in_envelope_intersecting(&envelope(f)) {
            steps.take(PAIR_WORK)?;
            let g = g.data as usize;
            let apart = faces[f].iter().all(|v| !faces[g].contains(v));
            if apart && is_near(f, g) && overlap(&triangle(f), &triangle(g)) {
                over[f].push(g as u32);
            }
        }
        over[f].sort_unstable();
    }
    Ok(over)
}

/// Whether two counter-clockwise triangles have an area in common: no side of one has the other on its right.
fn overlap(a: &[Vec2; 3], b: &[Vec2; 3]) -> bool {
    let parted = |a: &[Vec2; 3], b: &[Vec2; 3]| {
        (0..3).any(|k| {
            let (from, along) = (a[k], a[(k + 1) % 3] - a[k]);
            b.iter().all(|p| along.perp(&(p - from)) <= 0.0)
        })
    };
    !parted(a, b) && !parted(b, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flatten::{FlattenLimits, flatten};
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{holed_sheet, overlapping_slit};
    use crate::mesh::weld::weld;

    #[test]
    fn one_of_two_overlapping_lips_is_found() {
        let lip = |soup| {
            let region = region_around_hole(&weld(&soup).mesh, 0.2);
            let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited());
            let chart = chart.expect("a chart");
            overlapping_lip(&region, &chart, Budget::unlimited())
                .expect("no limits")
                .len()
        };
        let n = 40;
        assert_eq!(lip(holed_sheet(n, 0.2)), 0);
        for edges in [0.5, 1.0, 2.0] {
            let found = lip(overlapping_slit(n, edges / n as f64));
            // Sixteen squares along the slit, two triangles each.
            assert!(
                (40..300).contains(&found),
                "{found} faces for {edges} edges"
            );
        }
    }

    #[test]
    fn triangles_overlap_in_an_area() {
        let at = |x: f64, y: f64| {
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[a, b]| Vec2::new(a + x, b + y))
        };
        let own = at(0.0, 0.0);
        assert!(overlap(&own, &own) && overlap(&own, &at(0.4, 0.4)));
        assert!(!overlap(&own, &at(1.0, 0.0)) && !overlap(&own, &at(0.6, 0.6)));
    }
}
