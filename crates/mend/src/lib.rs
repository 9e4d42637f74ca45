//! Mends scans: synchronous functions that take a scan and give the mended scan and a report. The only crate that knows
//! all stages.
//!
//! In order: `welded_scan` welds the triangles and finds the boundary loops, `cut` takes damaged cloth out, `border`
//! closes bites at the cloth's own edge, `select` matches a request to loops,
//! `prepare` lays the cloth around a hole flat and makes a `hole` of it (a `prepared_hole` is this, or a `fair_hole` where
//! the cloth cannot be laid flat), `constraints` places anchors and gestures on
//! it, `moved_fill` asks the network for cloth that moved, `fill_hole` meshes it, `separate` pushes neighbouring
//! patches apart, `hole_report` measures the patch, `confidence` says how far it
//! may be off, `addition` writes it in glTF terms, and `texture` gives it its colour. `scan_holes` runs these
//! stages for all holes of a scan; [`mend`] drops it, a [`ScanSession`] keeps it. `edit` holds the gestures and the
//! anchor search. [`strip`] undoes mends. [`SharedMender`] is the port's [`Mender`](darn_contract::port::Mender).
//!
//! No async, no I/O, and no clocks except for the report's timings. The bytes depend on scan, constraints, weights and
//! version alone.

mod addition;
mod anchor_search;
mod bites;
mod border;
mod call_pools;
mod confidence;
mod constraints;
mod context;
mod cut;
mod cut_faces;
#[cfg(test)]
mod defect_tests;
mod digests;
mod doubts;
mod edit;
mod error;
mod fair_hole;
mod fill_hole;
mod flat_line;
mod flat_region;
mod formed_scan;
mod hem_strip;
mod hole;
mod hole_report;
mod hole_share;
mod inpainter;
mod islands;
mod laid_cloth;
mod last_pulled;
mod limits;
mod loose_pieces;
mod mender;
mod moved_fill;
mod near_seams;
mod nearest_loop;
mod network_share;
mod picture;
mod point_limit;
mod port;
mod prepare;
mod prepared_hole;
mod reach;
mod sampled_grid;
mod scan_additions;
mod scan_holes;
mod scan_notes;
mod scan_search;
mod select;
mod separate;
mod session;
mod session_description;
mod sorted;
mod stretch;
mod strip;
mod suspects;
mod tears;
#[cfg(test)]
mod testing;
mod texture;
mod texture_cloth;
mod texture_images;
mod texture_patch;
mod timings;
mod torn_corners;
mod welded_scan;
mod without_noise;

use std::time::Instant;

use darn_budget::Budget;
use darn_contract::port::{HolesQuery, Mended};
use darn_contract::{Anchor, Constraints, Search, v1};
use darn_gltf_scan::Scan;

pub use call_pools::CallPools;
pub use digests::file_digests;
pub use edit::SearchOptions;
pub use error::{MendError, reading_code};
pub use limits::{EditedFill, MendLimits};
pub use mender::{Call, NetworkMender};
pub use port::SharedMender;
pub use session::{ScanSession, SessionCall};
pub use strip::strip;
pub use timings::add_read_time;

use scan_additions::PatchChoices;
use scan_holes::ScanHoles;
use timings::milliseconds;
use welded_scan::WeldedScan;

/// darn's version, as reports and patches name it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Fills the loops of a scan that the constraints choose: by default all holes, and no finished opening. Holes that cannot be filled are skipped.
///
/// # Errors
/// A constraint that does not fit the scan, a named hole that cannot be filled, none that can, no hole at all; `Exhausted`.
pub fn mend<'a>(
    scan: &Scan,
    constraints: &Constraints,
    call: impl Into<Call<'a>>,
) -> Result<Mended, MendError> {
    let call = call.into();
    // The report names the scan's digests; of a large scan they take as long as half of the rest.
    let (holes, _) = rayon::join(
        || ScanHoles::open(scan, constraints, call),
        || scan.digests(),
    );
    holes?.mended_once(scan, constraints.into(), call)
}

/// Searches where on a hole's grid a point in space belongs: the cell where an anchor at that point brings the cloth
/// nearest to it.
///
/// # Errors
/// A hole that does not exist or cannot be laid flat, several holes of which the search names none; `Exhausted`.
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
    holes.mended(scan, filled, PatchChoices::default(), call)
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

/// Every boundary loop of a scan, with its kind and size, and what else the query wants.
///
/// # Errors
/// `Exhausted`.
pub fn find_holes(
    scan: &Scan,
    wanted: HolesQuery,
    budget: &Budget,
) -> Result<v1::HolesReport, MendError> {
    let started = Instant::now();
    let welded = WeldedScan::of(scan, budget)?;
    budget.hold(LOOP_REPORT * welded.loops.len())?;
    let mut loops = Vec::with_capacity(welded.loops.len());
    for rim in &welded.loops {
        budget.spend(LOOP_WORK)?;
        loops.push(welded.loop_report(rim, scan));
    }
    let suspects = match wanted.suspects {
        true => suspects::suspects(&welded, budget)?,
        false => Vec::new(),
    };
    Ok(v1::HolesReport {
        loops,
        candidates: border::candidates(&welded, budget)?,
        suspects,
        components: welded.topology.components as u32,
        vertices: welded.surface.mesh.positions.len() as u32,
        faces: welded.surface.mesh.faces.len() as u32,
        notes: scan_notes::notes(&welded, scan),
        set_aside: scan_notes::set_aside(&welded, scan),
        timings: Some(v1::ScanTimings {
            total: milliseconds(started),
            ..welded.timings
        }),
    })
}

/// Bytes of memory of a loop in a report, and of its JSON.
const LOOP_REPORT: usize = 1000;
/// Nanoseconds of work a loop in a report, and its JSON.
const LOOP_WORK: u64 = 3000;

#[cfg(test)]
mod tests {
    use darn_budget::{Exhausted, Limits};
    use darn_contract::HoleSelector;
    use darn_geometry::mesh::shapes::{concat, holed_sheet, jitter, sheet};
    use darn_geometry::mesh::{TriMesh, Vec3};

    use super::*;
    use crate::testing::{mender, scan_of};

    /// A sheet with a hole whose vertices lie anywhere: every triangle crosses every other.
    fn tangle(n: usize) -> TriMesh {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.3;
        jitter(&sheet(n, keep, |u, v| Vec3::new(u, v, 0.0)), 100.0, 1)
    }

    /// Why a scan is not mended within limits, if it is not; and the work that was counted, nanoseconds.
    fn mended_within(scan: &Scan, limits: Limits) -> (Option<MendError>, u64) {
        let budget = Budget::new(limits, &|| false);
        let call = Call {
            mender: mender(),
            budget: &budget,
        };
        let error = mend(scan, &Constraints::default(), call).err();
        (error, budget.spent())
    }

    /// The work of a scan, nanoseconds.
    fn work(scan: &Scan, limit: u64) -> (u64, Option<MendError>) {
        let limits = Limits {
            work: limit,
            ..Limits::default()
        };
        let (error, spent) = mended_within(scan, limits);
        (spent, error)
    }

    #[test]
    fn a_tangle_costs_no_more_than_its_size_allows() {
        for n in [16, 32] {
            let scan = scan_of(&tangle(n));
            let holes = find_holes(&scan, HolesQuery::default(), Budget::unlimited()).unwrap();
            assert!(!holes.loops.is_empty());
            // 36 bytes a vertex of positions and normals are more than the file has.
            let bytes = 36 * scan.surface.positions.len() as u64;
            let (spent, _) = work(&scan, u64::MAX - 1);
            assert!(
                spent < 2_000_000_000.max(50_000 * bytes),
                "{n}: {spent} ns for {bytes} bytes"
            );
        }
    }

    #[test]
    fn work_beyond_the_limit_is_refused_by_name_every_time_alike() {
        let scan = scan_of(&tangle(16));
        let (all, _) = work(&scan, u64::MAX - 1);
        let (_, error) = work(&scan, all / 2);
        let error = error.expect("a refusal");
        assert!(matches!(
            error,
            MendError::Exhausted(Exhausted::Work { .. })
        ));
        assert_eq!(error.code(), darn_contract::codes::TOO_MUCH_WORK);
        assert_eq!(work(&scan, u64::MAX - 1).0, all);
    }

    #[test]
    fn a_hole_that_needs_too_much_of_the_work_leaves_the_others_to_be_filled() {
        let mut sound = holed_sheet(24, 0.15);
        sound.positions.iter_mut().for_each(|p| p.x += 400.0);
        let scan = scan_of(&concat(&tangle(16), &sound));
        let mended = |constraints: &Constraints, limit: u64| {
            let limits = Limits {
                work: limit,
                ..Limits::default()
            };
            let budget = Budget::new(limits, &|| false);
            let call = Call {
                mender: mender(),
                budget: &budget,
            };
            mend(&scan, constraints, call).map(|mended| mended.report)
        };
        let (all, _) = work(&scan, u64::MAX - 1);
        let report = mended(&Constraints::default(), all / 10 * 9).expect("a mended scan");
        let filled: Vec<u32> = report.holes.iter().map(|hole| hole.id).collect();
        let left = report.skipped.iter();
        let left: Vec<_> = left.filter(|it| it.code == "too_much_work").collect();
        let ([_], [left]) = (&filled[..], &left[..]) else {
            panic!("{filled:?} {:?}", report.skipped);
        };
        assert!(
            left.reason.contains("s of work, its share"),
            "{}",
            left.reason
        );
        // One that is named may take all, and refuses the request where that is too little.
        let named = Constraints {
            holes: vec![HoleSelector::Id(left.id)],
            ..Constraints::default()
        };
        let refused = mended(&named, all / 3).expect_err("a refusal");
        assert!(matches!(
            refused,
            MendError::Exhausted(Exhausted::Work { .. })
        ));
    }

    #[test]
    fn a_step_that_would_end_after_the_deadline_is_a_matter_of_the_deadline() {
        let scan = scan_of(&tangle(16));
        let limits = Limits {
            deadline: Some(Instant::now() + std::time::Duration::from_millis(1)),
            ..Limits::default()
        };
        let error = mended_within(&scan, limits).0.expect("a refusal");
        assert_eq!(error.code(), darn_contract::codes::DEADLINE_EXCEEDED);
    }

    #[test]
    fn holes_take_memory_within_the_limit_or_are_refused() {
        let keep = |u: f64, v: f64| {
            let near = |x: f64| (x * 4.0).fract() - 0.5;
            near(u).hypot(near(v)) > 0.2
        };
        let scan = scan_of(&sheet(60, keep, |u, v| Vec3::new(u, v, 0.0)));
        let limits = Limits {
            memory: 4 << 20,
            ..Limits::default()
        };
        let error = mended_within(&scan, limits).0.expect("a refusal");
        assert_eq!(
            error.code(),
            darn_contract::codes::TOO_MUCH_MEMORY,
            "{error}"
        );
    }

    #[test]
    fn an_answer_beyond_the_limit_is_refused() {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
        let scan = scan_of(&sheet(12, keep, |u, v| Vec3::new(u, v, 0.0)));
        let limits = Limits {
            output: 1000,
            ..Limits::default()
        };
        let error = mended_within(&scan, limits).0.expect("a refusal");
        assert_eq!(error.code(), darn_contract::codes::ANSWER_TOO_LARGE);
    }

    #[test]
    fn a_report_repeats_no_long_name_for_every_loop() {
        let mesh = sheet(
            12,
            |u, v| (u - 0.5).hypot(v - 0.5) > 0.2,
            |u, v| Vec3::new(u, v, 0.0),
        );
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.cast().into()).collect();
        let named = darn_gltf_scan::export::NewMesh {
            name: &"x".repeat(100_000),
            positions: &positions,
            normals: &vec![[0.0, 0.0, 1.0]; positions.len()],
            texcoords: &[],
            faces: &mesh.faces,
        };
        let bytes = darn_gltf_scan::export::glb(&named).unwrap();
        let scan = Scan::read(bytes, &Default::default()).unwrap();
        let report = find_holes(&scan, HolesQuery::default(), Budget::unlimited()).unwrap();
        assert_eq!(report.loops.len(), 2);
        assert!(report.loops.iter().all(|l| l.mesh.len() < 300));
    }
}
