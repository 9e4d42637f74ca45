//! What makes a patch no plausible cloth. Such a patch is not applied unless the request accepts it.

use std::collections::HashMap;

use crate::confidence;
use crate::error::MendError;
use crate::fill_hole::PatchDraft;
use crate::hole_report::patch_report;
use crate::prepared_hole::HoleRef;
use crate::welded_scan::WeldedScan;
use darn_contract::v1;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::region::Region;
use darn_geometry::patch::Patch;
use darn_geometry::patch::quality;

/// Length of an edge over its length in the chart from which on it is absurd, if it is also longer by more than half the mean edge of the rim: noise
/// makes short edges twice as long. Cloth strains by a few per cent; on 115 holes with known answers, noise up to 0.2 of an edge, one patch of cloth with noise
/// has an edge stretched more than 2.4 times.
const MOST_STRETCH: f64 = 2.5;
/// Mean of these from which on the patch is absurd: its chart has far too little cloth for the hole. On 70 holes in garments, sound
/// patches have up to 1.14.
const MOST_MEAN_STRETCH: f64 = 1.3;
/// Pairs of triangles that cut each other, per triangle of the patch, from which on the patch is absurd. A tent over a frayed rim cuts itself in 24 %.
/// On 149 scans with sound holes, patches are cut by up to 3.4 %, where crumpled cloth is noisy.
const MOST_CUTS: f64 = 0.04;
/// The same of a fair surface, which has no folds that could touch: up to 0.8 % there; one that fills a torn sheet's outside has 3.5 %.
const MOST_CUTS_FAIR: f64 = 0.03;
/// Fewer cuts than these are never absurd: a patch of few triangles next to a fold touches it.
pub const FEW_CUTS: usize = 8;

/// Mean angle defect of a patch's inner vertices, radians, from which on it is crumpled, if that is also so many times that of the cloth around it. On
/// 90 holes in garments and scans, sound patches have up to 0.033 (deep pleats 0.017); those that are far from the truth, and filled at nearly twice its area,
/// 0.09 and more.
const MOST_CRUMPLED: f64 = 0.08;
const MOST_CRUMPLED_AGAINST_CLOTH: f64 = 4.0;
/// Cosine of the angle between the normals of a patch and of the cloth that it is sewn to from which on it is folded over there: 120°.
const FOLDED: f64 = -0.5;
/// Share of a rim's length along which the patch folds over, from which on it is absurd. On the same 149 scans, patches fold over along up to 5 %.
const MOST_FOLDED: f64 = 0.15;
/// Area of a fair surface over that of the triangles that bend least between the vertices of its rim, from which on it is absurd. On 19
/// holes in garments it is up to 1.21, over the missing toe of a sock 1.58.
const MOST_GROWN: f64 = 2.5;
/// Share of the new vertices whose confidence is very low, from which on nobody can trust the patch.
const MOST_UNSURE: f64 = 0.5;
/// Area of a patch over that of the piece that it mends, from which on nothing is known of such patches: evaluation covers holes of up to 85 % of the
/// side of a square sheet.
const MOST_OF_PIECE: f64 = 2.6;
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
    // A fair surface has no chart.
    let most = match patch.flat.is_empty() {
        true => MOST_CUTS_FAIR,
        false => MOST_CUTS,
    };
    if cuts > FEW_CUTS && cuts as f64 > most * faces as f64 {
        let share = 100.0 * cuts as f64 / faces.max(1) as f64;
        let limit = 100.0 * most;
        doubts.push(format!(
            "{cuts} pairs of triangles cut each other, {share:.1} % of its {faces} triangles (limit {limit:.0} %)"
        ));
    }
    let folded = folded_over(patch, region);
    if folded > MOST_FOLDED {
        doubts.push(format!(
            "it folds over along {:.0} % of its rim (limit {:.0} %)",
            100.0 * folded,
            100.0 * MOST_FOLDED
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

/// The largest stretch of the edges with an inner vertex that are longer than in the chart by more than half the rim's mean edge; 1 without such edges,
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
                if space - flat > 0.5 * edge {
                    most = most.max(space / flat.max(f64::MIN_POSITIVE));
                }
            }
        }
    }
    most
}

/// The share of the rim's length at which the patch folds over the cloth that it is sewn to: their triangles' normals point to opposite sides.
fn folded_over(patch: &Patch, region: &Region) -> f64 {
    let normal = |mesh: &[Vec3], face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh[v as usize]);
        (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)
    };
    let sides = |f: &[u32; 3]| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])];
    let mut at_rim = vec![false; region.mesh.positions.len()];
    patch.rim.iter().for_each(|v| at_rim[*v as usize] = true);
    let mut cloth: HashMap<(u32, u32), &[u32; 3]> = HashMap::new();
    for face in &region.mesh.faces {
        let of_rim = sides(face).into_iter();
        let of_rim = of_rim.filter(|(a, b)| at_rim[*a as usize] && at_rim[*b as usize]);
        cloth.extend(of_rim.map(|side| (side, face)));
    }
    let (mut folded, mut length) = (0.0, 0.0);
    for face in &patch.faces {
        for (a, b) in sides(face) {
            let (Some(from), Some(to)) = (patch.rim.get(a as usize), patch.rim.get(b as usize))
            else {
                continue;
            };
            // Beside the patch's side lies the cloth's, the other way round.
            let Some(beside) = cloth.get(&(*to, *from)) else {
                continue;
            };
            let edge = (patch.positions[a as usize] - patch.positions[b as usize]).norm();
            let normals =
                normal(&patch.positions, face).zip(normal(&region.mesh.positions, beside));
            length += edge;
            if normals.is_some_and(|(new, old)| new.dot(&old) < FOLDED) {
                folded += edge;
            }
        }
    }
    if length > 0.0 { folded / length } else { 0.0 }
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

impl HoleRef<'_> {
    /// The reasons why a patch of the hole is no plausible cloth.
    pub fn doubts(self, patch: &Patch) -> Vec<String> {
        let mut doubts = doubts(patch, self.region());
        if let HoleRef::Fair(hole) = self {
            let (area, span) = (quality::area(patch), hole.fair.span_area);
            if area > MOST_GROWN * span {
                doubts.push(format!(
                    "its area is {:.1} times that of the triangles that bend least between the vertices of its rim (limit {MOST_GROWN})",
                    area / span.max(f64::MIN_POSITIVE)
                ));
            }
        }
        doubts
    }

    /// The reasons why nobody can trust a patch of the hole, however it looks. `deviations` are those of its new vertices, empty where they are not known.
    pub fn mistrust(self, patch: &Patch, deviations: &[f32], welded: &WeldedScan) -> Vec<String> {
        let mut reasons = Vec::new();
        if let Some(hole) = self.charted()
            && let Some(confidence) = confidence::report(deviations, hole.extent())
            && confidence.very_low > MOST_UNSURE
        {
            reasons.push(format!(
                "{:.0} % of its new vertices are of very low confidence (limit {:.0} %)",
                100.0 * confidence.very_low,
                100.0 * MOST_UNSURE
            ));
        }
        let area = quality::area(patch);
        let around: f64 = face_areas(&self.region().mesh).iter().sum();
        // The cloth of the region is part of the piece.
        if area > MOST_OF_PIECE * around {
            let piece = welded.piece_area(self.id());
            if area > MOST_OF_PIECE * piece {
                reasons.push(format!(
                    "it would have {:.1} times as much cloth as the piece that it mends; evaluation covers up to {MOST_OF_PIECE} times",
                    area / piece.max(f64::MIN_POSITIVE)
                ));
            }
        }
        reasons
    }
}

impl PatchDraft<'_> {
    /// Why the draft is not applied unless the request accepts it. Cloth that anchors or gestures move is as the request wants it: its doubts are
    /// reported, but it is applied.
    pub fn reasons_to_leave(&self, welded: &WeldedScan) -> Vec<String> {
        if self.edited {
            return Vec::new();
        }
        let mut reasons = self.hole.doubts(&self.patch);
        let no_fair = self.hole.charted().and_then(|hole| hole.no_fair.as_ref());
        if let (Some(why), false) = (no_fair, reasons.is_empty()) {
            reasons.push(format!("a fair surface is none either: {why}"));
        }
        let deviations = self.deviations();
        let new = deviations.get(self.patch.rim.len()..).unwrap_or_default();
        reasons.extend(self.hole.mistrust(&self.patch, new, welded));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inpainter::Inpainter;
    use crate::prepared_hole::PreparedHole;
    use crate::testing::{mender, scan_of};
    use darn_budget::Budget;
    use darn_geometry::mesh::TriMesh;
    use darn_geometry::mesh::loops::LoopKind;
    use darn_geometry::mesh::shapes::{holed_sheet, tube};

    fn prepared(mesh: &TriMesh, kind: LoopKind) -> (WeldedScan, PreparedHole) {
        let welded = WeldedScan::of(&scan_of(mesh), Budget::unlimited()).unwrap();
        let rim = welded.loops.iter().find(|l| l.kind == kind);
        let id = rim.expect("a loop").id.0;
        let hole = PreparedHole::new(&welded, id, mender().into()).expect("a hole");
        (welded, hole)
    }

    /// The patch with its inner vertices `times` as far from the middle of its rim.
    fn blown(patch: &Patch, times: f64) -> Patch {
        let rim = patch.rim.len();
        let middle = patch.positions[..rim].iter().sum::<Vec3>() / rim as f64;
        let mut blown = patch.clone();
        let inner = blown.positions[rim..].iter_mut();
        inner.for_each(|p| *p = middle + (*p - middle) * times);
        blown
    }

    fn says(reasons: &[String], what: &str) -> bool {
        reasons.iter().any(|reason| reason.contains(what))
    }

    #[test]
    fn a_fair_surface_is_judged_by_its_area_and_its_cuts() {
        let (_, hole) = prepared(&tube(24, |_, v| v < 0.5), LoopKind::TubeEnd);
        let PreparedHole::Fair(hole) = hole else {
            panic!("the end of a tube has no chart");
        };
        let (hole, sound) = (HoleRef::Fair(&hole), &hole.fair.patch);
        assert_eq!(hole.doubts(sound), Vec::<String>::new());
        let doubts = hole.doubts(&blown(sound, 4.0));
        assert!(says(&doubts, "that bend least"), "{doubts:?}");
        let cut = Patch {
            crossings: FEW_CUTS + sound.faces.len() / 25,
            ..sound.clone()
        };
        assert!(says(&hole.doubts(&cut), "(limit 3 %)"));
    }

    #[test]
    fn a_patch_that_folds_over_its_rim_is_doubted() {
        let (_, hole) = prepared(&holed_sheet(24, 0.15), LoopKind::Hole);
        let PreparedHole::Charted(hole) = hole else {
            panic!("flat cloth has a chart");
        };
        let inpainter = Inpainter::choose(&mender().networks, None, None).unwrap();
        let sound = hole.unedited(&inpainter, mender().into()).unwrap();
        // The cloth around turned inwards, so that it lies under the patch.
        let mut turned = hole.region.clone();
        let middle = Vec3::new(0.5, 0.5, 0.0);
        for (v, p) in (0u32..).zip(&mut turned.mesh.positions) {
            if !turned.rim.contains(&v) {
                let from = *p - middle;
                let far = from.norm();
                *p = middle + from * ((0.3 - far) / far);
            }
        }
        let doubts = doubts(&sound.patch, &turned);
        assert!(says(&doubts, "folds over along"), "{doubts:?}");
    }

    #[test]
    fn a_patch_that_evaluation_does_not_cover_is_not_trusted() {
        let (welded, hole) = prepared(&holed_sheet(24, 0.15), LoopKind::Hole);
        let PreparedHole::Charted(hole) = hole else {
            panic!("flat cloth has a chart");
        };
        let inpainter = Inpainter::choose(&mender().networks, None, None).unwrap();
        let sound = hole.unedited(&inpainter, mender().into()).unwrap();
        let hole = HoleRef::Charted(&hole);
        let new = sound.patch.positions.len() - sound.patch.rim.len();
        let certain = vec![0.0; new];
        let none = hole.mistrust(&sound.patch, &certain, &welded);
        assert_eq!(none, Vec::<String>::new());
        // Half of the vertices may lie anywhere.
        let mut unsure = certain.clone();
        unsure[..new * 2 / 3].fill(1.0);
        let reasons = hole.mistrust(&sound.patch, &unsure, &welded);
        assert!(says(&reasons, "of very low confidence"), "{reasons:?}");
        let reasons = hole.mistrust(&blown(&sound.patch, 20.0), &certain, &welded);
        assert!(says(&reasons, "as the piece that it mends"), "{reasons:?}");
    }
}
