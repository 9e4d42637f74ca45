//! Laws of how patches share primitives and materials.

use serde_json::json;

use super::testing::{Builder, parsed, read_by_gltf, tent};
use super::{PatchPoint, PatchPrimitive, Scan, ScanLimits};
use darn_geometry::mesh::Vec3;

fn read(bytes: &[u8]) -> Scan {
    Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap()
}

#[test]
fn patches_of_a_mesh_and_material_share_a_primitive_and_keep_their_ranges() {
    let tents = |scan: &Scan| {
        let mut third = tent(scan, 0, Vec3::x());
        third.both_sides = true;
        let numbered = [tent(scan, 0, Vec3::z()), third, tent(scan, 0, -Vec3::z())].into_iter();
        let numbered = (0..).zip(numbered).map(|(id, mut tent)| {
            tent.hole.insert("id".into(), json!(id));
            tent
        });
        numbered.collect::<Vec<_>>()
    };
    for (builder, mirrors) in [(Builder::square(), false), (Builder::skinned(), true)] {
        let scan = read(&builder.glb());
        let tents = tents(&scan);
        let out = scan.write(&tents).unwrap();
        let again = read(&out);
        // Both sides of hole 1 are a pair of their own.
        assert_eq!(again.parts.len(), 4);
        let (json, _) = parsed(&out);
        let record =
            |primitive: usize| &json["meshes"][0]["primitives"][primitive]["extras"]["darn"];
        let darn = record(1);
        assert_eq!(darn["reconstructed"], true);
        assert_eq!(darn["weights"]["name"], "standard");
        let ids = |primitive: usize| -> Vec<u64> {
            let holes = record(primitive)["holes"].as_array().unwrap();
            holes
                .iter()
                .map(|hole| hole["id"].as_u64().unwrap())
                .collect()
        };
        assert_eq!([ids(1), ids(2), ids(3)], [vec![0, 2], vec![1], vec![1]]);
        for hole in darn["holes"].as_array().unwrap() {
            let number = |key: &str| hole[key].as_u64().unwrap() as usize;
            let tent = &tents[number("id")];
            let part = &again.parts[1];
            let first = part.faces.start as usize + number("firstIndex") / 3;
            let faces = &again.surface.faces[first..][..number("indexCount") / 3];
            let base = part.vertices.start + number("firstVertex") as u32;
            let own: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|v| v - base)).collect();
            // The reader turns mirrored faces as the writer does, and starts them with the same vertex.
            assert_eq!(own, tent.faces, "mirrors: {mirrors}");
            let PatchPoint::New(top) = tent.points[3] else {
                unreachable!()
            };
            let found = again.surface.positions[base as usize + 3];
            assert!((found - top).norm() < 1e-6, "{found} {top}");
            assert_eq!(number("vertexCount"), tent.points.len());
        }
        let (positions, indices) = read_by_gltf(&out);
        assert_eq!((positions.len(), indices.len()), (4, 9));
    }
}

#[test]
fn patches_of_many_vertices_have_wide_indices() {
    let scan = read(&Builder::square().glb());
    let mut wide = tent(&scan, 0, Vec3::z());
    let more = 40_000;
    wide.points.extend(vec![PatchPoint::New(Vec3::y()); more]);
    wide.normals.extend(vec![Vec3::z(); more]);
    let out = scan.write(&[wide.clone(), wide]).unwrap();
    let again = read(&out);
    assert_eq!(again.parts[1].vertices.len(), 2 * (more + 4));
    let faces = again.parts[1].faces.clone();
    let last = again.surface.faces[faces.end as usize - 1];
    let base = again.parts[1].vertices.start + more as u32 + 4;
    assert_eq!(last, [2, 0, 3].map(|v| base + v));
}

#[test]
fn all_patches_and_later_mends_share_one_copy_of_a_material() {
    let scan = read(&Builder::square().glb());
    let out = scan
        .write(&[tent(&scan, 0, Vec3::z()), tent(&scan, 0, -Vec3::z())])
        .unwrap();
    let again = read(&out);
    let out = again.write(&[tent(&again, 1, Vec3::z())]).unwrap();
    // The scan's, the copy, and the copy that marks.
    assert_eq!(parsed(&out).0["materials"].as_array().unwrap().len(), 3);
    // Extras that are not an object stay.
    let mut scan = Builder::square();
    scan.json["materials"][0]["extras"] = json!("loan 7");
    let scan = read(&scan.glb());
    let (json, _) = parsed(&scan.write(&[tent(&scan, 0, Vec3::z())]).unwrap());
    assert_eq!(json["materials"][1]["extras"], "loan 7");
}

#[test]
fn deviations_are_an_attribute_and_patches_without_them_stay_apart() {
    let scan = read(&Builder::square().glb());
    let plain = tent(&scan, 0, Vec3::z());
    let sure = PatchPrimitive {
        deviations: vec![0.0, 0.0, 0.0, 0.25],
        ..plain.clone()
    };
    let written = scan.write(&[sure.clone(), plain, sure]).unwrap();
    let (document, _) = parsed(&written);
    let primitives = document["meshes"][0]["primitives"].as_array().unwrap();
    let [.., with, without] = &primitives[..] else {
        panic!("{} primitives", primitives.len());
    };
    let index = with["attributes"]["_CONFIDENCE"].as_u64().unwrap() as usize;
    assert_eq!(document["accessors"][index]["count"], 8);
    assert_eq!(document["accessors"][index]["type"], "SCALAR");
    let said = &with["extras"]["darn"]["confidence"];
    assert_eq!(said["attribute"], "_CONFIDENCE");
    assert!(without["attributes"].get("_CONFIDENCE").is_none());
    assert!(without["extras"]["darn"].get("confidence").is_none());
    let again = read(&written);
    let found = again.parts.iter().find_map(|part| part.deviations.clone());
    assert_eq!(
        &found.unwrap()[..],
        [0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.25]
    );
}
