//! The ScarfFolds generator: cloth simulation, files of sheets, hole masks, training samples and scans with holes.
//!
//! Everything is drawn from an explicit seed. The order of use: [`sheets::make`] simulates one [`sheets::SimulatedSheet`] at rest
//! (a [`scene`] moved by an XPBD solver), [`samples::Sampler`] cuts training samples from sheets, and [`holed_scan::holed_scan`] meshes a
//! sheet like a scan. This module knows no network, no loss and no training loop.

pub(crate) mod contacts;
pub mod error;
pub mod export;
pub mod fabric;
mod field;
mod files;
pub mod holed_scan;
pub mod lattice;
pub mod manifest;
pub mod masks;
pub mod obstacle;
pub mod samples;
pub mod scene;
mod sheet;
pub mod sheets;
mod solver;
mod spline;
