//! Tests of the choice of loops.

use super::*;
use crate::testing::{anchor_at, grab_at, scan_of};
use darn_contract::Diameters;
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
    for (x, hole) in [(0.1, 0), (0.45, 0), (0.55, 1), (0.7, 1)] {
        let selection = selected(&holes(&[HoleSelector::Near([x, 0.5, 0.2])])).unwrap();
        assert_eq!(ids(&selection), [TWO_HOLES.holes[hole]]);
        let other = selection.skipped.iter().find(|s| s.code == "not_selected");
        assert_eq!(other.unwrap().id, TWO_HOLES.holes[1 - hole]);
    }
}

proptest! {
    #[test]
    fn the_nearest_hole_is_the_one_of_least_distance(x in -0.4..1.4f64, y in -0.4..1.4f64, z in -0.4..0.4f64) {
        let welded = &TWO_HOLES.welded;
        let point = Vec3::new(x, y, z);
        let found = NearestLoop::of(welded, Budget::unlimited()).to(&point).unwrap().unwrap();
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
fn a_loop_that_is_named_is_tried_whatever_its_kind() {
    let [left, _] = TWO_HOLES.holes;
    let selection = selected(&holes(&[HoleSelector::Id(TWO_HOLES.outer)])).unwrap();
    assert_eq!(ids(&selection), [TWO_HOLES.outer]);
    let both = Constraints {
        fill: Some(Fill::Holes),
        ..holes(&[HoleSelector::Id(left)])
    };
    let selection = selected(&both).unwrap();
    let named: Vec<bool> = selection.requests.iter().map(|r| r.named).collect();
    assert_eq!(named.iter().filter(|n| **n).count(), 1);
    assert_eq!(named.len(), 2);
}

#[test]
fn ends_of_tubes_are_filled_when_openings_are() {
    let window = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.12;
    let scan = scan_of(&tube(24, window));
    let welded = WeldedScan::of(&scan, Budget::unlimited()).unwrap();
    for (fill, filled, left) in [
        (Fill::Holes, 1, vec!["tube_end", "tube_end"]),
        (Fill::Openings, 2, vec!["not_selected"]),
        (Fill::All, 3, vec![]),
    ] {
        let asked = Constraints {
            fill: Some(fill),
            ..Constraints::default()
        };
        let selection = Selection::of(&scan, &welded, &asked, Budget::unlimited()).unwrap();
        assert_eq!(selection.requests.len(), filled, "{fill:?}");
        let codes: Vec<&str> = selection.skipped.iter().map(|s| s.code.as_str()).collect();
        assert_eq!(codes, left, "{fill:?}");
    }
}

#[test]
fn loops_outside_the_diameters_and_excepted_ones_are_left_unless_named() {
    let [left, right] = TWO_HOLES.holes;
    let code = |constraints: &Constraints, id: u32| {
        let selection = selected(constraints).unwrap();
        let skipped = selection.skipped.into_iter().find(|s| s.id == id);
        skipped.map(|s| s.code)
    };
    let excepted = Constraints {
        except: vec![right],
        ..Constraints::default()
    };
    assert_eq!(code(&excepted, right).as_deref(), Some("excepted"));
    assert_eq!(code(&excepted, left), None);
    for (diameters, expected) in [
        (
            Diameters {
                min: Some(0.5),
                max: None,
            },
            "too_small",
        ),
        (
            Diameters {
                min: None,
                max: Some(0.1),
            },
            "too_large",
        ),
    ] {
        let named = Constraints {
            fill: Some(Fill::Holes),
            diameters,
            ..holes(&[HoleSelector::Id(left)])
        };
        assert_eq!(code(&named, right).as_deref(), Some(expected));
        assert_eq!(code(&named, left), None);
        let nothing = Constraints {
            diameters,
            ..Constraints::default()
        };
        assert!(matches!(selected(&nothing), Err(MendError::NoHoles { .. })));
    }
    let contradiction = Constraints {
        except: vec![left, 99],
        ..holes(&[HoleSelector::Id(left)])
    };
    let error = selected(&contradiction).unwrap_err();
    assert_eq!(pointers(&error), ["/except/1", "/holes/0"]);
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
            HoleSelector::Id(77),
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
    assert!(detail.starts_with("there is no loop 77"), "{detail}");
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
