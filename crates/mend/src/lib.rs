//! The whole job as synchronous functions: a scan in, the mended scan and a report out. The only crate that knows all stages.
//!
//! `cloth` finds the loops, `select` matches them to the request, `prepared` lays a hole flat, `wishes` and `fill` bring constraints to it,
//! `hole` meshes it, `beside` keeps it off other patches, `dress` turns its patch into glTF terms; `opened` is all of a scan's holes, which a
//! [`ScanSession`] keeps and [`mend`] drops. [`edit`] turns gestures into anchors and searches anchors. [`NetworkMender`] is the port's
//! [`Mender`](darn_contract::port::Mender). No async, no I/O, no clocks but for the report's timings; the bytes depend on scan, constraints,
//! weights and version alone.

mod beside;
mod cloth;
mod dress;
pub mod edit;
mod error;
mod fill;
mod hole;
mod inpainter;
mod opened;
mod picture;
mod port;
mod prepared;
mod search;
mod select;
mod session;
mod wishes;

use std::sync::Arc;
use std::time::{Duration, Instant};

use darn_contract::port::{Cancellation, Mended};
use darn_contract::{Anchor, Constraints, Search, v1};
use darn_geometry::{flatten, patch};
use darn_gltf_scan::Scan;
use darn_net::Networks;

use cloth::Cloth;
pub use error::MendError;
pub use fill::Response;
use opened::Opened;
pub use port::SharedMender;
pub use session::{ScanSession, SessionCall};

/// darn's version, as the report and the patches carry it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The loaded networks, and the limits of a mend.
#[derive(Debug)]
pub struct NetworkMender {
    /// The networks that predict the cloth.
    pub networks: Networks,
    /// What a mend may cost and look like.
    pub limits: MendLimits,
    /// What a scan may cost.
    pub scan_limits: darn_gltf_scan::ScanLimits,
}

impl NetworkMender {
    /// A mender with default limits.
    pub fn new(networks: Networks) -> NetworkMender {
        NetworkMender {
            networks,
            limits: MendLimits::default(),
            scan_limits: darn_gltf_scan::ScanLimits::default(),
        }
    }
}

/// What a mend may cost and look like.
#[derive(Debug, Clone, PartialEq)]
pub struct MendLimits {
    /// When a chart is refused.
    pub flatten: flatten::FlattenLimits,
    /// How a patch is made.
    pub patch: patch::PatchOptions,
    /// How the network is asked for edited cloth.
    pub response: Response,
    /// How far an anchor search goes.
    pub search: edit::SearchOptions,
    /// Cells an anchor search looks at before it sets out.
    pub seeds: usize,
    /// Holes filled at once: each holds its chart, its grid and its patch until the last is done.
    pub holes: usize,
}

impl Default for MendLimits {
    fn default() -> Self {
        MendLimits {
            flatten: flatten::FlattenLimits::default(),
            patch: patch::PatchOptions::default(),
            response: Response::default(),
            search: edit::SearchOptions::default(),
            seeds: 16,
            holes: 1000,
        }
    }
}

/// Adds the time that reading the scan took, which [`mend`] does not see, to a report's timings.
pub fn add_read_time(timings: &mut Option<v1::ScanTimings>, read: Duration) {
    if let Some(timings) = timings {
        timings.read = read.as_secs_f64() * 1e3;
        timings.total += timings.read;
    }
}

/// A mender and its caller's cancellation check. Made of a [`NetworkMender`] alone it is never cancelled.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// What mends.
    pub mender: &'a NetworkMender,
    /// Whether the caller still waits.
    pub cancellation: Cancellation<'a>,
}

impl Call<'_> {
    /// # Errors
    /// `Abandoned` when nobody waits any more.
    fn go_on(&self) -> Result<(), MendError> {
        match self.cancellation.is_cancelled() {
            true => Err(MendError::Abandoned),
            false => Ok(()),
        }
    }
}

impl<'a> From<&'a NetworkMender> for Call<'a> {
    fn from(mender: &'a NetworkMender) -> Self {
        Call {
            mender,
            cancellation: Cancellation::NEVER,
        }
    }
}

impl<'a> From<&'a Arc<NetworkMender>> for Call<'a> {
    fn from(mender: &'a Arc<NetworkMender>) -> Self {
        Call::from(&**mender)
    }
}

/// Fills the holes of a scan that the constraints ask for; by default all of them, never an outer boundary or a tube's end.
///
/// # Errors
/// When a constraint does not fit the scan, or when a hole asked for cannot be filled, or when there is none; `Abandoned`.
pub fn mend<'a>(
    scan: &Scan,
    constraints: &Constraints,
    call: impl Into<Call<'a>>,
) -> Result<Mended, MendError> {
    let call = call.into();
    Opened::new(scan, constraints, call)?.mended(scan, constraints, call)
}

/// Searches where on a hole's grid a point in space belongs: the cell where an anchor at that point is best followed by the cloth.
///
/// # Errors
/// When the hole is not there, cannot be laid flat, or is not named among several; `Abandoned`.
pub fn optimize_anchor<'a>(
    scan: &Scan,
    search: &Search,
    call: impl Into<Call<'a>>,
) -> Result<v1::AnchorFound, MendError> {
    let call = call.into();
    Opened::for_search(scan, search, call)?.search(search, call)
}

/// Searches, and fills all holes with an anchor at the place that was found.
///
/// # Errors
/// As [`optimize_anchor`] and [`mend`].
pub fn mend_to_target<'a>(
    scan: &Scan,
    search: &Search,
    call: impl Into<Call<'a>>,
) -> Result<Mended, MendError> {
    let call = call.into();
    let opened = Opened::new(scan, &Constraints::default(), call)?;
    let found = opened.search(search, call)?;
    opened.mended(scan, &anchor_of(&found, search), call)
}

/// What a search found, as constraints: a soft anchor at its target.
pub fn anchor_of(found: &v1::AnchorFound, search: &Search) -> Constraints {
    let anchor = Anchor {
        hole: Some(found.hole),
        uv: <[f64; 2]>::try_from(found.uv.as_slice()).ok(),
        position: search.target,
        hard: false,
    };
    Constraints {
        anchors: vec![anchor],
        ..Constraints::default()
    }
}

/// Every boundary loop of a scan, and what it is.
pub fn find_holes(scan: &Scan) -> v1::HolesReport {
    let started = Instant::now();
    let cloth = Cloth::of(scan);
    v1::HolesReport {
        loops: cloth
            .loops
            .iter()
            .map(|l| cloth.described(l, scan))
            .collect(),
        components: cloth.topology.components as u32,
        vertices: cloth.welded.mesh.positions.len() as u32,
        faces: cloth.welded.mesh.faces.len() as u32,
        notes: cloth.notes(scan),
        timings: Some(v1::ScanTimings {
            total: milliseconds(started),
            ..cloth.timings
        }),
    }
}

/// Milliseconds since.
fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
