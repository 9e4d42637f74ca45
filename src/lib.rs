//! darn mends holes in scanned fabric: a glTF scan goes in, the same scan with its holes filled by plausible cloth comes out.
//!
//! The way of the data: [`scan`] → [`mesh`] → [`flatten`] → [`grid`] → [`net`] → [`patch`] → [`scan`]; [`mend`] walks it,
//! [`serve`] offers it over HTTP and gRPC. [`scarffolds`] and [`train`] make the weights.

// Allowed in `net/engine/simd.rs` alone, where each block says why it is sound.
#![deny(unsafe_code)]

mod cholesky;
pub mod contract;
pub mod edit;
pub mod evaluate;
pub mod flatten;
pub mod grid;
pub mod mend;
pub mod mesh;
pub mod net;
pub mod patch;
mod plain;
pub mod render;
pub mod scan;
pub mod scarffolds;
pub mod serve;
pub mod smooth;
pub mod train;
