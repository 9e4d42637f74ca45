//! Rims as scanners leave them: spikes, flaps and lips that overlap stay in the file, and the new cloth starts at the
//! sound edge beneath them.

use darn_contract::Constraints;
use darn_contract::v1;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::shapes::{
    flap, fray, overlapping_slit, sheet, three_cornered_tear, tongue,
};
use darn_geometry::mesh::{TriMesh, Vec3};

use super::cloth::{MendedScan, mended, packed, read};

/// Mends a scan with one hole: the hole's report, and the mended scan.
fn mend(mesh: &TriMesh) -> (v1::HoleReport, MendedScan) {
    let bytes = packed(mesh, &[]);
    let mended = mended(&bytes, &Constraints::default()).expect("a hole that can be filled");
    let after = MendedScan::of(&mended.bytes);
    // Every triangle of the scan is there, as it was.
    let before = read(&bytes).surface;
    let scan = &after.scan.surface;
    for (f, face) in before.faces.iter().enumerate() {
        assert_eq!(before.triangle(f), scan.triangle(f), "{face:?}");
    }
    let [hole] = &mended.report.holes[..] else {
        panic!("{} holes", mended.report.holes.len());
    };
    (hole.clone(), after)
}

fn check(report: &v1::HoleReport) {
    let patch = report.patch.as_ref().expect("a patch");
    assert!(
        patch.stretch_max < 2.0,
        "stretched {} times",
        patch.stretch_max
    );
    assert_eq!(patch.self_intersections, 0);
    assert_eq!(patch.seam_gap, 0.0);
    let said = report
        .notes
        .iter()
        .any(|n| n.contains("no part of the cloth"));
    assert_eq!(said, report.left_faces > 0, "{:?}", report.notes);
}

#[test]
fn a_frayed_rim_is_patched_from_its_sound_edge() {
    let n = 36;
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.18;
    let waves = |u: f64, v: f64| Vec3::new(u, v, 0.03 * (7.0 * u + 2.0 * v).sin());
    let clean = sheet(n, keep, waves);
    for (length, seed) in [(3.0, 1), (5.0, 2), (8.0, 3)] {
        let middle = |p: &Vec3| (p.x - 0.5).hypot(p.y - 0.5) < 0.4;
        let frayed = fray(&clean, middle, length / n as f64, seed);
        let (report, _) = mend(&frayed);
        check(&report);
        // A few ears of the cloth that spikes hang on come off with them.
        let spikes = frayed.faces.len() - clean.faces.len();
        let ears = report.left_faces as usize - spikes;
        assert!(
            ears < 8,
            "{ears} faces more than the {spikes} of the spikes"
        );
    }
}

#[test]
fn a_clean_rim_has_nothing_left_out() {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.18;
    let (report, _) = mend(&sheet(36, keep, |u, v| {
        Vec3::new(u, v, 0.05 * (7.0 * u).sin())
    }));
    check(&report);
    assert_eq!(report.left_faces, 0);
}

#[test]
fn cloth_is_laid_under_a_tongue() {
    for angle in [1.2, 1.6, 2.4, -1.6] {
        let (report, after) = mend(&tongue(33, angle));
        check(&report);
        assert!(report.left_faces > 200, "{} faces", report.left_faces);
        let highest = after
            .new_positions()
            .iter()
            .map(|p| p.z.abs())
            .fold(0.0, f64::max);
        assert!(
            highest < 0.03,
            "a tent of height {highest} over a tongue at {angle}"
        );
    }
}

fn waves(u: f64, v: f64) -> f64 {
    0.03 * (6.0 * u).sin() * (3.0 * v).cos()
}

/// How far the new cloth is from the waves, at most.
fn off(after: &MendedScan) -> f64 {
    let new = after.new_positions();
    let off = new.iter().map(|p| (p.z - waves(p.x, p.y)).abs());
    off.fold(0.0, f64::max)
}

#[test]
fn cloth_is_laid_under_a_flap_that_is_shorter_than_the_hole() {
    for (shape, angle) in [
        ([0.12, 0.1], 1.57),
        ([0.2, 0.1], 1.2),
        ([0.12, 0.14], 2.7),
        ([0.16, 0.1], -1.57),
    ] {
        let (_, soup) = flap(60, shape, angle, waves);
        let (report, after) = mend(&soup);
        check(&report);
        assert!(report.left_faces > 30, "{} faces", report.left_faces);
        assert!(
            off(&after) < 0.025,
            "{} off, {shape:?} {angle}",
            off(&after)
        );
    }
}

#[test]
fn cloth_is_laid_under_the_corner_of_a_three_cornered_tear() {
    for angle in [0.5, 0.9, 1.57, 2.6] {
        let (report, after) = mend(&three_cornered_tear(60, 0.2, angle, waves));
        check(&report);
        assert!(report.left_faces > 60, "{} faces", report.left_faces);
        // A corner that hardly stands out is left up to its bend.
        assert!(off(&after) < 0.03, "{} off at {angle}", off(&after));
        let area = after.patch_area() / (0.5 * 0.2 * 0.2);
        assert!((0.7..1.6).contains(&area), "{area} of the corner's area");
    }
}

#[test]
fn lips_that_overlap_are_joined() {
    for edges in [0.6, 1.5] {
        let (report, _) = mend(&overlapping_slit(40, edges / 40.0));
        check(&report);
        assert!(report.left_faces > 0);
    }
}

/// A sheet with a square hole and a strip of cloth in it, on a ridge that runs through both.
fn ridge(lift: f64) -> TriMesh {
    let within = |x: f64, half: f64| (x - 0.5).abs() < half;
    let strip = move |u: f64, v: f64| within(u, 0.065) && within(v, 0.16);
    let keep = |u: f64, v: f64| strip(u, v) || !(within(u, 0.2) && within(v, 0.24));
    sheet(40, keep, |u, v| {
        let ridge = 0.05 * (-((u - 0.5) / 0.1).powi(2)).exp();
        Vec3::new(u, v, ridge + if strip(u, v) { lift } else { 0.0 })
    })
}

#[test]
fn a_patch_meets_an_island_of_its_cloth() {
    let (report, after) = mend(&ridge(0.0));
    check(&report);
    let kinds: Vec<LoopKind> = after.loops.iter().map(|l| l.kind).collect();
    assert_eq!(kinds, [LoopKind::Outer], "{:?}", report.notes);
    assert_eq!(after.topology.components, 1);
    assert!(after.topology.non_manifold.is_empty());
    assert!(
        report
            .notes
            .iter()
            .any(|n| n.contains("the new cloth meets them"))
    );
}

#[test]
fn a_scrap_above_a_hole_is_left() {
    for lift in [0.15, -0.3] {
        let (report, after) = mend(&ridge(lift));
        assert_eq!(report.left_faces, 0);
        let mut kinds: Vec<LoopKind> = after.loops.iter().map(|l| l.kind).collect();
        kinds.dedup();
        assert_eq!(kinds, [LoopKind::Outer]);
        assert_eq!(after.topology.components, 2);
        let said = report
            .notes
            .iter()
            .any(|n| n.contains("float over or under"));
        assert!(said, "{:?}", report.notes);
    }
}

#[test]
fn a_patch_meets_an_island_that_has_a_hole_of_its_own() {
    let round = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5);
    let keep = move |u: f64, v: f64| {
        let r = round(u, v);
        r > 0.32 || (0.07 < r && r < 0.2)
    };
    let bytes = packed(&sheet(48, keep, |u, v| Vec3::new(u, v, waves(u, v))), &[]);
    let mended = mended(&bytes, &Constraints::default()).expect("two holes");
    let after = MendedScan::of(&mended.bytes);
    assert_eq!(
        mended.report.holes.len(),
        2,
        "that of the sheet and the island's"
    );
    let kinds: Vec<LoopKind> = after.loops.iter().map(|l| l.kind).collect();
    assert_eq!(
        kinds,
        [LoopKind::Outer],
        "{:?}",
        mended.report.holes[0].notes
    );
    assert_eq!(after.topology.components, 1);
    assert!(off(&after) < 0.02, "{} off", off(&after));
    let missing = std::f64::consts::PI * (0.32 * 0.32 - 0.2 * 0.2 + 0.07 * 0.07);
    let area = after.patch_area() / missing;
    assert!((0.9..1.15).contains(&area), "{area} of what is missing");
}

#[test]
fn scraps_within_a_hole_are_no_cuts_of_its_patch() {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.18;
    for fold in [0.0, 0.03] {
        let mut littered = sheet(24, keep, |u, v| Vec3::new(u, v, fold * (7.0 * u).sin()));
        for k in 0..8 {
            let angle = std::f64::consts::TAU * f64::from(k) / 8.0;
            let middle = Vec3::new(0.5 + 0.1 * angle.cos(), 0.5 + 0.1 * angle.sin(), 0.0);
            let tilt = Vec3::new(0.02, 0.0, 0.01 * f64::from(k % 3 - 1));
            let first = littered.positions.len() as u32;
            let corners = [middle - tilt, middle + tilt, middle + Vec3::y() * 0.04];
            littered.positions.extend(corners);
            littered.faces.push([first, first + 1, first + 2]);
        }
        let (report, after) = mend(&littered);
        let patch = report.patch.as_ref().expect("a patch");
        assert_eq!(
            (patch.self_intersections, patch.method.as_str()),
            (0, "network")
        );
        assert_eq!(after.topology.components, 9);
    }
}

#[test]
fn scraps_that_float_beside_the_cloth_are_told_of() {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.18;
    let cloth = sheet(36, keep, |u, v| Vec3::new(u, v, 0.0));
    let scraps = (0..5).map(|k| {
        let at = Vec3::new(0.2 * f64::from(k), 0.3, 0.4);
        [at, at + Vec3::x() * 0.03, at + Vec3::y() * 0.03]
    });
    let mut littered = cloth.clone();
    for corners in scraps {
        let first = littered.positions.len() as u32;
        littered.positions.extend(corners);
        littered.faces.push([first, first + 1, first + 2]);
    }
    let notes = |mesh: &TriMesh| {
        let mended = mended(&packed(mesh, &[]), &Constraints::default());
        mended.expect("a hole that can be filled").report.notes
    };
    assert_eq!(notes(&cloth), Vec::<String>::new());
    let said = notes(&littered);
    assert!(said[0].starts_with("5 loose scrap(s)"), "{said:?}");
}
