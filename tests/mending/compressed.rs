//! Compressed and quantized scans get the patches of their plain twins.

use std::collections::BTreeMap;

use base64::{Engine as _, prelude::BASE64_STANDARD};
use darn_contract::Constraints;
use darn_geometry::mesh::TriMesh;
use darn_geometry::mesh::curvature::vertex_normals;
use darn_lab::scarffolds::holed_scan::holed_scan;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::cloth::{MendedScan, ROUND, holed, mended, packed, read, sheet};
use super::encoded::{Coding, PlainMesh};

/// A mesh with the normals that a scan would have, its texture seen from above.
fn plain(mesh: &TriMesh) -> PlainMesh {
    let flat = |p: &[f32; 3]| [0.5 + 0.3 * p[0], 0.5 + 0.3 * p[1]].map(|x| x.clamp(0.0, 1.0));
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.cast().into()).collect();
    PlainMesh {
        texcoords: positions.iter().map(flat).collect(),
        positions,
        normals: (vertex_normals(mesh).iter().map(|n| n.cast().into())).collect(),
        faces: mesh.faces.clone(),
    }
}

#[test]
fn a_compressed_scan_gets_the_patch_of_its_decoded_twin() {
    let scan = plain(&holed(sheet(0), &ROUND).mesh);
    for coding in Coding::ALL {
        let bytes = scan.encode(coding);
        let twin = packed(&read(&bytes).surface, &[]);
        let patch = |bytes: &[u8]| {
            let mended = mended(bytes, &Constraints::default()).unwrap();
            MendedScan::of(&mended.bytes).new_positions()
        };
        let (patch, twin) = (patch(&bytes), patch(&twin));
        assert!(!twin.is_empty() && patch.len() == twin.len(), "{coding:?}");
        let apart = patch.iter().zip(&twin).map(|(a, b)| (a - b).norm());
        let apart = apart.fold(0.0, f64::max);
        // The twin's positions are rounded to f32 in the scene, the scan's are integers in their node's space.
        let tolerance = scan.tolerance(coding).max(1e-7);
        assert!(apart <= tolerance, "{coding:?}: {apart} > {tolerance}");
    }
}

/// The tests of the editor open the scans of this file. `DARN_BLESS=1` writes it anew.
#[test]
fn the_fixtures_of_the_editor_are_what_this_code_makes() {
    let small = holed_scan(sheet(0), 24, &ROUND, &mut ChaCha8Rng::seed_from_u64(5));
    let scan = plain(&small.mesh);
    let made: BTreeMap<String, String> = (Coding::ALL.into_iter())
        .map(|coding| {
            let bytes = scan.encode(coding);
            (format!("{coding:?}"), BASE64_STANDARD.encode(bytes))
        })
        .collect();
    let made = serde_json::to_string_pretty(&made).expect("texts") + "\n";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("web/tests/compressed.json");
    if std::env::var_os("DARN_BLESS").is_some() {
        std::fs::write(&path, &made).expect("the fixture is written");
    }
    assert!(std::fs::read_to_string(&path).expect("the fixture") == made);
}
