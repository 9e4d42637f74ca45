//! The seam to the heavy part: what the service asks of it, and how its refusals reach a caller.
//!
//! The service knows no scan, mesh or network; it is given something that mends and hands its errors on by class.

use crate::contract::{Constraints, FieldError, v1};

/// A mended scan and what was done to it.
#[derive(Debug, Clone)]
pub struct Mended {
    /// The glTF, in the container of the input.
    pub bytes: Vec<u8>,
    /// What was done.
    pub report: v1::Report,
}

/// What mends. Called from many worker threads at once; every call blocks until it is done.
pub trait Menders: Send + Sync + 'static {
    /// Fills the holes asked for.
    ///
    /// # Errors
    /// Why not.
    fn inpaint(&self, scan: &[u8], constraints: &Constraints) -> Result<Mended, Refusal>;

    /// Every boundary loop of a scan.
    ///
    /// # Errors
    /// Why not.
    fn find_holes(&self, scan: &[u8]) -> Result<v1::HolesReport, Refusal>;

    /// One small mend, whole and real; the service is ready when it has succeeded.
    ///
    /// # Errors
    /// Why the service can never be ready.
    fn warm_up(&self) -> Result<(), Refusal>;
}

/// Why a scan was not mended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{code}: {detail}")]
pub struct Refusal {
    /// Whose fault it is, and of which kind.
    pub class: Class,
    /// Stable word for programs, such as `not_a_disk`.
    pub code: &'static str,
    /// What, where and which limit, for a person. Never shown to a caller when the class is `Internal`.
    pub detail: String,
    /// The constraints it is about, if it is about constraints.
    pub fields: Vec<FieldError>,
}

/// Kinds of refusals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// The bytes are not a scan: truncated, not glTF, not JSON.
    Malformed,
    /// A limit of the service is exceeded by what the bytes decode to.
    TooLarge,
    /// A scan, but not one that can be mended as asked: geometry, extensions, constraints.
    Unprocessable,
    /// Our own fault.
    Internal,
}
