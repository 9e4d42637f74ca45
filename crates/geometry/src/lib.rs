//! Triangle meshes, their flattening, and patches for their holes; small functions on plain arrays, in f64 and scene
//! units.
//!
//! [`mesh`] welds triangles, finds boundary loops and grows regions; [`flatten`] lays a region flat (ARAP); [`grid`]
//! is a chart sampled on 64×64 cells, [`smooth`] fills such grids smoothly; [`misfit`] finds cloth at a rim
//! that fits no chart; [`patch`] makes a mesh of a filled grid that fits the hole's rim. This crate depends on no other crate of the workspace: it knows no glTF, no network and
//! no HTTP. `examples/flatten_a_sheet.rs` shows the first steps.

mod cholesky;
pub mod flatten;
pub mod grid;
pub mod mesh;
pub mod misfit;
pub mod patch;
pub mod polygon;
pub mod smooth;
