//! What a mended scan says of how far its new cloth may be off.

use std::sync::Arc;

use darn_budget::Budget;
use darn_contract::{Constraints, Fill};
use darn_geometry::mesh::shapes::tube;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_lab::scarffolds::holed_scan::{HoleShape, HoledScan};
use darn_mend::ScanSession;
use darn_net::WITHIN_90;
use serde_json::Value;

use super::cloth::{ROUND, holed, mended, mender, packed, read, sheet};
use super::patched::chunks;

/// A patch's primitive in a mended file.
struct PatchFile {
    primitive: Value,
    accessors: Value,
    views: Value,
    bin: Vec<u8>,
}

impl PatchFile {
    fn of(bytes: &[u8]) -> PatchFile {
        let (json, bin) = chunks(bytes);
        let all = json["meshes"].as_array().expect("meshes").iter();
        let mut all = all.flat_map(|mesh| mesh["primitives"].as_array().expect("primitives"));
        let new = |primitive: &&Value| primitive.pointer("/extras/darn/reconstructed").is_some();
        PatchFile {
            primitive: all.find(new).expect("a patch").clone(),
            accessors: json["accessors"].clone(),
            views: json["bufferViews"].clone(),
            bin: bin.to_vec(),
        }
    }

    fn accessor(&self, attribute: &str) -> Option<&Value> {
        let index = self.primitive["attributes"][attribute].as_u64()?;
        Some(&self.accessors[index as usize])
    }

    fn floats(&self, attribute: &str) -> Vec<f32> {
        let accessor = self.accessor(attribute).expect("the attribute");
        let view = &self.views[accessor["bufferView"].as_u64().expect("a view") as usize];
        let number = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        let bytes = &self.bin[number("byteOffset")..][..number("byteLength")];
        let floats = bytes.chunks_exact(4);
        floats
            .map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")))
            .collect()
    }
}

/// Distance of a point from a mesh whose triangles are small: from the planes of those around the nearest vertex, within them.
fn distance(p: &Vec3, mesh: &TriMesh) -> f64 {
    let to_segment = |a: &Vec3, b: &Vec3| {
        let along = b - a;
        let t = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (p - a - along * t).norm()
    };
    let to_face = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
        let normal = (b - a).cross(&(c - a));
        let foot = p - normal * ((p - a).dot(&normal) / normal.norm_squared());
        let inside = [[a, b], [b, c], [c, a]]
            .iter()
            .all(|[from, to]| (to - from).cross(&(foot - from)).dot(&normal) >= 0.0);
        match inside {
            true => (foot - p).norm(),
            false => to_segment(&a, &b)
                .min(to_segment(&b, &c))
                .min(to_segment(&c, &a)),
        }
    };
    mesh.faces.iter().map(to_face).fold(f64::INFINITY, f64::min)
}

fn scans() -> Vec<HoledScan> {
    let centre = Vec2::new(0.47, 0.52);
    let blob = HoleShape::Blob {
        centre,
        radius: 0.15,
    };
    let each =
        (0..3).flat_map(|k| [(k, &ROUND), (k, &blob)].map(|(k, hole)| holed(sheet(k), hole)));
    each.collect()
}

#[test]
fn most_of_the_new_cloth_lies_within_its_interval_of_the_truth() {
    let (mut within, mut all) = (0, 0);
    for cut in scans() {
        let done = mended(&packed(&cut.mesh, &[]), &Constraints::default()).unwrap();
        let file = PatchFile::of(&done.bytes);
        let (positions, deviations) = (file.floats("POSITION"), file.floats("_CONFIDENCE"));
        assert_eq!(positions.len(), 3 * deviations.len());
        for (p, deviation) in positions.chunks_exact(3).zip(&deviations) {
            if *deviation > 0.0 {
                let p = Vec3::new(p[0].into(), p[1].into(), p[2].into());
                all += 1;
                within += usize::from(distance(&p, &cut.lost) <= WITHIN_90 * f64::from(*deviation));
            }
        }
    }
    // The interval is for the place on the cloth; the cloth's surface is nearer.
    assert!(all > 300 && 10 * within > 8 * all, "{within} of {all}");
}

#[test]
fn every_vertex_of_a_patch_says_how_far_it_may_be_off() {
    let bytes = packed(&holed(sheet(1), &ROUND).mesh, &[]);
    let done = mended(&bytes, &Constraints::default()).unwrap();
    let report = done.report.holes[0].patch.clone().unwrap();
    let file = PatchFile::of(&done.bytes);
    let accessor = file.accessor("_CONFIDENCE").expect("the attribute");
    assert_eq!(accessor["type"], "SCALAR");
    assert_eq!(accessor["componentType"], 5126);
    let said = &file.primitive["extras"]["darn"]["confidence"];
    assert_eq!(said["attribute"], "_CONFIDENCE");

    let deviations = file.floats("_CONFIDENCE");
    assert_eq!(deviations.len(), report.vertices as usize);
    let mut new: Vec<f32> = deviations.iter().copied().filter(|d| *d > 0.0).collect();
    new.sort_by(f32::total_cmp);
    let rim = done.report.holes[0].vertices as usize;
    assert_eq!(deviations.len() - new.len(), rim, "only the rim is certain");
    let confidence = report
        .confidence
        .expect("the shipped weights are calibrated");
    let middle = f64::from(new[(0.5 * (new.len() - 1) as f64).round() as usize]);
    assert!((confidence.median - middle).abs() < 1e-9);
    assert!(confidence.p90 >= confidence.median);

    let session = ScanSession::open(
        read(&bytes),
        &Constraints::default(),
        Arc::clone(mender()),
        Budget::unlimited(),
    );
    let described = session.unwrap().described();
    // The file has the vertices in the order of its triangles.
    let sorted = |mut all: Vec<f32>| {
        all.sort_by(f32::total_cmp);
        all
    };
    let told = described.holes[0].patch_deviations.clone();
    assert!(sorted(told) == sorted(deviations));
}

#[test]
fn a_hole_without_a_chart_says_nothing_of_its_confidence() {
    // The ends of a tube have no chart.
    let both_ends = Constraints {
        fill: Some(Fill::Openings),
        ..Constraints::default()
    };
    let sleeve = tube(24, |_, v| v < 0.5);
    let done = mended(&packed(&sleeve, &[]), &both_ends).unwrap();
    let patch = done.report.holes[0].patch.clone().unwrap();
    assert_eq!((patch.method.as_str(), patch.confidence), ("fair", None));
    assert!(PatchFile::of(&done.bytes).accessor("_CONFIDENCE").is_none());
}
