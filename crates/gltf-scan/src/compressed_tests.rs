//! Laws of reading compressed geometry: what a file decodes to is what its plain twin has.

use std::collections::BTreeSet;

use darn_budget::{Budget, Limits};
use darn_geometry::mesh::Vec3;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{VertexEncoding, encode_vertex_buffer};
use serde_json::{Value, json};

use super::compressed::encoded::{Coding, PlainMesh, glb};
use super::{PatchPoint, PatchPrimitive, Scan, ScanError, ScanLimits, stripped};

/// Waved cloth of 14 × 14 vertices with a hole.
fn cloth() -> PlainMesh {
    const N: u32 = 14;
    let at = |k: u32| [(k % N) as f32 / 13.0, (k / N) as f32 / 13.0];
    let all = || (0..N * N).map(at);
    let mut faces = Vec::new();
    for k in (0..N * (N - 1)).filter(|k| k % N < N - 1) {
        if !(5..8).contains(&(k % N)) || !(5..8).contains(&(k / N)) {
            faces.extend([[k, k + 1, k + N + 1], [k, k + N + 1, k + N]]);
        }
    }
    let normal = |[u, _]: [f32; 2]| {
        let slope = 0.6 * (6.0 * u).cos();
        let length = slope.hypot(1.0);
        [-slope / length, 0.0, 1.0 / length]
    };
    PlainMesh {
        positions: all().map(|[u, v]| [u, v, 0.1 * (6.0 * u).sin()]).collect(),
        normals: all().map(normal).collect(),
        texcoords: all().collect(),
        faces,
    }
}

fn read(bytes: &[u8]) -> Result<Scan, ScanError> {
    Scan::read(bytes.to_vec(), &ScanLimits::default())
}

/// The twin's vertex at each of the scan's vertices: codecs may store vertices in another order.
fn twins(scan: &Scan, cloth: &PlainMesh, tolerance: f64) -> Vec<u32> {
    let twin = |point: &Vec3| {
        let distances = cloth
            .positions
            .iter()
            .map(|p| (Vec3::from(p.map(f64::from)) - point).norm());
        let (index, distance) = (distances.enumerate())
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(distance <= 1.8 * tolerance, "{distance} > {tolerance}");
        index as u32
    };
    scan.surface.positions.iter().map(twin).collect()
}

/// Triangles without order, each with its smallest vertex first.
fn triangles(faces: impl Iterator<Item = [u32; 3]>) -> BTreeSet<[u32; 3]> {
    let first = |face: [u32; 3]| {
        let [a, b, c] = face;
        match face.iter().min() {
            Some(least) if *least == b => [b, c, a],
            Some(least) if *least == c => [c, a, b],
            _ => face,
        }
    };
    faces.map(first).collect()
}

#[test]
fn every_coding_reads_as_its_plain_twin() {
    let cloth = cloth();
    for coding in Coding::ALL {
        let scan = read(&cloth.encode(coding)).unwrap();
        let twins = twins(&scan, &cloth, cloth.tolerance(coding));
        let faces = scan.surface.faces.iter();
        assert_eq!(
            triangles(faces.map(|face| face.map(|v| twins[v as usize]))),
            triangles(cloth.faces.iter().copied()),
            "{coding:?}"
        );
        let part = &scan.parts[0];
        let normals = part.normals.as_ref().unwrap();
        assert_eq!(normals.len(), twins.len());
        for (k, &twin) in twins.iter().enumerate() {
            let twin = twin as usize;
            let cosine: f32 = normals[k]
                .iter()
                .zip(&cloth.normals[twin])
                .map(|(a, b)| a * b)
                .sum();
            assert!(cosine > 0.9998, "{coding:?}: {:?}", normals[k]);
            let length = normals[k].iter().map(|x| x * x).sum::<f32>();
            assert!((length - 1.0).abs() < 1e-5, "{coding:?}: {length}");
            for (a, b) in part.texcoords[0][k].iter().zip(cloth.texcoords[twin]) {
                assert!((a - b).abs() < 2e-4, "{coding:?}: {a} is not {b}");
            }
        }
    }
}

#[test]
fn a_patch_is_plain_and_the_compressed_bytes_stay() {
    let cloth = cloth();
    for coding in Coding::ALL {
        let bytes = cloth.encode(coding);
        let scan = read(&bytes).unwrap();
        let patch = PatchPrimitive {
            name: "patch".into(),
            deviations: Vec::new(),
            part: 0,
            material_of: 0,
            points: vec![
                PatchPoint::Scan(0),
                PatchPoint::Scan(1),
                PatchPoint::New(Vec3::new(0.5, 0.5, 0.25)),
            ],
            normals: vec![Vec3::z(); 3],
            tangents: Vec::new(),
            texcoords: vec![vec![[0.0; 2]; 3]],
            colors: Vec::new(),
            faces: vec![[0, 1, 2]],
            both_sides: false,
            appearance: Default::default(),
            hole: Default::default(),
            method: Default::default(),
        };
        let out = scan.write(&[patch]).unwrap();
        let stripped = stripped(out.clone(), &ScanLimits::default(), Budget::unlimited());
        assert!(stripped.unwrap().unwrap().bytes == bytes, "{coding:?}");
        let again = read(&out).unwrap();
        let added = &again.parts[1];
        let start = added.vertices.start as usize;
        let rim = &again.surface.positions[start..start + 2];
        assert_eq!(
            rim,
            &scan.surface.positions[..2],
            "{coding:?}: rim, bit for bit"
        );
        let free = again.surface.positions[start + 2] - Vec3::new(0.5, 0.5, 0.25);
        assert!(free.norm() < 1e-6, "{coding:?}: {free:?}");
        let (old, new) = (bin(&bytes), bin(&out));
        assert!(new.starts_with(old), "{coding:?}");
        let listed = |bytes: &[u8]| document(bytes)["extensionsRequired"].clone();
        assert_eq!(listed(&out), listed(&bytes));
    }
}

fn document(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

fn bin(glb: &[u8]) -> &[u8] {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    &glb[28 + length..]
}

/// A scan after an edit of its JSON and its first buffer.
fn edited(coding: Coding, edit: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Result<Scan, ScanError> {
    let bytes = cloth().encode(coding);
    let (mut json, mut bin) = (document(&bytes), bin(&bytes).to_vec());
    edit(&mut json, &mut bin);
    read(&glb(&json, &bin))
}

#[test]
fn broken_streams_are_invalid_with_their_place() {
    let cloth = cloth();
    for coding in Coding::ALL.into_iter().skip(1) {
        let bytes = cloth.encode(coding);
        let (json, bin) = (document(&bytes), bin(&bytes));
        for k in (0..bin.len()).step_by(7) {
            let mut flipped = bin.to_vec();
            flipped[k] ^= 0x5A;
            if let Err(error) = read(&glb(&json, &flipped)) {
                assert!(error.pointer().is_some(), "{coding:?}, byte {k}: {error}");
            }
        }
        let views = json["bufferViews"].as_array().unwrap().len();
        let cut = edited(coding, |json, _| {
            let first = &mut json["bufferViews"][0];
            let length = match first.get("extensions").is_some() {
                true => {
                    let all = first["extensions"].as_object_mut().unwrap();
                    &mut all.values_mut().next().unwrap()["byteLength"]
                }
                false => &mut first["byteLength"],
            };
            *length = json!(length.as_u64().unwrap() / 2);
        });
        let error = cut.unwrap_err();
        assert!(
            matches!(error, ScanError::Invalid { .. }),
            "{coding:?}: {error}"
        );
        let place = if views == 1 {
            "/meshes/0/primitives/0/extensions"
        } else {
            "/bufferViews/0/extensions"
        };
        assert!(error.pointer().unwrap().starts_with(place), "{error}");
    }
}

#[test]
fn declared_sizes_are_refused_before_they_are_allocated() {
    let limit = |error: ScanError| match error {
        ScanError::Limit { limit, pointer, .. } => (limit, pointer),
        other => panic!("{other}"),
    };
    let meshopt = edited(Coding::MeshoptFloat, |json, _| {
        json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] =
            json!(1_000_000_000);
    });
    let place = "/bufferViews/0/extensions/EXT_meshopt_compression";
    assert_eq!(
        limit(meshopt.unwrap_err()),
        ("max_decoded_bytes", place.into())
    );
    // DRACO 2.2, triangles, then five bytes of a count above a billion.
    let huge = [0xFF, 0xFF, 0xFF, 0xFF, 0x07];
    let few = [3];
    let place = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (method, counts, name) in [
        (0, [&huge[..], &few[..]], "max_faces"),
        (0, [&few[..], &huge[..]], "max_vertices"),
        (1, [&huge[..], &few[..]], "max_vertices"),
        (1, [&few[..], &huge[..]], "max_faces"),
    ] {
        let bomb = edited(Coding::DracoSequential, |json, bin| {
            *bin = b"DRACO\x02\x02\x01".to_vec();
            bin.extend_from_slice(&[method, 0, 0]);
            if method == 1 {
                bin.push(0);
            }
            bin.extend_from_slice(&counts.concat());
            bin.extend_from_slice(&[0; 64]);
            json["bufferViews"][0]["byteLength"] = json!(bin.len());
            json["buffers"][0]["byteLength"] = json!(bin.len());
        });
        assert_eq!(
            limit(bomb.unwrap_err()),
            (name, place.into()),
            "method {method}"
        );
    }
    for coding in [Coding::MeshoptFloat, Coding::DracoEdgebreaker] {
        let tight = ScanLimits {
            max_decoded_bytes: 1000,
            ..ScanLimits::default()
        };
        let error = Scan::read(cloth().encode(coding), &tight).unwrap_err();
        assert_eq!(limit(error).0, "max_decoded_bytes");
    }
}

#[test]
fn decoding_counts_in_the_budget_and_gives_its_memory_back() {
    let cloth = cloth();
    for coding in Coding::ALL {
        let bytes = cloth.encode(coding);
        let limits = |memory| Limits {
            memory,
            ..Limits::default()
        };
        let budget = Budget::new(limits(1 << 30), &|| false);
        let scan = Scan::read_within(bytes.clone(), &ScanLimits::default(), &budget).unwrap();
        let json = 100 * super::json::values_at_most(document(&bytes).to_string().as_bytes());
        assert_eq!(budget.held(), scan.decoded_bytes() + json, "{coding:?}");
        let budget = Budget::new(limits(json + 2000), &|| false);
        let refused = Scan::read_within(bytes, &ScanLimits::default(), &budget);
        assert!(
            matches!(refused, Err(ScanError::Exhausted(_))),
            "{coding:?}"
        );
    }
}

#[test]
fn counts_that_a_draco_stream_does_not_keep_to_are_noted() {
    for coding in [Coding::DracoEdgebreaker, Coding::DracoSequential] {
        // The stream has no vertices that no triangle uses, the JSON of the fixture counts them.
        let read = read(&cloth().encode(coding)).unwrap();
        let (points, corners) = (read.surface.positions.len(), 3 * read.surface.faces.len());
        let state = |json: &mut Value| {
            for (accessor, count) in [points, points, points, corners].into_iter().enumerate() {
                json["accessors"][accessor]["count"] = json!(count);
            }
        };
        let sound = edited(coding, |json, _| state(json)).unwrap();
        assert_eq!(sound.misstated_streams, 0, "{coding:?}");
        for accessor in 0..4 {
            for count in [1, 3, 300_000] {
                let scan = edited(coding, |json, _| {
                    state(json);
                    json["accessors"][accessor]["count"] = json!(count);
                });
                let scan = scan.unwrap();
                assert_eq!(scan.misstated_streams, 1, "{coding:?} {accessor} {count}");
                assert_eq!(scan.surface, sound.surface);
            }
            for count in [json!(-1), json!("many"), json!(0.5)] {
                let scan = edited(coding, |json, _| {
                    json["accessors"][accessor]["count"] = count.clone()
                });
                let error = scan.unwrap_err();
                let place = format!("/accessors/{accessor}/count");
                assert_eq!(error.pointer(), Some(place.as_str()), "{error}");
            }
        }
    }
}

#[test]
fn a_draco_point_cloud_is_named() {
    let cloud = edited(Coding::DracoSequential, |_, bin| bin[7] = 0);
    let error = cloud.unwrap_err();
    assert!(matches!(error, ScanError::PointCloud { .. }), "{error}");
    assert!(error.to_string().contains("point cloud"), "{error}");
}

#[test]
fn plain_bytes_beside_a_stream_that_is_not_required_are_read() {
    // The plain bytes are in the BIN chunk, the stream is garbage.
    let scan = edited(Coding::Quantized, |json, bin| {
        json["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {
            "buffer": 0, "byteLength": 8, "byteStride": 8, "count": 1, "mode": "ATTRIBUTES",
        }});
        json["buffers"][0]["byteLength"] = json!(bin.len());
    });
    assert!(scan.is_ok(), "{:?}", scan.err());
}

#[test]
fn an_octahedral_normal_without_length_stays_zero() {
    let scan = edited(Coding::MeshoptQuantized, |json, bin| {
        let count = json["accessors"][1]["count"].as_u64().unwrap() as usize;
        let mut normals = [0, 0, 127, 0].repeat(count);
        normals[4 * 3..4 * 4].fill(0);
        let stream = encode_vertex_buffer(
            &normals,
            count,
            4,
            VertexEncoding::DEFAULT,
            &mut Workspace::default(),
        );
        let stream = stream.unwrap();
        let place = &mut json["bufferViews"][1]["extensions"]["KHR_meshopt_compression"];
        place["byteOffset"] = json!(bin.len());
        place["byteLength"] = json!(stream.len());
        bin.extend_from_slice(&stream);
        json["buffers"][0]["byteLength"] = json!(bin.len());
    });
    let scan = scan.unwrap();
    let normals = scan.parts[0].normals.as_ref().unwrap();
    assert_eq!(normals[2..5], [[0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 1.0]]);
}
