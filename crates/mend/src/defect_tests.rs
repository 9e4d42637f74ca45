//! Laws of mending scans with defects that files have and cloth has not.

use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::{Constraints, v1};
use darn_geometry::mesh::defects::{Defect, with_defects};
use darn_geometry::mesh::shapes::{concat, holed_sheet, sheet};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::{Scan, ScanLimits};
use rayon::prelude::*;

use crate::testing::{mender, scan_of, scan_of_tiles};
use crate::{MendError, find_holes, mend};

/// A bent sheet with a hole in its middle and one beside.
fn cloth() -> TriMesh {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.12 && (u - 0.2).hypot(v - 0.2) > 0.08;
    let place = |u: f64, v: f64| Vec3::new(u, v, 0.05 * (4.0 * u).sin());
    sheet(26, keep, place)
}

/// A copy of a mesh that lies on it and shows the other side.
fn back_of(mesh: &TriMesh) -> TriMesh {
    TriMesh {
        positions: mesh
            .positions
            .iter()
            .map(|p| p - Vec3::z() * 3e-4)
            .collect(),
        faces: mesh.faces.iter().map(|[a, b, c]| [*c, *b, *a]).collect(),
    }
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
    let chosen = (0..count).map(|_| all.swap_remove(below(all.len())));
    chosen.collect()
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
        mesh = concat(&mesh, &back_of(&cloth()));
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

/// What is not as it should be in the mended cloth with defects of these kinds.
fn wrong(kinds: &[Kind], seed: u64) -> Vec<String> {
    let scan = scan_with(kinds, seed);
    let mended = match mend(&scan, &Constraints::default(), mender()) {
        Ok(mended) => mended,
        Err(error) => return vec![error.to_string()],
    };
    let report = &mended.report;
    let (skins, lost, meshes) = (
        u32::from(kinds.contains(&Kind::SecondSkin)),
        u32::from(kinds.contains(&Kind::NotFinite)),
        1 + u32::from(kinds.contains(&Kind::Tile)),
    );
    let mut wrong = Vec::new();
    let mut expect = |what: &str, found: String, expected: String| {
        if found != expected {
            wrong.push(format!("{what}: {found}, not {expected}"));
        }
    };
    expect("filled", report.holes.len().to_string(), "2".to_owned());
    let mut left: Vec<&str> = report.skipped.iter().map(|l| l.code.as_str()).collect();
    left.sort_unstable();
    let outer = ["outer_boundary"].repeat(1 + skins as usize);
    let second = ["second_skin"].repeat(2 * skins as usize);
    expect("left", left.join(" "), [outer, second].concat().join(" "));
    for (kind, number) in [
        ("second_skin_hole", 2 * skins),
        ("vertex_not_finite", 2 * lost * meshes),
    ] {
        expect(kind, aside(report, kind).to_string(), number.to_string());
    }
    let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
    if scanned(&after) != scanned(&scan) {
        wrong.push("the scan's triangles are others".to_owned());
    }
    let found = find_holes(&after, HolesQuery::default(), Budget::unlimited()).expect("no budget");
    let open = [v1::LoopKind::Hole, v1::LoopKind::OuterBoundary].map(|k| count(&found, k));
    // The copy's rims stay as they are: the patches of the first skin lie over them.
    let skins = skins as usize;
    if open != [2 * skins, 1 + skins] {
        wrong.push(format!("{open:?} holes and borders are left"));
    }
    wrong
}

#[test]
fn every_hole_of_a_scan_with_defects_is_filled_and_nothing_else() {
    let all: Vec<Kind> = (0..100).flat_map(kinds).collect();
    let counted = |kind: Kind| all.iter().filter(|it| **it == kind).count();
    let own = [Kind::NotFinite, Kind::Tile, Kind::SecondSkin];
    let each = Defect::ALL.map(Kind::Mesh).into_iter().chain(own);
    assert!(each.map(counted).all(|count| count > 10), "each kind often");
    let each = (0..100).into_par_iter().flat_map_iter(|seed| {
        let kinds = kinds(seed);
        let wrong = wrong(&kinds, seed).into_iter();
        wrong.map(move |it| format!("{seed} {kinds:?}: {it}"))
    });
    let wrong: Vec<String> = each.collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_holes_of_a_second_skin_are_filled_once() {
    let front = holed_sheet(24, 0.15);
    let scan = scan_of(&concat(&front, &back_of(&front)));
    let mended = mend(&scan, &Constraints::default(), mender()).expect("a mended scan");
    assert_eq!(mended.report.holes.len(), 1);
    let codes = mended.report.skipped.iter().map(|l| l.code.as_str());
    assert_eq!(codes.filter(|code| *code == "second_skin").count(), 1);
    assert_eq!(aside(&mended.report, "second_skin_hole"), 1);
    let patch = mended.report.holes[0].patch.clone().expect("a patch");
    let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
    let new = after.surface.faces.len() - scan.surface.faces.len();
    assert_eq!(new, 2 * patch.faces as usize, "both sides");
    // Mended once more, it is as it was: the back is not closed again beneath the patch.
    let again = mend(&after, &Constraints::default(), mender()).expect_err("no hole");
    let MendError::NoHoles { skipped } = again else {
        panic!("{again}");
    };
    let codes = skipped.iter().map(|l| l.code.as_str());
    assert_eq!(codes.filter(|code| *code == "second_skin").count(), 1);
}

#[test]
fn a_hole_in_a_patch_or_beside_it_is_no_second_skin() {
    let scan = scan_of(&holed_sheet(24, 0.15));
    let mended = mend(&scan, &Constraints::default(), mender()).expect("a mended scan");
    let after = Scan::read(mended.bytes, &ScanLimits::default()).expect("a readable answer");
    // A hole that takes a part of the patch and of the cloth beside it, and one within the patch.
    for (middle, radius) in [(0.63, 0.05), (0.5, 0.05)] {
        let kept = |face: &u32| {
            let corners = after.surface.triangle(*face as usize);
            let at: Vec3 = corners.iter().map(|p| p / 3.0).sum();
            (at.x - middle).hypot(at.y - 0.5) > radius
        };
        let is_cut: Vec<bool> = (0..after.surface.faces.len() as u32)
            .map(|f| !kept(&f))
            .collect();
        assert!(is_cut.contains(&true));
        let torn = after
            .without_faces(&is_cut, Budget::unlimited())
            .expect("a torn scan");
        let again = mend(&torn, &Constraints::default(), mender()).expect("a hole");
        assert_eq!(again.report.holes.len(), 1, "{middle}");
    }
}
