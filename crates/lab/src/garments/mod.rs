//! Garments whose truth is known: flat panels, sewn, draped over simple bodies, and holes cut into them.
//!
//! The order of use: a `pattern` draws the panels of a [`GarmentKind`], `sewing` triangulates and joins them, `drape` moves the sewn mesh
//! over a body of capsules by the solver in `cloth`, [`holes`] cuts holes, and [`set`] does all this for a set and keeps it in a folder.
//! Everything follows from a seed. Lengths are metres and z is up; +y is up in files. This module knows no network and no mender.
//!
//! The sheets of [`scarffolds`](crate::scarffolds) are 51×51 lattices for training samples; a garment is an irregular mesh with seams,
//! openings and tubes, so its solver works on any triangle mesh.

mod body;
mod cloth;
mod contacts;
mod drape;
pub mod error;
mod flatness;
mod garment;
pub mod holes;
mod panel;
mod pattern;
mod patterns;
pub mod set;
mod sewing;

#[cfg(test)]
mod tests;

pub use error::GarmentError;
pub use flatness::FlatnessBand;
pub use garment::{Garment, GarmentKind, Opening, make};
