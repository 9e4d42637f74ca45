//! Triangle meshes, their flattening, and patches for their holes; small functions on plain arrays, in f64 and scene units.
//!
//! [`mesh`] welds triangles, finds boundary loops and grows regions; [`flatten`] lays a region flat (ARAP); [`grid`] is the chart sampled on
//! 64×64 cells, [`smooth`] its smooth fills; [`patch`] meshes a filled grid into the hole's rim. This crate knows no glTF, no network and no
//! HTTP, and none of the other crates.

mod cholesky;
pub mod flatten;
pub mod grid;
pub mod mesh;
pub mod patch;
pub mod polygon;
pub mod smooth;
