//! From glTF to glTF with the shipped weights, on cloth that darn's own generator simulated.

mod alternatives;
mod bodies;
mod borders;
mod cloth;
mod colours;
mod compressed;
mod confidence;
mod cuts;
mod editing;
#[path = "../../crates/gltf-scan/src/compressed/encoded.rs"]
mod encoded;
mod files;
mod fixtures;
mod image_formats;
mod laws;
mod mesh_files;
mod patched;
mod ragged;
mod requests;
mod rims;
mod stripped;
mod tubes;
