//! What reading a scan refuses, and how it says so.

use serde_json::{Value, json};

use super::testing::Builder;
use super::{Scan, ScanError, ScanLimits};

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
