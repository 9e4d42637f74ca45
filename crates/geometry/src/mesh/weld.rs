//! Welding: a triangle soup made into surfaces, forgiving what files have that cloth has not.

use std::sync::Arc;

use darn_budget::{Budget, Exhausted};

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId};
use super::pairing::{Paired, Twins, places};
use super::repair::{Repair, Repaired};
use super::topology::Topology;

/// A triangle soup made into surfaces, and how its faces lead back to the soup's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WeldedMesh {
    /// The welded mesh; vertices are numbered by first use in face order, none is unused.
    pub mesh: TriMesh,
    /// Per welded face the soup's face, ascending; the parts of a split face have the same. For their corners see
    /// [`WeldedMesh::soup_corners`].
    pub soup_face: Vec<u32>,
    /// What the mesh does not have as the soup has it.
    pub set_aside: SetAside,
    /// Per welded face whether one of the faces left out shows its other side.
    pub two_sided: Vec<bool>,
    /// The twins of the welded mesh's half-edges.
    twins: Arc<Twins>,
    /// What [`Topology::non_manifold`] lists.
    non_manifold: Vec<HalfEdgeId>,
    /// The faces that were turned or split, ascending, with the soup's vertices at their corners.
    changed: Vec<(FaceId, [u32; 3])>,
}

/// How many things a welded mesh does not have as its soup has them, by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SetAside {
    /// Faces left out because they name a vertex that does not exist or have no area; at the border also those that are
    /// no higher than the tolerance.
    pub degenerate_faces: usize,
    /// Faces left out because an earlier face has the same three places (whichever side it shows).
    pub duplicate_faces: usize,
    /// Faces left out because they hang, in pieces of few, on an edge of a larger piece.
    pub fins: usize,
    /// Faces turned to face the same way as those around them.
    pub flipped_faces: usize,
    /// Border vertices on the border edge of another face, which was split there.
    pub t_junctions: usize,
    /// Places joined to another that lies within the tolerance.
    pub near_seam_vertices: usize,
}

impl WeldedMesh {
    /// How the welded faces are connected. Two that share both ends of an edge may still be apart there: see [`weld`].
    pub fn topology(&self) -> Topology {
        Topology::with_twins(&self.mesh, self.twins.clone(), self.non_manifold.clone())
    }

    /// The vertices of `soup` at a welded face's corners, in the order of the welded face: those of its face in the
    /// soup, reversed where the face was turned. A part of a split face has vertices of other faces, too.
    pub fn soup_corners(&self, soup: &TriMesh, face: FaceId) -> Option<[u32; 3]> {
        let own = *self.soup_face.get(face.index())?;
        match self
            .changed
            .binary_search_by_key(&face, |changed| changed.0)
        {
            Ok(at) => Some(self.changed[at].1),
            Err(_) => soup.faces.get(own as usize).copied(),
        }
    }
}

/// [`weld_within`] for coordinates that are exact, without a budget.
pub fn weld(soup: &TriMesh) -> WeldedMesh {
    // Without a budget nothing is exhausted.
    weld_within(soup, &|_| 0.0, Budget::unlimited()).unwrap_or_default()
}

/// Welds `soup`: one vertex per place, then one per sheet where sheets touch only in a point or an edge. Near linear.
///
/// A place is an exact position (−0 equals 0). Border vertices are one place, too, when they are closer than four times
/// the precision of their coordinates (`precision` of a vertex of the soup, scene units) or a thousandth of the shortest
/// border edge there, and than a tenth of that edge. Inner vertices never move. A border edge that passes a border
/// vertex as closely is split there, if that lets faces meet.
///
/// Every edge joins at most two faces. Where more meet, the pairs that continue each other most smoothly are joined and
/// small pieces that hang on the edge are left out; where two only nearly meet and lie on each other, they are two
/// skins and stay apart. Faces that face the other way than most of their sheet are turned, as long as the sheet has
/// two sides.
///
/// A vertex whose faces form several edge-connected fans becomes one vertex per fan, so every boundary vertex of the
/// result lies on exactly one boundary loop. The result depends on the order of faces, not on how the soup numbered
/// its vertices.
///
/// # Errors
/// `Exhausted`.
pub fn weld_within(
    soup: &TriMesh,
    precision: &dyn Fn(u32) -> f64,
    budget: &Budget,
) -> Result<WeldedMesh, Exhausted> {
    let exact = places(soup);
    let repair = Repair {
        soup,
        exact: &exact,
        precision,
        budget,
    };
    let Repaired {
        sources,
        places,
        changed,
        twins,
        non_manifold,
        set_aside,
    } = repair.joined()?;
    let (faces, vertices) = twins.corner_fans();
    let mut positions = Vec::with_capacity(vertices);
    for (&vertex, &place) in faces.as_flattened().iter().zip(places.as_flattened()) {
        if vertex as usize == positions.len() {
            positions.push(soup.positions[place as usize]);
        }
    }
    Ok(WeldedMesh {
        mesh: TriMesh { positions, faces },
        changed,
        soup_face: sources.soup_face,
        set_aside,
        two_sided: sources.two_sided,
        twins: twins.into(),
        non_manifold,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::shapes::{concat, explode, jitter, sheet, shuffle};
    use crate::mesh::{Vec3, loops};

    /// A bumpy sheet with squares missing at random: bow-ties, islands and holes of every kind.
    fn sheet_with_random_holes() -> impl Strategy<Value = TriMesh> {
        (
            2usize..9,
            any::<u64>(),
            prop::collection::vec(prop::bool::weighted(0.7), 64),
        )
            .prop_map(|(n, seed, keep)| {
                let square = |x: f64| (x * n as f64) as usize;
                let flat = sheet(
                    n,
                    |u, v| keep[square(v) * 8 % 64 + square(u)],
                    |u, v| Vec3::new(u, v, 0.0),
                );
                jitter(&flat, 0.02, seed)
            })
    }

    proptest! {
        #[test]
        fn welding_twice_changes_nothing(soup in sheet_with_random_holes()) {
            let once = weld(&explode(&soup)).mesh;
            let twice = weld(&once);
            prop_assert_eq!(twice.mesh, once);
            prop_assert_eq!(twice.set_aside, SetAside::default());
        }

        #[test]
        fn the_numbering_of_the_soup_does_not_matter(soup in sheet_with_random_holes(), seed: u64) {
            let welded = weld(&soup);
            prop_assert_eq!(&weld(&shuffle(&soup, seed)), &welded);
            prop_assert_eq!(&weld(&explode(&soup)), &welded);
        }

        #[test]
        fn the_topology_is_that_of_the_mesh(soup in sheet_with_random_holes(), seed: u64) {
            let both = concat(&soup, &shuffle(&soup, seed));
            for soup in [&soup, &explode(&soup), &both] {
                let welded = weld(soup);
                prop_assert_eq!(welded.topology(), Topology::new(&welded.mesh));
            }
        }

        #[test]
        fn corners_keep_their_places(soup in sheet_with_random_holes()) {
            let welded = weld(&soup);
            for (f, &from) in welded.soup_face.iter().enumerate() {
                prop_assert_eq!(welded.mesh.triangle(f), soup.triangle(from as usize));
            }
        }

        #[test]
        fn every_boundary_vertex_lies_on_one_loop(soup in sheet_with_random_holes()) {
            let mesh = weld(&soup).mesh;
            let topology = Topology::new(&mesh);
            let loops = loops::boundary_loops(&mesh, &topology);
            let mut vertices: Vec<_> = loops.iter().flat_map(|l| l.vertices.clone()).collect();
            let count = vertices.len();
            vertices.sort_unstable();
            vertices.dedup();
            prop_assert_eq!(vertices.len(), count);
            prop_assert_eq!(count, topology.boundary().count());
        }
    }

    #[test]
    fn faces_with_a_reversed_duplicate_are_two_sided() {
        let front = sheet(3, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let faces = front.faces.iter().enumerate();
        let back = TriMesh {
            faces: faces
                .filter(|(k, _)| k % 2 == 0)
                .map(|(_, [a, b, c])| [*c, *b, *a])
                .collect(),
            ..front.clone()
        };
        let both = weld(&concat(&concat(&front, &back), &front));
        assert_eq!(both.mesh.faces.len(), front.faces.len());
        let expected: Vec<bool> = (0..front.faces.len()).map(|k| k % 2 == 0).collect();
        assert_eq!(both.two_sided, expected);
    }

    #[test]
    fn degenerate_duplicate_and_broken_faces_are_dropped() {
        let (a, b, c, d) = (
            Vec3::zeros(),
            Vec3::x(),
            Vec3::y(),
            Vec3::new(1.0, 1.0, 0.0),
        );
        let minus = Vec3::new(-0.0, 0.0, -0.0);
        let soup = TriMesh {
            positions: vec![a, b, c, d, minus],
            faces: vec![
                [0, 1, 2],
                [1, 2, 4],
                [2, 4, 1],
                [0, 4, 1],
                [0, 1, 9],
                [2, 1, 3],
            ],
        };
        let welded = weld(&soup);
        assert_eq!(welded.soup_face, [0, 5]);
        let left_out = SetAside {
            degenerate_faces: 2,
            duplicate_faces: 2,
            ..SetAside::default()
        };
        assert_eq!(welded.set_aside, left_out);
        assert_eq!(welded.mesh.positions, [a, b, c, d]);
    }

    #[test]
    fn a_fin_inside_a_sheet_comes_off_and_leaves_the_sheet_whole() {
        let sheet = sheet(4, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let fin = TriMesh {
            positions: vec![
                Vec3::new(0.5, 0.5, 0.0),
                Vec3::new(0.75, 0.5, 0.0),
                Vec3::new(0.7, 0.5, 1.0),
            ],
            faces: vec![[0, 1, 2]],
        };
        let welded = weld(&concat(&sheet, &fin));
        assert_eq!(welded.set_aside.fins, 1);
        let topology = welded.topology();
        assert_eq!(topology.components, 1);
        assert_eq!(topology.non_manifold, []);
        let loops = loops::boundary_loops(&welded.mesh, &topology);
        let lengths: Vec<usize> = loops.iter().map(|l| l.vertices.len()).collect();
        assert_eq!(lengths, [16]);
    }

    #[test]
    fn faces_that_face_opposite_ways_are_joined_where_they_continue_each_other() {
        let fold = |z: f64| TriMesh {
            positions: vec![
                Vec3::zeros(),
                Vec3::x(),
                Vec3::y(),
                Vec3::new(0.0, -1.0, z),
                Vec3::new(0.0, 1.0, z),
            ],
            faces: vec![[0, 1, 2], [0, 1, 3]],
        };
        let flat = weld(&fold(0.3));
        assert_eq!(
            (flat.set_aside.flipped_faces, flat.topology().components),
            (1, 1)
        );
        assert_eq!(flat.soup_corners(&fold(0.3), FaceId(1)), Some([0, 3, 1]));
        let mut folded_back = fold(0.3);
        folded_back.faces[1] = [0, 1, 4];
        let sharp = weld(&folded_back);
        assert_eq!(sharp.set_aside, SetAside::default());
        assert_eq!(sharp.topology().components, 2);
        assert_eq!(
            sharp.topology().non_manifold,
            [HalfEdgeId(0), HalfEdgeId(3)]
        );
    }
}
