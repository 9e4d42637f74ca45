//! Welding: one vertex per exact position, then one vertex per sheet where sheets touch only in a point or an edge.

use super::TriMesh;
use super::pairing::{Twins, bucket_starts, pair_half_edges, places};
use super::topology::Topology;

/// A triangle soup made into surfaces, and how its faces lead back to the soup's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WeldedMesh {
    /// The welded mesh; vertices are numbered by first use in face order, none is unused.
    pub mesh: TriMesh,
    /// Per welded face the soup's face, ascending; corner k of one is corner k of the other.
    pub soup_face: Vec<u32>,
    /// How many faces of the soup were left out: two corners in one place, the same three places as an earlier face
    /// (whichever side it shows), or an index out of range.
    pub dropped: usize,
    /// Per welded face whether one of the faces left out shows its other side.
    pub two_sided: Vec<bool>,
    /// The twins of the welded mesh's half-edges. `None` when sheets of the soup share an edge: splitting them makes
    /// more pairs.
    twins: Option<Twins>,
}

impl WeldedMesh {
    /// [`Topology::new`] of the welded mesh, without pairing its half-edges again.
    pub fn topology(&self) -> Topology {
        match &self.twins {
            Some(twins) => Topology::with_twins(&self.mesh, twins.clone(), Vec::new()),
            None => Topology::new(&self.mesh),
        }
    }
}

/// Welds `soup` by exact position (−0 equals 0) and splits bow-ties. Near linear.
///
/// A vertex whose faces form several edge-connected fans becomes one vertex per fan, all in the same place, so every
/// boundary vertex of the result lies on exactly one boundary loop. Faces are not joined across an edge where more
/// than two meet or two run the same way (a sheet crossed by such an edge up to its border is slit there). The result
/// depends on the order of faces, not on how the soup numbered its vertices.
pub fn weld(soup: &TriMesh) -> WeldedMesh {
    let place = places(soup);
    let distinct = distinct_faces(&soup.faces, &place);
    let faces: Vec<[u32; 3]> = distinct
        .faces
        .iter()
        .map(|&f| soup.faces[f as usize].map(|v| place[v as usize]))
        .collect();
    let pairing = pair_half_edges(&faces, &place);
    let (fan, fans) = pairing.twins.corner_fans();
    let mut positions = Vec::with_capacity(fans);
    for (corner, &old) in faces.as_flattened().iter().enumerate() {
        if fan[corner] as usize == positions.len() {
            positions.push(soup.positions[old as usize]);
        }
    }
    let dropped = soup.faces.len() - faces.len();
    let (faces, _) = fan.as_chunks::<3>();
    WeldedMesh {
        mesh: TriMesh {
            positions,
            faces: faces.to_vec(),
        },
        soup_face: distinct.faces,
        dropped,
        two_sided: distinct.two_sided,
        twins: pairing.non_manifold.is_empty().then_some(pairing.twins),
    }
}

/// The faces that [`distinct_faces`] keeps.
struct DistinctFaces {
    /// Their indices, ascending.
    faces: Vec<u32>,
    /// Per kept face whether a later face has the same places in the opposite order.
    two_sided: Vec<bool>,
}

/// The faces with three different places that no earlier face has.
fn distinct_faces(faces: &[[u32; 3]], place: &[u32]) -> DistinctFaces {
    let places = |face: &[u32; 3]| match face.map(|v| place.get(v as usize)) {
        [Some(&a), Some(&b), Some(&c)] if a != b && b != c && c != a => {
            let mut key = [a, b, c];
            key.sort_unstable();
            Some(key)
        }
        _ => None,
    };
    // In buckets by lowest place, each sorted: near linear, and no input makes it quadratic.
    let valid = || {
        (0u32..)
            .zip(faces)
            .filter_map(|(f, face)| Some((places(face)?, f)))
    };
    let starts = bucket_starts(valid().map(|(key, _)| key[0]), place.len());
    let mut fill = starts.clone();
    let mut sorted = vec![(0, 0, 0); starts.last().map_or(0, |&end| end as usize)];
    for ([low, middle, high], f) in valid() {
        sorted[fill[low as usize] as usize] = (middle, high, f);
        fill[low as usize] += 1;
    }
    // Around a face of three different places, two of the three steps ascend in one orientation and one in the other.
    let ascends_twice = |f: u32| {
        let [a, b, c] = faces[f as usize].map(|v| place[v as usize]);
        [(a, b), (b, c), (c, a)]
            .iter()
            .filter(|(from, to)| from < to)
            .count()
            == 2
    };
    let mut first = vec![false; faces.len()];
    let mut two_sided = vec![false; faces.len()];
    for s in starts.windows(2) {
        let bucket = &mut sorted[s[0] as usize..s[1] as usize];
        bucket.sort_unstable();
        for group in bucket.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let (kept, rest) = (group[0].2, &group[1..]);
            first[kept as usize] = true;
            two_sided[kept as usize] =
                (rest.iter()).any(|other| ascends_twice(other.2) != ascends_twice(kept));
        }
    }
    let (faces, two_sided) = (0..faces.len() as u32)
        .filter(|&f| first[f as usize])
        .map(|f| (f, two_sided[f as usize]))
        .unzip();
    DistinctFaces { faces, two_sided }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::index::HalfEdgeId;
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
            prop_assert_eq!(twice.dropped, 0);
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
            prop_assert_eq!(count, topology.twins().boundary().count());
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
        assert_eq!((welded.soup_face, welded.dropped), (vec![0, 5], 4));
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
        let mesh = weld(&concat(&sheet, &fin)).mesh;
        let topology = Topology::new(&mesh);
        assert_eq!(topology.components, 2);
        assert_eq!(topology.non_manifold.len(), 1);
        let loops = loops::boundary_loops(&mesh, &topology);
        let named: Vec<_> = loops
            .iter()
            .map(|l| (l.vertices.len(), l.non_manifold))
            .collect();
        assert_eq!(named, [(16, false), (3, true)]);
    }

    #[test]
    fn faces_that_run_the_same_way_are_not_joined() {
        let soup = TriMesh {
            positions: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), -Vec3::y()],
            faces: vec![[0, 1, 2], [0, 1, 3]],
        };
        let topology = Topology::new(&weld(&soup).mesh);
        assert_eq!(topology.components, 2);
        assert_eq!(topology.non_manifold, [HalfEdgeId(0), HalfEdgeId(3)]);
    }
}
