//! The port: the trait through which a service asks for mends, and how refusals reach a caller.
//!
//! The service knows no scan, mesh or network. It is given a [`Mender`] and hands its refusals on by class.

use std::fmt;

use crate::{Constraints, FieldError, Search, v1};

/// A mended scan and what was done to it.
#[derive(Debug, Clone)]
pub struct Mended {
    /// The glTF, in the container of the input.
    pub bytes: Vec<u8>,
    /// What was done.
    pub report: v1::Report,
}

/// The caller's cancellation check: whether the answer is still waited for. Cheap, and may be asked from any thread. Whoever mends asks it
/// before each hole and each step of a search, and gives up with any refusal when the call was cancelled.
#[derive(Clone, Copy)]
pub struct Cancellation<'a> {
    cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> Cancellation<'a> {
    /// A call that is never cancelled.
    pub const NEVER: Cancellation<'static> = Cancellation {
        cancelled: &|| false,
    };

    /// A call that is cancelled once `cancelled` says so.
    pub fn new(cancelled: &'a (dyn Fn() -> bool + Sync)) -> Cancellation<'a> {
        Cancellation { cancelled }
    }

    /// Whether nobody waits for the answer any more.
    pub fn is_cancelled(&self) -> bool {
        (self.cancelled)()
    }
}

impl fmt::Debug for Cancellation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Cancellation")
            .field(&self.is_cancelled())
            .finish()
    }
}

/// Mends scans. Called from many worker threads at once; every call blocks until it is done.
pub trait Mender: Send + Sync + 'static {
    /// Fills the holes asked for.
    ///
    /// # Errors
    /// Why not.
    fn inpaint(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal>;

    /// Searches where on a hole's grid a point in space belongs.
    ///
    /// # Errors
    /// Why not.
    fn optimize_anchor(
        &self,
        scan: &[u8],
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal>;

    /// The same, and the hole mended with the anchor it found.
    ///
    /// # Errors
    /// Why not.
    fn mend_to_target(
        &self,
        scan: &[u8],
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal>;

    /// Keeps a scan, its holes laid flat, so that constraints alone can be sent from then on. The constraints choose holes and weights.
    ///
    /// # Errors
    /// Why not.
    fn open(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal>;

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

/// A scan that is kept for editing. Called from worker threads, from one at a time (but for `bytes`, once, before the first
/// call); dropped on any thread that may block.
pub trait EditSession: Send + Sync + 'static {
    /// What it is, for who opened it; `id` and `idle_seconds` are the service's to fill in.
    fn described(&self) -> v1::Session;

    /// Bytes of memory it holds, about; asked again after every call, since it may grow.
    fn bytes(&self) -> usize;

    /// The patches alone for other anchors and edits. The constraints carry no holes, weights or `up`: those are the ones the
    /// session was opened with.
    ///
    /// # Errors
    /// Why not.
    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        cancellation: Cancellation<'_>,
    ) -> Result<Patches, Refusal>;

    /// The whole scan with the same constraints: the bytes that the stateless call would answer.
    ///
    /// # Errors
    /// Why not.
    fn mended(
        &self,
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal>;

    /// Searches where on a hole's grid a point in space belongs.
    ///
    /// # Errors
    /// Why not.
    fn optimize_anchor(
        &self,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal>;
}

/// How patches are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PatchForm {
    /// As a GLB of their own.
    Glb,
    /// Patch after patch, in order of hole id: the positions of all its vertices, `x, y, z` as little-endian f32, in the order of
    /// [`v1::SessionHole::patch_uvs`].
    Positions,
}

/// Patches without their scan.
#[derive(Debug, Clone)]
pub struct Patches {
    /// In the form asked for.
    pub bytes: Vec<u8>,
    /// What was done.
    pub report: v1::Report,
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
