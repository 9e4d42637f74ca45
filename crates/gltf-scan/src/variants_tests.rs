//! Laws of the variants that show which cloth is reconstructed.

use darn_geometry::mesh::Vec3;
use serde_json::{Value, json};

use super::testing::Builder;
use super::variants::{BLENDED, EXTENSION, MARKED};
use super::{PatchPoint, PatchPrimitive, Scan, ScanLimits};

fn read(bytes: &[u8]) -> Scan {
    Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap()
}

fn json_of(bytes: &[u8]) -> Value {
    let layout = super::container::layout(bytes).unwrap();
    serde_json::from_slice(&bytes[layout.json]).unwrap()
}

fn patch(scan: &Scan, part: usize) -> PatchPrimitive {
    let look = &scan.parts[part];
    let first = look.vertices.start;
    PatchPrimitive {
        name: "patch".into(),
        deviations: Vec::new(),
        part,
        material_of: part,
        points: vec![
            PatchPoint::Scan(first),
            PatchPoint::Scan(first + 1),
            PatchPoint::New(Vec3::new(0.5, 0.5, 1.0)),
        ],
        normals: vec![Vec3::z(); 3],
        tangents: Vec::new(),
        texcoords: vec![vec![[0.25; 2]; 3]; look.texcoords.len()],
        colors: vec![vec![[0.5; 4]; 3]; look.colors.len()],
        faces: vec![[0, 1, 2]],
        both_sides: false,
        appearance: Default::default(),
        hole: Default::default(),
        method: Default::default(),
    }
}

/// The JSON of a scan with a patch on its first part.
fn mended(scan: Builder) -> Value {
    let scan = read(&scan.glb());
    let out = scan.write(&[patch(&scan, 0)]).unwrap();
    gltf::Gltf::from_slice(&out).expect("a valid glTF");
    json_of(&out)
}

/// The material that a primitive of the first mesh has in a variant.
fn material<'j>(json: &'j Value, primitive: usize, variant: &str) -> &'j Value {
    let names = json["extensions"][EXTENSION]["variants"]
        .as_array()
        .unwrap();
    let index = names.iter().position(|it| it["name"] == variant).unwrap();
    let primitive = &json["meshes"][0]["primitives"][primitive];
    let mappings = primitive["extensions"][EXTENSION]["mappings"]
        .as_array()
        .unwrap();
    let mut of = mappings.iter().filter(|mapping| {
        let variants = mapping["variants"].as_array().unwrap();
        variants.contains(&json!(index))
    });
    let found = of.next().expect("a mapping")["material"].as_u64().unwrap();
    assert!(of.next().is_none(), "a variant maps one material");
    &json["materials"][found as usize]
}

#[test]
fn a_patch_blends_in_or_is_marked_and_the_scan_is_left_alone() {
    assert!(!BLENDED.contains(MARKED) && !MARKED.contains(BLENDED));
    let json = mended(Builder::square());
    assert_eq!(
        json["extensionsUsed"],
        json!(["KHR_xmp_json_ld", EXTENSION])
    );
    assert!(json.get("extensionsRequired").is_none());
    let primitives = &json["meshes"][0]["primitives"];
    assert!(primitives[0].get("extensions").is_none());
    assert_eq!(primitives[0]["material"], 0);
    let own = primitives[1]["material"].as_u64().unwrap() as usize;
    let blended = material(&json, 1, BLENDED);
    assert_eq!(blended, &json["materials"][own]);
    assert_eq!(blended["name"], "cloth (darn reconstruction)");
    assert!(blended.get("emissiveTexture").is_none());

    let marked = material(&json, 1, MARKED);
    assert_eq!(marked["name"], "cloth (darn reconstruction, marked)");
    let darn = json!({"reconstructed": true, "marked": true});
    assert_eq!(marked["extras"], json!({"weave": "twill", "darn": darn}));
    assert_eq!(marked["doubleSided"], true, "all else is the cloth's");
    let set = marked["emissiveTexture"]["texCoord"].as_u64().unwrap();
    let attributes = &primitives[1]["attributes"];
    assert!(attributes.get(format!("TEXCOORD_{set}")).is_some());
    let image = &json["images"][0];
    assert_eq!(image["mimeType"], "image/png");
    let view = &json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
    assert!(view.get("target").is_none());
}

#[test]
fn a_patch_changes_with_the_variants_of_the_cloth() {
    let mut scan = Builder::square();
    scan.push(
        "materials",
        json!({"name": "blue", "extensions": {"KHR_materials_unlit": {}}}),
    );
    scan.json["extensionsUsed"] = json!(["KHR_materials_unlit", EXTENSION]);
    scan.json["extensions"] = json!({EXTENSION: {"variants": [
        {"name": "red"}, {"name": "blue"}, {"name": "lining"},
    ]}});
    scan.json["meshes"][0]["primitives"][0]["extensions"] = json!({EXTENSION: {"mappings": [
        {"material": 0, "variants": [0]},
        {"material": 1, "variants": [1, 77]},
    ]}});
    let json = mended(scan);
    let names = json["extensions"][EXTENSION]["variants"]
        .as_array()
        .unwrap();
    assert_eq!(names.len(), 5);
    for (variant, name) in [
        ("red", "cloth (darn reconstruction)"),
        ("blue", "blue (darn reconstruction)"),
        // It maps nothing on the cloth, which then has its own material.
        ("lining", "cloth (darn reconstruction)"),
        (BLENDED, "cloth (darn reconstruction)"),
        (MARKED, "cloth (darn reconstruction, marked)"),
    ] {
        assert_eq!(material(&json, 1, variant)["name"], name, "{variant}");
    }
    // Where the cloth maps variants, darn's are those without one.
    for (variant, name) in [("blue", "blue"), (BLENDED, "cloth"), (MARKED, "cloth")] {
        assert_eq!(material(&json, 0, variant)["name"], name, "{variant}");
    }
    let blue = material(&json, 1, "blue");
    assert!(blue["extensions"].get("KHR_materials_unlit").is_some());
    assert_eq!(blue["extras"]["darn"]["reconstructed"], true);
    assert_eq!(json["extensionsUsed"].as_array().unwrap().len(), 3);
}

#[test]
fn patches_of_cloth_with_other_variants_are_other_primitives() {
    let mut scan = Builder::square();
    scan.push("materials", json!({"name": "blue"}));
    scan.json["extensions"] = json!({EXTENSION: {"variants": [{"name": "blue"}]}});
    let mut other = scan.json["meshes"][0]["primitives"][0].clone();
    other["extensions"] = json!({EXTENSION: {"mappings": [{"material": 1, "variants": [0]}]}});
    scan.primitive(other);
    let scan = read(&scan.glb());
    let patches = [patch(&scan, 0), patch(&scan, 1), patch(&scan, 0)];
    let json = json_of(&scan.write(&patches).unwrap());
    assert_eq!(json["meshes"][0]["primitives"].as_array().unwrap().len(), 4);
    assert_eq!(
        material(&json, 2, "blue")["name"],
        "cloth (darn reconstruction)"
    );
    assert_eq!(
        material(&json, 3, "blue")["name"],
        "blue (darn reconstruction)"
    );
}

#[test]
fn a_marked_patch_is_seen_in_any_light_and_on_any_cloth() {
    let unlit = json!({"extensions": {"KHR_materials_unlit": {}}});
    let dark = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.1, 0.1, 0.5]}, "alphaMode": "BLEND"});
    for source in [unlit, dark, json!({})] {
        let mut scan = Builder::square();
        scan.json["materials"] = json!([source]);
        let json = mended(scan);
        let marked = material(&json, 1, MARKED);
        let unlit = marked.pointer("/extensions/KHR_materials_unlit");
        assert!(unlit.is_none(), "an unlit material does not glow");
        assert_eq!(marked["emissiveFactor"], json!([1.0, 1.0, 1.0]));
        let factor = marked["pbrMetallicRoughness"]["baseColorFactor"]
            .as_array()
            .unwrap();
        let factor: Vec<f64> = factor.iter().map(|x| x.as_f64().unwrap()).collect();
        assert!(factor[0] < factor[2] && factor[2] <= 0.5, "{factor:?}");
        let opacity = source.pointer("/pbrMetallicRoughness/baseColorFactor/3");
        assert_eq!(factor[3], opacity.and_then(Value::as_f64).unwrap_or(1.0));
    }
}

#[test]
fn the_hatch_has_texture_coordinates_of_its_own_where_there_is_room() {
    for sets in 0..6_usize {
        let mut scan = Builder::square();
        for n in 0..sets {
            let set = scan.floats(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0_f32]]);
            scan.json["meshes"][0]["primitives"][0]["attributes"][format!("TEXCOORD_{n}")] =
                json!(set);
        }
        let json = mended(scan);
        let patch = &json["meshes"][0]["primitives"][1];
        let count = (0..8).filter(|n| patch["attributes"].get(format!("TEXCOORD_{n}")).is_some());
        let marked = material(&json, 1, MARKED);
        if sets < 4 {
            assert_eq!(count.count(), sets + 1);
            assert_eq!(marked["emissiveTexture"]["texCoord"], sets);
            assert_eq!(patch["extras"]["darn"]["hatch"], sets);
        } else {
            assert_eq!(count.count(), sets);
            assert!(marked.get("emissiveTexture").is_none());
            assert!(marked["emissiveFactor"][0].as_f64().unwrap() > 0.1);
        }
    }
}

#[test]
fn later_mends_add_no_variant_and_no_set() {
    let scan = read(&Builder::square().glb());
    let once = read(&scan.write(&[patch(&scan, 0)]).unwrap());
    // On the cloth, and on the patch.
    for part in [0, 1] {
        let mut again = patch(&once, part);
        again.part = part;
        let out = once.write(&[again]).unwrap();
        let json = json_of(&out);
        let variants = json["extensions"][EXTENSION]["variants"]
            .as_array()
            .unwrap();
        assert_eq!(variants.len(), 2);
        assert_eq!(json["extensionsUsed"].as_array().unwrap().len(), 2);
        assert_eq!(
            material(&json, 2, MARKED)["name"],
            "cloth (darn reconstruction, marked)"
        );
        assert_eq!(read(&out).parts[2].texcoords.len(), 1);
    }
    let mut beside = patch(&once, 1);
    beside.part = 1;
    let json = json_of(&once.write(&[beside]).unwrap());
    assert_eq!(
        json["materials"].as_array().unwrap().len(),
        3,
        "those of the patch"
    );
}

#[test]
fn a_scan_whose_extensions_cannot_be_added_to_is_mended_without_variants() {
    for (key, value) in [
        ("extensions", json!(7)),
        ("extensions", json!({EXTENSION: []})),
        ("extensions", json!({EXTENSION: {"variants": {}}})),
        ("extensionsUsed", json!("none")),
    ] {
        let mut scan = Builder::square();
        scan.json[key] = value.clone();
        let scan = read(&scan.glb());
        let json = json_of(&scan.write(&[patch(&scan, 0)]).unwrap());
        match value.get(EXTENSION) {
            Some(own) => assert_eq!(&json[key][EXTENSION], own),
            None => assert_eq!(json[key], value),
        }
        let primitive = &json["meshes"][0]["primitives"][1];
        assert!(primitive.get("extensions").is_none());
        assert_eq!(json["materials"][1]["name"], "cloth (darn reconstruction)");
    }
}
