//! Hostile and broken scans: reading them never panics, never exceeds the memory limits, and reports where the error is.

use darn_budget::Budget;
use darn_gltf_scan::{Scan, ScanError, ScanLimits, stripped};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A small valid scan as JSON and binary chunk: transforms, a strip, a sparse accessor, normalized colours, strides, two materials.
fn scan() -> (Value, Vec<u8>) {
    let mut bin = Vec::new();
    let floats =
        |bin: &mut Vec<u8>, values: &[f32]| values.iter().for_each(|x| bin.extend(x.to_le_bytes()));
    floats(
        &mut bin,
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0],
    ); // 0..48 positions
    bin.extend([0, 0, 1, 0, 2, 0, 0, 0, 2, 0, 3, 0]); // 48..60 triangles, u16
    bin.extend([0, 1, 3, 2]); // 60..64 strip, u8
    bin.extend([255, 0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 9, 9, 9, 0]); // 64..80 colours, stride 4
    bin.extend([1, 0, 0, 0]); // 80..84 sparse index
    floats(&mut bin, &[1.0, 0.0, 0.5]); // 84..96 sparse value
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "matrix": [2,0,0,0, 0,2,0,0, 0,0,-2,0, 1,2,3,1]}, {"mesh": 0, "rotation": [0, 0, 0, 1]}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "COLOR_0": 3}, "indices": 1, "material": 0},
            {"attributes": {"POSITION": 4}, "indices": 2, "mode": 5, "material": 1, "targets": [{"POSITION": 0}]}]}],
        "materials": [{}, {}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6},
            {"bufferView": 2, "componentType": 5121, "type": "SCALAR", "count": 4},
            {"bufferView": 3, "componentType": 5121, "type": "VEC3", "count": 4, "normalized": true},
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4, "sparse": {"count": 1,
                "indices": {"bufferView": 4, "componentType": 5121},
                "values": {"bufferView": 4, "byteOffset": 4}}}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12},
            {"buffer": 0, "byteOffset": 60, "byteLength": 4},
            {"buffer": 0, "byteOffset": 64, "byteLength": 16, "byteStride": 4},
            {"buffer": 0, "byteOffset": 80, "byteLength": 16}],
        "buffers": [{"byteLength": 96}]
    });
    (json, bin)
}

fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((12 + 8 + json.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", bin)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

/// The valid scan as a GLB.
fn valid_glb() -> Vec<u8> {
    let (json, bin) = scan();
    glb(&json.to_string(), &bin)
}

/// Reads bytes under small limits. A scan that is read respects the limits, and is written back unchanged.
fn read_and_write(bytes: &[u8]) -> Result<(), ScanError> {
    let limits = ScanLimits {
        max_vertices: 10_000,
        max_faces: 10_000,
        ..ScanLimits::default()
    };
    // Whatever they are, nothing of darn's is in them.
    let stripped = stripped(bytes.to_vec(), &limits, Budget::unlimited());
    assert!(
        stripped.is_ok_and(|found| found.is_none()) || Scan::read(bytes.to_vec(), &limits).is_err()
    );
    let scan = Scan::read(bytes.to_vec(), &limits)?;
    assert!(
        scan.surface.positions.len() <= limits.max_vertices
            && scan.surface.faces.len() <= limits.max_faces
    );
    let vertices = scan.surface.positions.len();
    assert!(
        scan.surface
            .faces
            .iter()
            .flatten()
            .all(|v| (*v as usize) < vertices)
    );
    assert_eq!(scan.write(&[])?, bytes);
    Ok(())
}

/// Whether an error begins with the JSON pointer of a place.
fn names(error: &ScanError, pointer: &str) -> bool {
    error.to_string().starts_with(&format!("{pointer}: "))
}

/// The error of the valid scan after an edit.
fn error_after(edit: impl FnOnce(&mut Value, &mut Vec<u8>)) -> ScanError {
    let (mut json, mut bin) = scan();
    edit(&mut json, &mut bin);
    read_and_write(&glb(&json.to_string(), &bin)).expect_err("an invalid scan")
}

#[test]
fn the_valid_scan_is_read() {
    read_and_write(&valid_glb()).unwrap();
}

#[test]
fn every_truncation_is_refused() {
    let bytes = valid_glb();
    for n in 0..bytes.len() {
        assert!(
            matches!(
                read_and_write(&bytes[..n]),
                Err(ScanError::Container { .. })
            ),
            "{n} bytes"
        );
    }
}

#[test]
fn each_kind_of_invalid_scan_has_its_error() {
    let nan = error_after(|_, bin| bin[12..16].copy_from_slice(&f32::NAN.to_le_bytes()));
    assert_eq!(nan.to_string(), "/accessors/0: position 1 is not finite");
    let index = error_after(|_, bin| bin[50] = 200);
    assert!(
        matches!(
            index,
            ScanError::IndexOutOfRange {
                element: 1,
                index: 200,
                vertices: 4,
                ..
            }
        ),
        "{index}"
    );
    let accessor = error_after(|json, _| json["meshes"][0]["primitives"][0]["indices"] = json!(77));
    assert!(
        names(&accessor, "/meshes/0/primitives/0/indices"),
        "{accessor}"
    );
    let huge = error_after(|json, _| json["buffers"][0]["byteLength"] = json!(1_u64 << 31));
    assert!(names(&huge, "/buffers/0/byteLength"), "{huge}");
    assert!(huge.to_string().contains("2147483648"), "{huge}");
    let count = error_after(|json, _| json["accessors"][0]["count"] = json!(u64::MAX));
    assert!(names(&count, "/accessors/0"), "{count}");
    let cycle = error_after(|json, _| json["nodes"][1]["children"] = json!([0]));
    assert!(names(&cycle, "/nodes/1/children/0"), "{cycle}");
    let empty = error_after(|json, _| json["scenes"] = json!([{}]));
    assert!(matches!(empty, ScanError::NoTriangles { .. }), "{empty}");
    assert!(matches!(
        read_and_write(b""),
        Err(ScanError::Container { offset: 0, .. })
    ));
}

#[test]
fn accessors_without_data_respect_the_limits() {
    let limit = error_after(|json, _| {
        json["accessors"][0] =
            json!({"componentType": 5126, "type": "VEC3", "count": 2_000_000_000});
    });
    assert_eq!(
        limit.to_string(),
        "/accessors/0: 2000000000 exceeds the limit max_vertices = 10000"
    );
    let sets = error_after(|json, _| {
        // Four vertices, but a colour accessor that claims a billion.
        json["accessors"][3] =
            json!({"componentType": 5126, "type": "VEC3", "count": 1_000_000_000});
    });
    assert!(names(&sets, "/accessors/3"), "{sets}");
}

#[test]
fn deep_and_wide_json_is_refused_before_it_is_built() {
    let deep = format!("{{\"asset\":{}", "[".repeat(100_000));
    assert!(matches!(
        read_and_write(deep.as_bytes()),
        Err(ScanError::Container { .. })
    ));
    let wide = format!("{{\"asset\":[{}0]}}", "0,".repeat(1_100_000));
    assert!(matches!(
        read_and_write(wide.as_bytes()),
        Err(ScanError::Limit {
            limit: "max_json_values",
            ..
        })
    ));
}

/// Peak address space of this process, in bytes. Unlike resident memory it includes zeroed pages that were never touched.
#[cfg(target_os = "linux")]
fn peak_address_space() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmPeak:"))
        .unwrap();
    line.trim()
        .trim_end_matches(" kB")
        .parse::<usize>()
        .unwrap()
        * 1024
}

#[test]
#[cfg(target_os = "linux")]
fn claimed_lengths_allocate_no_memory() {
    let before = peak_address_space();
    for length in [1_u64 << 31, 1 << 33, 1 << 40] {
        error_after(|json, _| json["buffers"][0]["byteLength"] = json!(length));
        error_after(|json, _| json["bufferViews"][0]["byteLength"] = json!(length));
        error_after(|json, _| json["accessors"][0]["count"] = json!(length));
        error_after(|json, _| json["accessors"][4]["sparse"]["count"] = json!(length));
        error_after(|json, _| json["accessors"][1]["count"] = json!(length));
    }
    // Test threads reserve address space too, but less than the smallest claimed length, 2 GiB.
    assert!(
        peak_address_space() - before < 1 << 30,
        "{} bytes",
        peak_address_space() - before
    );
}

/// Numbers at the limits of the formats, and values that are no numbers.
fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec![
            "-1",
            "0",
            "1",
            "2",
            "3",
            "4",
            "5",
            "1.0",
            "1.5",
            "-0",
            "65535",
            "65536",
            "4294967295",
            "4294967296",
            "2147483648",
            "18446744073709551615",
            "18446744073709551616",
            "1e308",
            "1e999",
            "null",
            "true",
            "\"\"",
            "[]",
            "{}",
            "5120",
            "5121",
            "5123",
            "5125",
            "5126",
        ])
        .prop_map(str::to_owned),
        any::<i64>().prop_map(|n| n.to_string()),
        any::<f64>()
            .prop_filter("JSON has finite numbers only", |x| x.is_finite())
            .prop_map(|x| x.to_string()),
    ]
}

/// The JSON of the valid scan with some of its numbers replaced.
fn with_numbers_replaced(edits: &[(prop::sample::Index, String)]) -> String {
    let mut text = scan().0.to_string();
    for (which, number) in edits {
        let bytes = text.as_bytes();
        let starts: Vec<usize> = (1..bytes.len())
            .filter(|&i| bytes[i].is_ascii_digit() && matches!(bytes[i - 1], b':' | b',' | b'['))
            .collect();
        if starts.is_empty() {
            break;
        }
        let start = starts[which.index(starts.len())];
        let end = start
            + bytes[start..]
                .iter()
                .take_while(|b| matches!(b, b'0'..=b'9' | b'.' | b'e' | b'-'))
                .count();
        text.replace_range(start..end, number);
    }
    text
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn changed_bytes_do_not_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut bytes = valid_glb();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read_and_write(&bytes);
    }

    #[test]
    fn replaced_numbers_do_not_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), number()), 1..5)) {
        let (_, bin) = scan();
        let text = with_numbers_replaced(&edits);
        let _ = read_and_write(&glb(&text, &bin));
        let _ = read_and_write(text.as_bytes());
    }

    #[test]
    fn random_binary_chunks_do_not_panic(bin in prop::collection::vec(any::<u8>(), 0..200)) {
        let (json, _) = scan();
        let _ = read_and_write(&glb(&json.to_string(), &bin));
    }

    #[test]
    fn random_bytes_do_not_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..300), has_header in any::<bool>()) {
        if has_header && bytes.len() >= 12 {
            let length = bytes.len() as u32;
            bytes[..8].copy_from_slice(b"glTF\x02\0\0\0");
            bytes[8..12].copy_from_slice(&length.to_le_bytes());
        }
        let _ = read_and_write(&bytes);
    }
}
