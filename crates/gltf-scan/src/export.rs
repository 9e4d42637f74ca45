//! Meshes of our own as a fresh GLB: for each one node, one mesh, one primitive; one material. For sheets, patches alone, examples and tests.

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
    meshes(std::slice::from_ref(mesh))
}

/// Several meshes as GLB bytes: each a node and a mesh of its own, all of one material.
///
/// # Errors
/// [`ScanError::Addition`] when the file would pass the 4 GiB that a GLB can hold.
pub fn meshes(meshes: &[Fresh]) -> Result<Vec<u8>, ScanError> {
    let mut store = Store::default();
    let primitives: Vec<Value> = meshes.iter().map(|mesh| store.primitive(mesh)).collect();
    let named = meshes.iter().zip(primitives);
    let each = |k: usize| json!({"mesh": k, "name": meshes[k].name});
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("darn ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": (0..meshes.len()).collect::<Vec<_>>()}],
        "nodes": (0..meshes.len()).map(each).collect::<Vec<_>>(),
        "meshes": named.map(|(m, p)| json!({"name": m.name, "primitives": [p]})).collect::<Vec<_>>(),
        "materials": [{
            "name": "cloth",
            "doubleSided": true,
            "pbrMetallicRoughness": {"baseColorFactor": [0.72, 0.6, 0.42, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
        }],
        "accessors": store.accessors,
        "bufferViews": store.views,
        "buffers": [{"byteLength": store.bin.len()}],
    });
    pack_glb(document.to_string().as_bytes(), Some(&store.bin), &[]).ok_or_else(|| {
        ScanError::Addition {
            addition: 0,
            detail: "the file would pass 4 GiB".into(),
        }
    })
}

/// The binary chunk and what describes it.
#[derive(Default)]
struct Store {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Store {
    fn primitive(&mut self, mesh: &Fresh) -> Value {
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let along = |d: usize| mesh.positions.iter().map(move |p| p[d]);
            (0..3)
                .map(|d| along(d).reduce(pick).unwrap_or(0.0))
                .collect()
        };
        let (low, high) = (bound(f32::min), bound(f32::max));
        let position = self.push(
            bytes_of(mesh.positions),
            34962,
            json!({"componentType": 5126, "type": "VEC3", "count": mesh.positions.len(), "min": low, "max": high}),
        );
        let normal = self.push(
            bytes_of(mesh.normals),
            34962,
            json!({"componentType": 5126, "type": "VEC3", "count": mesh.normals.len()}),
        );
        let mut attributes = json!({"POSITION": position, "NORMAL": normal});
        if !mesh.texcoords.is_empty() {
            let texcoord =
                json!({"componentType": 5126, "type": "VEC2", "count": mesh.texcoords.len()});
            attributes["TEXCOORD_0"] = self.push(bytes_of(mesh.texcoords), 34962, texcoord).into();
        }
        let indices = self.push(
            mesh.faces
                .iter()
                .flatten()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
            34963,
            json!({"componentType": 5125, "type": "SCALAR", "count": 3 * mesh.faces.len()}),
        );
        json!({"attributes": attributes, "indices": indices, "material": 0})
    }

    /// Appends bytes with a view of them and an accessor; the accessor's index.
    fn push(&mut self, bytes: Vec<u8>, target: u32, mut accessor: Value) -> usize {
        self.views.push(
            json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len(), "target": target}),
        );
        self.bin.extend_from_slice(&bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        accessor["bufferView"] = (self.views.len() - 1).into();
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn bytes_of<const N: usize>(rows: &[[f32; N]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Scan, ScanLimits};
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
        let scan = Scan::read(&glb(&fresh).unwrap(), &ScanLimits::default()).unwrap();
        assert_eq!(scan.surface.faces, [[0, 1, 2]]);
        assert_eq!(
            scan.surface.positions[2],
            darn_geometry::mesh::Vec3::new(0.0, 2.0, 0.5)
        );
        assert_eq!(*scan.parts[0].texcoords[0], fresh.texcoords[..]);
        assert_eq!(scan.mesh_name(0), Some("scarf"));
    }

    #[test]
    fn several_meshes_keep_their_names_and_order() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]];
        let fresh = |name| Fresh {
            name,
            positions: &positions,
            normals: &[[0.0, 0.0, 1.0]; 3],
            texcoords: &[],
            faces: &[[0, 1, 2]],
        };
        let bytes = meshes(&[fresh("one"), fresh("two")]).unwrap();
        let scan = Scan::read(&bytes, &ScanLimits::default()).unwrap();
        assert_eq!(scan.surface.faces.len(), 2);
        assert_eq!(scan.mesh_name(1), Some("two"));
    }
}
