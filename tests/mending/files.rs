//! What files hold beside the cloth of a scene, and cloth that they store in odd ways.

use darn_budget::Budget;
use darn_contract::{Constraints, HoleSelector};
use darn_geometry::mesh::shapes::{holed_sheet, sheet};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::{ScanLimits, stripped};
use darn_texture::testset::{Fabric, Layout, TestScan};
use serde_json::{Value, json};

use super::cloth::{MendedScan, mended, packed};
use super::patched::{Patched, chunks, edited, fabric, push};

/// What a mend reports of a kind that it set aside.
fn aside(report: &darn_contract::v1::Report, kind: &str) -> u32 {
    let of_kind = report.set_aside.iter().filter(|it| it.kind == kind);
    of_kind.map(|it| it.count).sum()
}

#[test]
fn what_a_file_holds_beside_its_scene_is_noted_and_stays() {
    const SIGNATURE: &[u8] = b"signed by a scanner";
    let mut bytes = edited(&packed(&holed_sheet(24, 0.15), &[]), |json| {
        let other = json["meshes"][0].clone();
        push(&mut json["meshes"], other);
        json["extensionsUsed"] = json!(["MSFT_lod"]);
        json["nodes"] = json!([
            {"mesh": 0, "name": "near", "extensions": {"MSFT_lod": {"ids": [1]}}},
            {"mesh": 1},
            {"mesh": 1},
        ]);
        json["scenes"] = json!([{"nodes": [0]}, {"name": "in the store", "nodes": [2]}]);
    });
    bytes.extend(SIGNATURE);
    let mended = mended(&bytes, &Constraints::default()).expect("one hole");
    let notes = mended.report.notes.join("\n");
    for said in [
        "other scenes with meshes of their own (scene 1 \"in the store\")",
        "other levels of detail (MSFT_lod of node 0 \"near\")",
        "19 byte(s) follow the end",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
    assert_eq!(mended.report.holes.len(), 1);
    assert!(mended.bytes.ends_with(SIGNATURE));
    let undone = stripped(mended.bytes, &ScanLimits::default(), Budget::unlimited());
    assert_eq!(undone.expect("readable").expect("a mend").bytes, bytes);
}

#[test]
fn vertices_that_are_not_finite_and_not_used_are_counted() {
    let mut mesh = holed_sheet(24, 0.15);
    for lost in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        mesh.positions.push(Vec3::new(0.3, lost, 0.0));
    }
    let mended = mended(&packed(&mesh, &[]), &Constraints::default()).expect("one hole");
    assert_eq!(mended.report.holes.len(), 1);
    assert_eq!(aside(&mended.report, "vertex_not_finite"), 3);
}

/// Two GLBs of [`packed`] as one; the second has a node of its own, at an origin.
fn joined(first: &[u8], second: &[u8], origin: Vec3) -> Vec<u8> {
    let (other, other_bin) = chunks(second);
    let mut bin = chunks(first).1.to_vec();
    let moved = bin.len();
    let mut joined = edited(first, |json| {
        let base = |json: &Value, list: &str| json[list].as_array().map_or(0, Vec::len);
        let (views, accessors) = (base(json, "bufferViews"), base(json, "accessors"));
        let shifted = |value: &Value, by: usize| json!(value.as_u64().unwrap_or(0) as usize + by);
        for view in other["bufferViews"].as_array().expect("views") {
            let mut view = view.clone();
            view["byteOffset"] = shifted(&view["byteOffset"], moved);
            push(&mut json["bufferViews"], view);
        }
        for accessor in other["accessors"].as_array().expect("accessors") {
            let mut accessor = accessor.clone();
            accessor["bufferView"] = shifted(&accessor["bufferView"], views);
            push(&mut json["accessors"], accessor);
        }
        let mut mesh = other["meshes"][0].clone();
        let primitive = &mut mesh["primitives"][0];
        primitive["indices"] = shifted(&primitive["indices"], accessors);
        let attributes = primitive["attributes"].as_object_mut().expect("attributes");
        attributes
            .values_mut()
            .for_each(|index| *index = shifted(index, accessors));
        push(&mut json["meshes"], mesh);
        let node = json!({"mesh": 1, "translation": [origin.x, origin.y, origin.z]});
        push(&mut json["nodes"], node);
        let index = json["nodes"].as_array().map_or(0, Vec::len) - 1;
        push(&mut json["scenes"][0]["nodes"], json!(index));
        json["buffers"][0]["byteLength"] = json!(moved + other_bin.len());
    });
    // The chunk of the buffer, longer.
    let text = u32::from_le_bytes(joined[12..16].try_into().expect("four bytes")) as usize;
    joined.truncate(20 + text);
    bin.extend(other_bin);
    joined.extend((bin.len() as u32).to_le_bytes());
    joined.extend(b"BIN\0");
    joined.extend(bin);
    let length = joined.len() as u32;
    joined[8..12].copy_from_slice(&length.to_le_bytes());
    joined
}

#[test]
fn nothing_is_laid_over_a_print_that_is_set_into_the_cloth_with_its_own_origin() {
    let place = |u: f64, v: f64| Vec3::new(u + 3.1, v - 1.7, 0.04 * (5.0 * u).sin());
    let in_print = |u: f64, v: f64| (u - 0.7).abs() < 0.1 && (v - 0.7).abs() < 0.1;
    let in_hole = |u: f64, v: f64| (u - 0.35).hypot(v - 0.35) < 0.12;
    let cloth = sheet(30, |u, v| !in_print(u, v) && !in_hole(u, v), place);
    let origin = place(0.7, 0.7);
    let print = sheet(30, in_print, |u, v| place(u, v) - origin);
    let bytes = joined(&packed(&cloth, &[]), &packed(&print, &[]), origin);
    let mended = mended(&bytes, &Constraints::default()).expect("one hole");
    assert_eq!(mended.report.holes.len(), 1, "{:?}", mended.report.skipped);
    let codes: Vec<&str> = (mended.report.skipped.iter().map(|s| s.code.as_str())).collect();
    assert_eq!(codes, ["outer_boundary"]);
    let hole = place(0.35, 0.35);
    for new in MendedScan::of(&mended.bytes).new_positions() {
        assert!((new - hole).norm() < 0.2, "{new:?}");
    }
}

/// A sheet with four round holes, the last with a rim that no cloth has: its vertices lie high and low in turn.
fn one_bad_hole_of_four() -> TriMesh {
    let holes = [[0.22, 0.22], [0.78, 0.22], [0.22, 0.78], [0.76, 0.76]];
    let away = |u: f64, v: f64, [x, y]: [f64; 2]| (u - x).hypot(v - y);
    let keep = |u: f64, v: f64| holes.iter().all(|hole| away(u, v, *hole) > 0.1);
    let place = |u: f64, v: f64| {
        let near = away(u, v, holes[3]) < 0.14;
        let turn = ((97.0 * u + 61.0 * v) * 41.0).sin().signum();
        Vec3::new(u, v, if near { 0.11 * turn } else { 0.0 })
    };
    sheet(48, keep, place)
}

#[test]
fn a_hole_that_no_plausible_cloth_fills_leaves_the_others_to_be_filled() {
    let bytes = packed(&one_bad_hole_of_four(), &[]);
    let report = mended(&bytes, &Constraints::default())
        .expect("three holes")
        .report;
    assert_eq!(report.holes.len(), 3, "{:?}", report.skipped);
    let left = report
        .skipped
        .iter()
        .filter(|it| it.code != "outer_boundary");
    let [bad] = left.collect::<Vec<_>>()[..] else {
        panic!("{:?}", report.skipped);
    };
    assert_eq!(bad.code, "no_plausible_fill");
    assert!(bad.reason.contains("no plausible cloth"), "{}", bad.reason);
    assert!(bad.patch.is_some(), "its numbers");
    let named = Constraints {
        holes: vec![HoleSelector::Id(bad.id)],
        ..Constraints::default()
    };
    let refused = mended(&bytes, &named).expect_err("a hole that is named is filled or refused");
    assert_eq!(refused.code().word, "no_plausible_fill");
}

#[test]
fn a_mirrored_map_goes_on_mirrored_at_its_axis() {
    for (kind, least) in [(Fabric::Twill, 0.85), (Fabric::Plaid, 0.75)] {
        let sheet = TestScan::new(kind, Layout::Mirrored, 128);
        let own = Patched::of(&mended(&fabric(&sheet), &Constraints::default()).expect("a hole"));
        let share = own.share_right(&sheet);
        assert!(
            share > least,
            "{} {}: {share}",
            kind.name(),
            own.report.method
        );
    }
}
