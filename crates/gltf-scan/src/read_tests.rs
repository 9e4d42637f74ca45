//! Laws of reading a scan.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::skin::Influence;
use super::testing::Builder;
use super::{Container, Scan, ScanError, ScanLimits};
use darn_geometry::mesh::Vec3;

fn read(bytes: &[u8]) -> Result<Scan, ScanError> {
    Scan::read(bytes.to_vec(), &ScanLimits::default())
}

#[test]
fn both_containers_give_the_same_geometry() {
    let (glb, gltf) = (
        read(&Builder::square().glb()).unwrap(),
        read(&Builder::square().gltf()).unwrap(),
    );
    assert_eq!(
        (glb.container(), gltf.container()),
        (Container::Glb, Container::Gltf)
    );
    assert_eq!(glb.surface, gltf.surface);
    assert_eq!(glb.surface.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(glb.surface.positions[2], Vec3::new(1.0, 1.0, 0.0));
    assert_eq!((glb.part_of_face(1), glb.part_of_face(2)), (Some(0), None));
    assert_eq!(glb.parts[0].material, Some(0));
}

#[test]
fn strips_and_fans_wind_like_triangles_and_skip_degenerate_ones() {
    for (mode, indices, faces) in [
        (5, vec![0, 1, 3, 2], vec![[0, 1, 3], [1, 2, 3]]),
        (5, vec![0, 1, 3, 3, 2], vec![[0, 1, 3]]),
        (5, vec![0, 1, 3, 65535, 1, 2, 3], vec![[0, 1, 3], [1, 2, 3]]),
        (6, vec![0, 1, 2, 3], vec![[1, 2, 0], [2, 3, 0]]),
        (4, vec![0, 1, 2, 3, 0], vec![[0, 1, 2]]),
    ] {
        let mut scan = Builder::square();
        let indices = scan.indices_u16(&indices);
        scan.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        scan.json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        assert_eq!(
            read(&scan.glb()).unwrap().surface.faces,
            faces,
            "mode {mode}"
        );
    }
}

#[test]
fn without_indices_vertices_come_in_order_and_points_are_ignored() {
    let mut scan = Builder::square();
    scan.json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}, "mode": 6.0});
    scan.primitive(json!({"attributes": {"POSITION": 0}, "mode": 0}));
    let scan = read(&scan.glb()).unwrap();
    assert_eq!(scan.surface.faces.len(), 2);
    assert_eq!(scan.parts.len(), 1);
}

#[test]
fn index_and_texcoord_types_decode() {
    let mut scan = Builder::square();
    let u8s = scan.accessor(&[0, 1, 2], 5121, "SCALAR", 3);
    let u32s: Vec<u8> = [2_u32, 3, 0].iter().flat_map(|i| i.to_le_bytes()).collect();
    let u32s = scan.accessor(&u32s, 5125, "SCALAR", 3);
    let half = [0_u8, 255, 0, 0, 128, 128, 0, 0, 255, 0, 0, 0, 51, 0, 0, 0];
    let uv = scan.accessor(&half, 5121, "VEC2", 4);
    scan.json["accessors"][uv]["normalized"] = json!(true);
    let view = scan.json["accessors"][uv]["bufferView"].as_u64().unwrap() as usize;
    scan.json["bufferViews"][view]["byteStride"] = json!(4);
    let signed: Vec<u8> = [i16::MIN, i16::MAX, 0]
        .repeat(4)
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let color = scan.accessor(&signed, 5122, "VEC3", 4);
    scan.json["accessors"][color]["normalized"] = json!(true);
    let attributes = json!({"POSITION": 0, "TEXCOORD_0": uv, "COLOR_0": color});
    scan.json["meshes"][0]["primitives"] = json!([{"attributes": attributes, "indices": u8s}, {"attributes": attributes, "indices": u32s}]);
    let scan = read(&scan.glb()).unwrap();
    assert_eq!(scan.surface.faces, [[0, 1, 2], [2, 3, 0]]);
    assert_eq!(
        scan.parts[0].vertices, scan.parts[1].vertices,
        "a shared accessor is decoded once"
    );
    assert_eq!(
        &*scan.parts[1].texcoords[0],
        &[[0.0, 1.0], [128.0 / 255.0; 2], [1.0, 0.0], [0.2, 0.0]]
    );
    assert_eq!(scan.parts[0].colors[0][3], [-1.0, 1.0, 0.0, 1.0]);
}

#[test]
fn sparse_values_replace_zeros() {
    let mut scan = Builder::square();
    let indices = scan.view(&[1, 2]);
    let values: Vec<u8> = [1.0_f32, 0.0, 0.0, 0.0, 1.0, 0.5]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let values = scan.view(&values);
    let sparse = json!({"componentType": 5126, "type": "VEC3", "count": 3.0, "sparse": {"count": 2,
        "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}}});
    let position = scan.push("accessors", sparse);
    scan.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": position}}]);
    let scan = read(&scan.glb()).unwrap();
    assert_eq!(
        scan.surface.positions,
        [Vec3::zeros(), Vec3::x(), Vec3::new(0.0, 1.0, 0.5)]
    );
}

#[test]
fn transforms_accumulate_and_mirrors_reverse_faces() {
    let mut scan = Builder::square();
    let matrix = [
        0.0,
        2.0,
        0.0,
        0.0,
        -2.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        2.0,
        0.0,
        0.0,
        0.0,
        123456.789012345,
        1.0,
    ];
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    scan.json["nodes"] = json!([
        {"children": [1], "matrix": matrix},
        {"mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0, -quarter, quarter], "scale": [1, 1, -1]},
    ]);
    let scan = read(&scan.glb()).unwrap();
    // Corner (1, 0, 0): turned to (0, −1, 0), shifted to (1, −1, 0), then by the matrix to (2, 2, …).
    assert!((scan.surface.positions[1] - Vec3::new(2.0, 2.0, 123456.789012345)).norm() < 1e-12);
    assert_eq!(scan.surface.faces, [[0, 2, 1], [0, 3, 2]]);
}

#[test]
fn a_node_transform_moves_its_children_but_not_its_skinned_mesh() {
    let mut scan = Builder::skinned();
    scan.json["nodes"][0]["children"] = json!([3]);
    scan.push("nodes", json!({"mesh": 0}));
    let scan = read(&scan.glb()).unwrap();
    assert_eq!(scan.surface.positions[2], Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(scan.surface.positions[6], Vec3::new(11.0, 1.0, 0.0));
    assert_eq!(
        scan.surface.faces,
        [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]],
        "only the child is mirrored"
    );
}

#[test]
fn joint_and_weight_types_decode() {
    let mut scan = Builder::skinned();
    // Shorts with a gap after every four; all weights sparse.
    let joints: Vec<u8> = [0_u16, 700, 2, 3, 9, 9]
        .repeat(4)
        .iter()
        .flat_map(|j| j.to_le_bytes())
        .collect();
    let joints = scan.accessor(&joints, 5123, "VEC4", 4);
    let view = scan.json["accessors"][joints]["bufferView"]
        .as_u64()
        .unwrap() as usize;
    scan.json["bufferViews"][view]["byteStride"] = json!(12);
    let indices = scan.view(&[0, 3]);
    let values = scan.view(&[255, 0, 0, 0, 51, 204, 0, 0]);
    let weights = json!({"componentType": 5121, "type": "VEC4", "count": 4, "normalized": true, "sparse": {"count": 2,
        "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}}});
    let weights = scan.push("accessors", weights);
    scan.json["meshes"][0]["primitives"][0]["attributes"] =
        json!({"POSITION": 0, "JOINTS_0": joints, "WEIGHTS_0": weights});
    let scan = read(&scan.glb()).unwrap();
    let sets = scan.parts[0].skinning.as_ref().unwrap();
    let joints = [0, 700, 2, 3];
    let with = |weights| Influence { joints, weights };
    assert_eq!(sets.len(), 1);
    assert_eq!(
        *sets[0],
        [
            with([1.0, 0.0, 0.0, 0.0]),
            with([0.0; 4]),
            with([0.0; 4]),
            with([0.2, 0.8, 0.0, 0.0])
        ]
    );
}

#[test]
fn invalid_joints_and_weights_are_named() {
    let cases = [
        ("/accessors/2", "componentType", json!(5120)),
        ("/accessors/2", "count", json!(3)),
        ("/accessors/3", "type", json!("VEC3")),
        ("/accessors/3", "count", json!(3)),
    ];
    for (pointer, key, value) in cases {
        let mut scan = Builder::skinned();
        scan.json.pointer_mut(pointer).unwrap()[key] = value;
        let error = read(&scan.glb()).unwrap_err();
        assert_eq!(error.pointer(), Some(pointer), "{error}");
    }
    let tight = ScanLimits {
        max_attribute_values: 31,
        ..ScanLimits::default()
    };
    let error = Scan::read(Builder::skinned().glb(), &tight).unwrap_err();
    assert!(
        error.to_string().contains("max_attribute_values = 31"),
        "{error}"
    );
}

#[test]
fn morph_targets_that_are_on_by_default_are_reported() {
    let posed = |mesh: Value, node: Value, targets: usize| {
        let mut scan = Builder::square();
        scan.json["meshes"][0]["weights"] = mesh;
        scan.json["nodes"][0]["weights"] = node;
        scan.json["meshes"][0]["primitives"][0]["targets"] =
            json!(vec![json!({"POSITION": 0}); targets]);
        read(&scan.glb()).unwrap().posed_by_morph_targets()
    };
    let none = || Value::Null;
    assert!(!posed(none(), none(), 2));
    assert!(!posed(json!([0, 0.0]), none(), 2));
    assert!(posed(json!([0, 0.5]), none(), 2));
    assert!(posed(none(), json!([-1, 0]), 2));
    assert!(
        !posed(json!([1, 1]), json!([0, 0]), 2),
        "a node's weights count in place of its mesh's"
    );
    assert!(!posed(json!([0, 1]), none(), 1), "no such target");
}

#[test]
fn instances_are_read_and_marked() {
    let mut scan = Builder::square();
    scan.json["nodes"] =
        json!([{"mesh": 0, "children": [1]}, {"mesh": 0, "translation": [0, 0, 1]}]);
    let scan = read(&scan.glb()).unwrap();
    assert_eq!(scan.surface.faces.len(), 4);
    let flags: Vec<_> = scan
        .parts
        .iter()
        .map(|part| (part.node, part.shared, part.first_instance))
        .collect();
    assert_eq!(flags, [(0, true, true), (1, true, false)]);
}

#[test]
fn without_a_scene_the_first_one_or_all_roots_are_drawn() {
    let mut scan = Builder::square();
    scan.json["nodes"] = json!([{"mesh": 0}, {"children": [0]}]);
    scan.json["scenes"] = json!([{"nodes": [1]}, {}]);
    scan.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(read(&scan.clone().glb()).unwrap().parts.len(), 1);
    scan.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(read(&scan.glb()).unwrap().parts.len(), 1);
}

proptest! {
    #[test]
    fn stored_floats_keep_their_bits(
        points in prop::collection::vec(prop::array::uniform3(prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL), 3..20),
    ) {
        let mut scan = Builder::new();
        let position = scan.floats(&points);
        scan.primitive(json!({"attributes": {"POSITION": position}}));
        let scan = read(&scan.gltf()).unwrap();
        for (vertex, point) in points.iter().enumerate() {
            let (_, stored) = scan.stored_position(vertex as u32).unwrap();
            prop_assert_eq!(stored.map(f32::to_bits), point.map(f32::to_bits));
        }
    }
}
