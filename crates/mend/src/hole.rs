//! One prepared hole with a request's constraints: cloth moved, meshed, measured and reported.

use std::time::Instant;

use rstar::{PointDistance as _, RTree};

use super::cloth::{Cloth, kind};
use super::inpainter::Inpainter;
use super::prepared::{Prepared, Unedited};
use super::select::Chosen;
use super::wishes::Wishes;
use super::{MendError, MendLimits, fill, milliseconds};
use darn_contract::v1;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::index::VertexId;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::patch::quality::{self, Quality};
use darn_geometry::patch::{self, Patch, Pull};

/// Largest stretch of an edge, of chart or patch, that goes without a note.
const SUSPICIOUS: f64 = 1.5;
/// A loose piece whose border keeps this near to new cloth, in edges of the hole's rim, lies in the hole.
const IN_THE_HOLE: f64 = 1.5;
/// How often less and less of a move is tried before the pulls alone draw the cloth.
const TRIES: usize = 2;

/// A hole's new cloth, before anything is said about it.
pub struct Filled<'h, 'c> {
    /// The hole.
    pub prepared: &'h Prepared,
    /// The triangles.
    pub patch: Patch,
    wishes: Wishes<'c>,
    timings: v1::HoleTimings,
}

/// A hole's new cloth and what is to be said about it.
pub struct Made {
    /// The triangles.
    pub patch: Patch,
    /// The report.
    pub report: v1::HoleReport,
}

/// Fills a prepared hole.
///
/// # Errors
/// Constraints that do not fit the hole, hard anchors out of reach, and whatever keeps it from being meshed.
pub fn fill<'h: 'c, 'c>(
    prepared: &'h Prepared,
    chosen: &'c Chosen,
    inpainter: &Inpainter,
    limits: &MendLimits,
) -> Result<Filled<'h, 'c>, MendError> {
    let unedited = prepared.unedited(inpainter, limits)?;
    let wishes = Wishes::of((prepared, &unedited), chosen, inpainter, limits)?;
    let mut timings = prepared.timings;
    timings.net += unedited.net_ms;
    timings.patch += unedited.patch_ms;

    let pulls = wishes.pulls();
    let patch = if pulls.is_empty() {
        unedited.patch.clone()
    } else {
        let started = Instant::now();
        let moved = fill::moved(
            (prepared, &unedited),
            &wishes.moves(),
            inpainter,
            limits.response,
        )?;
        timings.net += milliseconds(started);
        let started = Instant::now();
        let patch = drawn((prepared, &unedited), &moved, &pulls, limits)?;
        timings.patch += milliseconds(started);
        patch
    };
    Ok(Filled {
        prepared,
        patch,
        wishes,
        timings,
    })
}

/// The patch of moved cloth, of as much of its move as the cloth can bear: what the network answers to far wishes is itself stretched.
fn drawn(
    (prepared, unedited): (&Prepared, &Unedited),
    moved: &[Vec3],
    pulls: &[Pull],
    limits: &MendLimits,
) -> Result<Patch, MendError> {
    let stretch = |patch: &Patch| quality::measure(patch, &prepared.region).stretch_max;
    let usual = stretch(&unedited.patch);
    let most = patch::stretch_limit(usual);
    let mut share = 1.0;
    for _ in 0..TRIES {
        let each = unedited.filled.iter().zip(moved);
        let filled: Vec<Vec3> = each.map(|(from, to)| from.lerp(to, share)).collect();
        let patch = prepared.patch(&filled, pulls, limits)?;
        let found = stretch(&patch);
        if found <= most {
            return Ok(patch);
        }
        share *= (most - usual) / (found - usual);
    }
    prepared.patch(&unedited.filled, pulls, limits)
}

/// Measures a filled hole and writes its report.
///
/// # Errors
/// Hard anchors that were not met.
pub fn described(filled: Filled, cloth: &Cloth) -> Result<Made, MendError> {
    let Filled {
        prepared,
        patch,
        wishes,
        mut timings,
    } = filled;
    let (anchors, edits) = wishes.kept(&patch)?;

    let started = Instant::now();
    let quality = quality::measure(&patch, &prepared.region);
    timings.report = milliseconds(started);
    let mut notes = notes(prepared, &quality);
    notes.extend(covered(prepared, &patch, cloth));
    notes.extend(wishes.notes(&anchors));
    let rim = &cloth.loops[prepared.id as usize];
    let report = v1::HoleReport {
        id: prepared.id,
        kind: kind(rim.kind) as i32,
        length: rim.length,
        vertices: rim.vertices.len() as u32,
        chart: Some(chart_report(prepared)),
        grid: Some(prepared.report),
        patch: Some(patch_report(&patch, &quality)),
        timings: Some(timings),
        notes,
        anchors,
        edits,
    };
    Ok(Made { patch, report })
}

fn chart_report(prepared: &Prepared) -> v1::ChartReport {
    v1::ChartReport {
        faces: prepared.region.faces.len() as u32,
        stretch_mean: prepared.chart.stretch_mean,
        stretch_max: prepared.chart.stretch_max,
        flips: prepared.chart.flipped as u32,
        iterations: prepared.chart.rounds as u32,
    }
}

fn patch_report(patch: &Patch, quality: &Quality) -> v1::PatchReport {
    v1::PatchReport {
        vertices: patch.positions.len() as u32,
        faces: patch.faces.len() as u32,
        area: quality.area,
        stretch_mean: quality.stretch_mean,
        stretch_max: quality.stretch_max,
        gaussian_curvature: quality.gaussian_curvature,
        seam_gap: quality.seam_gap,
        self_intersections: quality.self_intersections as u32,
        strain_iterations: patch.strain_rounds as u32,
        refinement: match patch.collisions {
            0 => "strain_limiting",
            _ => "strain_limiting+collisions",
        }
        .to_owned(),
    }
}

/// A note on loose pieces of the scan that lie where the new cloth is: a chart of the cloth around the hole does not know of them.
fn covered(prepared: &Prepared, patch: &Patch, cloth: &Cloth) -> Option<String> {
    let rim = &cloth.loops[prepared.id as usize];
    let others =
        (cloth.loops.iter()).filter(|l| l.kind == LoopKind::Outer && l.component != rim.component);
    let mut others = others.peekable();
    others.peek()?;
    let near = IN_THE_HOLE * rim.length / rim.vertices.len().max(1) as f64;
    let tree = RTree::bulk_load(
        patch
            .positions
            .iter()
            .map(|p| <[f64; 3]>::from(*p))
            .collect(),
    );
    let is_near = |v: &VertexId| {
        let place = <[f64; 3]>::from(cloth.welded.mesh.positions[v.index()]);
        let nearest = tree.nearest_neighbor(&place);
        nearest.is_some_and(|p| p.distance_2(&place) <= near * near)
    };
    let inside = others.filter(|l| l.vertices.iter().all(is_near));
    let pieces: Vec<String> = inside.map(|l| l.id.to_string()).collect();
    (!pieces.is_empty()).then(|| {
        format!(
            "loose piece(s) of the scan lie in the hole (their borders: loop {}); they were kept, and the new cloth covers their place, too",
            pieces.join(", ")
        )
    })
}

/// What a person should look at before trusting the patch.
fn notes(prepared: &Prepared, quality: &Quality) -> Vec<String> {
    let mut notes = Vec::new();
    if prepared.denoised {
        notes.push(
            "the scan is noisy: the cloth around the hole was seen without that noise, its rim was kept"
                .into(),
        );
    }
    if prepared.chart.stretch_max > SUSPICIOUS {
        notes.push(format!(
            "the cloth around the hole does not lie flat well: an edge is stretched {:.2} times",
            prepared.chart.stretch_max
        ));
    }
    if quality.stretch_max > SUSPICIOUS {
        let most = quality.stretch_max;
        notes.push(format!("an edge of the patch is stretched {most:.2} times"));
    }
    if quality.self_intersections > 0 {
        notes.push(format!(
            "the patch cuts itself or the cloth around it in {} pair(s) of triangles",
            quality.self_intersections
        ));
    }
    let others = prepared.region.holes.len();
    if others > 0 {
        notes.push(format!(
            "{others} other hole(s) lie in the region and were unknown to the network"
        ));
    }
    notes
}
