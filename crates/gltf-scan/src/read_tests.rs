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

/// The error of a unit square after an edit of its JSON.
fn refused(edit: impl FnOnce(&mut Value)) -> ScanError {
    let mut square = Builder::square();
    square.json["buffers"][0]["byteLength"] = json!(square.bin.len());
    edit(&mut square.json);
    read(&square.glb_as_is()).expect_err("a refusal")
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

#[test]
fn refusals_name_the_place() {
    type Edit = fn(&mut Value);
    let cases: [(&str, Edit); 16] = [
        ("/accessors/0", |j| {
            j["accessors"][0]["byteOffset"] = json!(1)
        }),
        ("/accessors/0", |j| {
            j["accessors"][0]["count"] = json!(3_000_000_000_u64)
        }),
        ("/accessors/0/count", |j| {
            j["accessors"][0]["count"] = json!(-1)
        }),
        ("/bufferViews/0", |j| {
            j["bufferViews"][0]["byteOffset"] = json!(u64::MAX)
        }),
        ("/bufferViews/0/byteStride", |j| {
            j["bufferViews"][0]["byteStride"] = json!(8)
        }),
        ("/buffers/0/byteLength", |j| {
            j["buffers"][0]["byteLength"] = json!(1_u64 << 31)
        }),
        ("/meshes/0/primitives/0/attributes/POSITION", |j| {
            j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9);
        }),
        ("/accessors/1", |j| j["accessors"][0]["count"] = json!(2)),
        ("/meshes/0/primitives/0/material", |j| {
            j["materials"] = json!([])
        }),
        ("/nodes/0/mesh", |j| j["nodes"][0]["mesh"] = json!(3)),
        ("/nodes/0/children/0", |j| {
            j["nodes"][0]["children"] = json!([0])
        }),
        ("/nodes/0/rotation", |j| {
            j["nodes"][0]["rotation"] = json!([0, 0, 0, 0])
        }),
        ("/scene", |j| j["scene"] = json!(1)),
        ("/asset/version", |j| j["asset"]["version"] = json!("1.0")),
        ("/buffers/0/uri", |j| {
            j["buffers"][0]["uri"] = json!("/etc/passwd")
        }),
        ("/accessors/0", |j| {
            j["accessors"][0]["componentType"] = json!(5125)
        }),
    ];
    for (pointer, edit) in cases {
        let error = refused(edit);
        assert_eq!(error.pointer(), Some(pointer), "{error}");
    }
}

#[test]
fn a_required_extension_that_holds_no_geometry_is_no_reason_to_refuse() {
    let mut scan = Builder::square();
    scan.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    assert!(read(&scan.glb()).is_ok());
}

#[test]
fn what_is_drawn_in_place_of_triangles_is_named() {
    let draws = |primitives: Value| {
        let mut scan = Builder::square();
        scan.json["meshes"][0]["primitives"] = primitives;
        read(&scan.glb()).unwrap_err().to_string()
    };
    let of = |mode: u32| json!({"attributes": {"POSITION": 0}, "mode": mode});
    let mut splats = of(0);
    splats["extensions"] = json!({"KHR_gaussian_splatting": {"kernel": "ellipse"}});
    let mut voxels = of(0x7FFF_FFFF);
    voxels["extensions"] = json!({"EXT_primitive_voxels": {"shape": 0}});
    for (primitives, words) in [
        (json!([of(0), of(0)]), "only 2 primitive(s) of points;"),
        (json!([of(1), of(3)]), "only 2 primitive(s) of lines;"),
        (json!([splats.clone()]), "Gaussian splats"),
        (json!([voxels]), "voxels"),
        (
            json!([of(0), splats]),
            "of points and 1 primitive(s) of Gaussian",
        ),
        (json!([{"attributes": {}}]), "triangles without positions"),
    ] {
        let text = draws(primitives);
        assert!(text.contains(words), "{text}");
    }
    let mut scan = Builder::square();
    scan.json["scenes"] = json!([{"nodes": []}]);
    let text = read(&scan.glb()).unwrap_err().to_string();
    assert!(text.contains("1 mesh(es) outside"), "{text}");
}

#[test]
fn positions_that_are_not_finite_and_indices_out_of_range_are_named() {
    let mut scan = Builder::square();
    scan.bin[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = read(&scan.glb()).unwrap_err();
    assert!(
        matches!(error, ScanError::NotFinite { element: 1, .. }),
        "{error}"
    );
    assert_eq!(error.pointer(), Some("/accessors/0"));
    let mut scan = Builder::square();
    scan.bin[50..52].copy_from_slice(&7_u16.to_le_bytes());
    let error = read(&scan.glb()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "/accessors/1: element 1 is index 7, but the primitive has 4 vertices"
    );
}

#[test]
fn positions_that_no_triangle_uses_need_not_be_finite() {
    let mut file = Builder::new();
    let position = file.floats(&[
        [f32::NAN, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, f32::INFINITY, 0.0],
    ]);
    file.json["accessors"][position]["min"] = json!([0, 0, 0]);
    file.json["accessors"][position]["max"] = json!([1, 1, 0]);
    let indices = file.indices_u16(&[1, 2, 3]);
    file.primitive(json!({"attributes": {"POSITION": position}, "indices": indices}));
    let scan = read(&file.clone().glb()).unwrap();
    assert_eq!((scan.not_finite, scan.surface.faces.len()), (2, 1));
    assert!(
        scan.surface
            .positions
            .iter()
            .flatten()
            .all(|x| x.is_finite())
    );
    let used = file.indices_u16(&[2, 3, 4]);
    file.primitive(json!({"attributes": {"POSITION": position}, "indices": used}));
    let error = read(&file.glb()).unwrap_err();
    assert_eq!(error.to_string(), "/accessors/0: position 4 is not finite");
}

#[test]
fn a_node_that_moves_positions_out_of_range_is_named() {
    let mut file = Builder::square();
    file.json["nodes"][0]["scale"] = json!([1e308, 1, 1]);
    file.json["nodes"][0]["translation"] = json!([1e308, 0, 0]);
    let error = read(&file.glb()).unwrap_err();
    assert_eq!(error.to_string(), "/nodes/0: position 1 is not finite");
}

#[test]
fn limits_are_named_with_their_value() {
    let glb = Builder::square().glb();
    let tight = |limits: ScanLimits| Scan::read(glb.clone(), &limits).unwrap_err().to_string();
    let all = ScanLimits::default();
    for (text, limits) in [
        (
            "max_vertices = 3",
            ScanLimits {
                max_vertices: 3,
                ..all.clone()
            },
        ),
        (
            "max_faces = 1",
            ScanLimits {
                max_faces: 1,
                ..all.clone()
            },
        ),
        (
            "max_nodes = 0",
            ScanLimits {
                max_nodes: 0,
                ..all.clone()
            },
        ),
        (
            "max_primitives = 0",
            ScanLimits {
                max_primitives: 0,
                ..all.clone()
            },
        ),
        (
            "max_json_values = 10",
            ScanLimits {
                max_json_values: 10,
                ..all.clone()
            },
        ),
    ] {
        let error = tight(limits);
        assert!(error.contains(text), "{error}");
    }
}

#[test]
fn morph_targets_are_objects_and_few() {
    let with_targets = |targets: serde_json::Value| {
        let mut json: serde_json::Value = serde_json::from_str(TARGETS).unwrap();
        json["meshes"][0]["primitives"][0]["targets"] = targets;
        Scan::read(json.to_string().into_bytes(), &ScanLimits::default())
    };
    assert_eq!(
        with_targets(serde_json::json!([{}, {}])).unwrap().parts[0].targets,
        2
    );
    let zeros = with_targets(serde_json::json!([{}, 0])).unwrap_err();
    assert_eq!(zeros.pointer(), Some("/meshes/0/primitives/0/targets/1"));
    let many = with_targets(serde_json::json!(vec![serde_json::json!({}); 1025])).unwrap_err();
    assert!(
        many.to_string().contains("max_morph_targets = 1024"),
        "{many}"
    );
}

/// One triangle in a data URI.
const TARGETS: &str = r#"{
    "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
}"#;

#[test]
fn memory_of_the_parsed_json_is_counted_and_not_guessed() {
    let held = |extras: serde_json::Value| {
        let mut json: serde_json::Value = serde_json::from_str(TARGETS).unwrap();
        json["extras"] = extras;
        let text = json.to_string();
        let scan = Scan::read(text.clone().into_bytes(), &ScanLimits::default()).unwrap();
        (scan.bytes_held(), text.len())
    };
    let (plain, _) = held(serde_json::json!(null));
    let (nested, text) = held(serde_json::json!(vec![serde_json::json!([]); 10_000]));
    // A list takes the place of a value, however short its text.
    assert!(nested - plain >= 10_000 * size_of::<serde_json::Value>());
    assert!(nested > 10 * text);
    let (string, text) = held(serde_json::json!("x".repeat(100_000)));
    assert!(string < 4 * text);
}

#[test]
fn a_scan_that_draws_nothing_says_so() {
    assert!(matches!(
        read(&Builder::new().glb()),
        Err(ScanError::NoTriangles { .. })
    ));
    assert!(matches!(
        read(b""),
        Err(ScanError::Container { offset: 0, .. })
    ));
    assert!(matches!(
        read(b"solid stl"),
        Err(ScanError::Container { .. })
    ));
    assert!(matches!(
        read(b"{\"asset\": nope}"),
        Err(ScanError::Container { offset: 11.., .. })
    ));
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
