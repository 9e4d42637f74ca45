//! Reads glTF scans as one list of triangles, and writes them back with patches appended and nothing else changed.
//!
//! This is the only crate that knows glTF. A scan is a GLB, or glTF JSON with its buffers as data URIs. The crate opens
//! no file and no URL, and checks every count against the bytes behind it before it allocates. It does not weld
//! vertices and does not look for holes.
//!
//! Skinned meshes are read in their bind pose: at their stored positions, without their node's transform. A patch on a
//! skinned mesh takes the joints and weights of the scan's nearest vertices. Morph targets are read at weight 0, even
//! those that the file turns on ([`Scan::posed_by_morph_targets`] reports that); a patch gets as many targets as its
//! mesh has, without displacement.

mod accessor;
mod append;
mod attributes;
mod buffers;
mod container;
mod cut;
mod error;
pub mod export;
mod json;
mod json_edit;
mod left_out;
mod limits;
mod patch_primitive;
mod patch_skin;
mod read;
#[cfg(test)]
mod read_tests;
mod scan;
mod scene;
mod skin;
#[cfg(test)]
pub(crate) mod testing;
mod triangles;
mod write;
#[cfg(test)]
mod write_tests;

pub use container::Container;
pub use error::ScanError;
pub use left_out::NamedPlace;
pub use limits::ScanLimits;
pub use patch_primitive::{PatchPoint, PatchPrimitive};
pub use scan::{Scan, ScanPart};
