//! Writes meshes that have no scan as a GLB: one node, mesh and primitive for each, one material for all that have no texture.
//! For simulated sheets, patches without their scan, examples and tests.

use serde_json::{Value, json};

use super::buffers::BufferTarget;
use super::container::{float_bytes, pack_glb};
use super::error::ScanError;
use super::patch_appearance::OwnTexture;
use super::patch_images::ImageSheet;
use super::texture_slots::TextureKind;

/// A mesh to write. `positions` and `normals` are `[vertices]`, `texcoords` too or empty.
#[derive(Debug, Clone, Copy)]
pub struct NewMesh<'a> {
    /// Name of mesh and node.
    pub name: &'a str,
    /// Positions.
    pub positions: &'a [[f32; 3]],
    /// Unit normals.
    pub normals: &'a [[f32; 3]],
    /// TEXCOORD_0; empty for none.
    pub texcoords: &'a [[f32; 2]],
    /// Triangles over the positions, counter-clockwise.
    pub faces: &'a [[u32; 3]],
}

/// One mesh as GLB bytes.
///
/// # Errors
/// [`ScanError::InvalidPatch`] when the file would exceed the 4 GiB of a GLB.
pub fn glb(mesh: &NewMesh) -> Result<Vec<u8>, ScanError> {
    meshes(std::slice::from_ref(mesh))
}

/// Several meshes as GLB bytes, each with its own node, all with one material.
///
/// # Errors
/// [`ScanError::InvalidPatch`] when the file would exceed the 4 GiB of a GLB.
pub fn meshes(meshes: &[NewMesh]) -> Result<Vec<u8>, ScanError> {
    let plain = meshes.iter().map(|mesh| ColouredMesh {
        mesh: *mesh,
        look: MeshLook::Cloth,
    });
    coloured_meshes(&plain.collect::<Vec<_>>())
}

/// A mesh to write, and its colour.
#[derive(Debug, Clone)]
pub struct ColouredMesh<'a> {
    /// The mesh.
    pub mesh: NewMesh<'a>,
    /// Its colour.
    pub look: MeshLook<'a>,
}

/// The colour of a mesh.
#[derive(Debug, Clone)]
pub enum MeshLook<'a> {
    /// The same as that of all others.
    Cloth,
    /// The base colour of images of its own, in which its texture coordinates lie.
    Images(&'a OwnTexture),
    /// The `pbrMetallicRoughness` of a material without images.
    Plain(Value),
}

/// Several meshes as [`meshes`] writes them, those with a colour of their own in a material of their own.
///
/// # Errors
/// [`ScanError::InvalidPatch`] when the file would exceed the 4 GiB of a GLB.
pub fn coloured_meshes(meshes: &[ColouredMesh]) -> Result<Vec<u8>, ScanError> {
    let mut buffer = BufferBuilder::default();
    let mut materials = vec![json!({
        "name": "cloth",
        "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorFactor": [0.72, 0.6, 0.42, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
    })];
    let (mut images, mut textures) = (Vec::new(), Vec::new());
    let mut primitives: Vec<Value> = Vec::new();
    for ColouredMesh { mesh, look } in meshes {
        let mut primitive = buffer.primitive(mesh);
        let pbr = match look {
            MeshLook::Cloth => None,
            MeshLook::Plain(pbr) => Some(pbr.clone()),
            MeshLook::Images(own) => match own.base_colour() {
                Some(layer) => {
                    let png = ImageSheet::of(&[own]).png(layer, TextureKind::BaseColour)?;
                    let view = buffer.view(&png, None);
                    images.push(json!({"bufferView": view, "mimeType": "image/png"}));
                    textures.push(json!({"source": images.len() - 1}));
                    Some(json!({
                        "baseColorTexture": {"index": textures.len() - 1},
                        "metallicFactor": 0.0,
                        "roughnessFactor": 0.9,
                    }))
                }
                None => None,
            },
        };
        if let Some(pbr) = pbr {
            primitive["material"] = materials.len().into();
            materials.push(json!({
                "name": "darn reconstruction",
                "doubleSided": true,
                "pbrMetallicRoughness": pbr,
            }));
        }
        primitives.push(primitive);
    }
    let names = || meshes.iter().map(|it| it.mesh.name);
    let named = names().zip(primitives);
    let nodes = names()
        .enumerate()
        .map(|(k, name)| json!({"mesh": k, "name": name}));
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("darn ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": (0..meshes.len()).collect::<Vec<_>>()}],
        "nodes": nodes.collect::<Vec<_>>(),
        "meshes": named.map(|(name, p)| json!({"name": name, "primitives": [p]})).collect::<Vec<_>>(),
        "materials": materials,
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.bin.len()}],
    });
    if !images.is_empty() {
        document["textures"] = textures.into();
        document["images"] = images.into();
    }
    pack_glb(document.to_string().as_bytes(), Some(&buffer.bin), &[]).ok_or_else(|| {
        ScanError::InvalidPatch {
            patch: 0,
            detail: "the file would pass 4 GiB".into(),
        }
    })
}

/// The BIN chunk, its buffer views and its accessors.
#[derive(Default)]
struct BufferBuilder {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl BufferBuilder {
    fn primitive(&mut self, mesh: &NewMesh) -> Value {
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let along = |d: usize| mesh.positions.iter().map(move |p| p[d]);
            (0..3)
                .map(|d| along(d).reduce(pick).unwrap_or(0.0))
                .collect()
        };
        let (low, high) = (bound(f32::min), bound(f32::max));
        let position = self.push(
            float_bytes(mesh.positions),
            BufferTarget::Vertices,
            json!({"componentType": 5126, "type": "VEC3", "count": mesh.positions.len(), "min": low, "max": high}),
        );
        let normal = self.push(
            float_bytes(mesh.normals),
            BufferTarget::Vertices,
            json!({"componentType": 5126, "type": "VEC3", "count": mesh.normals.len()}),
        );
        let mut attributes = json!({"POSITION": position, "NORMAL": normal});
        if !mesh.texcoords.is_empty() {
            let texcoord =
                json!({"componentType": 5126, "type": "VEC2", "count": mesh.texcoords.len()});
            attributes["TEXCOORD_0"] = self
                .push(
                    float_bytes(mesh.texcoords),
                    BufferTarget::Vertices,
                    texcoord,
                )
                .into();
        }
        let indices = self.push(
            mesh.faces
                .iter()
                .flatten()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
            BufferTarget::Indices,
            json!({"componentType": 5125, "type": "SCALAR", "count": 3 * mesh.faces.len()}),
        );
        json!({"attributes": attributes, "indices": indices, "material": 0})
    }

    /// Appends bytes with a buffer view and an accessor of their own; returns the accessor's index.
    fn push(&mut self, bytes: Vec<u8>, target: BufferTarget, mut accessor: Value) -> usize {
        accessor["bufferView"] = self.view(&bytes, Some(target)).into();
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends bytes with a buffer view of their own; returns the view's index.
    fn view(&mut self, bytes: &[u8], target: Option<BufferTarget>) -> usize {
        let mut view =
            json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = json!(target as u32);
        }
        self.views.push(view);
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Scan, ScanLimits};
    use super::*;

    #[test]
    fn a_written_mesh_reads_back() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]];
        let mesh = NewMesh {
            name: "scarf",
            positions: &positions,
            normals: &[[0.0, 0.0, 1.0]; 3],
            texcoords: &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            faces: &[[0, 1, 2]],
        };
        let scan = Scan::read(glb(&mesh).unwrap(), &ScanLimits::default()).unwrap();
        assert_eq!(scan.surface.faces, [[0, 1, 2]]);
        assert_eq!(
            scan.surface.positions[2],
            darn_geometry::mesh::Vec3::new(0.0, 2.0, 0.5)
        );
        assert_eq!(*scan.parts[0].texcoords[0], mesh.texcoords[..]);
        assert_eq!(scan.mesh_name(0), Some("scarf"));
    }

    #[test]
    fn several_meshes_keep_their_names_and_order() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]];
        let mesh = |name| NewMesh {
            name,
            positions: &positions,
            normals: &[[0.0, 0.0, 1.0]; 3],
            texcoords: &[],
            faces: &[[0, 1, 2]],
        };
        let bytes = meshes(&[mesh("one"), mesh("two")]).unwrap();
        let scan = Scan::read(bytes, &ScanLimits::default()).unwrap();
        assert_eq!(scan.surface.faces.len(), 2);
        assert_eq!(scan.mesh_name(1), Some("two"));
    }
}
