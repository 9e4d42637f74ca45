//! Holes in tubes: sleeves with folds, cut open and laid flat; and what no chart can lay out.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use darn_budget::Budget;
use darn_contract::{Anchor, Constraints, Edit, Gesture, HoleSelector, v1};
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::shapes::sheet;
use darn_geometry::mesh::weld::weld;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_mend::ScanSession;

use super::cloth::{MendedScan, mended, mender, packed, read};

/// Height of a sleeve; its radius is about 1.
const HEIGHT: f64 = 3.2;

/// A sleeve whose radius at (angle, height) is 1 plus `fold` there; squares for which `keep(u, v)` is false are left out.
fn sleeve(keep: impl Fn(f64, f64) -> bool, fold: impl Fn(f64, f64) -> f64) -> TriMesh {
    let place = |u: f64, v: f64| {
        let (angle, z) = (if u == 1.0 { 0.0 } else { TAU * u }, HEIGHT * v);
        let radius = 1.0 + fold(angle, z);
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    Arc::unwrap_or_clone(weld(&sheet(72, keep, place)).mesh)
}

/// Everything but a hole that takes this share of the circumference and a quarter of the height.
fn around(share: f64) -> impl Fn(f64, f64) -> bool {
    move |u, v| (2.0 * (u - 0.5) / share).powi(4) + (8.0 * (v - 0.5)).powi(4) > 1.0
}

fn folds(kind: &str) -> fn(f64, f64) -> f64 {
    match kind {
        "along" => |angle, _| 0.05 * (8.0 * angle).sin(),
        "spiral" => |angle, z| 0.05 * (6.0 * angle + 6.0 * z).sin(),
        "rings" => |_, z| 0.05 * (8.0 * z).sin(),
        _ => |_, _| 0.0,
    }
}

#[test]
fn holes_in_sleeves_are_closed_close_to_the_truth() {
    for kind in ["smooth", "along", "spiral", "rings"] {
        let fold = folds(kind);
        for share in [0.15, 0.35, 0.6] {
            let keep = around(share);
            let bytes = packed(&sleeve(&keep, fold), &[]);
            let done = mended(&bytes, &Constraints::default()).expect("a sleeve");
            let [hole] = &done.report.holes[..] else {
                panic!("one hole, not {}", done.report.holes.len());
            };
            assert!(hole.chart.is_some(), "{kind} {share}: {:?}", hole.notes);
            let seen = MendedScan::of(&done.bytes);
            let new = seen.new_positions();
            let off = |p: &Vec3| {
                let angle = p.y.atan2(p.x);
                (p.xy().norm() - 1.0 - fold(angle, p.z)).abs()
            };
            let mean = new.iter().map(off).sum::<f64>() / new.len() as f64;
            // The folds are 0.05 high: a lid through their middle is 0.03 off.
            assert!(mean < 0.03, "{kind} {share}: {mean}");
            let missing = sleeve(|u, v| !keep(u, v), fold);
            let truth: f64 = face_areas(&missing).iter().sum();
            let share_of_truth = seen.patch_area() / truth;
            assert!(
                (0.9..1.1).contains(&share_of_truth),
                "{kind} {share}: {share_of_truth}"
            );
        }
    }
}

/// A sleeve with a hole all round, but for a bridge one square wide.
fn nearly_cut_through() -> Vec<u8> {
    let keep = |u: f64, v: f64| (v - 0.5).abs() > 0.1 || u < 1.0 / 72.0;
    packed(&sleeve(keep, |_, _| 0.0), &[])
}

/// What fills that hole: its rim is so even that it is taken for an opening, which is filled when it is named.
fn named() -> Constraints {
    Constraints {
        holes: vec![HoleSelector::Id(1)],
        ..Constraints::default()
    }
}

#[test]
fn a_hole_without_a_chart_gets_a_fair_surface_and_the_report_says_so() {
    let bytes = nearly_cut_through();
    let done = mended(&bytes, &named()).expect("a fair surface");
    let [hole] = &done.report.holes[..] else {
        panic!("one hole, not {}", done.report.holes.len());
    };
    let patch = hole.patch.as_ref().expect("a patch");
    assert_eq!((patch.method.as_str(), patch.network_share), ("fair", 0.0));
    assert!(hole.chart.is_none() && hole.grid.is_none());
    assert!(
        hole.notes.iter().any(|n| n.contains("cannot be laid flat")),
        "{:?}",
        hole.notes
    );
    assert_eq!(patch.self_intersections, 0);
    let seen = MendedScan::of(&done.bytes);
    assert!(seen.loops.iter().all(|l| l.kind != LoopKind::Hole));
    for p in seen.new_positions() {
        let radius = p.xy().norm();
        assert!((radius - 1.0).abs() < 0.05, "{radius}");
    }
    // The same bytes every time.
    let again = mended(&bytes, &named()).expect("a fair surface");
    assert!(again.bytes == done.bytes);
}

#[test]
fn anchors_and_gestures_on_a_hole_without_a_chart_are_refused_by_their_pointers() {
    let asked = Constraints {
        anchors: vec![Anchor {
            hole: None,
            uv: None,
            position: [-1.0, 0.0, 1.6],
            hard: false,
        }],
        edits: vec![Edit {
            hole: None,
            gesture: Gesture::Grab {
                uv: [0.5, 0.5],
                offset: [0.0, 0.0, 0.1],
            },
        }],
        ..named()
    };
    let error = mended(&nearly_cut_through(), &asked).expect_err("a refusal");
    assert_eq!(error.code(), darn_contract::codes::CONSTRAINTS_DO_NOT_FIT);
    let pointers: Vec<String> = error.fields().into_iter().map(|f| f.pointer).collect();
    assert_eq!(pointers, ["/anchors/0", "/edits/0"]);
}

#[test]
fn a_session_holds_a_hole_without_a_chart() {
    let scan = read(&nearly_cut_through());
    let never = Budget::unlimited();
    let opening = named();
    let session =
        ScanSession::open(scan, &opening, Arc::clone(mender()), never).expect("a session");
    let described = session.described();
    let [hole] = &described.holes[..] else {
        panic!("one hole, not {}", described.holes.len());
    };
    assert!(!hole.rim_positions.is_empty() && !hole.patch_faces.is_empty());
    assert!(
        hole.grid_positions.is_empty() && hole.patch_uvs.is_empty() && hole.chart_png.is_empty()
    );
    let kept = session.call(never).mended(&opening).expect("a patch");
    let single = mended(&nearly_cut_through(), &opening).expect("a patch");
    assert!(kept.bytes == single.bytes);
}

/// A ball of radius 1 with lumps, the sum of six waves by a number, and a hole of about a third of its radius.
fn lumpy_ball(seed: u64) -> TriMesh {
    const RINGS: u32 = 24;
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let waves: Vec<(Vec3, f64)> = (0..6)
        .map(|_| {
            let along = [random(), random(), random()].map(|x| 18.0 * x - 9.0);
            (Vec3::from(along), 6.0 * random())
        })
        .collect();
    let direction = |k: u32| {
        let (ring, place) = (f64::from(k / (2 * RINGS)), f64::from(k % (2 * RINGS)));
        let polar = 0.02 + ring * (PI - 0.04) / f64::from(RINGS - 1);
        let angle = place * PI / f64::from(RINGS);
        let (sin, cos) = polar.sin_cos();
        Vec3::new(sin * angle.cos(), sin * angle.sin(), cos)
    };
    let lump = |d: &Vec3| -> f64 {
        waves
            .iter()
            .map(|(along, at)| (d.dot(along) + at).sin())
            .sum()
    };
    let all: Vec<Vec3> = (0..RINGS * 2 * RINGS).map(direction).collect();
    let quads = || (0..RINGS - 1).flat_map(|ring| (0..2 * RINGS).map(move |k| (ring, k)));
    let vertex = |ring: u32, k: u32| ring * 2 * RINGS + k % (2 * RINGS);
    let corners = |(ring, k)| {
        let below = ring + 1;
        [(ring, k), (below, k), (below, k + 1), (ring, k + 1)].map(|(r, k)| vertex(r, k))
    };
    let lower = quads().map(corners).map(|[a, b, c, _]| [a, b, c]);
    let upper = quads().map(corners).map(|[a, _, c, d]| [a, c, d]);
    let middle = |f: &[u32; 3]| f.iter().map(|v| all[*v as usize] / 3.0).sum::<Vec3>();
    TriMesh {
        faces: lower
            .chain(upper)
            .filter(|f| (middle(f) - Vec3::x()).norm() > 0.35)
            .collect(),
        positions: all.iter().map(|d| d * (1.0 + 0.12 * lump(d))).collect(),
    }
}

#[test]
fn where_a_surface_that_continues_the_cloth_is_a_tangle_a_plain_one_closes_the_hole() {
    let done = mended(&packed(&lumpy_ball(39), &[]), &Constraints::default());
    let report = done.expect("a ball").report;
    assert_eq!(report.skipped, []);
    let tangled = |h: &&v1::HoleReport| h.notes.iter().any(|n| n.contains("no plausible cloth"));
    let hole = report.holes.iter().find(tangled).expect("the large hole");
    let patch = hole.patch.as_ref().expect("a patch");
    assert_eq!(patch.method, "fair");
    assert!(hole.doubts.is_empty(), "{:?}", hole.doubts);
}
