//! Compressed and quantized scans get the patches of their plain twins.

use darn_contract::Constraints;
use darn_geometry::mesh::curvature::vertex_normals;

use super::cloth::{MendedScan, ROUND, holed, mended, packed, read, sheet};
use super::encoded::{Coding, PlainMesh};

#[test]
fn a_compressed_scan_gets_the_patch_of_its_decoded_twin() {
    let mesh = holed(sheet(0), &ROUND).mesh;
    let positions = mesh.positions.iter();
    let flat = |p: &[f32; 3]| [0.5 + 0.3 * p[0], 0.5 + 0.3 * p[1]].map(|x| x.clamp(0.0, 1.0));
    let positions: Vec<[f32; 3]> = positions.map(|p| p.cast().into()).collect();
    let scan = PlainMesh {
        texcoords: positions.iter().map(flat).collect(),
        positions,
        normals: (vertex_normals(&mesh).iter().map(|n| n.cast().into())).collect(),
        faces: mesh.faces,
    };
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
