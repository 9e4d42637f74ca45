//! Laws of welding what files have and cloth has not.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::defects::{Defect, with_defects};
use super::loops::{BoundaryLoop, LoopKind, boundary_loops};
use super::shapes::{concat, sheet};
use super::topology::Topology;
use super::weld::{WeldedMesh, weld, weld_within};
use super::{TriMesh, Vec3};
use darn_budget::Budget;

/// A bent sheet with a hole in its middle and one beside.
fn cloth(n: usize) -> TriMesh {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.17 && (u - 0.2).hypot(v - 0.2) > 0.1;
    sheet(n, keep, |u, v| {
        Vec3::new(u, v, 0.1 * (5.0 * u).sin() + 0.05 * (4.0 * v).cos())
    })
}

fn loops_of(welded: &WeldedMesh) -> (Topology, Vec<BoundaryLoop>) {
    let topology = welded.topology();
    let loops = boundary_loops(&welded.mesh, &topology);
    (topology, loops)
}

/// The places of every loop's kind and centre, rounded.
fn described(loops: &[BoundaryLoop]) -> BTreeSet<(bool, [i64; 3])> {
    let each = loops.iter();
    let rounded = |l: &BoundaryLoop| l.centroid.map(|x| (x * 100.0).round() as i64).into();
    each.map(|l| (l.kind == LoopKind::Hole, rounded(l)))
        .collect()
}

fn kinds() -> impl Strategy<Value = Vec<Defect>> {
    prop::sample::subsequence(Defect::ALL.to_vec(), 1..=5)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn defects_neither_hide_nor_make_holes(n in 14usize..30, kinds in kinds(), seed: u64) {
        let sound = cloth(n);
        let (_, expected) = loops_of(&weld(&sound));
        prop_assert_eq!(expected.len(), 3);
        let soup = with_defects(&sound, &kinds, seed);
        let welded = weld(&soup);
        let (topology, loops) = loops_of(&welded);
        prop_assert_eq!(topology.components, 1, "{:?}", welded.set_aside);
        prop_assert_eq!(&topology.non_manifold, &[]);
        prop_assert_eq!(loops.len(), 3, "{:?}", welded.set_aside);
        prop_assert_eq!(described(&loops), described(&expected));
        // Every face is in the mesh or was counted.
        let kept: BTreeSet<u32> = welded.soup_faces.iter().collect();
        let aside = welded.set_aside;
        let left_out = aside.degenerate_faces + aside.duplicate_faces + aside.fins;
        prop_assert_eq!(kept.len() + left_out, soup.faces.len());
        // Every corner lies where the scan has it, to the tolerance.
        for (f, face) in (0u32..).zip(&welded.mesh.faces) {
            let corners = welded.soup_corners(&soup, super::index::FaceId(f)).expect("corners");
            for (v, s) in face.iter().zip(corners) {
                let off = welded.mesh.positions[*v as usize] - soup.positions[s as usize];
                prop_assert!(off.norm() < 1e-3 / n as f64);
            }
        }
    }

    #[test]
    fn faces_are_turned_back_and_nothing_else_changes(n in 14usize..30, seed: u64) {
        let sound = weld(&cloth(n));
        let welded = weld(&with_defects(&cloth(n), &[Defect::FlippedFace], seed));
        prop_assert!((1..=4).contains(&welded.set_aside.flipped_faces));
        // The same faces, whichever corner comes first.
        let from_lowest = |mesh: &TriMesh| -> Vec<[[u64; 3]; 3]> {
            let corners = |f: usize| mesh.triangle(f).map(|p| [p.x, p.y, p.z].map(f64::to_bits));
            (0..mesh.faces.len())
                .map(|f| {
                    let mut corners = corners(f);
                    let lowest = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
                    corners.rotate_left(lowest);
                    corners
                })
                .collect()
        };
        prop_assert_eq!(from_lowest(&welded.mesh), from_lowest(&sound.mesh));
    }

    #[test]
    fn a_gap_wider_than_the_tolerance_stays(n in 10usize..24, gap in 0.003..0.5f64) {
        let left = sheet(n, |u, _| u < 0.5, |u, v| Vec3::new(u, v, 0.0));
        let right = sheet(n, |u, _| u > 0.5, |u, v| Vec3::new(u + gap / n as f64, v, 0.0));
        let both = concat(&left, &right);
        let (topology, _) = loops_of(&weld(&both));
        prop_assert_eq!(topology.components, 2);
    }

    #[test]
    fn tiles_meet_within_the_precision_of_their_coordinates(
        n in 10usize..24, offset in 0.0..3000.0f64,
    ) {
        // The right tile has its own origin.
        let place = |u: f64, v: f64| Vec3::new(u + offset, v + offset, 0.2 * (3.0 * v).sin());
        let rounded = |p: Vec3| p.map(|x| f64::from(x as f32));
        let origin = Vec3::new(0.37 + offset, 0.61 + offset, 0.013);
        let left = sheet(2 * n, |u, _| u < 0.5, |u, v| rounded(place(u, v)));
        let right = sheet(2 * n, |u, _| u > 0.5, |u, v| {
            rounded(place(u, v) - origin) + rounded(origin)
        });
        let precision = |_: u32| f64::from(f32::EPSILON) * 2.0 * (1.0 + offset);
        let both = concat(&left, &right);
        let welded = weld_within(&both, &precision, Budget::unlimited()).expect("no budget");
        let (topology, loops) = loops_of(&welded);
        prop_assert_eq!((topology.components, loops.len()), (1, 1));
    }
}

#[test]
fn a_fine_tile_meets_a_coarse_one() {
    let place = |u: f64, v: f64| Vec3::new(u, v, 0.0);
    let coarse = sheet(8, |u, _| u < 0.5, place);
    let fine = sheet(24, |u, _| u > 0.5, place);
    let welded = weld(&concat(&coarse, &fine));
    assert_eq!(welded.set_aside.t_junctions, 16);
    let (topology, loops) = loops_of(&welded);
    assert_eq!((topology.components, loops.len()), (1, 1));
    assert_eq!(loops[0].kind, LoopKind::Outer);
}

#[test]
fn a_moebius_strip_stays_cut_where_its_sides_meet() {
    let n = 24;
    let strip = sheet(
        n,
        |_, v| v < 0.25,
        |u, v| {
            let (around, across) = (u * std::f64::consts::TAU, v - 0.125);
            let at = |angle: f64, across: f64| {
                let radius = 1.0 + across * (0.5 * angle).cos();
                Vec3::new(
                    radius * angle.cos(),
                    radius * angle.sin(),
                    across * (0.5 * angle).sin(),
                )
            };
            // The last column lies exactly on the first, upside down.
            if u == 1.0 {
                at(0.0, -across)
            } else {
                at(around, across)
            }
        },
    );
    let welded = weld(&strip);
    let (topology, loops) = loops_of(&welded);
    assert_eq!(
        (topology.components, welded.set_aside.flipped_faces),
        (1, 0)
    );
    assert_eq!(topology.non_manifold.len(), 2 * n / 4);
    assert_eq!(loops.len(), 1);
}

#[test]
fn a_fin_of_two_triangles_comes_off_a_rim_whichever_way_they_face() {
    let sound = cloth(20);
    let (_, expected) = loops_of(&weld(&sound));
    let rim = &expected[2];
    let mesh = weld(&sound).mesh;
    let [a, b] = [0, 1].map(|k: usize| mesh.positions[rim.vertices[k].index()]);
    for faces in [[[0, 1, 2], [1, 0, 3]], [[0, 1, 2], [0, 1, 3]]] {
        let (across, up) = ((a + b) * 0.5 + (rim.centroid - a) * 0.2, Vec3::z() * 0.03);
        let fin = TriMesh {
            positions: vec![a, b, across + up, across - up],
            faces: faces.to_vec(),
        };
        let welded = weld(&concat(&sound, &fin));
        let (topology, loops) = loops_of(&welded);
        assert_eq!(
            (welded.set_aside.fins, welded.set_aside.flipped_faces),
            (2, 0)
        );
        assert_eq!((topology.non_manifold, loops.len()), (vec![], 3));
    }
}

#[test]
fn two_skins_that_nearly_touch_stay_apart() {
    let front = cloth(20);
    let back = TriMesh {
        positions: front
            .positions
            .iter()
            .map(|p| p - Vec3::z() * 2e-5)
            .collect(),
        faces: front.faces.iter().map(|[a, b, c]| [*c, *b, *a]).collect(),
    };
    let welded = weld(&concat(&front, &back));
    let (topology, loops) = loops_of(&welded);
    assert_eq!((topology.components, loops.len()), (2, 6));
}

#[test]
fn three_sheets_at_one_edge_are_joined_where_they_continue_each_other() {
    let flat = sheet(8, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
    let wall = sheet(8, |_, _| true, |u, v| Vec3::new(0.5, u, v));
    let welded = weld(&concat(&wall, &flat));
    let (topology, loops) = loops_of(&welded);
    assert_eq!((topology.components, loops.len()), (2, 2));
    assert_eq!(topology.non_manifold.len(), 8);
    assert!(loops.iter().all(|l| !l.non_manifold));
}
