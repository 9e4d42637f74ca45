//! Tests of anchors and gestures on a hole, with a network that needs no weights.

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
