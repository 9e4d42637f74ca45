//! Laws of mending scans with defects that files have and cloth has not.

use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::{Constraints, v1};
use darn_geometry::mesh::defects::{Defect, with_defects};
use darn_geometry::mesh::shapes::{concat, holed_sheet, sheet};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::{Scan, ScanLimits};

use crate::testing::{mender, scan_of, scan_of_tiles};
use crate::{find_holes, mend};

/// A bent sheet with a hole in its middle and one beside.
fn cloth() -> TriMesh {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.12 && (u - 0.2).hypot(v - 0.2) > 0.08;
    let place = |u: f64, v: f64| Vec3::new(u, v, 0.05 * (4.0 * u).sin());
    sheet(26, keep, place)
}

/// A kind of defect of a mesh, or of how a file stores it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mesh(Defect),
    /// Vertices that no triangle uses, at NaN and infinity.
    NotFinite,
    /// A square of the cloth is a mesh of its own, whose node has another origin.
    Tile,
    /// A copy of the cloth that lies on it and shows the other side.
    SecondSkin,
}

/// One to five different kinds, by a number.
fn kinds(seed: u64) -> Vec<Kind> {
    let own = [Kind::NotFinite, Kind::Tile, Kind::SecondSkin];
    let mut all: Vec<Kind> = Defect::ALL.map(Kind::Mesh).into_iter().chain(own).collect();
    // Knuth's multiplier; the high bits are the good ones.
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut below = |n: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % n
    };
    let count = 1 + below(5);
    (0..count)
        .map(|_| all.swap_remove(below(all.len())))
        .collect()
}

/// The cloth with defects of these kinds.
fn scan_with(kinds: &[Kind], seed: u64) -> Scan {
    let of_mesh = kinds.iter().filter_map(|kind| match kind {
        Kind::Mesh(defect) => Some(*defect),
        _ => None,
    });
    let of_mesh: Vec<Defect> = of_mesh.collect();
    let mut mesh = with_defects(&cloth(), &of_mesh, seed);
    if kinds.contains(&Kind::SecondSkin) {
        let back = TriMesh {
            positions: (cloth().positions.iter().map(|p| p - Vec3::z() * 3e-4)).collect(),
            faces: (cloth().faces.iter().map(|[a, b, c]| [*c, *b, *a])).collect(),
        };
        mesh = concat(&mesh, &back);
    }
    if kinds.contains(&Kind::NotFinite) {
        let lost = [f64::NAN, f64::INFINITY].map(|x| Vec3::new(0.1, x, 0.0));
        mesh.positions.extend(lost);
    }
    if !kinds.contains(&Kind::Tile) {
        return scan_of_tiles(&[(mesh, Vec3::zeros())]);
    }
    let in_tile = |face: &[u32; 3]| {
        let middle: Vec3 = face.iter().map(|v| mesh.positions[*v as usize] / 3.0).sum();
        (middle.x - 0.75).abs() < 0.12 && (middle.y - 0.3).abs() < 0.12
    };
    let (tile, rest): (Vec<_>, Vec<_>) = mesh.faces.iter().partition(|face| in_tile(face));
    let part = |faces| TriMesh {
        positions: mesh.positions.clone(),
        faces,
    };
    let origin = Vec3::new(0.751, 0.302, -0.013);
    scan_of_tiles(&[(part(rest), Vec3::zeros()), (part(tile), origin)])
}

/// The triangles of a scan without darn's own, by their corners, in order.
fn scanned(scan: &Scan) -> Vec<[[u64; 3]; 3]> {
    let parts = scan.parts.iter().filter(|part| !part.reconstructed);
    let faces = parts.flat_map(|part| part.faces.clone());
    let corners = faces.map(|f| scan.surface.triangle(f as usize));
    let bits = |p: Vec3| [p.x, p.y, p.z].map(f64::to_bits);
    corners.map(|corners| corners.map(bits)).collect()
}

fn count(report: &v1::HolesReport, kind: v1::LoopKind) -> usize {
    report.loops.iter().filter(|l| l.kind() == kind).count()
}

fn aside(report: &v1::Report, kind: &str) -> u32 {
    let counted = report.set_aside.iter().filter(|it| it.kind == kind);
    counted.map(|it| it.count).sum()
}

#[test]
fn every_hole_of_a_scan_with_defects_is_filled_and_nothing_else() {
    for seed in 0..100 {
        let kinds = kinds(seed);
        let scan = scan_with(&kinds, seed);
        let mended = mend(&scan, &Constraints::default(), mender())
            .unwrap_or_else(|error| panic!("{seed} {kinds:?}: {error}"));
        let report = &mended.report;
        assert_eq!(report.holes.len(), 2, "{seed} {kinds:?}");
        let skin = kinds.contains(&Kind::SecondSkin);
        let mut left: Vec<&str> = report.skipped.iter().map(|l| l.code.as_str()).collect();
        left.sort_unstable();
        let expected: &[&str] = match skin {
            true => &[
                "outer_boundary",
                "outer_boundary",
                "second_skin",
                "second_skin",
            ],
            false => &["outer_boundary"],
        };
        assert_eq!(left, expected, "{seed} {kinds:?}");
        let skins = if skin { 2 } else { 0 };
        assert_eq!(aside(report, "second_skin_hole"), skins, "{seed} {kinds:?}");
        let lost = if kinds.contains(&Kind::NotFinite) {
            2
        } else {
            0
        };
        let meshes = if kinds.contains(&Kind::Tile) { 2 } else { 1 };
        let counted = aside(report, "vertex_not_finite");
        assert_eq!(counted, lost * meshes, "{seed} {kinds:?}");
        let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
        assert_eq!(scanned(&after), scanned(&scan), "{seed} {kinds:?}");
        let found =
            find_holes(&after, HolesQuery::default(), Budget::unlimited()).expect("no budget");
        let open = [v1::LoopKind::Hole, v1::LoopKind::OuterBoundary].map(|k| count(&found, k));
        assert_eq!(open, [0, 1 + usize::from(skin)], "{seed} {kinds:?}");
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
    assert_eq!(aside(&mended.report, "second_skin_hole"), 1);
    let patch = mended.report.holes[0].patch.clone().expect("a patch");
    let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
    let new = after.surface.faces.len() - scan.surface.faces.len();
    assert_eq!(new, 2 * patch.faces as usize, "both sides");
}
