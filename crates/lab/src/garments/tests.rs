//! Laws of garments and their sets.

use super::garment::{Garment, GarmentKind, make};
use super::holes::{HoleWish, cut};
use super::set;
use darn_geometry::mesh::TriMesh;
use darn_geometry::mesh::loops::boundary_loops;
use darn_geometry::mesh::topology::Topology;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// A skirt: it drapes in the shortest time.
static SKIRT: LazyLock<Garment> = LazyLock::new(|| make(GarmentKind::Skirt, 1000).unwrap());

/// The triangles of meshes by the bits of their corners, each from its least corner on.
fn triangles(meshes: &[&TriMesh]) -> BTreeSet<[[u64; 3]; 3]> {
    let of = |mesh: &TriMesh| -> Vec<[[u64; 3]; 3]> {
        let corners = |f: &[u32; 3]| {
            let mut c = f.map(|v| <[f64; 3]>::from(mesh.positions[v as usize]).map(f64::to_bits));
            let least = (0..3).min_by_key(|k| c[*k]).unwrap_or(0);
            c.rotate_left(least);
            c
        };
        mesh.faces.iter().map(corners).collect()
    };
    meshes.iter().flat_map(|m| of(m)).collect()
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_another_garment() {
    let again = make(GarmentKind::Skirt, 1000).unwrap();
    assert_eq!(SKIRT.mesh, again.mesh);
    assert_ne!(SKIRT.mesh, make(GarmentKind::Skirt, 1001).unwrap().mesh);
}

#[test]
fn draping_keeps_the_lengths_of_woven_cloth() {
    assert!(SKIRT.strain < 0.05, "{}", SKIRT.strain);
    // Folds, not a flat lay: the cloth is deeper than it is thick.
    let depth = |mesh: &TriMesh| {
        let z = mesh.positions.iter().map(|p| p.z);
        z.clone().fold(f64::MIN, f64::max) - z.fold(f64::MAX, f64::min)
    };
    assert!(depth(&SKIRT.mesh) > 0.2);
}

#[test]
fn a_garment_is_one_piece_whose_only_loops_are_its_openings() {
    let topology = Topology::new(&SKIRT.mesh);
    assert_eq!((topology.components, topology.non_manifold.len()), (1, 0));
    let loops = boundary_loops(&SKIRT.mesh, &topology);
    assert_eq!(loops.len(), SKIRT.openings.len());
    for opening in &SKIRT.openings {
        let same = |l: &&darn_geometry::mesh::loops::BoundaryLoop| {
            l.vertices.len() == opening.vertices && (l.length / opening.length - 1.0).abs() < 1e-6
        };
        assert_eq!(loops.iter().filter(same).count(), 1, "{opening:?}");
    }
}

#[test]
fn what_was_cut_out_sewn_back_is_the_intact_garment() {
    for (share, ragged) in [(None, false), (Some(0.15), true), (Some(0.6), true)] {
        let wish = HoleWish { share, ragged };
        let found = cut(&SKIRT, wish, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let back = triangles(&[&found.mesh, &found.lost]);
        assert_eq!(back, triangles(&[&SKIRT.mesh]));
        let topology = Topology::new(&found.mesh);
        assert_eq!((topology.components, topology.non_manifold.len()), (1, 0));
        let loops = boundary_loops(&found.mesh, &topology);
        assert_eq!(loops.len(), SKIRT.openings.len() + 1);
    }
}

#[test]
fn a_set_is_read_as_it_was_written() {
    let case = set::case(1, GarmentKind::Skirt, 0).unwrap();
    let dir = tempfile::tempdir().unwrap();
    set::write(dir.path(), 1, std::slice::from_ref(&case)).unwrap();
    let read = set::read(dir.path()).unwrap();
    assert_eq!(read[0].record.name, case.record.name);
    assert_eq!(triangles(&[&read[0].intact]), triangles(&[&case.intact]));
    for (a, b) in read[0].holes.iter().zip(&case.holes) {
        assert_eq!(
            triangles(&[&a.mesh, &a.lost]),
            triangles(&[&b.mesh, &b.lost])
        );
    }
}
