//! What darn's parts and callers agree on: the messages generated from `proto/`, the check of a request's constraints and queries,
//! the table of error codes, and the [`port`] through which the service asks for mends.
//!
//! It knows no HTTP and no gRPC, no geometry, and nothing that reads a scan.

pub mod codes;
mod error_chain;
mod json;
mod message;
mod outcome;
pub mod port;
mod validate;

pub use codes::{Code, GrpcCode};
pub use darn_json::{EXCERPT_BYTES, cut, excerpt};
pub use error_chain::error_chain;
pub use json::{JsonError, from_json};
pub use outcome::Outcome;
pub use validate::{
    Anchor, Border, Constraints, Cut, Diameters, Edit, FieldError, Fill, Gesture, HoleSelector,
    LAST_ALTERNATIVE, PatchBuffer, Search, TextureChoice, TornEdge,
};

/// The messages of `proto/darn/v1/darn.proto`, as generated.
#[allow(missing_docs, clippy::all, clippy::pedantic, rustdoc::all)]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/darn.v1.rs"));
    include!(concat!(env!("OUT_DIR"), "/darn.v1.serde.rs"));

    /// The encoded `FileDescriptorSet` these types were generated from, comments included.
    pub const DESCRIPTORS: &[u8] =
        include_bytes!(concat!(env!("OUT_DIR"), "/darn.descriptors.bin"));
}
