//! The textured scans in `tests/`, which `scripts/validate` mends and loads with other programs. `DARN_BLESS=1` writes them anew.

use std::path::Path;

use darn_contract::TextureChoice;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_texture::testset::{Fabric, Layout, TestScan};
use serde_json::{Value, json};

use super::cloth::{mended, packed};
use super::colours::patched;
use super::patched::{
    bent, chunks, data_uri, edited, fabric, png, push, push_variant, with_texture,
};

/// A file with all that a texture can have here: an atlas, a normal map, roughness and occlusion in one image, two variants.
fn with_everything() -> Vec<u8> {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    let map = |texel: &dyn Fn([u8; 4]) -> [u8; 4]| {
        let texels: Vec<[u8; 4]> = sheet.texels.iter().map(|t| texel(*t)).collect();
        json!({ "uri": data_uri(&png(sheet.side, &texels)) })
    };
    edited(&fabric(&sheet), |json| {
        push(
            &mut json["images"],
            map(&|[r, g, _, _]| [96 + r / 4, 96 + g / 4, 230, 255]),
        );
        push(
            &mut json["images"],
            map(&|[r, g, _, _]| [255 - r / 8, 128 + g / 4, 0, 255]),
        );
        push(&mut json["images"], map(&|[r, g, b, a]| [b, r, g, a]));
        for source in 1..4 {
            push(&mut json["textures"], json!({ "source": source }));
        }
        let material = &mut json["materials"][0];
        material["normalTexture"] = json!({ "index": 1, "scale": 0.8 });
        material["occlusionTexture"] = json!({ "index": 2, "strength": 0.7 });
        material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 2 });
        let mut other = material.clone();
        other["name"] = json!("swapped");
        other["pbrMetallicRoughness"]["baseColorTexture"]["index"] = json!(3);
        push_variant(json, other);
    })
}

/// The fixture of a name, which is what this code makes but for how the PNGs in it are packed: that is their library's affair.
fn fixture(name: &str, made: &[u8]) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    if std::env::var_os("DARN_BLESS").is_some() {
        std::fs::write(&path, made).expect("the fixture is written");
    }
    let fixture = std::fs::read(&path).expect("the fixture");
    let without_images = |bytes: &[u8]| {
        let (mut json, bin) = chunks(bytes);
        json["images"] = Value::Null;
        (json, bin.to_vec())
    };
    assert!(without_images(&fixture) == without_images(made), "{name}");
    fixture
}

#[test]
fn all_images_of_the_textured_fixture_go_on() {
    let fixture = fixture("tests/textured.glb", &with_everything());
    let own = patched(&fixture, None);
    assert_eq!(own.report.method, "synthesized", "{}", own.report.reason);
    // Base colours of two looks, normals, and one image for roughness and occlusion.
    assert_eq!(own.report.layers, 4);
    let material = own.material(None);
    let index = |info: &Value| info["index"].as_u64().expect("a texture");
    assert_eq!(
        index(&material["occlusionTexture"]),
        index(&material["pbrMetallicRoughness"]["metallicRoughnessTexture"])
    );
    assert_eq!(material["occlusionTexture"]["strength"], json!(0.7));
    assert_eq!(material["normalTexture"]["scale"], json!(0.8));
}

/// Two sheets in one mesh, each with a hole across the line at which its image is mirrored, with a normal map.
fn mirrored_twice() -> Vec<u8> {
    let sheet = TestScan::new(Fabric::Twill, Layout::Mirrored, 64);
    let apart = Vec3::new(2.0, 0.0, 0.0);
    let once = sheet.mesh.positions.iter().map(|p| bent([p.x, p.y]));
    let once: Vec<Vec3> = once.collect();
    let count = once.len() as u32;
    let again = sheet.mesh.faces.iter().map(|face| face.map(|v| v + count));
    let mesh = TriMesh {
        positions: once
            .iter()
            .copied()
            .chain(once.iter().map(|p| p + apart))
            .collect(),
        faces: sheet.mesh.faces.iter().copied().chain(again).collect(),
    };
    let normals = sheet
        .texels
        .iter()
        .map(|[r, g, _, _]| [96 + r / 4, 96 + g / 4, 230, 255]);
    let normals: Vec<[u8; 4]> = normals.collect();
    let images = [&sheet.texels, &normals].map(|texels| data_uri(&png(sheet.side, texels)));
    edited(&packed(&mesh, &sheet.texcoords.repeat(2)), |json| {
        json["images"] = json!(images.map(|uri| json!({ "uri": uri })));
        json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
        json["materials"][0] = json!({
            "name": "cloth",
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0 },
            "normalTexture": { "index": 1 },
        });
    })
}

#[test]
fn both_holes_of_the_mirrored_fixture_are_filled_with_tangents_where_there_is_a_normal_map() {
    let fixture = fixture("tests/mirrored.glb", &mirrored_twice());
    for (choice, has_tangents) in [
        (TextureChoice::Synthesize, true),
        (TextureChoice::Continue, true),
        (TextureChoice::Flat, false),
        (TextureChoice::None, false),
    ] {
        let done = mended(&fixture, &with_texture(Some(choice))).expect("two holes");
        assert_eq!(done.report.holes.len(), 2);
        let (json, _) = chunks(&done.bytes);
        let primitives = json["meshes"][0]["primitives"]
            .as_array()
            .expect("primitives");
        let [_, patches @ ..] = &primitives[..] else {
            panic!("no primitive")
        };
        assert!(!patches.is_empty());
        for patch in patches {
            let found = patch["attributes"].get("TANGENT").is_some();
            assert_eq!(found, has_tangents, "{choice:?}");
        }
    }
}
