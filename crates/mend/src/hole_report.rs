//! Measures a hole's patch and writes its report.

use std::time::Instant;

use darn_budget::Budget;

use crate::confidence;
use crate::error::MendError;
use crate::fair_hole::FairHole;
use crate::fill_hole::PatchDraft;
use crate::hole::Hole;
use crate::loose_pieces;
use crate::prepared_hole::HoleRef;
use crate::timings::milliseconds;
use crate::welded_scan::{WeldedScan, kind};
use darn_contract::v1;
use darn_geometry::patch::Patch;
use darn_geometry::patch::quality::{self, Quality};

/// A note is written when an edge of chart or patch is stretched more than this.
const SUSPICIOUS: f64 = 1.5;
/// Most islands that a note names.
const MAX_NAMED: usize = 20;

/// A hole's patch and its report.
pub struct FilledHole<'a> {
    /// The hole.
    pub hole: HoleRef<'a>,
    /// The triangles.
    pub patch: Patch,
    /// How far each of its vertices may be off, a standard deviation in scene units; empty where that is not known.
    pub deviations: Vec<f32>,
    /// The report.
    pub report: v1::HoleReport,
}

impl<'a> PatchDraft<'a> {
    /// Measures the patch and writes its report.
    ///
    /// # Errors
    /// `OutOfReach` for hard anchors that it does not meet.
    pub fn measured(
        self,
        welded: &WeldedScan,
        budget: &Budget,
    ) -> Result<FilledHole<'a>, MendError> {
        let deviations = self.deviations();
        let PatchDraft {
            hole,
            patch,
            network_share,
            constraints,
            unedited,
            mut timings,
            ..
        } = self;
        let kept = (constraints.as_ref().map(|c| c.kept(&patch)).transpose()?).unwrap_or_default();

        let started = Instant::now();
        let quality = quality::measure(&patch, hole.region());
        timings.report = milliseconds(started);
        let alternative = unedited.as_ref().map_or(0, |unedited| unedited.alternative);
        let new = deviations.get(patch.rim.len()..).unwrap_or_default();
        let extent = hole.charted().map(Hole::extent);
        let confidence = extent.and_then(|extent| confidence::report(new, extent));
        let mut doubts = hole.doubts(&patch);
        doubts.extend(hole.mistrust(&patch, new, welded));
        let mut notes = notes(hole, &quality);
        notes.extend(loose_pieces::notes(hole, &patch, welded, budget)?);
        notes.extend(constraints.iter().flat_map(|c| c.notes(&kept.anchors)));
        let rim = &welded.loops[hole.id() as usize];
        let report = v1::HoleReport {
            id: hole.id(),
            kind: kind(rim.kind) as i32,
            length: rim.length,
            vertices: rim.vertices.len() as u32,
            chart: hole.charted().map(chart_report),
            grid: hole.charted().map(|hole| hole.report),
            patch: Some(v1::PatchReport {
                network_share: f64::from(network_share),
                confidence,
                alternative: alternative.into(),
                ..patch_report(hole, &patch, &quality)
            }),
            // Written with the scan.
            texture: None,
            timings: Some(timings),
            notes,
            anchors: kept.anchors,
            edits: kept.edits,
            doubts,
            left_faces: hole.left_faces() as u32,
            cut: welded.cuts.report(hole.id()),
        };
        Ok(FilledHole {
            hole,
            patch,
            deviations,
            report,
        })
    }
}

fn chart_report(hole: &Hole) -> v1::ChartReport {
    v1::ChartReport {
        faces: hole.region.faces.len() as u32,
        stretch_mean: hole.chart.stretch_mean,
        stretch_max: hole.chart.stretch_max,
        flips: hole.chart.flipped as u32,
        iterations: hole.chart.rounds as u32,
    }
}

/// What was measured of a patch.
pub fn patch_report(hole: HoleRef, patch: &Patch, quality: &Quality) -> v1::PatchReport {
    let (method, stages) = match hole {
        HoleRef::Charted(_) => ("network", "strain_limiting"),
        HoleRef::Fair(_) => ("fair", "fairing"),
    };
    v1::PatchReport {
        method: method.to_owned(),
        refinement: match patch.collisions {
            0 => stages.to_owned(),
            _ => format!("{stages}+collisions"),
        },
        vertices: patch.positions.len() as u32,
        faces: patch.faces.len() as u32,
        area: quality.area,
        stretch_mean: quality.stretch_mean,
        stretch_max: quality.stretch_max,
        gaussian_curvature: quality.gaussian_curvature,
        seam_gap: quality.seam_gap,
        self_intersections: quality.self_intersections as u32,
        strain_iterations: patch.strain_rounds as u32,
        ..v1::PatchReport::default()
    }
}

/// Which pieces of the scan were no part of the cloth at a hole's rim, and which lie loose and are.
fn rim_notes(hole: HoleRef) -> Vec<String> {
    let mut notes = Vec::new();
    let left = hole.left_faces();
    if left > 0 {
        notes.push(format!(
            "{left} triangle(s) at the rim are no part of the cloth's edge (spikes, threads, flaps or a lip that lies over the other \
             one); they were kept. The new cloth starts at the sound edge beneath them, and may pass through them"
        ));
    }
    let islands = hole.charted().map_or(&[][..], |hole| &hole.islands);
    if !islands.is_empty() {
        let borders: Vec<String> = (islands.iter().take(MAX_NAMED))
            .map(ToString::to_string)
            .collect();
        notes.push(format!(
            "{} loose piece(s) of the scan lie in the hole as part of its cloth (their borders: loop {}); the new cloth meets them",
            islands.len(),
            borders.join(", ")
        ));
    }
    notes
}

/// What a person should look at before trusting the patch.
fn notes(hole: HoleRef, quality: &Quality) -> Vec<String> {
    let mut notes = Vec::new();
    if let HoleRef::Fair(FairHole { reason, .. }) = hole {
        notes.push(format!(
            "the cloth around the hole cannot be laid flat ({reason}); a fair surface without folds closes it"
        ));
    }
    if hole.denoised() {
        notes.push(
            "the scan is noisy: the cloth around the hole was seen without that noise, its rim was kept"
                .into(),
        );
    }
    notes.extend(rim_notes(hole));
    if let Some(hole) = hole.charted() {
        notes.extend(hole.extent_note());
    }
    let most = hole.charted().map_or(1.0, |hole| hole.chart.stretch_max);
    if most > SUSPICIOUS {
        notes.push(format!(
            "the cloth around the hole does not lie flat well: an edge is stretched {most:.2} times"
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
    let others = hole.region().holes.len();
    if others > 0 {
        notes.push(format!(
            "{others} other hole(s) lie in the region and were unknown to the network"
        ));
    }
    notes
}
