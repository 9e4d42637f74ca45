//! Laws of writing patches. The `gltf` crate reads the results back as an independent check.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::skin::Influence;
use super::testing::{Builder, parsed, read_by_gltf, tent};
use super::{PatchPoint, PatchPrimitive, Scan, ScanError, ScanLimits};
use darn_geometry::mesh::Vec3;

fn read(bytes: &[u8]) -> Scan {
    Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap()
}

/// Asserts that everything in `old` is in `new`, in the same place and spelling. Lists may have grown; the places in
/// `free` may differ.
fn assert_kept(old: &Value, new: &Value, at: &str, free: &[&str]) {
    match (old, new) {
        _ if free.contains(&at) => {}
        (Value::Object(old), Value::Object(new)) => {
            let keys: Vec<_> = new.keys().take(old.len()).collect();
            assert_eq!(keys, old.keys().collect::<Vec<_>>(), "{at}");
            old.iter().for_each(|(key, value)| {
                assert_kept(value, &new[key], &format!("{at}/{key}"), free)
            });
        }
        (Value::Array(old), Value::Array(new)) => {
            assert!(new.len() >= old.len(), "{at}");
            old.iter()
                .zip(new)
                .enumerate()
                .for_each(|(i, (old, new))| assert_kept(old, new, &format!("{at}/{i}"), free));
        }
        _ => assert_eq!(old.to_string(), new.to_string(), "{at}"),
    }
}

#[test]
fn without_patches_the_bytes_come_back() {
    for bytes in [Builder::square().glb(), Builder::square().gltf()] {
        assert_eq!(read(&bytes).write(&[]).unwrap(), bytes);
    }
}

#[test]
fn everything_in_the_scan_stays() {
    let mut scan = Builder::square();
    scan.json["asset"]["extensions"] = json!({"X_museum": {"a": null}});
    scan.json["nodes"][0]["extras"] = Value::Null;
    scan.bin.push(7);
    let mut text = scan.json.to_string();
    text = text.replacen(
        "\"byteLength\":0",
        &format!("\"byteLength\":{}", scan.bin.len()),
        1,
    );
    let odd = "\n \"x\" : [1.0,-0, 1E5,1e+05,0.10,123456.789012345678901,1.50e-3,\"é\\u00e9\"],";
    text.insert_str(1, odd);
    let rest = [4, 0, 0, 0, b'M', b'U', b'S', 0, 1, 2, 3, 4];
    let bytes = super::container::pack_glb(text.as_bytes(), Some(&scan.bin), &rest).unwrap();
    let scan = read(&bytes);
    let out = scan
        .write(&[tent(&scan, 0, Vec3::new(0.5, 0.5, 1.0))])
        .unwrap();
    let ((old, old_bin), (new, new_bin)) = (parsed(&bytes), parsed(&out));
    assert_kept(&old, &new, "", &["/buffers/0/byteLength"]);
    assert!(
        String::from_utf8_lossy(&out).contains(odd),
        "not a character of what was there changes"
    );
    assert_eq!(&new_bin[..old_bin.len()], &old_bin);
    assert!(out.ends_with(&rest));
    assert_eq!(
        u32::from_le_bytes(out[8..12].try_into().unwrap()) as usize,
        out.len()
    );
    let material = &new["materials"][1];
    assert_eq!(material["name"], "cloth (darn reconstruction)");
    assert_eq!(
        material["extras"],
        json!({"weave": "twill", "darn": {"reconstructed": true}})
    );
    assert_eq!(new["meshes"][0]["primitives"][1]["material"], 1);
    assert_eq!(
        new["meshes"][0]["primitives"][1]["extras"]["darn"]["holes"][0]["id"],
        0
    );
}

#[test]
fn a_patch_reads_back_where_it_was_put() {
    let mut scan = Builder::square();
    scan.json["nodes"][0] = json!({"mesh": 0, "scale": [2, 0.5, -1], "translation": [10, 0.1, -3]});
    let normals = scan.floats(&[[0.0, 0.0, 1.0]; 4]);
    let uv = scan.floats(&[[0.0, 0.0]; 4]);
    let color = scan.floats(&[[0.5_f32, 0.5, 0.5]; 4]);
    let attributes = json!({"POSITION": 0, "NORMAL": normals, "TEXCOORD_0": uv, "COLOR_0": color});
    scan.json["meshes"][0]["primitives"][0]["attributes"] = attributes;
    let scan = read(&scan.glb());
    let top = Vec3::new(10.7, 0.3, -2.2);
    let tent = tent(&scan, 0, top);
    let out = scan.write(std::slice::from_ref(&tent)).unwrap();
    let again = read(&out);
    let patch = &again.parts[1];
    let at = |vertex: u32| again.surface.positions[(patch.vertices.start + vertex) as usize];
    for vertex in 0..3 {
        assert_eq!(
            at(vertex),
            scan.surface.positions[vertex as usize],
            "the rim is the scan's own"
        );
    }
    assert!((at(3) - top).norm() < 1e-6);
    let faces = &again.surface.faces[patch.faces.start as usize..];
    for (face, wanted) in faces.iter().zip(&tent.faces) {
        let mut face = face.map(|v| v - patch.vertices.start);
        while face[0] != wanted[0] {
            face.rotate_left(1);
        }
        assert_eq!(
            &face, wanted,
            "counter-clockwise in the scene, even if the node mirrors"
        );
    }
    assert_eq!(&*patch.texcoords[0], &[[0.25, 0.5]; 4]);
    assert_eq!(
        &*patch.colors[0],
        &[[0.1, 0.2, 0.3, 1.0]; 4],
        "VEC3 like its neighbour"
    );
    assert!(patch.normals.is_some());
    let (positions, indices) = read_by_gltf(&out);
    assert_eq!((positions.len(), indices.len()), (4, 9));
    assert_eq!(positions[1], [1.0, 0.0, 0.0]);
}

#[test]
fn new_bytes_go_to_the_bin_chunk_or_to_a_data_uri() {
    // JSON: a data URI of its own.
    let scan = read(&Builder::square().gltf());
    let (json, _) = parsed(&scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap());
    assert_eq!(json["buffers"].as_array().unwrap().len(), 2);
    assert_eq!(json["bufferViews"][2]["buffer"], 1);
    // A GLB whose first buffer has a uri: likewise, and no BIN chunk appears.
    let bytes = super::container::pack_glb(&Builder::square().gltf(), None, &[]).unwrap();
    let scan = read(&bytes);
    let out = scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap();
    assert!(super::container::layout(&out).unwrap().bin.is_none());
    assert_eq!(read(&out).parts.len(), 2);
    // A GLB without any buffer (all zeros): a BIN chunk appears.
    let mut flat = Builder::square();
    flat.json["accessors"] = json!([{"componentType": 5126, "type": "VEC3", "count": 3}]);
    flat.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": 0}}]);
    flat.json.as_object_mut().unwrap().remove("buffers");
    flat.json.as_object_mut().unwrap().remove("bufferViews");
    let bytes = super::container::pack_glb(flat.json.to_string().as_bytes(), None, &[]).unwrap();
    let scan = read(&bytes);
    let out = scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap();
    let (json, bin) = parsed(&out);
    assert_eq!(json["buffers"], json!([{"byteLength": bin.len()}]));
    assert_eq!(read(&out).parts.len(), 2);
}

#[test]
fn a_patch_has_the_mesh_s_morph_targets_and_none_moves_it() {
    let mut scan = Builder::square();
    scan.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}, {"POSITION": 0}]);
    let scan = read(&scan.glb());
    let (json, _) = parsed(&scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap());
    let targets = json["meshes"][0]["primitives"][1]["targets"]
        .as_array()
        .unwrap();
    assert_eq!(targets.len(), 2);
    let still = &json["accessors"][targets[0]["POSITION"].as_u64().unwrap() as usize];
    assert_eq!(
        (still["count"].as_u64(), &still["max"]),
        (Some(4), &json!([0.0, 0.0, 0.0]))
    );
}

/// The sets of joints and weights of the last part.
fn sets(bytes: &[u8]) -> Vec<Vec<Influence>> {
    let scan = read(bytes);
    let sets = scan.parts.last().unwrap().skinning.as_ref().unwrap();
    sets.iter().map(|set| set.to_vec()).collect()
}

#[test]
fn a_patch_on_a_skinned_mesh_has_the_joints_of_its_rim() {
    let bytes = Builder::skinned().glb();
    let scan = read(&bytes);
    // Nearest to the corner (1, 0, 0), where the skin's positions are.
    let top = Vec3::new(0.9, 0.2, 0.125);
    let out = scan.write(&[tent(&scan, 0, top)]).unwrap();
    let sets = sets(&out);
    let [set] = &sets[..] else {
        panic!("one set, as the rim has")
    };
    let own = &scan.parts[0].skinning.as_ref().unwrap()[0];
    assert_eq!(set[..], [own[0], own[1], own[2], own[1]]);

    let document = gltf::Gltf::from_slice(&out).unwrap().document;
    let mesh = document.meshes().next().unwrap();
    let primitive = mesh.primitives().last().unwrap();
    for (semantic, component) in [
        (gltf::Semantic::Joints(0), gltf::accessor::DataType::U16),
        (gltf::Semantic::Weights(0), gltf::accessor::DataType::F32),
    ] {
        let accessor = primitive.get(&semantic).unwrap();
        assert_eq!((accessor.count(), accessor.data_type()), (4, component));
        assert_eq!(accessor.dimensions(), gltf::accessor::Dimensions::Vec4);
    }
    let (positions, _) = read_by_gltf(&out);
    assert_eq!(positions[3], [0.9, 0.2, 0.125], "in the mesh's own space");
    let ((old, old_bin), (new, new_bin)) = (parsed(&bytes), parsed(&out));
    assert_kept(&old, &new, "", &["/buffers/0/byteLength"]);
    assert_eq!(&new_bin[..old_bin.len()], &old_bin);
}

#[test]
fn weights_of_a_patch_sum_to_one_over_all_sets() {
    let mut scan = Builder::skinned();
    let none = [0.0_f32; 4];
    let first = [[0.5, 0.5, 0.0, 0.0], none, [0.7, 0.0, 0.0, 0.0], none];
    let second = [[1.0, 0.0, 0.0, 0.0], none, [0.1, 0.2, 0.0, 0.0], none];
    let (first, second) = (scan.floats(&first), scan.floats(&second));
    let joints = scan.accessor(&[2_u8, 3, 0, 0].repeat(4), 5121, "VEC4", 4);
    let attributes = &mut scan.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["WEIGHTS_0"] = json!(first);
    attributes["JOINTS_1"] = json!(joints);
    attributes["WEIGHTS_1"] = json!(second);
    let scan = read(&scan.glb());
    let out = scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap();
    let sets = sets(&out);
    let [first, second] = &sets[..] else {
        panic!("both sets")
    };
    let weights = |k: usize| (first[k].weights, second[k].weights);
    assert_eq!(
        weights(0),
        ([0.25, 0.25, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]),
        "they summed to 2"
    );
    assert_eq!(
        weights(1),
        ([1.0, 0.0, 0.0, 0.0], none),
        "there were none at all"
    );
    assert_eq!(
        weights(2),
        ([0.7, 0.0, 0.0, 0.0], [0.1, 0.2, 0.0, 0.0]),
        "they sum to 1 up to rounding and keep their bits"
    );
    assert_eq!(weights(3), weights(0), "the nearest vertex gives both sets");
    assert_eq!(
        (first[3].joints, second[3].joints),
        ([0, 1, 0, 0], [2, 3, 0, 0])
    );
}

#[test]
fn only_patches_of_skinned_meshes_have_joints() {
    let mut scan = Builder::square();
    scan.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "skin": 0}, {}]);
    scan.json["skins"] = json!([{"joints": [2]}]);
    let scan = read(&scan.glb());
    let out = scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap();
    let first = Influence {
        joints: [0; 4],
        weights: [1.0, 0.0, 0.0, 0.0],
    };
    assert_eq!(sets(&out), [[first; 4]], "its primitive says nothing");

    let mut scan = Builder::skinned();
    let node = scan.json["nodes"][0].as_object_mut().unwrap();
    node.remove("skin");
    let scan = read(&scan.glb());
    let (json, _) = parsed(&scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap());
    let attributes = &json["meshes"][0]["primitives"][1]["attributes"];
    assert!(attributes.get("JOINTS_0").is_none() && attributes.get("WEIGHTS_0").is_none());
}

#[test]
fn a_patch_that_contradicts_itself_is_refused() {
    let scan = read(&Builder::square().glb());
    let good = tent(&scan, 0, Vec3::z());
    let bad = [
        PatchPrimitive {
            part: 7,
            ..good.clone()
        },
        PatchPrimitive {
            faces: vec![],
            ..good.clone()
        },
        PatchPrimitive {
            faces: vec![[0, 1, 4]],
            ..good.clone()
        },
        PatchPrimitive {
            texcoords: vec![vec![]],
            ..good.clone()
        },
        PatchPrimitive {
            deviations: vec![0.5],
            ..good.clone()
        },
        PatchPrimitive {
            deviations: vec![f32::NAN; 4],
            ..good.clone()
        },
        PatchPrimitive {
            points: vec![PatchPoint::Scan(99); 4],
            ..good.clone()
        },
        PatchPrimitive {
            points: vec![PatchPoint::New(Vec3::repeat(1e300)); 4],
            ..good.clone()
        },
    ];
    for patch in bad {
        assert!(matches!(
            scan.write(&[good.clone(), patch]),
            Err(ScanError::InvalidPatch { patch: 1, .. })
        ));
    }
    let mut flat = Builder::square();
    flat.json["nodes"][0]["scale"] = json!([1, 1, 0]);
    let flat = read(&flat.glb());
    assert!(matches!(
        flat.write(&[tent(&flat, 0, Vec3::z())]),
        Err(ScanError::Singular { node: 0 })
    ));
}

proptest! {
    #[test]
    fn rim_positions_come_back_bit_for_bit(
        corners in prop::collection::vec(prop::array::uniform3(-1e6_f32..1e6), 3..9),
        translation in prop::array::uniform3(-1e6_f64..1e6),
        scale in prop::array::uniform3(prop_oneof![-3.0_f64..-0.1, 0.1_f64..3.0]),
    ) {
        let mut scan = Builder::new();
        let position = scan.floats(&corners);
        scan.primitive(json!({"attributes": {"POSITION": position}, "mode": 5}));
        scan.json["nodes"][0] = json!({"mesh": 0, "translation": translation, "scale": scale});
        let scan = read(&scan.glb());
        let out = scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap();
        let (positions, _) = read_by_gltf(&out);
        for (old, new) in corners.iter().zip(&positions).take(3) {
            prop_assert_eq!(old.map(f32::to_bits), new.map(f32::to_bits));
        }
        let again = read(&out);
        prop_assert_eq!(&again.surface.positions[..corners.len()], &scan.surface.positions[..]);
        prop_assert_eq!(&again.surface.positions[corners.len()..][..3], &scan.surface.positions[..3]);
    }
}
