//! A hole's anchors and gestures as points of its cloth with targets within reach, and how well a patch kept them.

use std::collections::BTreeMap;

use crate::context::HoleContext;
use crate::edit::{CellMove, ClothSurface, PlacedPoint, PlacedPoints};
use crate::error::MendError;
use crate::hole::Hole;
use crate::select::{Entry, HoleRequest};
use darn_contract::{Anchor, FieldError, Gesture, v1};
use darn_geometry::grid;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::{Firmness, Patch, Pull};

/// A hard anchor is met when the cloth is nearer to it than this share of the hole's extent.
const MET: f64 = 1e-3;

/// Most points that anchors and gestures may move on one hole. Their forces are solved for together, by a dense system that cannot be
/// interrupted: this many take a third of a second.
const MAX_POINTS: usize = 1024;
/// Nanoseconds of work a face of the patch in the search for the place of a point.
const FACE_WORK: u64 = 5;
/// Nanoseconds of work of bringing a point within reach.
const REACH_WORK: u64 = 400_000;
/// Nanoseconds of work of a gesture: the displacements of all cells before it.
const GESTURE_WORK: u64 = 5_000_000;

/// What the cloth of a hole should do.
pub struct HoleConstraints<'a> {
    hole: &'a Hole,
    anchors: Vec<Entry<Anchor>>,
    /// First the anchors' points, in their order, then those that gestures placed. Targets are within reach.
    points: Vec<PlacedPoint>,
    /// The target that the request gives each point, within reach or not.
    asked: Vec<Vec3>,
    /// For each gesture the indices of the points that it moved.
    edits: Vec<Vec<usize>>,
}

/// How a patch kept the constraints, in the contract's words.
#[derive(Default)]
pub struct KeptConstraints {
    /// One for each anchor of the hole.
    pub anchors: Vec<v1::AnchorReport>,
    /// One for each gesture on it.
    pub edits: Vec<v1::EditReport>,
}

impl<'a> HoleContext<'a> {
    /// Places a request's anchors and gestures on the cloth. Anchors without uv are searched for.
    ///
    /// # Errors
    /// `Constraints` for every uv that does not lie in the hole, `OutOfReach` for hard anchors that the cloth cannot
    /// reach; whatever [`HoleContext::place_anchor`] fails with.
    pub fn constraints(&self, request: &HoleRequest) -> Result<HoleConstraints<'a>, MendError> {
        let hole = self.hole;
        check_count(hole, request.anchors.len())?;
        check_uvs(hole, request)?;
        let place_work = FACE_WORK * self.unedited.patch.faces.len() as u64;
        let position = |flat: Vec2| self.unedited.patch.at(flat);
        let surface = ClothSurface {
            square: hole.chart.frame,
            position: &position,
        };
        let mut anchors = Vec::new();
        for Entry { value: anchor, .. } in &request.anchors {
            self.call.budget.spend(place_work)?;
            let target = Vec3::from(anchor.position);
            let uv = match anchor.uv {
                Some(uv) => uv.into(),
                None => self.place_anchor(target)?,
            };
            let firmness = match anchor.hard {
                true => Firmness::Hard,
                false => Firmness::Soft,
            };
            anchors.push(surface.point(uv, target, firmness));
        }
        let mut asked = targets(&anchors);
        self.call.budget.spend(REACH_WORK * anchors.len() as u64)?;
        bring_within_reach(hole, &mut anchors);
        let mut placed = PlacedPoints::new(&hole.cells, surface, anchors);
        let mut edits: Vec<Vec<usize>> = Vec::with_capacity(request.edits.len());
        for edit in &request.edits {
            self.call.budget.spend(GESTURE_WORK + place_work)?;
            edits.push(placed.apply(&edit.value.gesture));
        }
        let mut points = placed.points().to_vec();
        asked.extend(targets(&points).into_iter().skip(asked.len()));
        check_count(hole, points.len())?;
        if !edits.is_empty() {
            self.call.budget.spend(REACH_WORK * points.len() as u64)?;
            bring_within_reach(hole, &mut points);
        }
        let constraints = HoleConstraints {
            hole,
            anchors: request.anchors.clone(),
            points,
            asked,
            edits,
        };
        // Hard anchors that are plainly out of reach are refused before the network is asked.
        constraints.check_hard_anchors(|k| constraints.beyond_reach(k))?;
        Ok(constraints)
    }
}

impl HoleConstraints<'_> {
    /// Each cell that should move and how far, the mean where several points lie in one; in order of the cells'
    /// indices.
    pub fn moves(&self) -> Vec<CellMove> {
        let mut sums: BTreeMap<usize, (Vec3, f64)> = BTreeMap::new();
        for point in &self.points {
            let cell = grid::cell_at(point.uv);
            if self.hole.cells.contains(cell) {
                let (sum, count) = sums.entry(cell).or_insert((Vec3::zeros(), 0.0));
                *sum += point.displacement();
                *count += 1.0;
            }
        }
        let mean = |(cell, (sum, count)): (usize, (Vec3, f64))| CellMove {
            cell,
            by: sum / count,
        };
        sums.into_iter().map(mean).collect()
    }

    /// What pulls at the patch: the points at their exact place, not only in their cells.
    pub fn pulls(&self) -> Vec<Pull> {
        let pull = |p: &PlacedPoint| Pull {
            at: p.flat,
            to: p.target,
            firmness: p.firmness,
        };
        self.points.iter().map(pull).collect()
    }

    /// How a patch kept anchors and gestures.
    ///
    /// # Errors
    /// `OutOfReach` for hard anchors that it does not meet.
    pub fn kept(&self, patch: &Patch) -> Result<KeptConstraints, MendError> {
        let away = |k: usize| (patch.at(self.points[k].flat) - self.asked[k]).norm();
        self.check_hard_anchors(away)?;
        let anchors = (0..self.anchors.len()).map(|k| v1::AnchorReport {
            distance: away(k),
            uv: self.points[k].uv.iter().copied().collect(),
            beyond_reach: self.beyond_reach(k),
        });
        let edits = self.edits.iter().map(|moved| v1::EditReport {
            anchors: moved.len() as u32,
            distance: moved.iter().map(|k| away(*k)).fold(0.0, f64::max),
        });
        Ok(KeptConstraints {
            anchors: anchors.collect(),
            edits: edits.collect(),
        })
    }

    /// What a person should know about anchors that were not kept.
    pub fn notes(&self, anchors: &[v1::AnchorReport]) -> Vec<String> {
        let (extent, cell) = (self.hole.extent(), self.hole.cell_width());
        let mut notes = Vec::new();
        for (Entry { index, .. }, anchor) in self.anchors.iter().zip(anchors) {
            if anchor.distance > extent {
                notes.push(format!(
                    "anchor {index} is {:.3} away from the cloth, farther than the hole is wide ({extent:.3})",
                    anchor.distance
                ));
            } else if anchor.beyond_reach > 0.5 * cell {
                notes.push(format!(
                    "anchor {index} lies {:.4} beyond what the cloth around the hole can reach; it was drawn there as far as that allows",
                    anchor.beyond_reach
                ));
            }
        }
        notes
    }

    /// How far the target that was asked for lies from the one within reach, scene units.
    fn beyond_reach(&self, point: usize) -> f64 {
        (self.points[point].target - self.asked[point]).norm()
    }

    /// Checks that all hard anchors are met when the cloth stays `away(k)` from the target of point `k`.
    fn check_hard_anchors(&self, away: impl Fn(usize) -> f64) -> Result<(), MendError> {
        let limit = MET * self.hole.extent();
        let mut wrong = Vec::new();
        for (k, anchor) in self.anchors.iter().enumerate() {
            let distance = away(k);
            // A distance that is not a number is not met.
            if anchor.value.hard && (distance > limit || distance.is_nan()) {
                let detail = format!(
                    "the cloth stays {distance:.4} away from it, {limit:.4} is allowed; it lies {:.4} beyond what the cloth around the \
                     hole can reach without being stretched",
                    self.beyond_reach(k)
                );
                wrong.push(FieldError::new(
                    format!("/anchors/{}", anchor.index),
                    detail,
                ));
            }
        }
        if wrong.is_empty() {
            Ok(())
        } else {
            Err(MendError::OutOfReach(wrong))
        }
    }
}

fn targets(points: &[PlacedPoint]) -> Vec<Vec3> {
    points.iter().map(|p| p.target).collect()
}

/// Moves all targets to the nearest positions that the hole's cloth reaches.
fn bring_within_reach(hole: &Hole, points: &mut [PlacedPoint]) {
    let reachable = hole.reach.nearest(points);
    for (point, target) in points.iter_mut().zip(reachable) {
        point.target = target;
    }
}

/// Checks how many points a request moves on a hole.
fn check_count(hole: &Hole, points: usize) -> Result<(), MendError> {
    if points <= MAX_POINTS {
        return Ok(());
    }
    let detail = format!(
        "anchors and gestures move {points} points of hole {}; at most {MAX_POINTS} can be moved at once",
        hole.id
    );
    let wrong = FieldError::new("", detail);
    Err(MendError::Constraints(vec![wrong]))
}

/// Checks that every uv of a request lies in the hole.
fn check_uvs(hole: &Hole, request: &HoleRequest) -> Result<(), MendError> {
    let mut wrong = Vec::new();
    let mut check = |pointer: String, uv: [f64; 2]| {
        if !hole.contains(uv.into()) {
            let detail = format!("[{}, {}] does not lie in the hole", uv[0], uv[1]);
            wrong.push(FieldError::new(pointer, detail));
        }
    };
    for Entry { index, value } in &request.anchors {
        if let Some(uv) = value.uv {
            check(format!("/anchors/{index}/uv"), uv);
        }
    }
    for Entry { index, value } in &request.edits {
        match value.gesture {
            Gesture::Grab { uv, .. } => check(format!("/edits/{index}/grab/uv"), uv),
            Gesture::Twist { uv, .. } => check(format!("/edits/{index}/twist/uv"), uv),
            Gesture::Pinch { uvs, .. } => {
                check(format!("/edits/{index}/pinch/uvs/0"), uvs[0]);
                check(format!("/edits/{index}/pinch/uvs/1"), uvs[1]);
            }
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(MendError::Constraints(wrong))
    }
}

#[cfg(test)]
#[path = "constraints_tests.rs"]
mod tests;
