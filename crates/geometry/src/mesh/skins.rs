//! Second skins: copies of cloth that lie on it, as exports with two sides have them.

use darn_budget::{Budget, Exhausted, Steps};
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::loops::{BoundaryLoop, LoopKind};
use super::{TriMesh, Vec3};

/// How far a vertex of a copied rim may lie from the rim, in the rim's mean edge lengths. Cloth of two layers is thicker.
const THIN: f64 = 0.05;
/// Nanoseconds of work a vertex in a search tree.
const VERTEX_WORK: u64 = 500;

/// A hole whose rim is a copy of another hole's rim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SecondSkin {
    /// The hole that is copied, by index among the loops; the lower one.
    pub first: u32,
    /// Whether the copy shows the other side.
    pub is_back: bool,
}

/// Per loop whether it is a hole of a second skin, and of which hole. O(n log n) in the holes' vertices.
///
/// # Errors
/// `Exhausted`.
pub fn second_skins(
    mesh: &TriMesh,
    loops: &[BoundaryLoop],
    budget: &Budget,
) -> Result<Vec<Option<SecondSkin>>, Exhausted> {
    let mut skins = vec![None; loops.len()];
    let holes = || loops.iter().filter(|l| l.kind == LoopKind::Hole);
    if holes().nth(1).is_none() {
        return Ok(skins);
    }
    let mut steps = Steps::of(budget);
    steps.take(VERTEX_WORK * loops.len() as u64)?;
    let centre = |l: &BoundaryLoop| -> [f64; 3] { l.centroid.into() };
    let centres = holes().map(|l| GeomWithData::new(centre(l), l.id.0));
    let centres = RTree::bulk_load(centres.collect());
    for hole in holes() {
        let thin = THIN * hole.length / hole.vertices.len() as f64;
        let near = centres.locate_within_distance(centre(hole), thin * thin);
        let mut near: Vec<u32> = near.map(|c| c.data).filter(|c| *c < hole.id.0).collect();
        near.sort_unstable();
        for first in near {
            let other = &loops[first as usize];
            let alike = skins[first as usize].is_none()
                && other.vertices.len() == hole.vertices.len()
                && (other.length - hole.length).abs() < THIN * hole.length;
            if !alike {
                continue;
            }
            steps.take(VERTEX_WORK * 2 * hole.vertices.len() as u64)?;
            if copies(mesh, other, hole, thin) {
                let is_back = vector_area(mesh, other).dot(&vector_area(mesh, hole)) < 0.0;
                skins[hole.id.index()] = Some(SecondSkin { first, is_back });
                break;
            }
        }
    }
    Ok(skins)
}

/// Whether every vertex of a rim lies beside one of another.
fn copies(mesh: &TriMesh, first: &BoundaryLoop, second: &BoundaryLoop, thin: f64) -> bool {
    let points = |l: &BoundaryLoop| -> Vec<[f64; 3]> {
        let each = l.vertices.iter();
        each.map(|v| mesh.positions[v.index()].into()).collect()
    };
    let tree = RTree::bulk_load(points(first));
    points(second).iter().all(|p| {
        let nearest = tree.nearest_neighbor_iter_with_distance_2(p).next();
        nearest.is_some_and(|(_, distance)| distance <= thin * thin)
    })
}

/// Half the sum of pᵢ × pᵢ₊₁ along a loop, seen from its centre.
fn vector_area(mesh: &TriMesh, l: &BoundaryLoop) -> Vec3 {
    let at = |k: usize| mesh.positions[l.vertices[k % l.vertices.len()].index()] - l.centroid;
    let parts = (0..l.vertices.len()).map(|k| at(k).cross(&at(k + 1)));
    parts.sum::<Vec3>() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::boundary_loops;
    use crate::mesh::shapes::{concat, holed_sheet};
    use crate::mesh::weld::weld;

    fn skins_at(distance: f64) -> Vec<Option<SecondSkin>> {
        let front = holed_sheet(20, 0.2);
        let moved = front.positions.iter();
        let back = TriMesh {
            positions: moved.map(|p| p - Vec3::z() * distance).collect(),
            faces: front.faces.iter().map(|[a, b, c]| [*c, *b, *a]).collect(),
        };
        let welded = weld(&concat(&front, &back));
        let loops = boundary_loops(&welded.mesh, &welded.topology());
        second_skins(&welded.mesh, &loops, Budget::unlimited()).expect("no budget")
    }

    #[test]
    fn the_holes_of_a_second_skin_are_found_and_those_of_a_second_layer_are_not() {
        let back = Some(SecondSkin {
            first: 1,
            is_back: true,
        });
        assert_eq!(skins_at(0.0005), [None, None, None, back]);
        assert_eq!(skins_at(0.01), [None; 4]);
    }
}
