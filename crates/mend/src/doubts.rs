//! What makes a patch no plausible cloth. Such a patch is not applied unless the request accepts it.

use crate::error::MendError;
use crate::fill_hole::PatchDraft;
use crate::hole_report::patch_report;
use darn_contract::v1;
use darn_geometry::mesh::region::Region;
use darn_geometry::patch::Patch;
use darn_geometry::patch::quality;

/// Length of an edge over its length in the chart from which on it is absurd, if it is also longer by more than the mean edge of the rim: noise makes
/// short edges twice as long. Cloth strains by a few per cent; on 115 holes with known answers, noise up to 0.2 of an edge, one patch of cloth with noise
/// has an edge stretched more than 2.4 times.
const MOST_STRETCH: f64 = 2.5;
/// Mean of these from which on the patch is absurd: its chart has far too little cloth for the hole. On 70 holes in garments, sound
/// patches have up to 1.14.
const MOST_MEAN_STRETCH: f64 = 1.3;
/// Pairs of triangles that cut each other, per triangle of the patch, from which on the patch is absurd. A scrap that floats in a hole is cut by 6 % of
/// the patch's triangles, a tent over a frayed rim cuts itself in 24 %.
const MOST_CUTS: f64 = 0.1;
/// Fewer cuts than these are never absurd: a patch of few triangles next to a fold touches it.
pub const FEW_CUTS: usize = 8;

/// Mean angle defect of a patch's inner vertices, radians, from which on it is crumpled, if that is also so many times that of the cloth around it. On
/// 90 holes in garments and scans, sound patches have up to 0.033 (deep pleats 0.017); those that are far from the truth, and filled at nearly twice its area,
/// 0.09 and more.
const MOST_CRUMPLED: f64 = 0.08;
const MOST_CRUMPLED_AGAINST_CLOTH: f64 = 4.0;
/// Patches of fewer inner vertices are never crumpled.
const FEW_VERTICES: usize = 30;

/// The reasons why a patch in a region is no plausible cloth, each with its numbers; none for a sound patch.
pub fn doubts(patch: &Patch, region: &Region) -> Vec<String> {
    let mut doubts = Vec::new();
    let stretch = largest_stretch(patch);
    if stretch > MOST_STRETCH {
        doubts.push(format!(
            "an edge is stretched {stretch:.2} times (limit {MOST_STRETCH})"
        ));
    }
    let mean = mean_stretch(patch);
    if mean > MOST_MEAN_STRETCH {
        doubts.push(format!(
            "its edges are stretched {mean:.2} times in the mean (limit {MOST_MEAN_STRETCH})"
        ));
    }
    let (cuts, faces) = (patch.crossings, patch.faces.len());
    if cuts > FEW_CUTS && cuts as f64 > MOST_CUTS * faces as f64 {
        let share = 100.0 * cuts as f64 / faces.max(1) as f64;
        let limit = 100.0 * MOST_CUTS;
        doubts.push(format!(
            "{cuts} pairs of triangles cut each other, {share:.1} % of its {faces} triangles (limit {limit:.0} %)"
        ));
    }
    let crumpled = quality::gaussian_curvature(patch);
    if crumpled > MOST_CRUMPLED && patch.positions.len() > patch.rim.len() + FEW_VERTICES {
        let around = quality::region_curvature(region);
        if crumpled > MOST_CRUMPLED_AGAINST_CLOTH * around {
            doubts.push(format!(
                "it is crumpled: its mean angle defect is {crumpled:.2} rad, {:.1} times that of the cloth around it (limits {MOST_CRUMPLED} and \
                 {MOST_CRUMPLED_AGAINST_CLOTH})",
                crumpled / around.max(f64::MIN_POSITIVE)
            ));
        }
    }
    doubts
}

/// The largest stretch of the edges with an inner vertex that are longer than in the chart by more than the rim's mean edge; 1 without such edges,
/// infinite where a length is not a number. A patch without a chart has no stretch.
fn largest_stretch(patch: &Patch) -> f64 {
    if patch.flat.is_empty() {
        return 1.0;
    }
    let (rim, place) = (patch.rim.len(), |v: u32| patch.positions[v as usize]);
    let length: f64 = (0..rim)
        .map(|k| (patch.positions[(k + 1) % rim] - patch.positions[k]).norm())
        .sum();
    let edge = length / rim.max(1) as f64;
    let mut most = 1.0f64;
    for face in &patch.faces {
        for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
            if a.max(b) as usize >= rim {
                let flat = (patch.flat[a as usize] - patch.flat[b as usize]).norm();
                let space = (place(a) - place(b)).norm();
                if space.is_nan() || flat.is_nan() {
                    return f64::INFINITY;
                }
                if space - flat > edge {
                    most = most.max(space / flat.max(f64::MIN_POSITIVE));
                }
            }
        }
    }
    most
}

/// The length of all edges over that in the chart; 1 for a patch without a chart.
fn mean_stretch(patch: &Patch) -> f64 {
    let (mut space, mut flat) = (0.0, 0.0);
    for face in patch.faces.iter().filter(|_| !patch.flat.is_empty()) {
        for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
            let (a, b) = (a as usize, b as usize);
            space += (patch.positions[a] - patch.positions[b]).norm();
            flat += (patch.flat[a] - patch.flat[b]).norm();
        }
    }
    if flat > 0.0 { space / flat } else { 1.0 }
}

impl PatchDraft<'_> {
    /// Why the draft is not applied unless the request accepts it. Cloth that anchors or gestures move is as the request wants it: its doubts are
    /// reported, but it is applied.
    pub fn reasons_to_leave(&self) -> Vec<String> {
        if self.edited {
            return Vec::new();
        }
        let mut reasons = doubts(&self.patch, self.hole.region());
        let no_fair = self.hole.charted().and_then(|hole| hole.no_fair.as_ref());
        if let (Some(why), false) = (no_fair, reasons.is_empty()) {
            reasons.push(format!("a fair surface is none either: {why}"));
        }
        reasons
    }

    /// The error of a draft that is not applied.
    pub fn left(&self, doubts: Vec<String>) -> MendError {
        let quality = quality::measure(&self.patch, self.hole.region());
        let measured = patch_report(self.hole, &self.patch, &quality);
        MendError::NoPlausibleFill {
            hole: self.hole.id(),
            doubts,
            patch: Box::new(v1::PatchReport {
                network_share: f64::from(self.network_share),
                ..measured
            }),
        }
    }
}
