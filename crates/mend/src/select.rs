//! Matches a request to the loops of a scan: which loops it fills, and which anchors and gestures belong to which of
//! them.

use std::collections::BTreeMap;

use crate::error::MendError;
use crate::nearest_hole::NearestHole;
use crate::welded_scan::{WeldedScan, kind};
use darn_budget::Budget;
use darn_contract::{Anchor, Constraints, Edit, FieldError, HoleSelector, v1};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_gltf_scan::Scan;

/// Which loops are filled with which constraints, and which are left.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The holes to fill, in order of id.
    pub requests: Vec<HoleRequest>,
    /// All other loops, in order of id.
    pub skipped: Vec<v1::Skipped>,
}

/// A hole to fill, and its part of the constraints.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HoleRequest {
    /// The loop's id, which is its index among the scan's loops.
    pub id: u32,
    /// Its anchors.
    pub anchors: Vec<Entry<Anchor>>,
    /// Its gestures, in order.
    pub edits: Vec<Entry<Edit>>,
}

/// An entry of one of the request's lists.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry<T> {
    /// Its index in the request, for error pointers and notes.
    pub index: usize,
    /// What the request says.
    pub value: T,
}

impl HoleRequest {
    fn without_constraints(id: u32) -> HoleRequest {
        HoleRequest {
            id,
            ..HoleRequest::default()
        }
    }
}

impl Selection {
    /// Matches a request to the loops of a scan.
    ///
    /// # Errors
    /// `Constraints` for every selector, anchor or gesture that matches no loop to fill; `NonManifold` when the rim of
    /// a selected hole is no closed line; `NoHoles` when nothing is selected and there is no hole; `Exhausted`.
    pub fn of(
        scan: &Scan,
        welded: &WeldedScan,
        constraints: &Constraints,
        budget: &Budget,
    ) -> Result<Selection, MendError> {
        let mut near = NearestHole::of(welded, budget);
        let mut wrong = Vec::new();
        let mut requests = Requests::default();
        if constraints.holes.is_empty() {
            let loops = welded.loops.iter();
            let fillable = loops.filter(|l| reason_to_skip(scan, welded, l).is_none());
            fillable.for_each(|l| requests.add(l.id.0));
        }
        for (i, selector) in constraints.holes.iter().enumerate() {
            let rim = match selector {
                HoleSelector::Id(id) => with_id(welded, *id),
                HoleSelector::Near(point) => near.to(&Vec3::from(*point))?,
            };
            match rim.and_then(|rim| fillable(scan, welded, rim)) {
                Ok(id) => requests.add(id),
                Err(detail) => wrong.push(FieldError::new(format!("/holes/{i}"), detail)),
            }
        }
        wrong.extend(requests.assign(constraints));
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        let mut ids = requests.0.keys().copied();
        if let Some(hole) = ids.find(|id| welded.loops[*id as usize].non_manifold) {
            return Err(MendError::NonManifold { hole });
        }
        let skipped: Vec<v1::Skipped> = (welded.loops.iter())
            .filter(|l| !requests.0.contains_key(&l.id.0))
            .map(|l| skipped(scan, welded, l))
            .collect();
        if requests.0.is_empty() {
            return Err(MendError::NoHoles { skipped });
        }
        Ok(Selection {
            requests: requests.0.into_values().collect(),
            skipped,
        })
    }

    /// The same holes with the anchors and edits of another request, whose hole selectors are not looked at.
    ///
    /// # Errors
    /// `Constraints` for every anchor or gesture that belongs to none of the holes.
    pub fn with_constraints(&self, constraints: &Constraints) -> Result<Selection, MendError> {
        let mut requests = Requests::default();
        self.requests.iter().for_each(|r| requests.add(r.id));
        let wrong = requests.assign(constraints);
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        Ok(Selection {
            requests: requests.0.into_values().collect(),
            skipped: self.skipped.clone(),
        })
    }
}

/// The holes to fill, by id.
#[derive(Default)]
struct Requests(BTreeMap<u32, HoleRequest>);

impl Requests {
    fn add(&mut self, id: u32) {
        let new = || HoleRequest::without_constraints(id);
        self.0.entry(id).or_insert_with(new);
    }

    /// Gives every anchor and gesture to its hole; an error for each that has none.
    fn assign(&mut self, constraints: &Constraints) -> Vec<FieldError> {
        let mut wrong = Vec::new();
        for (index, value) in constraints.anchors.iter().copied().enumerate() {
            match self.owner(value.hole) {
                Ok(hole) => hole.anchors.push(Entry { index, value }),
                Err(detail) => {
                    wrong.push(FieldError::new(format!("/anchors/{index}/hole"), detail));
                }
            }
        }
        for (index, value) in constraints.edits.iter().copied().enumerate() {
            match self.owner(value.hole) {
                Ok(hole) => hole.edits.push(Entry { index, value }),
                Err(detail) => {
                    wrong.push(FieldError::new(format!("/edits/{index}/hole"), detail));
                }
            }
        }
        wrong
    }

    /// The hole that an anchor or gesture belongs to: the one it names, or the only one.
    fn owner(&mut self, named: Option<u32>) -> Result<&mut HoleRequest, String> {
        let count = self.0.len();
        match named {
            Some(id) => (self.0.get_mut(&id))
                .ok_or_else(|| format!("hole {id} is not among the holes to fill")),
            None if count == 1 => {
                (self.0.values_mut().next()).ok_or_else(|| "there is no hole to fill".to_owned())
            }
            None => Err(format!(
                "{count} holes are to be filled; say which one it belongs to"
            )),
        }
    }
}

/// The loop with an id, or why there is none.
fn with_id(welded: &WeldedScan, id: u32) -> Result<&BoundaryLoop, String> {
    welded.loops.get(id as usize).ok_or_else(|| {
        format!(
            "there is no loop {id}; the scan has {} boundary loop(s), numbered from 0",
            welded.loops.len()
        )
    })
}

/// The id of a selected loop, or why it may not be filled.
fn fillable(scan: &Scan, welded: &WeldedScan, rim: &BoundaryLoop) -> Result<u32, String> {
    match reason_to_skip(scan, welded, rim) {
        // `MendError::NonManifold`, with a code of its own, tells of these.
        Some(SkipReason {
            code: "non_manifold",
            ..
        })
        | None => Ok(rim.id.0),
        Some(SkipReason { phrase, .. }) => {
            Err(format!("loop {} is never filled: it is {phrase}", rim.id))
        }
    }
}

/// Why a loop is left as it is.
struct SkipReason {
    /// A stable word for programs.
    code: &'static str,
    /// What the loop is, for a person.
    phrase: &'static str,
}

/// Why a loop is left as it is when no selector names it; `None` for a hole that can be filled.
fn reason_to_skip(scan: &Scan, welded: &WeldedScan, rim: &BoundaryLoop) -> Option<SkipReason> {
    let (code, phrase) = match rim.kind {
        LoopKind::Outer => ("outer_boundary", "the cloth's own edge, the outer boundary"),
        LoopKind::TubeEnd => ("tube_end", "the end of a tube, such as a sleeve"),
        LoopKind::Hole if rim.non_manifold => (
            "non_manifold",
            "a hole whose rim runs through edges shared by more than two triangles",
        ),
        LoopKind::Hole if !welded.on_first_instance(scan, rim) => (
            "same_mesh",
            "a hole of a mesh that another node draws, too; the patch there shows here as well",
        ),
        LoopKind::Hole => return None,
    };
    Some(SkipReason { code, phrase })
}

fn skipped(scan: &Scan, welded: &WeldedScan, rim: &BoundaryLoop) -> v1::Skipped {
    let reason = reason_to_skip(scan, welded, rim).unwrap_or(SkipReason {
        code: "not_selected",
        phrase: "a hole that the request did not choose",
    });
    v1::Skipped {
        id: rim.id.0,
        kind: kind(rim.kind) as i32,
        code: reason.code.to_owned(),
        reason: reason.phrase.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{anchor_at, grab_at, scan_of};
    use darn_geometry::mesh::nearest::distance_to_loop;
    use darn_geometry::mesh::shapes::{sheet, tube};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    struct TwoHoles {
        scan: Scan,
        welded: WeldedScan,
        holes: [u32; 2],
        outer: u32,
    }

    /// A flat sheet with a round hole on the left and one on the right.
    static TWO_HOLES: LazyLock<TwoHoles> = LazyLock::new(|| {
        let keep = |u: f64, v: f64| (u - 0.3).hypot(v - 0.5).min((u - 0.7).hypot(v - 0.5)) > 0.1;
        let scan = scan_of(&sheet(24, keep, |u, v| Vec3::new(u, v, 0.0)));
        let welded = WeldedScan::of(&scan, Budget::unlimited()).unwrap();
        let of_kind = |kind| {
            let ids = welded.loops.iter().filter(|l| l.kind == kind);
            ids.map(|l| l.id.0).collect::<Vec<u32>>()
        };
        let mut holes = of_kind(LoopKind::Hole);
        holes.sort_by(|a, b| {
            let x = |id: &u32| welded.loops[*id as usize].centroid.x;
            x(a).total_cmp(&x(b))
        });
        TwoHoles {
            holes: holes.try_into().expect("two holes"),
            outer: of_kind(LoopKind::Outer)[0],
            welded,
            scan,
        }
    });

    fn selected(constraints: &Constraints) -> Result<Selection, MendError> {
        Selection::of(
            &TWO_HOLES.scan,
            &TWO_HOLES.welded,
            constraints,
            Budget::unlimited(),
        )
    }

    fn holes(selectors: &[HoleSelector]) -> Constraints {
        Constraints {
            holes: selectors.to_vec(),
            ..Constraints::default()
        }
    }

    fn ids(selection: &Selection) -> Vec<u32> {
        selection.requests.iter().map(|r| r.id).collect()
    }

    fn pointers(error: &MendError) -> Vec<String> {
        error.fields().into_iter().map(|f| f.pointer).collect()
    }

    #[test]
    fn without_selectors_every_hole_is_filled_and_the_outer_boundary_is_left() {
        let selection = selected(&Constraints::default()).unwrap();
        assert_eq!(selection.requests.len(), 2);
        let skipped: Vec<&str> = selection.skipped.iter().map(|s| s.code.as_str()).collect();
        assert_eq!(skipped, ["outer_boundary"]);
    }

    #[test]
    fn a_place_selects_the_hole_whose_rim_is_nearest() {
        for (x, hole) in [(-9.0, 0), (0.45, 0), (0.55, 1), (0.7, 1)] {
            let selection = selected(&holes(&[HoleSelector::Near([x, 0.5, 0.2])])).unwrap();
            assert_eq!(ids(&selection), [TWO_HOLES.holes[hole]]);
            let other = selection.skipped.iter().find(|s| s.code == "not_selected");
            assert_eq!(other.unwrap().id, TWO_HOLES.holes[1 - hole]);
        }
    }

    proptest! {
        #[test]
        fn the_nearest_hole_is_the_one_of_least_distance(x in -2.0..3.0f64, y in -2.0..3.0f64, z in -1.0..1.0f64) {
            let welded = &TWO_HOLES.welded;
            let point = Vec3::new(x, y, z);
            let found = NearestHole::of(welded, Budget::unlimited()).to(&point).unwrap().unwrap();
            let distance = |rim: &BoundaryLoop| distance_to_loop(&welded.surface.mesh, rim, &point);
            let least = TWO_HOLES.holes.map(|id| distance(&welded.loops[id as usize]));
            prop_assert_eq!(distance(found), least[0].min(least[1]));
        }
    }

    #[test]
    fn many_places_ask_the_budget() {
        let left = Budget::new(darn_budget::Limits::default(), &|| true);
        let places = vec![HoleSelector::Near([0.0; 3]); 100_000];
        let constraints = holes(&places);
        let refused = Selection::of(&TWO_HOLES.scan, &TWO_HOLES.welded, &constraints, &left);
        assert!(matches!(refused, Err(MendError::Exhausted(_))));
    }

    #[test]
    fn a_hole_that_is_selected_twice_is_filled_once() {
        let [left, _] = TWO_HOLES.holes;
        let twice = [HoleSelector::Near([0.3, 0.5, 0.0]), HoleSelector::Id(left)];
        assert_eq!(ids(&selected(&holes(&twice)).unwrap()), [left]);
    }

    #[test]
    fn every_entry_that_does_not_fit_is_named_in_the_order_of_the_request() {
        let [left, right] = TWO_HOLES.holes;
        let constraints = Constraints {
            holes: vec![
                HoleSelector::Id(TWO_HOLES.outer),
                HoleSelector::Id(left),
                HoleSelector::Id(99),
            ],
            anchors: vec![anchor_at(Some(left)), anchor_at(Some(right))],
            edits: vec![grab_at(Some(99)), grab_at(None)],
            ..Constraints::default()
        };
        let error = selected(&constraints).unwrap_err();
        let wrong = ["/holes/0", "/holes/2", "/anchors/1/hole", "/edits/0/hole"];
        assert_eq!(pointers(&error), wrong);
        let detail = &error.fields()[0].detail;
        assert!(
            detail.ends_with("the cloth's own edge, the outer boundary"),
            "{detail}"
        );
    }

    #[test]
    fn constraints_without_a_hole_belong_to_the_only_one() {
        let constraints = Constraints {
            anchors: vec![anchor_at(None)],
            edits: vec![grab_at(None)],
            ..holes(&[HoleSelector::Id(TWO_HOLES.holes[1])])
        };
        let selection = selected(&constraints).unwrap();
        let request = &selection.requests[0];
        assert_eq!((request.anchors.len(), request.edits.len()), (1, 1));

        let of_two = Constraints {
            holes: Vec::new(),
            ..constraints
        };
        let error = selected(&of_two).unwrap_err();
        assert_eq!(pointers(&error), ["/anchors/0/hole", "/edits/0/hole"]);
    }

    #[test]
    fn the_ends_of_a_tube_are_left_and_a_hole_in_its_side_is_filled() {
        let window = |u: f64, v: f64| (u - 0.5).abs() > 0.1 || (v - 0.5).abs() > 0.1;
        let scan = scan_of(&tube(24, window));
        let selection = Selection::of(
            &scan,
            &WeldedScan::of(&scan, Budget::unlimited()).unwrap(),
            &Constraints::default(),
            Budget::unlimited(),
        );
        let selection = selection.unwrap();
        assert_eq!(selection.requests.len(), 1);
        assert!(selection.skipped.iter().all(|s| s.code == "tube_end"));
        assert_eq!(selection.skipped.len(), 2);
    }

    #[test]
    fn a_scan_without_holes_is_refused_with_the_loops_that_it_has() {
        let scan = scan_of(&sheet(4, |_, _| true, |u, v| Vec3::new(u, v, 0.0)));
        let error = Selection::of(
            &scan,
            &WeldedScan::of(&scan, Budget::unlimited()).unwrap(),
            &Constraints::default(),
            Budget::unlimited(),
        );
        let error = error.unwrap_err();
        assert!(matches!(&error, MendError::NoHoles { skipped } if skipped.len() == 1));
    }

    proptest! {
        #[test]
        fn a_later_request_is_matched_as_if_its_holes_were_selected_anew(
            chosen in prop::sample::subsequence(vec![0usize, 1], 1..=2),
            anchors in prop::collection::vec(prop::option::of(0u32..4), 0..4),
            edits in prop::collection::vec(prop::option::of(0u32..4), 0..4),
        ) {
            let opened = holes(&chosen.iter().map(|k| HoleSelector::Id(TWO_HOLES.holes[*k])).collect::<Vec<_>>());
            let first = selected(&opened).unwrap();
            prop_assert_eq!(first.requests.len() + first.skipped.len(), TWO_HOLES.welded.loops.len());
            let later = Constraints {
                anchors: anchors.into_iter().map(anchor_at).collect(),
                edits: edits.into_iter().map(grab_at).collect(),
                ..Constraints::default()
            };
            let anew = selected(&Constraints { holes: opened.holes, ..later.clone() });
            match (first.with_constraints(&later), anew) {
                (Ok(kept), Ok(anew)) => {
                    let given: usize = kept.requests.iter().map(|r| r.anchors.len() + r.edits.len()).sum();
                    prop_assert_eq!(given, later.anchors.len() + later.edits.len());
                    prop_assert_eq!(kept, anew);
                }
                (Err(kept), Err(anew)) => prop_assert_eq!(kept.to_string(), anew.to_string()),
                (kept, anew) => prop_assert!(false, "{:?} {:?}", kept.is_ok(), anew.is_ok()),
            }
        }
    }
}
