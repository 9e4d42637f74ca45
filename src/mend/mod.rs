//! The whole job as one synchronous function: read scan in, patched bytes and a report out. The only room that knows all stages.
//! `cloth` finds the loops, `select` matches them to the request, `hole` mends one, `dress` turns its patch into glTF terms.
//! No async, no I/O, no clocks but for the report's timings; the bytes depend on scan, constraints, weights and version alone.

mod cloth;
mod dress;
mod error;
mod hole;
mod select;

use std::time::{Duration, Instant};

use crate::contract::{Constraints, v1};
use crate::net::Network;
use crate::scan::{Addition, Scan};
use crate::{flatten, patch};

use cloth::Cloth;
pub use error::MendError;

/// darn's version, as the report and the patches carry it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What mends: one loaded network and how far to go.
#[derive(Debug)]
pub struct Mender {
    /// The network that imagines the cloth.
    pub network: Network,
    /// What a mend may cost and look like.
    pub limits: Limits,
}

/// What a mend may cost and look like.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Limits {
    /// When a chart is refused.
    pub flatten: flatten::Limits,
    /// How a patch is made.
    pub patch: patch::Options,
}

/// A mended scan.
#[derive(Debug, Clone)]
pub struct Mended {
    /// The glTF, in the container of the input; the input's own bytes when nothing was filled.
    pub bytes: Vec<u8>,
    /// What was done.
    pub report: v1::Report,
}

impl Mended {
    /// The same with the time that reading the scan took, which [`mend`] does not see.
    pub fn with_read_time(mut self, read: Duration) -> Mended {
        if let Some(timings) = &mut self.report.timings {
            timings.read = read.as_secs_f64() * 1e3;
            timings.total += timings.read;
        }
        self
    }
}

/// Fills the holes of a scan that the constraints ask for; by default all of them, never an outer boundary or a tube's end.
///
/// # Errors
/// When a constraint does not fit the scan, or when a hole asked for cannot be filled, or when there is none.
pub fn mend(scan: &Scan, constraints: &Constraints, mender: &Mender) -> Result<Mended, MendError> {
    let started = Instant::now();
    let cloth = Cloth::of(scan);
    let selection = select::select(scan, &cloth, constraints)?;
    let holes_started = Instant::now();
    let mut additions: Vec<Addition> = Vec::new();
    let mut holes = Vec::new();
    for chosen in &selection.chosen {
        let (addition, report) = hole::mend(scan, &cloth, chosen, mender)?;
        additions.push(addition);
        holes.push(report);
    }
    let holes_ms = milliseconds(holes_started);
    let write_started = Instant::now();
    let bytes = scan.write(&additions)?;
    let report = v1::Report {
        version: VERSION.to_owned(),
        weights: Some(weights(mender)),
        holes,
        skipped: selection.skipped,
        timings: Some(v1::ScanTimings {
            read: 0.0,
            holes: holes_ms,
            write: milliseconds(write_started),
            total: milliseconds(started),
            ..cloth.timings
        }),
        notes: cloth.notes(scan),
    };
    Ok(Mended { bytes, report })
}

/// Every boundary loop of a scan, and what it is.
///
/// # Errors
/// None today; the signature leaves room for limits on what is searched.
pub fn find_holes(scan: &Scan, _limits: &Limits) -> Result<v1::HolesReport, MendError> {
    let started = Instant::now();
    let cloth = Cloth::of(scan);
    Ok(v1::HolesReport {
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
    })
}

/// The weights a report names.
fn weights(mender: &Mender) -> v1::Weights {
    let card = mender.network.card();
    v1::Weights {
        name: card.name.clone(),
        sha256: card.sha256.clone(),
    }
}

/// Milliseconds since.
fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
