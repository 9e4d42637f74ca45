//! Mends scans: synchronous functions that take a scan and give the mended scan and a report. The only crate that knows
//! all stages.
//!
//! In order: `welded_scan` welds the triangles and finds the boundary loops, `select` matches a request to loops,
//! `prepare` lays the cloth around a hole flat and makes a `hole` of it, `constraints` places anchors and gestures on
//! it, `moved_fill` asks the network for cloth that moved, `fill_hole` meshes it, `separate` pushes neighbouring
//! patches apart, `hole_report` measures the patch, and `addition` writes it in glTF terms. `scan_holes` runs these
//! stages for all holes of a scan; [`mend`] drops it, a [`ScanSession`] keeps it. `edit` holds the gestures and the
//! anchor search. [`SharedMender`] is the port's [`Mender`](darn_contract::port::Mender).
//!
//! No async, no I/O, and no clocks except for the report's timings. The bytes depend on scan, constraints, weights and
//! version alone.

mod addition;
mod anchor_search;
mod constraints;
mod context;
mod edit;
mod error;
mod fill_hole;
mod hole;
mod hole_report;
mod inpainter;
mod limits;
mod mender;
mod moved_fill;
mod picture;
mod port;
mod prepare;
mod scan_holes;
mod select;
mod separate;
mod session;
#[cfg(test)]
mod testing;
mod timings;
mod welded_scan;

use std::time::Instant;

use darn_contract::port::Mended;
use darn_contract::{Anchor, Constraints, Search, v1};
use darn_gltf_scan::Scan;

pub use edit::SearchOptions;
pub use error::MendError;
pub use limits::{EditedFill, MendLimits};
pub use mender::{Call, NetworkMender};
pub use port::SharedMender;
pub use session::{ScanSession, SessionCall};
pub use timings::add_read_time;

use scan_holes::ScanHoles;
use timings::milliseconds;
use welded_scan::WeldedScan;

/// darn's version, as reports and patches name it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Fills the holes of a scan that the constraints choose: by default all of them, and never an outer boundary or the
/// end of a tube.
///
/// # Errors
/// A constraint that does not fit the scan, a chosen hole that cannot be filled, no hole at all; `Abandoned` when the
/// call is cancelled.
pub fn mend<'a>(
    scan: &Scan,
    constraints: &Constraints,
    call: impl Into<Call<'a>>,
) -> Result<Mended, MendError> {
    let call = call.into();
    let holes = ScanHoles::open(scan, constraints, call)?;
    holes.mended(scan, holes.filled(call)?)
}

/// Searches where on a hole's grid a point in space belongs: the cell where an anchor at that point brings the cloth
/// nearest to it.
///
/// # Errors
/// A hole that does not exist or cannot be laid flat, several holes of which the search names none; `Abandoned` when
/// the call is cancelled.
pub fn optimize_anchor<'a>(
    scan: &Scan,
    search: &Search,
    call: impl Into<Call<'a>>,
) -> Result<v1::AnchorFound, MendError> {
    let call = call.into();
    ScanHoles::open_for_search(scan, search, call)?.search(search, call)
}

/// Searches as [`optimize_anchor`], and fills all holes with an anchor at the place that was found.
///
/// # Errors
/// As [`optimize_anchor`] and [`mend`].
pub fn mend_to_target<'a>(
    scan: &Scan,
    search: &Search,
    call: impl Into<Call<'a>>,
) -> Result<Mended, MendError> {
    let call = call.into();
    let holes = ScanHoles::open(scan, &Constraints::default(), call)?;
    let found = holes.search(search, call)?;
    let filled = holes.filled_with(scan, &anchor_of(&found, search), call)?;
    holes.mended(scan, filled)
}

/// The result of a search as constraints: one soft anchor at the search's target.
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

/// Every boundary loop of a scan, with its kind and size.
pub fn find_holes(scan: &Scan) -> v1::HolesReport {
    let started = Instant::now();
    let welded = WeldedScan::of(scan);
    let loops = welded.loops.iter();
    v1::HolesReport {
        loops: loops.map(|l| welded.loop_report(l, scan)).collect(),
        components: welded.topology.components as u32,
        vertices: welded.surface.mesh.positions.len() as u32,
        faces: welded.surface.mesh.faces.len() as u32,
        notes: welded.notes(scan),
        timings: Some(v1::ScanTimings {
            total: milliseconds(started),
            ..welded.timings
        }),
    }
}
