//! A mesh of our own as a fresh GLB: one node, one mesh, one primitive, one material. For sheets, examples and tests.

use serde_json::{Value, json};

use super::ScanError;
use super::container::pack_glb;

/// A mesh to write; all lists but `faces` and `texcoords` (which may be empty) are one entry per vertex.
#[derive(Debug, Clone, Copy)]
pub struct Fresh<'a> {
    /// Name of mesh and node.
    pub name: &'a str,
    /// Positions.
    pub positions: &'a [[f32; 3]],
    /// Unit normals.
    pub normals: &'a [[f32; 3]],
    /// TEXCOORD_0, or none.
    pub texcoords: &'a [[f32; 2]],
    /// Triangles.
    pub faces: &'a [[u32; 3]],
}

/// The mesh as GLB bytes.
///
/// # Errors
/// [`ScanError::Addition`] when the file would pass the 4 GiB that a GLB can hold.
pub fn glb(mesh: &Fresh) -> Result<Vec<u8>, ScanError> {
    let mut bin = Vec::new();
    let mut views = Vec::new();
    let mut accessors = Vec::new();
    let mut push = |bytes: Vec<u8>, target: u32, mut accessor: Value| -> usize {
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len(), "target": target}));
        bin.extend_from_slice(&bytes);
        bin.resize(bin.len().next_multiple_of(4), 0);
        accessor["bufferView"] = (views.len() - 1).into();
        accessors.push(accessor);
        accessors.len() - 1
    };
    let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
        (0..3)
            .map(|d| {
                mesh.positions
                    .iter()
                    .map(|p| p[d])
                    .reduce(pick)
                    .unwrap_or(0.0)
            })
            .collect()
    };
    let (low, high) = (bound(f32::min), bound(f32::max));
    let position = push(
        bytes_of(mesh.positions),
        34962,
        json!({"componentType": 5126, "type": "VEC3", "count": mesh.positions.len(), "min": low, "max": high}),
    );
    let normal = push(
        bytes_of(mesh.normals),
        34962,
        json!({"componentType": 5126, "type": "VEC3", "count": mesh.normals.len()}),
    );
    let mut attributes = json!({"POSITION": position, "NORMAL": normal});
    if !mesh.texcoords.is_empty() {
        let texcoord =
            json!({"componentType": 5126, "type": "VEC2", "count": mesh.texcoords.len()});
        attributes["TEXCOORD_0"] = push(bytes_of(mesh.texcoords), 34962, texcoord).into();
    }
    let indices = push(
        mesh.faces
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect(),
        34963,
        json!({"componentType": 5125, "type": "SCALAR", "count": 3 * mesh.faces.len()}),
    );
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("darn ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": mesh.name}],
        "meshes": [{"name": mesh.name, "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{
            "name": "cloth",
            "doubleSided": true,
            "pbrMetallicRoughness": {"baseColorFactor": [0.72, 0.6, 0.42, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
        }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bin.len()}],
    });
    pack_glb(document.to_string().as_bytes(), Some(&bin), &[]).ok_or_else(|| ScanError::Addition {
        addition: 0,
        detail: "the file would pass 4 GiB".into(),
    })
}

fn bytes_of<const N: usize>(rows: &[[f32; N]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Limits, Scan};
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]];
        let fresh = Fresh {
            name: "scarf",
            positions: &positions,
            normals: &[[0.0, 0.0, 1.0]; 3],
            texcoords: &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            faces: &[[0, 1, 2]],
        };
        let scan = Scan::read(&glb(&fresh).unwrap(), &Limits::default()).unwrap();
        assert_eq!(scan.surface.faces, [[0, 1, 2]]);
        assert_eq!(
            scan.surface.positions[2],
            crate::mesh::Vec3::new(0.0, 2.0, 0.5)
        );
        assert_eq!(*scan.parts[0].texcoords[0], fresh.texcoords[..]);
        assert_eq!(scan.mesh_name(0), Some("scarf"));
    }
}
