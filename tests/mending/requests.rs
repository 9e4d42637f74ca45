//! What a request may ask of a scan, and what it is told.

use darn::contract::{Anchor, Constraints, Edit, Gesture, HoleSelector};
use darn::mend::MendError;
use darn::mesh::intersect::intersections_with;
use darn::mesh::{TriMesh, Vec3};
use darn::scarffolds::scanned::Hole;

use super::cloth::{ROUND, Seen, holed, laid, mended, packed, sheet};

/// Two sheets side by side, each with a hole; the second is moved along x.
fn pair() -> Vec<u8> {
    let mut both = holed(sheet(0), &ROUND).mesh;
    let other = holed(sheet(1), &ROUND).mesh;
    let base = both.positions.len() as u32;
    both.positions
        .extend(other.positions.iter().map(|p| p + Vec3::x() * 5.0));
    both.faces
        .extend(other.faces.iter().map(|f| f.map(|v| v + base)));
    packed(&both, &[])
}

fn asking(holes: &[HoleSelector]) -> Constraints {
    Constraints {
        holes: holes.to_vec(),
        ..Constraints::default()
    }
}

#[test]
fn all_holes_are_filled_by_default_and_one_by_id_or_place() {
    let bytes = pair();
    let all = mended(&bytes, &Constraints::default()).unwrap().report;
    assert_eq!(all.holes.len(), 2);
    let second = all.holes[1].id;
    for selector in [
        HoleSelector::Id(second),
        HoleSelector::Near([5.0, 0.0, 0.0]),
    ] {
        let one = mended(&bytes, &asking(&[selector])).unwrap();
        assert_eq!(
            one.report.holes.iter().map(|h| h.id).collect::<Vec<_>>(),
            [second]
        );
        assert!(one.report.skipped.iter().any(|s| s.code == "not_selected"));
        assert_eq!(Seen::of(&one.bytes).loops.len(), 3);
    }
}

#[test]
fn a_hole_that_is_not_there_is_named() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let error = mended(&bytes, &asking(&[HoleSelector::Id(7)])).unwrap_err();
    assert_eq!(error.code(), "constraints_do_not_fit");
    assert_eq!(error.fields()[0].pointer, "/holes/0");
    assert!(
        error.fields()[0].detail.contains("there is no loop 7"),
        "{error}"
    );
}

#[test]
fn the_outer_boundary_is_never_filled() {
    let report = mended(
        &packed(&holed(sheet(0), &ROUND).mesh, &[]),
        &Constraints::default(),
    )
    .unwrap()
    .report;
    let outer = report
        .skipped
        .iter()
        .find(|s| s.code == "outer_boundary")
        .unwrap();
    let error = mended(
        &packed(&holed(sheet(0), &ROUND).mesh, &[]),
        &asking(&[HoleSelector::Id(outer.id)]),
    )
    .unwrap_err();
    assert!(
        error.fields()[0].detail.contains("outer boundary"),
        "{error}"
    );
}

#[test]
fn a_scan_without_holes_is_refused_and_its_loops_are_named() {
    let none = Hole::Circle {
        centre: darn::mesh::Vec2::new(0.5, 0.5),
        radius: 0.0,
    };
    let bytes = packed(&holed(sheet(0), &none).mesh, &[]);
    let error = mended(&bytes, &Constraints::default()).unwrap_err();
    assert_eq!(error.code(), "no_holes");
    assert!(
        error
            .to_string()
            .contains("loop 0 is left (the cloth's own edge"),
        "{error}"
    );
}

#[test]
fn a_mesh_that_two_nodes_draw_is_mended_once() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let text = String::from_utf8_lossy(&bytes[20..]).into_owned();
    let json_length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let json = text[..json_length]
        .replace(
            r#""scenes":[{"nodes":[0]}]"#,
            r#""scenes":[{"nodes":[0,1]}]"#,
        )
        .replace(
            r#""nodes":[{"mesh":0,"#,
            r#""nodes":[{"mesh":0,"translation":[7,0,0]},{"mesh":0,"#,
        );
    let json = format!("{json:width$}", width = json.len().next_multiple_of(4));
    let rest = &bytes[20 + json_length..];
    let mut doubled = b"glTF\x02\0\0\0".to_vec();
    doubled.extend((20 + json.len() as u32 + rest.len() as u32).to_le_bytes());
    doubled.extend((json.len() as u32).to_le_bytes());
    doubled.extend(b"JSON");
    doubled.extend(json.as_bytes());
    doubled.extend(rest);
    let mended = mended(&doubled, &Constraints::default()).unwrap();
    assert_eq!(mended.report.holes.len(), 1);
    assert!(mended.report.skipped.iter().any(|s| s.code == "same_mesh"));
    let after = Seen::of(&mended.bytes);
    assert_eq!(after.loops.len(), 2, "both nodes show the one patch");
    assert!(after.topology.non_manifold.is_empty());
}

#[test]
fn an_anchor_draws_the_cloth_towards_it_and_its_distance_is_told() {
    let bytes = packed(&holed(&laid(|u, v| [u, 0.0, -v]), &ROUND).mesh, &[]);
    let anchor = |position| Constraints {
        anchors: vec![Anchor {
            hole: None,
            uv: Some([0.5, 0.5]),
            position,
            hard: false,
        }],
        ..Constraints::default()
    };
    let height = |c: &Constraints| {
        let mended = mended(&bytes, c).unwrap();
        let highest = Seen::of(&mended.bytes)
            .invented()
            .iter()
            .map(|p| p.y)
            .fold(f64::MIN, f64::max);
        (
            highest,
            mended
                .report
                .holes
                .first()
                .and_then(|h| h.anchors.first().map(|a| a.distance)),
        )
    };
    let middle = [0.5, 0.03, -0.48];
    let (lifted, kept) = height(&anchor(middle));
    let (flat, none) = height(&Constraints::default());
    assert!(lifted > flat + 0.002, "{lifted} {flat}");
    assert_eq!(none, None);
    assert!(kept.unwrap() < 0.1, "{kept:?}");
}

#[test]
fn an_anchor_beside_the_hole_is_refused() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let constraints = Constraints {
        anchors: vec![Anchor {
            hole: None,
            uv: Some([0.01, 0.01]),
            position: [0.0, 0.0, 0.0],
            hard: false,
        }],
        ..Constraints::default()
    };
    let error = mended(&bytes, &constraints).unwrap_err();
    assert!(
        matches!(&error, MendError::Constraints(f) if f[0].pointer == "/anchors/0/uv"),
        "{error}"
    );
}

#[test]
fn a_tube_keeps_its_ends_and_loses_its_hole() {
    // A closed tube with a square hole: neither end is touched.
    let (around, along) = (48u32, 40u32);
    let at = |i: u32, j: u32| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
        Vec3::new(angle.cos(), 0.12 * f64::from(j), angle.sin())
    };
    let positions = (0..=along)
        .flat_map(|j| (0..around).map(move |i| at(i, j)))
        .collect();
    let mut faces = Vec::new();
    for j in 0..along {
        for i in (0..around).filter(|i| !((5..12).contains(i) && (15..22).contains(&j))) {
            let (a, b) = (j * around + i, j * around + (i + 1) % around);
            faces.extend([[a, a + around, b], [b, a + around, b + around]]);
        }
    }
    let mended = mended(
        &packed(&TriMesh { positions, faces }, &[]),
        &Constraints::default(),
    )
    .unwrap();
    assert_eq!(mended.report.holes.len(), 1);
    let after = Seen::of(&mended.bytes);
    assert_eq!(after.loops.len(), 2);
    for p in after.invented() {
        assert!((p.x.hypot(p.z) - 1.0).abs() < 0.05, "{p:?}");
    }
}

#[test]
fn patches_of_two_layers_are_kept_off_each_other() {
    let lower = holed(&laid(|u, v| [u, v, 0.0]), &ROUND).mesh;
    let mut both = lower.clone();
    let base = both.positions.len() as u32;
    let above = lower.positions.iter().map(|p| p + Vec3::z() * 0.01);
    both.positions.extend(above);
    both.faces
        .extend(lower.faces.iter().map(|f| f.map(|v| v + base)));
    let bytes = packed(&both, &[]);
    let holes = mended(&bytes, &Constraints::default())
        .unwrap()
        .report
        .holes;
    // The lower layer's new cloth is drawn through the upper layer's.
    let through = Constraints {
        edits: vec![Edit {
            hole: Some(holes[0].id),
            gesture: Gesture::Grab {
                uv: [0.5, 0.5],
                offset: [0.0, 0.0, 0.03],
            },
        }],
        ..Constraints::default()
    };
    let mended = mended(&bytes, &through).unwrap();
    let seen = Seen::of(&mended.bytes);
    let highest = seen.invented().iter().map(|p| p.z).fold(0.0, f64::max);
    assert!(highest > 0.015, "the grab moved the cloth: {highest}");
    let patch: Vec<u32> = seen.patch.iter().map(|f| *f as u32).collect();
    let cuts = intersections_with(&seen.welded.mesh, &patch).len();
    let told: u32 = (mended.report.holes.iter().flat_map(|h| &h.patch))
        .map(|p| p.self_intersections)
        .sum();
    assert_eq!((cuts, told), (0, 0));
}
