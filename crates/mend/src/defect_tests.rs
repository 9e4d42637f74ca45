//! Laws of mending scans with defects that files have and cloth has not.

use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::{Constraints, v1};
use darn_geometry::mesh::defects::{Defect, with_defects};
use darn_geometry::mesh::shapes::{concat, holed_sheet, sheet};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::{Scan, ScanLimits};

use crate::testing::{mender, scan_of};
use crate::{find_holes, mend};

/// A bent sheet with a hole in its middle and one beside.
fn cloth() -> TriMesh {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.12 && (u - 0.2).hypot(v - 0.2) > 0.08;
    let place = |u: f64, v: f64| Vec3::new(u, v, 0.05 * (4.0 * u).sin());
    sheet(26, keep, place)
}

/// The kinds of a number's bits: one to five.
fn kinds(bits: u64) -> Vec<Defect> {
    const KINDS: [Defect; 6] = [
        Defect::FlippedFace,
        Defect::Fin,
        Defect::DuplicateFace,
        Defect::DegenerateFace,
        Defect::TJunction,
        Defect::NearSeam,
    ];
    let chosen = KINDS.into_iter().enumerate();
    let chosen = chosen.filter(|(k, _)| bits >> k & 1 == 1);
    chosen.map(|(_, kind)| kind).take(5).collect()
}

fn count(report: &v1::HolesReport, kind: v1::LoopKind) -> usize {
    report.loops.iter().filter(|l| l.kind() == kind).count()
}

#[test]
fn every_hole_of_a_scan_with_defects_is_filled_and_nothing_else() {
    for seed in 0..100 {
        let kinds = kinds(1 + seed % 63);
        let scan = scan_of(&with_defects(&cloth(), &kinds, seed));
        let mended = mend(&scan, &Constraints::default(), mender())
            .unwrap_or_else(|error| panic!("{seed} {kinds:?}: {error}"));
        let report = &mended.report;
        assert_eq!(report.holes.len(), 2, "{seed} {kinds:?}");
        let left: Vec<&str> = report.skipped.iter().map(|l| l.code.as_str()).collect();
        assert_eq!(left, ["outer_boundary"], "{seed} {kinds:?}");
        let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
        let (faces, vertices) = (scan.surface.faces.len(), scan.surface.positions.len());
        assert_eq!(after.surface.faces[..faces], scan.surface.faces);
        assert_eq!(after.surface.positions[..vertices], scan.surface.positions);
        let found =
            find_holes(&after, HolesQuery::default(), Budget::unlimited()).expect("no budget");
        let open = [v1::LoopKind::Hole, v1::LoopKind::OuterBoundary].map(|k| count(&found, k));
        assert_eq!(open, [0, 1], "{seed} {kinds:?}");
    }
}

#[test]
fn the_holes_of_a_second_skin_are_filled_once() {
    let front = holed_sheet(24, 0.15);
    let back = TriMesh {
        positions: front
            .positions
            .iter()
            .map(|p| p - Vec3::z() * 3e-4)
            .collect(),
        faces: front.faces.iter().map(|[a, b, c]| [*c, *b, *a]).collect(),
    };
    let scan = scan_of(&concat(&front, &back));
    let mended = mend(&scan, &Constraints::default(), mender()).expect("a mended scan");
    assert_eq!(mended.report.holes.len(), 1);
    let codes = mended.report.skipped.iter().map(|l| l.code.as_str());
    assert_eq!(codes.filter(|code| *code == "second_skin").count(), 1);
    let mut aside = mended.report.set_aside.iter();
    let skin = aside.find(|it| it.kind == "second_skin_hole");
    assert_eq!(skin.map(|it| it.count), Some(1));
    let patch = mended.report.holes[0].patch.clone().expect("a patch");
    let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
    let new = after.surface.faces.len() - scan.surface.faces.len();
    assert_eq!(new, 2 * patch.faces as usize, "both sides");
}
