//! Reads glTF scans as one list of triangles, and writes them back with patches appended and nothing else changed.
//!
//! This is the only crate that knows glTF. A scan is a GLB; glTF JSON, with its buffers as data URIs or as files that the
//! caller gives with it; a zip with one of these and its files; or a mesh as OBJ or PLY. A glTF's geometry may be
//! plain, quantized (`KHR_mesh_quantization`) or compressed (`KHR_draco_mesh_compression`, `EXT_meshopt_compression`,
//! `KHR_meshopt_compression`); patches are plain floats. The crate opens no file and no URL, and checks every count
//! against the bytes behind it before it allocates. It does not weld vertices and does not look for holes.
//!
//! Skinned meshes are read in their bind pose: at their stored positions, without their node's transform. A patch on a
//! skinned mesh takes the joints and weights of the scan's nearest vertices. Morph targets are read at weight 0, even
//! those that the file turns on ([`Scan::posed_by_morph_targets`] reports that); a patch gets as many targets as its
//! mesh has, without displacement.

mod accessor;
mod append;
mod attributes;
mod buffers;
mod checked_patch;
mod cloth_look;
mod compressed;
#[cfg(test)]
mod compressed_tests;
mod container;
mod content;
mod cut;
mod digests;
mod error;
pub mod export;
mod files;
#[cfg(test)]
mod files_tests;
mod hatch;
mod images;
mod json;
mod json_edit;
mod left_out;
mod limits;
mod mesh_file;
mod pack;
mod patch_appearance;
mod patch_buffer;
mod patch_group;
#[cfg(test)]
mod patch_group_tests;
mod patch_images;
mod patch_materials;
mod patch_primitive;
mod patch_skin;
mod primitive;
mod read;
#[cfg(test)]
mod read_tests;
#[cfg(test)]
mod refusal_tests;
mod scan;
mod scan_reader;
mod scene;
mod skin;
mod strip;
#[cfg(test)]
mod strip_tests;
#[cfg(test)]
pub(crate) mod testing;
mod texture_slots;
mod triangles;
mod undo;
mod unmarked;
mod variants;
#[cfg(test)]
mod variants_tests;
mod write;
#[cfg(test)]
mod write_tests;
mod xmp;
#[cfg(test)]
mod xmp_tests;
mod zip_files;
mod zip_undo;

pub use cloth_look::{ClothLook, LookLayer, NoLook, TexturePlaces, TextureSource, TextureWrap};
pub use container::Container;
pub use content::SceneContent;
pub use darn_mesh_files::MeshFileError;
pub use digests::FileDigests;
pub use error::ScanError;
pub use files::{Siblings, material_image_paths, material_library_paths, sibling_paths};
pub use images::{DecodedImage, ImageError};
pub use left_out::NamedPlace;
pub use limits::ScanLimits;
pub use pack::repacked;
pub use patch_appearance::{OwnTexture, PatchAppearance};
pub use patch_buffer::{NewFile, PatchBuffer};
pub use patch_primitive::{PatchPoint, PatchPrimitive};
pub use scan::{Scan, ScanPart};
pub use strip::{Stripped, stripped};
pub use texture_slots::TextureKind;
pub use unmarked::Marks;
pub use write::WrittenScan;
