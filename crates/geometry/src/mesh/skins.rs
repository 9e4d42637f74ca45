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

/// A hole of a second skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SecondSkin {
    /// Its rim is a copy of another hole's rim.
    Copy {
        /// The hole that is copied, by index among the loops; the lower one.
        first: u32,
        /// Whether the copy shows the other side.
        is_back: bool,
    },
    /// Its rim lies on a patch that closes the hole of the first skin.
    Patched,
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
        let thin = thin_beside(hole);
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
            if copies(mesh, other, hole) {
                let is_back = vector_area(mesh, other).dot(&vector_area(mesh, hole)) < 0.0;
                skins[hole.id.index()] = Some(SecondSkin::Copy { first, is_back });
                break;
            }
        }
    }
    Ok(skins)
}

/// Those of some holes whose rims lie on the `vertices` of patches. O(n log n).
///
/// # Errors
/// `Exhausted`.
pub fn on_patches<'l>(
    mesh: &TriMesh,
    holes: impl Iterator<Item = &'l BoundaryLoop>,
    vertices: Vec<[f64; 3]>,
    budget: &Budget,
) -> Result<Vec<&'l BoundaryLoop>, Exhausted> {
    budget.spend(VERTEX_WORK * vertices.len() as u64)?;
    let tree = RTree::bulk_load(vertices);
    let mut steps = Steps::of(budget);
    let mut found = Vec::new();
    for hole in holes {
        steps.take(VERTEX_WORK * hole.vertices.len() as u64)?;
        if lies_beside(mesh, hole, &tree) {
            found.push(hole);
        }
    }
    Ok(found)
}

/// How far a vertex of a rim may lie from what it lies on, scene units.
fn thin_beside(rim: &BoundaryLoop) -> f64 {
    THIN * rim.length / rim.vertices.len() as f64
}

/// Whether every vertex of a rim lies beside one of another.
fn copies(mesh: &TriMesh, first: &BoundaryLoop, second: &BoundaryLoop) -> bool {
    let points = first.vertices.iter();
    let points = points.map(|v| mesh.positions[v.index()].into());
    lies_beside(mesh, second, &RTree::bulk_load(points.collect()))
}

/// Whether every vertex of a rim lies beside one of a tree.
fn lies_beside(mesh: &TriMesh, rim: &BoundaryLoop, tree: &RTree<[f64; 3]>) -> bool {
    let thin = thin_beside(rim);
    rim.vertices.iter().all(|v| {
        let point: [f64; 3] = mesh.positions[v.index()].into();
        let nearest = tree.nearest_neighbor_iter_with_distance_2(&point).next();
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
        let back = Some(SecondSkin::Copy {
            first: 1,
            is_back: true,
        });
        assert_eq!(skins_at(0.0005), [None, None, None, back]);
        assert_eq!(skins_at(0.01), [None; 4]);
    }
}
