//! Welding: a triangle soup made into surfaces, forgiving what files have that cloth has not.

use std::sync::Arc;

use darn_budget::{Budget, Exhausted};

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId};
use super::pairing::{Paired, Twins, places};
use super::repair::{Repair, Repaired};
use super::topology::{Fans, Topology};

/// A triangle soup made into surfaces, and how its faces lead back to the soup's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WeldedMesh {
    /// The welded mesh; vertices are numbered by first use in face order, none is unused.
    pub mesh: Arc<TriMesh>,
    /// Which of the soup's faces the welded faces are. For their corners see [`WeldedMesh::soup_corners`].
    pub soup_faces: SoupFaces,
    /// What the mesh does not have as the soup has it.
    pub set_aside: SetAside,
    /// Per welded face whether one of the faces left out shows its other side; empty where none does.
    two_sided: Vec<bool>,
    /// The twins of the welded mesh's half-edges.
    twins: Arc<Twins>,
    /// Per vertex the first half-edge that leaves it.
    first_leaving: Arc<Vec<HalfEdgeId>>,
    /// What [`Topology::non_manifold`] lists.
    non_manifold: Vec<HalfEdgeId>,
    /// The faces that were turned or split, ascending, with the soup's vertices at their corners.
    changed: Vec<(FaceId, [u32; 3])>,
}

/// Per face of a welded mesh the face of the soup that it was made of, ascending; the parts of a split face have the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SoupFaces {
    /// So many welded faces, each with the number of its face in the soup.
    Same(usize),
    /// Other numbers.
    Listed(Vec<u32>),
}

impl Default for SoupFaces {
    fn default() -> Self {
        SoupFaces::Same(0)
    }
}

impl SoupFaces {
    /// The same without a list where each of the soup's `count` faces is one welded face.
    fn compact(self, count: usize) -> SoupFaces {
        match self {
            // Ascending numbers without repetition below their count are all of them.
            SoupFaces::Listed(faces)
                if faces.len() == count && faces.is_sorted_by(|a, b| a < b) =>
            {
                SoupFaces::Same(count)
            }
            faces => faces,
        }
    }

    /// How many welded faces there are.
    pub fn len(&self) -> usize {
        match self {
            SoupFaces::Same(count) => *count,
            SoupFaces::Listed(faces) => faces.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The soup's face of a welded one; `None` for one that does not exist.
    #[inline]
    pub fn of(&self, face: FaceId) -> Option<u32> {
        match self {
            SoupFaces::Same(count) => (face.index() < *count).then_some(face.0),
            SoupFaces::Listed(faces) => faces.get(face.index()).copied(),
        }
    }

    /// The soup's faces in the order of the welded ones.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.len() as u32).filter_map(|f| self.of(FaceId(f)))
    }

    /// The welded faces that were made of a face of the soup.
    pub fn parts(&self, soup_face: u32) -> impl Iterator<Item = FaceId> + use<> {
        let range = match self {
            SoupFaces::Same(count) => {
                let at = soup_face as usize;
                at.min(*count)..(at + 1).min(*count)
            }
            SoupFaces::Listed(faces) => {
                let first = faces.partition_point(|own| *own < soup_face);
                first..faces.partition_point(|own| *own <= soup_face)
            }
        };
        range.map(|part| FaceId(part as u32))
    }

    /// Bytes of memory that it holds.
    pub fn bytes(&self) -> usize {
        match self {
            SoupFaces::Same(_) => 0,
            SoupFaces::Listed(faces) => 4 * faces.len(),
        }
    }
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
        let fans = Fans {
            twins: self.twins.clone(),
            first: self.first_leaving.clone(),
            non_manifold: self.non_manifold.clone(),
        };
        Topology::with_fans(self.mesh.clone(), fans)
    }

    /// Whether one of the faces left out shows the other side of a welded face.
    pub fn is_two_sided(&self, face: FaceId) -> bool {
        self.two_sided.get(face.index()).copied().unwrap_or(false)
    }

    /// The vertices of `soup` at a welded face's corners, in the order of the welded face: those of its face in the
    /// soup, reversed where the face was turned. A part of a split face has vertices of other faces, too.
    pub fn soup_corners(&self, soup: &TriMesh, face: FaceId) -> Option<[u32; 3]> {
        let own = self.soup_faces.of(face)?;
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
    let mut first_leaving = Vec::with_capacity(vertices);
    let corners = faces.as_flattened().iter().zip(places.as_flattened());
    for (h, (&vertex, &place)) in (0u32..).map(HalfEdgeId).zip(corners) {
        if vertex as usize == positions.len() {
            positions.push(soup.positions[place as usize]);
            first_leaving.push(h);
        }
    }
    Ok(WeldedMesh {
        mesh: TriMesh { positions, faces }.into(),
        changed,
        soup_faces: sources.soup_faces.compact(soup.faces.len()),
        set_aside,
        two_sided: sources.two_sided,
        twins: twins.into(),
        first_leaving: first_leaving.into(),
        non_manifold,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::index::VertexId;
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
                let (fans, paired) = (welded.topology(), Topology::new(&welded.mesh));
                prop_assert_eq!(&fans.non_manifold, &paired.non_manifold);
                prop_assert_eq!(fans.components, paired.components);
                for face in (0..welded.mesh.faces.len() as u32).map(FaceId) {
                    prop_assert_eq!(fans.component(face), paired.component(face));
                    for h in face.half_edges() {
                        prop_assert_eq!(fans.twin(h), paired.twin(h));
                        prop_assert_eq!(fans.origin(h), paired.origin(h));
                    }
                }
                for v in (0..welded.mesh.positions.len() as u32).map(VertexId) {
                    prop_assert_eq!(fans.leaving(v), paired.leaving(v));
                }
                prop_assert_eq!(fans.boundary_vertices(), paired.boundary_vertices());
            }
        }

        #[test]
        fn corners_keep_their_places(soup in sheet_with_random_holes()) {
            let welded = weld(&soup);
            for (f, from) in welded.soup_faces.iter().enumerate() {
                prop_assert_eq!(welded.mesh.triangle(f), soup.triangle(from as usize));
                prop_assert!(welded.soup_faces.parts(from).any(|part| part.index() == f));
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
        for k in 0..front.faces.len() {
            assert_eq!(both.is_two_sided(FaceId(k as u32)), k % 2 == 0);
        }
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
        assert_eq!(welded.soup_faces, SoupFaces::Listed(vec![0, 5]));
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
