//! Requests: which holes they select, what is refused, and what the report says.

use std::sync::atomic::{AtomicUsize, Ordering};

use darn_budget::{Budget, Exhausted, Limits};
use darn_contract::{Anchor, Constraints, Edit, Gesture, HoleSelector};
use darn_geometry::mesh::intersect::intersections_with;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_lab::scarffolds::holed_scan::HoleShape;
use darn_mend::{Call, MendError, MendLimits, NetworkMender, mend};
use darn_net::Networks;

use super::cloth::{
    MendedScan, ROUND, WEIGHTS, holed, laid, mended, mender, network, packed, read, sheet,
};

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
        assert_eq!(MendedScan::of(&one.bytes).loops.len(), 3);
    }
}

#[test]
fn a_selector_of_a_missing_loop_is_refused_by_its_pointer() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let error = mended(&bytes, &asking(&[HoleSelector::Id(7)])).unwrap_err();
    assert_eq!(error.code().word, "constraints_do_not_fit");
    assert_eq!(error.fields()[0].pointer, "/holes/0");
    assert!(
        error.fields()[0].detail.contains("there is no loop 7"),
        "{error}"
    );
}

#[test]
fn the_outer_boundary_is_filled_only_when_it_is_named() {
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
    // It is tried when it is named, and a failure is about it.
    let named = asking(&[HoleSelector::Id(outer.id)]);
    match mended(&packed(&holed(sheet(0), &ROUND).mesh, &[]), &named) {
        Ok(mended) => assert_eq!(mended.report.holes[0].id, outer.id),
        Err(error) => assert_eq!(error.hole(), Some(outer.id)),
    }
}

#[test]
fn a_scan_without_holes_is_refused_and_its_loops_are_named() {
    let none = HoleShape::Circle {
        centre: darn_geometry::mesh::Vec2::new(0.5, 0.5),
        radius: 0.0,
    };
    let bytes = packed(&holed(sheet(0), &none).mesh, &[]);
    let error = mended(&bytes, &Constraints::default()).unwrap_err();
    assert_eq!(error.code().word, "no_holes");
    assert!(
        error
            .to_string()
            .contains("loop 0 is left (the cloth's own edge"),
        "{error}"
    );
}

/// The scan with a second node that draws the same mesh; it is a copy of the first with these members.
fn drawn_twice(glb: &[u8], members: &[(&str, serde_json::Value)]) -> Vec<u8> {
    let (mut json, bin) = unpacked(glb);
    let mut second = json["nodes"][0].clone();
    for (key, value) in members {
        second[*key] = value.clone();
    }
    json["nodes"] = [second, json["nodes"][0].clone()].into();
    json["scenes"][0]["nodes"] = [0, 1].into();
    repacked(&json, &bin)
}

#[test]
fn a_hole_between_two_nodes_of_one_mesh_is_left() {
    // Half a sheet, half of a hole on its edge; the other half is its mirror image.
    let half = laid(|u, v| [u, v, 0.02 * (9.0 * v).sin()]);
    let cut = HoleShape::Circle {
        centre: Vec2::new(0.0, 0.5),
        radius: 0.15,
    };
    let mirrored = [("scale", serde_json::json!([-1, 1, 1]))];
    let whole = drawn_twice(&packed(&holed(&half, &cut).mesh, &[]), &mirrored);
    let error = mended(&whole, &Constraints::default()).unwrap_err();
    let MendError::NoHoles { skipped } = &error else {
        panic!("{error}");
    };
    let codes: Vec<&str> = skipped.iter().map(|s| s.code.as_str()).collect();
    assert_eq!(
        codes.iter().filter(|c| **c == "same_mesh").count(),
        1,
        "{codes:?}"
    );
}

#[test]
fn a_mesh_that_two_nodes_draw_is_mended_once() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let doubled = drawn_twice(&bytes, &[("translation", serde_json::json!([7, 0, 0]))]);
    let mended = mended(&doubled, &Constraints::default()).unwrap();
    assert_eq!(mended.report.holes.len(), 1);
    let again = mended.report.skipped.iter().find(|s| s.code == "same_mesh");
    let again = again.expect("the other node's");
    let after = MendedScan::of(&mended.bytes);
    assert_eq!(after.loops.len(), 2, "both nodes show the one patch");
    assert!(after.topology.non_manifold.is_empty());

    let loops = MendedScan::of(&doubled).loops;
    let places = [mended.report.holes[0].id, again.id]
        .map(|id| HoleSelector::Near(loops[id as usize].centroid.into()));
    let error = super::cloth::mended(&doubled, &asking(&places)).unwrap_err();
    let pointers: Vec<String> = error.fields().into_iter().map(|f| f.pointer).collect();
    assert_eq!(pointers, ["/holes/1"]);
}

#[test]
fn a_loose_piece_in_the_hole_is_noted() {
    let mut mesh = holed(sheet(0), &ROUND).mesh;
    let alone = mended(&packed(&mesh, &[]), &Constraints::default()).unwrap();
    let noted = |notes: &[String]| notes.iter().any(|n| n.contains("loose piece"));
    assert!(!noted(&alone.report.holes[0].notes));

    // A small piece of the new cloth, as a loose piece of the scan.
    let new = MendedScan::of(&alone.bytes);
    let at = |f: &usize| {
        let corners = new.welded.mesh.faces[*f].map(|v| new.welded.mesh.positions[v as usize]);
        corners.iter().sum::<Vec3>() / 3.0
    };
    let middle = new.patch.iter().map(at).sum::<Vec3>() / new.patch.len() as f64;
    let shred = new.patch.iter().filter(|f| (at(f) - middle).norm() < 0.05);
    let base = mesh.positions.len() as u32;
    mesh.positions.extend(&new.welded.mesh.positions);
    mesh.faces
        .extend(shred.map(|f| new.welded.mesh.faces[*f].map(|v| v + base)));
    let report = mended(&packed(&mesh, &[]), &Constraints::default())
        .unwrap()
        .report;
    assert_eq!(report.holes.len(), 1);
    assert!(noted(&report.holes[0].notes), "{:?}", report.holes[0].notes);
}

#[test]
fn cloth_with_triangles_on_both_sides_gets_a_patch_with_both() {
    let single = holed(sheet(0), &ROUND).mesh;
    let mut double = single.clone();
    let base = single.positions.len() as u32;
    double.positions.extend(&single.positions);
    double.faces.extend(
        single
            .faces
            .iter()
            .map(|[a, b, c]| [c + base, b + base, a + base]),
    );
    let [one, both] = [&single, &double].map(|mesh| {
        let mended = mended(&packed(mesh, &[]), &Constraints::default()).unwrap();
        let scan = read(&mended.bytes);
        let new = scan.parts.iter().filter(|part| part.reconstructed);
        let faces: Vec<[[u64; 3]; 3]> = new
            .flat_map(|part| {
                &scan.surface.faces[part.faces.start as usize..part.faces.end as usize]
            })
            .map(|f| {
                f.map(|v| <[f64; 3]>::from(scan.surface.positions[v as usize]).map(f64::to_bits))
            })
            .collect();
        faces
    });
    let (front, back) = both.split_at(both.len() / 2);
    assert_eq!(front, one);
    let turned: Vec<_> = front.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert_eq!(back, turned);
}

#[test]
fn more_holes_than_are_filled_at_once_are_refused() {
    let mender = NetworkMender {
        limits: MendLimits {
            holes: 1,
            ..MendLimits::default()
        },
        ..NetworkMender::new(Networks::new(network(WEIGHTS), Vec::new()))
    };
    let scan = read(&pair());
    let error = mend(&scan, &Constraints::default(), &mender).unwrap_err();
    assert_eq!(error.code().word, "too_many_holes");
    assert!(error.to_string().contains("2 holes"), "{error}");
}

#[test]
fn a_call_ends_whenever_it_is_cancelled() {
    let scan = read(&pair());
    let asked = AtomicUsize::new(0);
    // Cancelled when the budget is asked for the nth time.
    let mend_until = |n: usize| {
        asked.store(0, Ordering::Relaxed);
        let cancelled = || asked.fetch_add(1, Ordering::Relaxed) >= n;
        let call = Call {
            mender: mender(),
            budget: &Budget::new(Limits::default(), &cancelled),
        };
        mend(&scan, &Constraints::default(), call).err()
    };
    assert!(mend_until(usize::MAX).is_none());
    let all = asked.load(Ordering::Relaxed);
    assert!(all > 100, "the budget was asked {all} times");
    let moments = (0..10).map(|k| k * k * all / 100);
    for n in moments {
        let error = mend_until(n).expect("cancelled");
        let cancelled = matches!(error, MendError::Exhausted(Exhausted::Cancelled));
        assert!(cancelled, "{n}: {error}");
    }
}

#[test]
fn an_anchor_moves_the_cloth_towards_it_and_its_distance_is_reported() {
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
        let highest = MendedScan::of(&mended.bytes)
            .new_positions()
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
fn the_hole_of_a_tube_is_filled_and_its_ends_stay_open() {
    // A tube with a square hole.
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
    let after = MendedScan::of(&mended.bytes);
    assert_eq!(after.loops.len(), 2);
    for p in after.new_positions() {
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
    // A grab moves the lower layer's patch through the upper layer's.
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
    let seen = MendedScan::of(&mended.bytes);
    let highest = seen.new_positions().iter().map(|p| p.z).fold(0.0, f64::max);
    assert!(highest > 0.015, "the grab moved the cloth: {highest}");
    let patch: Vec<u32> = seen.patch.iter().map(|f| *f as u32).collect();
    let cuts = intersections_with(&seen.welded.mesh, &patch).len();
    let told: u32 = (mended.report.holes.iter().flat_map(|h| &h.patch))
        .map(|p| p.self_intersections)
        .sum();
    assert_eq!((cuts, told), (0, 0));
}

/// The JSON and the BIN chunk of a GLB.
fn unpacked(glb: &[u8]) -> (serde_json::Value, Vec<u8>) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let (text, rest) = glb[20..].split_at(length);
    (serde_json::from_slice(text).unwrap(), rest[8..].to_vec())
}

fn repacked(json: &serde_json::Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + text.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text[..]), (b"BIN\0", bin)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

/// The scan with a skin of two joints, of which the second gains weight along x; the mesh's node lies far away.
fn skinned(glb: &[u8]) -> Vec<u8> {
    use serde_json::json;
    let points = super::cloth::read(glb).surface.positions;
    let (mut json, mut bin) = unpacked(glb);
    let joints = bin.len();
    bin.extend([0_u8, 1, 0, 0].repeat(points.len()));
    let weights = bin.len();
    for point in &points {
        let x = point.x.clamp(0.0, 1.0) as f32;
        bin.extend([1.0 - x, x, 0.0, 0.0].map(f32::to_le_bytes).as_flattened());
    }
    let end = bin.len();
    let mut push = |list: &str, value| {
        let list = json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    };
    let mut attribute = |from: usize, to: usize, component: u32| {
        let view = json!({"buffer": 0, "byteOffset": from, "byteLength": to - from});
        let view = push("bufferViews", view);
        let accessor = json!({"bufferView": view, "componentType": component, "type": "VEC4", "count": points.len()});
        push("accessors", accessor)
    };
    let (joints, weights) = (
        attribute(joints, weights, 5121),
        attribute(weights, end, 5126),
    );
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    json["nodes"] = json!([{"mesh": 0, "skin": 0, "translation": [100, 0, 0]}, {}, {}]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    json["skins"] = json!([{"joints": [1, 2]}]);
    json["buffers"][0]["byteLength"] = json!(end);
    repacked(&json, &bin)
}

#[test]
fn a_patch_of_a_skinned_scan_has_the_weights_of_the_cloth_around_it() {
    let flat = packed(&holed(&laid(|u, v| [u, v, 0.0]), &ROUND).mesh, &[]);
    let mended = mended(&skinned(&flat), &Constraints::default()).unwrap();
    let new = MendedScan::of(&mended.bytes).new_positions();
    assert!(
        new.iter().all(|p| p.x < 1.0),
        "the transform of a skinned mesh's node does not count"
    );
    let (json, bin) = unpacked(&mended.bytes);
    let index = |value: &serde_json::Value| value.as_u64().unwrap() as usize;
    let attributes = &json["meshes"][0]["primitives"][1]["attributes"];
    let span = |name: &str| {
        let accessor = &json["accessors"][index(&attributes[name])];
        let view = &json["bufferViews"][index(&accessor["bufferView"])];
        &bin[index(&view["byteOffset"])..][..index(&view["byteLength"])]
    };
    let floats = |name: &str| -> Vec<f32> {
        let (each, _) = span(name).as_chunks::<4>();
        each.iter()
            .map(|bytes| f32::from_le_bytes(*bytes))
            .collect()
    };
    let (positions, weights) = (floats("POSITION"), floats("WEIGHTS_0"));
    let (positions, weights) = (positions.as_chunks::<3>().0, weights.as_chunks::<4>().0);
    assert_eq!(weights.len(), positions.len());
    assert_eq!(span("JOINTS_0").len(), 8 * positions.len());
    for (at, weights) in positions.iter().zip(weights) {
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        // No point of the hole is farther from its rim than its radius, 0.13.
        assert!((weights[1] - at[0]).abs() < 0.2, "{at:?} {weights:?}");
    }
}
