//! The contract: the types generated from `proto/` and the one check of what a request asks, used by both doors.
//! May use: prost, pbjson, serde. Lives here: messages, their JSON, their validation.
//! May not live here: HTTP, gRPC servers, geometry, anything that knows what a scan is.

mod error_chain;
mod json;
pub mod port;
mod validate;

pub use error_chain::error_chain;
pub use json::{JsonError, from_json};
pub use validate::{Anchor, Constraints, Edit, FieldError, Gesture, HoleSelector, Search};

/// The messages and the gRPC service of `proto/darn/v1/darn.proto`, as generated.
#[allow(missing_docs, clippy::all, clippy::pedantic, rustdoc::all)]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/darn.v1.rs"));
    include!(concat!(env!("OUT_DIR"), "/darn.v1.serde.rs"));

    /// The encoded `FileDescriptorSet` these types were generated from, comments included.
    pub const DESCRIPTORS: &[u8] =
        include_bytes!(concat!(env!("OUT_DIR"), "/darn.descriptors.bin"));
}
