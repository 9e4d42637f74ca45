//! One hole from rim to patch: region, chart, grid, network, mesh, and the numbers of each.

use std::time::Instant;

use super::cloth::{Cloth, kind};
use super::select::Chosen;
use super::{MendError, Mender, dress, milliseconds};
use crate::contract::{Anchor, FieldError, v1};
use crate::flatten::{self, Chart};
use crate::grid::{self, Grid, Normalisation};
use crate::mesh::loops::BoundaryLoop;
use crate::mesh::region::{self, Region};
use crate::mesh::{Vec2, Vec3};
use crate::patch::quality::{self, Quality};
use crate::patch::{self, Patch, PatchError};
use crate::scan::{Addition, Scan};

/// How much of the grid's side the hole should take, so that hole and context share it as in training.
const SHARE: f64 = 0.5;
/// A region is grown again when its reach is off by more than this factor.
const OFF: f64 = 1.3;
/// Reach of each further try, when a region gives no usable chart.
const SMALLER: f64 = 0.6;
/// Largest stretch of an edge, of chart or patch, that goes without a note.
const SUSPICIOUS: f64 = 1.5;
/// Reach of the collar that the extent of a hole is first read off, as a share of what suits a round one.
const COLLAR: f64 = 0.2;
/// Tries with smaller and smaller regions.
const TRIES: usize = 4;

/// Mends one hole.
pub fn mend(
    scan: &Scan,
    cloth: &Cloth,
    chosen: &Chosen,
    mender: &Mender,
) -> Result<(Addition, v1::HoleReport), MendError> {
    let rim = &cloth.loops[chosen.id as usize];
    let mut reach = reach_for(extent_at_a_glance(cloth, rim));
    let mut tries = 0;
    let (laid, patch, grid) = loop {
        let outcome = Laid::out(cloth, chosen.id, reach, mender).and_then(|laid| {
            let (patch, grid) = laid.filled(chosen, mender)?;
            Ok((laid, patch, grid))
        });
        tries += 1;
        match outcome {
            Err(error) if tries < TRIES && may_shrink(&error) => reach *= SMALLER,
            outcome => break outcome?,
        }
    };
    let started = Instant::now();
    let quality = quality::measure(&patch, &laid.region);
    let mut timings = v1::HoleTimings {
        net: grid.net_ms,
        patch: grid.patch_ms,
        raster: grid.raster_ms,
        ..laid.timings
    };
    timings.report = milliseconds(started);
    let anchors: Vec<v1::AnchorReport> = (chosen.anchors.iter())
        .map(|(_, a)| kept(&patch, &laid.chart, a))
        .collect();
    let report = v1::HoleReport {
        id: chosen.id,
        kind: kind(rim.kind) as i32,
        length: rim.length,
        vertices: rim.vertices.len() as u32,
        chart: Some(v1::ChartReport {
            faces: laid.region.faces.len() as u32,
            stretch_mean: laid.chart.stretch_mean,
            stretch_max: laid.chart.stretch_max,
            flips: laid.chart.flipped as u32,
            iterations: laid.chart.rounds as u32,
        }),
        grid: Some(grid.report),
        patch: Some(v1::PatchReport {
            vertices: patch.positions.len() as u32,
            faces: patch.faces.len() as u32,
            area: quality.area,
            stretch_mean: quality.stretch_mean,
            stretch_max: quality.stretch_max,
            gaussian_curvature: quality.gaussian_curvature,
            seam_gap: quality.seam_gap,
            self_intersections: quality.self_intersections as u32,
            strain_iterations: patch.strain_rounds as u32,
        }),
        timings: Some(timings),
        notes: laid.notes(&quality, &anchors),
        anchors,
    };
    let addition = dress::addition(
        (scan, cloth),
        (&laid.region, &laid.chart),
        &patch,
        &report,
        mender,
    )?;
    Ok((addition, report))
}

/// Cloth around a hole, laid flat.
struct Laid {
    region: Region,
    chart: Chart,
    timings: v1::HoleTimings,
}

/// What the grid stage measured.
struct GridOutcome {
    report: v1::GridReport,
    raster_ms: f64,
    net_ms: f64,
    patch_ms: f64,
}

impl Laid {
    /// Grows and flattens the region; once more when the chart shows that the reach did not suit the hole.
    fn out(cloth: &Cloth, hole: u32, reach: f64, mender: &Mender) -> Result<Laid, MendError> {
        let laid = Self::with_reach(cloth, hole, reach, mender)?;
        let wanted = reach_for(laid.hole_extent());
        // Only outwards if the region stopped because it was asked to, not because the cloth ended or wraps around.
        let off = wanted < reach / OFF || (wanted > reach * OFF && laid.region.reach >= reach);
        if !off {
            return Ok(laid);
        }
        let mut again = match Self::with_reach(cloth, hole, wanted, mender) {
            Ok(again) => again,
            Err(_) => return Ok(laid),
        };
        again.timings.region += laid.timings.region;
        again.timings.flatten += laid.timings.flatten;
        Ok(again)
    }

    fn with_reach(
        cloth: &Cloth,
        hole: u32,
        reach: f64,
        mender: &Mender,
    ) -> Result<Laid, MendError> {
        let started = Instant::now();
        let region = region::grow(
            &cloth.welded.mesh,
            &cloth.topology,
            &cloth.loops,
            hole as usize,
            reach,
        )
        .map_err(|source| MendError::Region { hole, source })?;
        let grown = milliseconds(started);
        let started = Instant::now();
        let chart = flatten::flatten(&region, &mender.limits.flatten)
            .map_err(|source| MendError::Flatten { hole, source })?;
        let timings = v1::HoleTimings {
            region: grown,
            flatten: milliseconds(started),
            ..Default::default()
        };
        Ok(Laid {
            region,
            chart,
            timings,
        })
    }

    /// The rim as a polygon in uv.
    fn rim_uv(&self) -> Vec<Vec2> {
        let uv = |v: &u32| self.chart.uv(*v);
        self.region.rim.iter().map(uv).collect()
    }

    /// Larger side of the hole's box in the chart, scene units.
    fn hole_extent(&self) -> f64 {
        let (low, high) = self.rim_uv().iter().fold(
            (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY)),
            |(low, high), uv| (low.inf(uv), high.sup(uv)),
        );
        (high - low).max() * self.chart.frame.side
    }

    /// Samples the grid, sets the anchors, asks the network and meshes the answer.
    fn filled(&self, chosen: &Chosen, mender: &Mender) -> Result<(Patch, GridOutcome), MendError> {
        let started = Instant::now();
        let mut grid = flatten::raster(&self.region.mesh, &self.chart);
        let raster_ms = milliseconds(started);
        let too_little = MendError::TooLittleKnown {
            hole: chosen.id,
            known: grid.known_count(),
        };
        let normal = grid.normalisation().ok_or(too_little)?;
        let report = self.grid_report(&grid, &normal);
        self.anchor(&mut grid, &chosen.anchors)?;

        let started = Instant::now();
        let predicted = mender
            .network
            .fill(std::slice::from_ref(&grid.normalised(&normal)))?;
        let net_ms = milliseconds(started);

        let started = Instant::now();
        let filled = grid.filled(predicted.first().map_or(&[], Vec::as_slice), &normal);
        let patch = patch::build(&self.region, &self.chart, &filled, &mender.limits.patch)
            .map_err(|source| MendError::Patch {
                hole: chosen.id,
                source,
            })?;
        Ok((
            patch,
            GridOutcome {
                report,
                raster_ms,
                net_ms,
                patch_ms: milliseconds(started),
            },
        ))
    }

    /// Sets each anchor's cell to its position and marks it known (soft: the network may not reach it).
    fn anchor(&self, grid: &mut Grid, anchors: &[(usize, Anchor)]) -> Result<(), MendError> {
        let polygon = self.rim_uv();
        let mut wrong = Vec::new();
        for (i, anchor) in anchors {
            let cell = grid::cell_at(anchor.uv.into());
            if inside(&polygon, grid::cell_centre(cell)) {
                grid.positions[cell] = anchor.position.into();
                grid.known[cell] = true;
            } else {
                let [u, v] = anchor.uv;
                wrong.push(FieldError::new(
                    format!("/anchors/{i}/uv"),
                    format!("[{u}, {v}] does not lie in the hole"),
                ));
            }
        }
        if wrong.is_empty() {
            Ok(())
        } else {
            Err(MendError::Constraints(wrong))
        }
    }

    fn grid_report(&self, grid: &Grid, normal: &Normalisation) -> v1::GridReport {
        let spacing = grid::spacing(&grid.positions, |a, b| grid.known[a] && grid.known[b]);
        let polygon = self.rim_uv();
        v1::GridReport {
            spacing_mean: normal.scale / grid::SIDE as f64,
            spacing_variance: spacing.variance / (spacing.mean * spacing.mean),
            known: grid.known_count() as f64 / grid::CELLS as f64,
            hole: patch::signed_area(&polygon).abs(),
        }
    }

    /// What a person should look at before trusting the patch.
    fn notes(&self, quality: &Quality, anchors: &[v1::AnchorReport]) -> Vec<String> {
        let mut notes = Vec::new();
        if self.chart.stretch_max > SUSPICIOUS {
            notes.push(format!(
                "the cloth around the hole does not lie flat well: an edge is stretched {:.2} times",
                self.chart.stretch_max
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
        let others = self.region.holes.len();
        if others > 0 {
            notes.push(format!(
                "{others} other hole(s) lie in the region and were unknown to the network"
            ));
        }
        let extent = self.hole_extent();
        for (k, anchor) in anchors.iter().enumerate() {
            if anchor.distance > extent {
                notes.push(format!(
                    "anchor {k} is {:.3} away from the cloth, farther than the hole is wide ({extent:.3})",
                    anchor.distance
                ));
            }
        }
        notes
    }
}

/// Reach of a region around a hole of this extent.
fn reach_for(extent: f64) -> f64 {
    0.5 * extent * (1.0 / SHARE - 1.0)
}

/// Larger side of the hole's box in a chart of a narrow collar around it; where that cannot be laid flat, that of a round hole.
fn extent_at_a_glance(cloth: &Cloth, rim: &BoundaryLoop) -> f64 {
    let round = rim.length / std::f64::consts::PI;
    let collar = region::grow(
        &cloth.welded.mesh,
        &cloth.topology,
        &cloth.loops,
        rim.id as usize,
        COLLAR * reach_for(round),
    );
    let extent = collar.map(|collar| flatten::hole_extent(&collar));
    match extent {
        Ok(Ok(extent)) => extent,
        _ => round,
    }
}

/// Whether a smaller region may do better.
fn may_shrink(error: &MendError) -> bool {
    match error {
        MendError::Flatten { .. } => true,
        MendError::Patch { source, .. } => *source == PatchError::RimCrosses,
        _ => false,
    }
}

/// Whether a point lies in a polygon (even–odd rule).
fn inside(polygon: &[Vec2], p: Vec2) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = edges.filter(|(a, b)| {
        (a.y <= p.y) != (b.y <= p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) > p.x
    });
    crossed.count() % 2 == 1
}

/// How far the patch stays away from an anchor, at the anchor's uv.
fn kept(patch: &Patch, chart: &Chart, anchor: &Anchor) -> v1::AnchorReport {
    let at = patch.at(chart.frame.point(anchor.uv.into()));
    v1::AnchorReport {
        distance: (at - Vec3::from(anchor.position)).norm(),
    }
}
