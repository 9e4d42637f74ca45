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
mod tests {
    use darn_budget::Budget;

    use super::*;
    use crate::mender::Call;
    use crate::testing::{BEST_UV, context, mender, request};
    use proptest::prelude::*;

    const MIDDLE: [f64; 2] = [0.5, 0.5];
    /// Nowhere near the hole, which is about a disk of radius ¼ in the middle of the chart.
    const OUTSIDE: [f64; 2] = [0.05, 0.9];

    /// Where the unedited cloth is.
    fn cloth_at(context: &HoleContext, uv: [f64; 2]) -> Vec3 {
        let flat = context.hole.chart.frame.point(uv.into());
        context.unedited.patch.at(flat)
    }

    /// An anchor that moves the cloth at a uv by a vector.
    fn soft(context: &HoleContext, uv: [f64; 2], by: Vec3) -> Anchor {
        Anchor {
            hole: None,
            uv: Some(uv),
            position: (cloth_at(context, uv) + by).into(),
            hard: false,
        }
    }

    fn hard(context: &HoleContext, uv: [f64; 2], by: Vec3) -> Anchor {
        Anchor {
            hard: true,
            ..soft(context, uv, by)
        }
    }

    fn grab(uv: [f64; 2], offset: Vec3) -> Gesture {
        Gesture::Grab {
            uv,
            offset: offset.into(),
        }
    }

    fn pointers(outcome: Result<HoleConstraints, MendError>) -> (&'static str, Vec<String>) {
        match outcome {
            Ok(_) => ("", Vec::new()),
            Err(error) => {
                let pointers = error.fields().into_iter().map(|f| f.pointer);
                (error.code().word, pointers.collect())
            }
        }
    }

    #[test]
    fn an_anchor_on_the_unedited_cloth_moves_nothing() {
        let context = context();
        let asked = request(&[soft(&context, MIDDLE, Vec3::zeros())], &[]);
        let constraints = context.constraints(&asked).unwrap();
        let moves = constraints.moves();
        assert_eq!(moves.len(), 1);
        assert_eq!(moves[0].by, Vec3::zeros());
        assert_eq!(moves[0].cell, grid::cell_at(MIDDLE.into()));
        assert_eq!(constraints.pulls()[0].to, cloth_at(&context, MIDDLE));
    }

    #[test]
    fn anchors_without_uv_ask_the_budget() {
        let left = Budget::new(darn_budget::Limits::default(), &|| true);
        let call = Call {
            mender: mender(),
            budget: &left,
        };
        let context = HoleContext { call, ..context() };
        let free = Anchor {
            uv: None,
            ..soft(&context, MIDDLE, Vec3::zeros())
        };
        let refused = context.constraints(&request(&[free], &[])).err();
        assert!(matches!(refused, Some(MendError::Exhausted(_))));
    }

    #[test]
    fn points_beyond_what_is_solved_for_at_once_are_refused() {
        let context = context();
        let many = vec![soft(&context, MIDDLE, Vec3::zeros()); MAX_POINTS + 1];
        let (code, _) = pointers(context.constraints(&request(&many, &[])));
        assert_eq!(code, "constraints_do_not_fit");
    }

    #[test]
    fn every_uv_beside_the_hole_is_named() {
        let context = context();
        let up = Vec3::z() * 0.01;
        let asked = request(
            &[soft(&context, MIDDLE, up), soft(&context, OUTSIDE, up)],
            &[
                grab(OUTSIDE, up),
                Gesture::Pinch {
                    uvs: [MIDDLE, OUTSIDE],
                    amount: 0.5,
                },
                Gesture::Twist {
                    uv: OUTSIDE,
                    radius: 0.1,
                    axis: [0.0, 0.0, 1.0],
                    angle: 1.0,
                },
            ],
        );
        let (code, pointers) = pointers(context.constraints(&asked));
        assert_eq!(code, "constraints_do_not_fit");
        let wrong = [
            "/anchors/1/uv",
            "/edits/0/grab/uv",
            "/edits/1/pinch/uvs/1",
            "/edits/2/twist/uv",
        ];
        assert_eq!(pointers, wrong);
    }

    #[test]
    fn a_soft_anchor_out_of_reach_is_moved_within_reach_and_noted() {
        let context = context();
        let up = Vec3::z() * 10.0 * context.hole.extent();
        let asked = request(&[soft(&context, MIDDLE, up)], &[]);
        let constraints = context.constraints(&asked).unwrap();
        let rise = constraints.moves()[0].by;
        assert!(
            rise.z > 0.0 && rise.norm() < context.hole.extent(),
            "{rise}"
        );
        let kept = constraints.kept(&context.unedited.patch).unwrap();
        let anchor = &kept.anchors[0];
        assert!((anchor.beyond_reach - (up - rise).norm()).abs() < 1e-9);
        assert!((anchor.distance - up.norm()).abs() < 1e-9);
        let notes = constraints.notes(&kept.anchors);
        assert!(notes[0].starts_with("anchor 0 is"), "{notes:?}");
    }

    #[test]
    fn hard_anchors_out_of_reach_are_refused_and_soft_ones_are_not() {
        let context = context();
        let up = Vec3::z() * 10.0 * context.hole.extent();
        let near = [0.45, 0.55];
        let asked = request(
            &[
                soft(&context, near, Vec3::zeros()),
                hard(&context, MIDDLE, up),
            ],
            &[],
        );
        let (code, pointers) = pointers(context.constraints(&asked));
        assert_eq!(code, "anchor_out_of_reach");
        assert_eq!(pointers, ["/anchors/1"]);
    }

    #[test]
    fn a_patch_that_misses_a_hard_anchor_is_refused() {
        let context = context();
        let up = Vec3::z() * 0.1 * context.hole.extent();
        let asked = request(&[hard(&context, MIDDLE, up)], &[]);
        let constraints = context.constraints(&asked).unwrap();
        let error = constraints.kept(&context.unedited.patch).err().unwrap();
        assert_eq!(error.fields()[0].pointer, "/anchors/0");
    }

    #[test]
    fn an_anchor_without_uv_goes_where_the_loss_is_least() {
        let context = context();
        let free = Anchor {
            uv: None,
            ..soft(&context, MIDDLE, Vec3::zeros())
        };
        let constraints = context.constraints(&request(&[free], &[])).unwrap();
        let kept = constraints.kept(&context.unedited.patch).unwrap();
        let cell = grid::cell_at(BEST_UV.map(f64::from).into());
        let centre: [f64; 2] = grid::cell_centre(cell).into();
        assert_eq!(kept.anchors[0].uv, centre);
    }

    #[test]
    fn gestures_move_points_but_no_hard_anchor() {
        let context = context();
        let up = Vec3::z() * 0.02 * context.hole.extent();
        let free = [0.5, 0.4];
        let asked = request(
            &[hard(&context, MIDDLE, up)],
            &[grab(MIDDLE, up), grab(free, up), grab(free, up)],
        );
        let constraints = context.constraints(&asked).unwrap();
        let kept = constraints.kept(&context.unedited.patch);
        assert!(kept.is_err(), "the unedited patch misses the hard anchor");
        let moved: Vec<usize> = constraints.edits.iter().map(Vec::len).collect();
        assert_eq!(moved, [0, 1, 1]);
        let pulls = constraints.pulls();
        assert_eq!(pulls.len(), 2);
        assert!((pulls[0].to - cloth_at(&context, MIDDLE) - up).norm() < 1e-12);
        let twice = pulls[1].to - cloth_at(&context, free);
        assert!(twice.z > 2.0 * up.z - 1e-9, "{twice}");
    }

    #[test]
    fn the_move_of_a_cell_is_the_mean_of_its_points() {
        let context = context();
        let by = [0.01, 0.03].map(|share| Vec3::z() * share * context.hole.extent());
        let centre = grid::cell_centre(grid::cell_at(MIDDLE.into()));
        let beside = [centre.x + 0.002, centre.y];
        let asked = request(
            &[
                soft(&context, centre.into(), by[0]),
                soft(&context, beside, by[1]),
            ],
            &[],
        );
        let constraints = context.constraints(&asked).unwrap();
        let moves = constraints.moves();
        assert_eq!(moves.len(), 1);
        let targets = constraints.points.iter().map(PlacedPoint::displacement);
        let mean = targets.sum::<Vec3>() / 2.0;
        assert!((moves[0].by - mean).norm() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn soft_anchors_anywhere_move_cells_of_the_hole_and_stay_within_reach(
            places in prop::collection::vec((0.4..0.6f64, 0.4..0.6f64, prop::array::uniform3(-2.0..2.0f64)), 1..6)
        ) {
            let context = context();
            let extent = context.hole.extent();
            let anchors: Vec<Anchor> = places.iter()
                .map(|(u, v, by)| soft(&context, [*u, *v], Vec3::from(*by) * extent))
                .collect();
            let constraints = context.constraints(&request(&anchors, &[])).unwrap();
            let moves = constraints.moves();
            prop_assert!(moves.is_sorted_by(|a, b| a.cell < b.cell));
            for CellMove { cell, by } in moves {
                prop_assert!(context.hole.cells.contains(cell));
                prop_assert!(by.norm() < extent);
            }
            for (k, (pull, anchor)) in constraints.pulls().iter().zip(&anchors).enumerate() {
                let short = (pull.to - Vec3::from(anchor.position)).norm();
                prop_assert_eq!(constraints.beyond_reach(k), short);
            }
            // Targets within reach are nearly kept when they are asked for again.
            let again: Vec<Anchor> = constraints.pulls().iter().zip(&anchors)
                .map(|(pull, anchor)| Anchor { position: pull.to.into(), ..*anchor })
                .collect();
            let again = context.constraints(&request(&again, &[])).unwrap();
            for k in 0..anchors.len() {
                prop_assert!(again.beyond_reach(k) < 0.05 * extent);
            }
        }
    }

    #[test]
    fn edits_are_reported_one_by_one() {
        let context = context();
        let up = Vec3::z() * 0.02 * context.hole.extent();
        let edits = [grab(MIDDLE, up), grab([0.45, 0.45], Vec3::zeros())];
        let constraints = context.constraints(&request(&[], &edits)).unwrap();
        let kept = constraints.kept(&context.unedited.patch).unwrap();
        assert_eq!(kept.edits.len(), 2);
        assert!((kept.edits[0].distance - up.norm()).abs() < 1e-9);
    }
}
