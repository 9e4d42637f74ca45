//! What a mend put in is taken out again: whole scans of every kind that the repository has, byte for byte.

use std::path::Path;

use darn_budget::Budget;
use darn_contract::port::ScanForm;
use darn_contract::{Constraints, HoleSelector, TextureChoice};
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::shapes::sheet as shape;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::ScanLimits;
use darn_mend::strip;
use serde_json::json;

use super::cloth::{ROUND, holed, mended, packed, sheet};
use super::encoded::{Coding, PlainMesh};
use super::mesh_files::{obj, ply};
use super::patched::{data_uri, edited, png, with_texture};

const CHOICES: [Option<TextureChoice>; 5] = [
    None,
    Some(TextureChoice::Synthesize),
    Some(TextureChoice::Continue),
    Some(TextureChoice::Flat),
    Some(TextureChoice::None),
];

/// Mends a scan once with each of some constraints, and takes all of it out again.
fn check(name: &str, before: &[u8], mends: &[Constraints]) {
    let mut bytes = before.to_vec();
    for constraints in mends {
        let done = mended(&bytes, constraints).expect(name);
        assert!(!done.report.holes.is_empty(), "{name}");
        bytes = done.bytes;
    }
    let limits = ScanLimits::default();
    let stripped = strip(bytes, ScanForm::AsReceived, &limits, Budget::unlimited()).expect(name);
    assert!(stripped.report.exact, "{name}: {:?}", stripped.report.notes);
    assert_eq!(stripped.report.mends as usize, mends.len(), "{name}");
    assert!(stripped.bytes == before, "{name}: the bytes from before");
}

#[test]
fn fixtures_come_back_from_every_choice_of_texture() {
    for path in ["examples/scarf_hole.glb", "tests/textured.glb"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        let before = std::fs::read(file).expect(path);
        for choice in CHOICES {
            let name = format!("{path}, {choice:?}");
            check(&name, &before, &[with_texture(choice)]);
        }
    }
}

#[test]
fn compressed_and_quantized_scans_come_back() {
    let mesh = holed(sheet(0), &ROUND).mesh;
    let scan = PlainMesh {
        positions: mesh.positions.iter().map(|p| p.cast().into()).collect(),
        normals: (vertex_normals(&mesh).iter())
            .map(|n| n.cast().into())
            .collect(),
        texcoords: vec![[0.5; 2]; mesh.positions.len()],
        faces: mesh.faces,
    };
    for coding in Coding::ALL {
        let before = scan.encode(coding);
        check(&format!("{coding:?}"), &before, &[Constraints::default()]);
    }
}

fn four_holes() -> TriMesh {
    let near = |x: f64| (2.0 * x).fract() - 0.5;
    let keep = |u: f64, v: f64| near(u).hypot(near(v)) > 0.2;
    shape(32, keep, |u, v| Vec3::new(u, v, 0.02 * (7.0 * u).sin()))
}

/// One of the four holes, and then the rest.
fn in_turn(first: Option<TextureChoice>, then: Option<TextureChoice>) -> [Constraints; 2] {
    let one = Constraints {
        holes: vec![HoleSelector::Near([0.25, 0.25, 0.0])],
        ..with_texture(first)
    };
    [one, with_texture(then)]
}

/// A sheet with four holes and an image on it.
fn textured() -> Vec<u8> {
    let mesh = four_holes();
    let places = mesh.positions.iter();
    let texcoords: Vec<[f32; 2]> = places.map(|p| [p.x as f32, p.y as f32]).collect();
    let side = 64;
    let texels: Vec<[u8; 4]> = (0..side * side)
        .map(|k| match (k % side / 4 + k / side / 4) % 2 {
            0 => [180, 40, 30, 255],
            _ => [230, 220, 190, 255],
        })
        .collect();
    edited(&packed(&mesh, &texcoords), |json| {
        json["images"] = json!([{ "uri": data_uri(&png(side, &texels)) }]);
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"][0]["pbrMetallicRoughness"] =
            json!({ "baseColorTexture": { "index": 0 } });
    })
}

#[test]
fn textured_scans_come_back_when_one_hole_is_mended_and_then_the_rest() {
    let before = textured();
    for first in CHOICES {
        for then in [Some(TextureChoice::Synthesize), Some(TextureChoice::Flat)] {
            let name = format!("{first:?}, then {then:?}");
            check(&name, &before, &in_turn(first, then));
        }
    }
}

#[test]
fn mesh_files_come_back_when_one_hole_is_mended_and_then_the_rest() {
    let mesh = four_holes();
    for (name, before) in [("OBJ", obj(&mesh)), ("PLY", ply(&mesh))] {
        for choice in CHOICES {
            let name = format!("{name}, {choice:?}");
            check(&name, &before, &in_turn(choice, choice));
        }
    }
}
