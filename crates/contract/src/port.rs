//! The port: the traits through which the service asks for mends, and the refusals it hands on to callers.
//!
//! The service knows no scan, mesh or network: it is given a [`Mender`].

use bytes::Bytes;
use darn_budget::Budget;

use crate::{Code, Constraints, FieldError, Outcome, Search, codes, v1};

/// What is wanted beside a scan's boundary loops.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HolesQuery {
    /// What a mesher has probably sealed.
    pub suspects: bool,
}

/// A mended scan and its report.
#[derive(Debug, Clone)]
pub struct Mended {
    /// The glTF, in the container of the input: GLB, JSON, or a zip with its files.
    pub bytes: Vec<u8>,
    /// The media type of that container.
    pub media_type: &'static str,
    /// What was done.
    pub report: v1::Report,
    /// A file that the glTF refers to anew, if it is neither in the glTF nor in its zip: of a scan whose files were read beside it.
    pub file: Option<NewFile>,
}

/// A file that a mended glTF refers to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewFile {
    /// Its path relative to the glTF.
    pub path: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

/// A scan without what darn put in, and the report.
#[derive(Debug, Clone)]
pub struct Stripped {
    /// The glTF, in the container of the input or the form asked for.
    pub bytes: Vec<u8>,
    /// The media type of that container.
    pub media_type: &'static str,
    /// What was taken out.
    pub report: v1::StripReport,
}

/// Mends scans. Called from many worker threads at once; every call blocks until it is done, or until its budget is exhausted: a mender
/// asks it in every loop whose length the input decides, and after a cancellation it returns any refusal, which nobody reads. `scan` holds the bytes of a GLB, or of a
/// glTF JSON with data URIs, or of a zip with a glTF and its files; they are shared with the request, not copied.
pub trait Mender: Send + Sync + 'static {
    /// Fills the selected holes.
    ///
    /// # Errors
    /// The scan is not readable or not mendable, or the constraints do not fit it.
    fn inpaint(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal>;

    /// A mended scan in another form. Only scans that came as a zip have one.
    ///
    /// # Errors
    /// `Exhausted`; a file is missing that a GLB must hold.
    fn repacked(
        &self,
        mended: Mended,
        _form: ScanForm,
        _budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        Ok(mended)
    }

    /// Takes everything out of a scan that a mend put in.
    ///
    /// # Errors
    /// The scan is not readable, or has nothing to take out; `Exhausted`.
    fn strip(&self, scan: Bytes, form: ScanForm, budget: &Budget<'_>) -> Result<Stripped, Refusal>;

    /// Searches the uv of a hole's grid at which an anchor takes the cloth closest to a point in scene space.
    ///
    /// # Errors
    /// As [`Mender::inpaint`], for the search.
    fn optimize_anchor(
        &self,
        scan: Bytes,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal>;

    /// The same search, then mends the hole with the anchor found.
    ///
    /// # Errors
    /// As [`Mender::optimize_anchor`].
    fn mend_to_target(
        &self,
        scan: Bytes,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal>;

    /// Reads a scan and flattens its holes once, so that later calls need constraints alone. `constraints` select holes and weights.
    ///
    /// # Errors
    /// As [`Mender::inpaint`].
    fn open(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal>;

    /// Every boundary loop of a scan, and what else is wanted.
    ///
    /// # Errors
    /// The scan is not readable.
    fn find_holes(
        &self,
        scan: Bytes,
        wanted: HolesQuery,
        budget: &Budget<'_>,
    ) -> Result<v1::HolesReport, Refusal>;

    /// The weights that it has loaded, those of requests that name none first.
    fn weights(&self) -> Vec<v1::Weights>;

    /// Mends one small scan completely. The service is ready once it has succeeded.
    ///
    /// # Errors
    /// Any refusal: the service can never be ready.
    fn warm_up(&self) -> Result<(), Refusal>;
}

/// A scan kept for editing. Its calls come from worker threads, one at a time (`bytes` is also called once before the first of them);
/// it is dropped on a thread that may block.
pub trait EditSession: Send + Sync + 'static {
    /// The session as its opener sees it; the service fills in `id` and `idle_seconds`.
    fn described(&self) -> v1::Session;

    /// How its holes were filled when it was opened.
    fn outcome(&self) -> Outcome;

    /// Memory held, in bytes, estimated. Read again after every call, since it may grow.
    fn bytes(&self) -> usize;

    /// The patches alone for these anchors and edits. The constraints carry no holes, weights or `up`: those were chosen when the
    /// session was opened.
    ///
    /// # Errors
    /// The constraints do not fit the scan or cannot be met.
    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        budget: &Budget<'_>,
    ) -> Result<Patches, Refusal>;

    /// The patches as a drag shows them, of the holes that [`EditSession::described`] lists: the positions of all vertices, patch after patch, in order of
    /// hole id, in the order of [`v1::SessionHole::patch_uvs`], then the normals of all vertices in that order, `x, y, z` as little-endian f32. They
    /// are the vertices of [`EditSession::patches`]; what it measures and reports is left out.
    ///
    /// # Errors
    /// As [`EditSession::patches`].
    fn draft(&self, constraints: &Constraints, budget: &Budget<'_>) -> Result<Vec<u8>, Refusal>;

    /// The whole scan mended with these anchors and edits: the bytes that the stateless [`Mender::inpaint`] returns.
    ///
    /// # Errors
    /// As [`EditSession::patches`].
    fn mended(&self, constraints: &Constraints, budget: &Budget<'_>) -> Result<Mended, Refusal>;

    /// The search of [`Mender::optimize_anchor`] on the kept scan.
    ///
    /// # Errors
    /// The query does not fit the scan.
    fn optimize_anchor(
        &self,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal>;

    /// Some cells of the map of that search, so that a map can be had in pieces with other calls between them.
    ///
    /// # Errors
    /// As [`EditSession::optimize_anchor`].
    fn map_piece(
        &self,
        search: &Search,
        span: MapSpan,
        budget: &Budget<'_>,
    ) -> Result<v1::MapPiece, Refusal>;
}

/// Which cells of a map are wanted, in the order in which pieces have them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MapSpan {
    /// Cells that earlier pieces had.
    pub first: usize,
    /// Most cells of this piece.
    pub count: usize,
}

/// The form of a scan that came as a zip with a glTF and its files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanForm {
    /// A zip again.
    AsReceived,
    /// The glTF alone, which goes on referring to its files.
    Gltf,
    /// One GLB with all files in it.
    Glb,
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

/// Patches without their scan, and the report.
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
    /// The kind of refusal.
    pub code: Code,
    /// What, where and which limit, for a person. Logged instead of sent when [`Refusal::is_internal`].
    pub detail: String,
    /// The constraints at fault, if any.
    pub fields: Vec<FieldError>,
    /// How the mend went, where it came as far as the scan's holes.
    pub outcome: Option<Outcome>,
}

impl Refusal {
    /// A refusal that is not about constraints.
    pub fn new(code: Code, detail: impl Into<String>) -> Self {
        Self {
            code,
            detail: detail.into(),
            fields: Vec::new(),
            outcome: None,
        }
    }

    /// Whether the mender itself failed; callers are not told its details.
    pub fn is_internal(&self) -> bool {
        self.code == codes::INTERNAL
    }
}
