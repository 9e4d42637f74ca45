//! Bites, rips and torn corners at the cloth's own edge.

use std::sync::Arc;

use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::{Border, Constraints, HoleSelector, TornEdge, v1};
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::shapes::{sheet, tube};
use darn_geometry::mesh::weld::weld;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_mend::find_holes;

use super::cloth::{MendedScan, area, mended, packed, read};

fn asking(border: Border) -> Constraints {
    Constraints {
        holes: vec![HoleSelector::Border(border)],
        ..Constraints::default()
    }
}

/// A sheet of 48 squares a side without what `keep` leaves out, folded along v.
fn torn(keep: impl Fn(f64, f64) -> bool, fold: f64) -> TriMesh {
    let folded = sheet(48, keep, |u, v| Vec3::new(u, v, fold * (9.0 * u).sin()));
    Arc::unwrap_or_clone(weld(&folded).mesh)
}

fn bitten(u: f64, v: f64) -> bool {
    (u - 0.5).hypot(v) > 0.14
}

fn candidates(bytes: &[u8]) -> Vec<v1::BorderCandidate> {
    let found = find_holes(&read(bytes), HolesQuery::default(), Budget::unlimited());
    found.unwrap().candidates
}

/// The area of the patch over the area that is missing from the whole sheet.
fn share_mended(bytes: &[u8], mesh: &TriMesh, fold: f64) -> f64 {
    let after = MendedScan::of(bytes);
    assert!(
        after.loops.iter().all(|l| l.kind == LoopKind::Outer),
        "{:?}",
        after.loops.len()
    );
    assert!(after.topology.non_manifold.is_empty());
    after.patch_area() / (area(&torn(|_, _| true, fold)) - area(mesh))
}

#[test]
fn a_bite_is_told_and_left_until_it_is_asked_for() {
    for fold in [0.0, 0.04] {
        let mesh = torn(bitten, fold);
        let bytes = packed(&mesh, &[]);
        let told = candidates(&bytes);
        assert_eq!(told.len(), 1, "{told:?}");
        let error = mended(&bytes, &Constraints::default()).unwrap_err();
        assert_eq!(error.code().word, "no_holes");
        assert!(
            error.to_string().contains("\"border\": \"auto\""),
            "{error}"
        );

        let auto = mended(&bytes, &asking(Border::Auto)).unwrap();
        assert_eq!(auto.report.holes.len(), 1);
        let share = share_mended(&auto.bytes, &mesh, fold);
        assert!((0.93..1.07).contains(&share), "fold {fold}: {share}");
        for p in MendedScan::of(&auto.bytes).new_positions() {
            let off = p.z - fold * (9.0 * p.x).sin();
            assert!(off.abs() < 0.02 && p.y > -0.03, "fold {fold}: {p:?}");
        }
        // The scan's bytes stay, and the candidate says the same as `auto`.
        assert!(
            read(&auto.bytes)
                .surface
                .faces
                .starts_with(&read(&bytes).surface.faces)
        );
        let message = v1::Constraints {
            holes: vec![v1::HoleSelector {
                border: told[0].border.clone(),
                ..Default::default()
            }],
            ..Default::default()
        };
        let named = Constraints::check(&message).expect("a stretch that can be sent");
        assert!(mended(&bytes, &named).unwrap().bytes == auto.bytes);
    }
}

#[test]
fn a_rip_is_closed_and_a_torn_corner_is_mended_up_to_a_line() {
    let ripped = torn(|u, v| (u - 0.5).abs() > 0.015 || v > 0.4, 0.0);
    let answer = mended(&packed(&ripped, &[]), &asking(Border::Auto)).unwrap();
    let share = share_mended(&answer.bytes, &ripped, 0.0);
    assert!((0.9..1.1).contains(&share), "{share}");

    let corner = torn(|u, v| u + v > 0.3, 0.0);
    let line = Border::Line {
        from: [0.0, 0.32, 0.0],
        to: [0.32, 0.0, 0.0],
        along: vec![[0.0; 3]],
    };
    let answer = mended(&packed(&corner, &[]), &asking(line)).unwrap();
    let share = share_mended(&answer.bytes, &corner, 0.0);
    assert!((0.97..1.03).contains(&share), "{share}");
}

#[test]
fn torn_corners_are_found_and_mended_up_to_where_they_were() {
    let ragged = |u: f64, v: f64| u + v > 0.3 + 0.04 * (9.0 * v.atan2(u)).sin();
    for (mesh, fold) in [
        (torn(|u, v| u + v > 0.3, 0.0), 0.0),
        (torn(ragged, 0.02), 0.02),
    ] {
        let bytes = packed(&mesh, &[]);
        let told = candidates(&bytes);
        assert_eq!(told.len(), 1, "{told:?}");
        assert_eq!(told[0].border.as_ref().map(|b| b.along.len()), Some(1));
        let error = mended(&bytes, &Constraints::default()).unwrap_err();
        assert_eq!(error.code().word, "no_holes");
        let answer = mended(&bytes, &asking(Border::Auto)).unwrap();
        let share = share_mended(&answer.bytes, &mesh, fold);
        assert!((0.93..1.07).contains(&share), "fold {fold}: {share}");
        let after = MendedScan::of(&answer.bytes);
        let corner = after.new_positions().into_iter();
        let off = corner.map(|p| p.norm()).fold(f64::INFINITY, f64::min);
        assert!(off < 0.03, "fold {fold}: {off}");
    }
}

#[test]
fn a_border_without_a_bite_is_refused_at_its_place() {
    let whole = packed(&torn(|_, _| true, 0.0), &[]);
    assert!(candidates(&whole).is_empty());
    let same = Border::Line {
        from: [0.5, 0.0, 0.0],
        to: [0.501, 0.0, 0.0],
        along: Vec::new(),
    };
    for (border, told) in [(Border::Auto, "no bite"), (same, "same vertex")] {
        let error = mended(&whole, &asking(border)).unwrap_err();
        assert_eq!(error.fields()[0].pointer, "/holes/0/border");
        assert!(error.to_string().contains(told), "{error}");
    }
}

/// A sheet torn in two along v, across a ragged gap, folded along v; `turned` shows the right piece from its other side.
fn torn_in_two(fold: f64, turned: Turned) -> TriMesh {
    let gap = |u: f64, v: f64| (u - 0.5 - 0.015 * (23.0 * v).sin()).abs() > 0.06;
    let mut mesh = torn(gap, fold);
    let is_right = |v: u32| mesh.positions[v as usize].x > 0.5;
    if turned == Turned::Right {
        for face in &mut mesh.faces {
            if is_right(face[0]) {
                face.swap(1, 2);
            }
        }
    }
    mesh
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Turned {
    None,
    Right,
}

#[test]
fn cloth_torn_in_two_is_joined_by_its_candidate() {
    for (fold, turned) in [
        (0.0, Turned::None),
        (0.04, Turned::None),
        (0.04, Turned::Right),
    ] {
        let mesh = torn_in_two(fold, turned);
        let bytes = packed(&mesh, &[]);
        let told = candidates(&bytes);
        let [tear] = &told[..] else {
            panic!("{turned:?}, fold {fold}: {told:?}");
        };
        assert!((0.95..1.4).contains(&tear.length), "{tear:?}");
        assert!((0.08..0.16).contains(&tear.mouth), "{tear:?}");
        assert!(tear.facing_loop.is_some_and(|other| other != tear.r#loop));
        let message = v1::Constraints {
            holes: vec![v1::HoleSelector {
                border: tear.border.clone(),
                ..Default::default()
            }],
            ..Default::default()
        };
        let named = Constraints::check(&message).expect("a tear that can be sent");
        let answer = mended(&bytes, &named).unwrap();
        assert_eq!(answer.report.holes.len(), 1, "{:?}", answer.report);
        // Loops 0 and 1 are the edges of the two pieces.
        assert_eq!(answer.report.holes[0].id, 2);
        let notes = &answer.report.holes[0].notes;
        assert!(
            answer
                .report
                .notes
                .iter()
                .chain(notes)
                .any(|n| n.contains("torn edges")),
            "{:?}",
            answer.report
        );
        let share = share_mended(&answer.bytes, &mesh, fold);
        assert!(
            (0.93..1.07).contains(&share),
            "{turned:?}, fold {fold}: {share}"
        );
        assert_eq!(MendedScan::of(&answer.bytes).loops.len(), 1);
        for p in MendedScan::of(&answer.bytes).new_positions() {
            let off = p.z - fold * (9.0 * p.x).sin();
            assert!(off.abs() < 0.025, "{turned:?}, fold {fold}: {p:?}");
            assert!(
                (-0.03..1.03).contains(&p.y),
                "{turned:?}, fold {fold}: {p:?}"
            );
        }
        let before = read(&bytes).surface.faces;
        assert!(read(&answer.bytes).surface.faces.starts_with(&before));
    }
}

#[test]
fn an_edge_that_is_torn_more_raggedly_than_its_piece_is_long_is_joined_from_corner_to_corner() {
    // Teeth of one square, three squares deep: each torn edge is longer than the rest of its piece's.
    let keep = |u: f64, v: f64| {
        let tooth = 3.0 / 48.0 * f64::from((v * 48.0) as u32 % 2);
        (u - 0.35 - tooth).abs() > 0.05
    };
    let mesh = torn(keep, 0.0);
    let bytes = packed(&mesh, &[]);
    let told = candidates(&bytes);
    let [tear] = &told[..] else {
        panic!("{told:?}");
    };
    assert!(tear.length > 2.5, "{tear:?}");
    let border = tear.border.clone().expect("a border");
    let facing = border.facing.clone().expect("a torn edge");
    for end in [&border.from, &border.to, &facing.from, &facing.to] {
        assert!(end[1] < 1e-6 || end[1] > 1.0 - 1e-6, "no corner: {end:?}");
    }
    let message = v1::Constraints {
        holes: vec![v1::HoleSelector {
            border: Some(border),
            ..Default::default()
        }],
        ..Default::default()
    };
    let named = Constraints::check(&message).expect("a tear that can be sent");
    let answer = mended(&bytes, &named).unwrap();
    let share = share_mended(&answer.bytes, &mesh, 0.0);
    assert!((0.95..1.05).contains(&share), "{share}");
}

#[test]
fn pieces_that_do_not_face_each_other_are_no_tear() {
    // One above the other, and side by side at a right angle.
    let beside = |place: &dyn Fn(Vec3) -> Vec3| {
        let mut both = torn(|u, _| u < 0.5, 0.0);
        let count = both.positions.len() as u32;
        let other = torn(|u, _| u < 0.5, 0.0);
        both.positions
            .extend(other.positions.iter().map(|p| place(*p)));
        both.faces
            .extend(other.faces.iter().map(|f| f.map(|v| v + count)));
        candidates(&packed(&both, &[]))
    };
    let above = beside(&|p| p + Vec3::new(0.0, 0.0, 0.05));
    assert!(above.is_empty(), "{above:?}");
    let corner = beside(&|p| Vec3::new(0.55, p.y, p.x));
    assert!(corner.is_empty(), "{corner:?}");
    let far = beside(&|p| Vec3::new(1.5 - p.x, 1.0 - p.y, 0.0));
    assert!(far.is_empty(), "{far:?}");
}

#[test]
fn a_tear_that_cannot_be_joined_is_refused_at_its_place() {
    let bytes = packed(&torn_in_two(0.0, Turned::None), &[]);
    let tear = |first: [[f64; 3]; 2], second: [[f64; 3]; 2]| {
        let edge = |[from, to]: [[f64; 3]; 2]| TornEdge { from, to };
        Border::Tear([edge(first), edge(second)])
    };
    let left = [[0.44, 1.0, 0.0], [0.44, 0.0, 0.0]];
    for (border, told) in [
        (tear(left, [[0.6, 0.5, 0.0]; 2]), "in `facing`"),
        (tear(left, left), "overlaps"),
        (tear([[0.4, 0.5, 0.0]; 2], left), "same vertex"),
    ] {
        let error = mended(&bytes, &asking(border)).unwrap_err();
        assert_eq!(error.fields()[0].pointer, "/holes/0/border", "{error}");
        assert!(error.to_string().contains(told), "{error}");
    }
}

/// A bag with a round mouth at either end, without what `keep` leaves out.
fn bag(keep: impl Fn(f64, f64) -> bool) -> TriMesh {
    let mut mesh = Arc::unwrap_or_clone(weld(&tube(48, keep)).mesh);
    for p in &mut mesh.positions {
        let polar = 0.8 + (std::f64::consts::PI - 1.6) * p.z / 4.0;
        *p = Vec3::new(p.x * polar.sin(), p.y * polar.sin(), -1.5 * polar.cos());
    }
    mesh
}

#[test]
fn an_opening_with_a_rip_stays_open_and_the_rip_is_mended_named_or_found() {
    for depth in [0.15, 0.25, 0.3] {
        let ripped = bag(|u, v| (u - 0.5).abs() * 48.0 > 1.0 || v > depth);
        let bytes = packed(&ripped, &[]);
        let error = mended(&bytes, &Constraints::default()).unwrap_err();
        assert_eq!(error.code().word, "no_holes");
        assert_eq!(candidates(&bytes).len(), 1);
        // The rip's mouth, at the other side of the bag's mouth from where its angles begin.
        let lip = |angle: f64| {
            let (sin, cos) = (std::f64::consts::PI + angle).sin_cos();
            let radius = 0.8_f64.sin();
            [radius * cos, radius * sin, -1.5 * 0.8_f64.cos()]
        };
        let named = Border::Line {
            from: lip(-0.14),
            to: lip(0.14),
            along: Vec::new(),
        };
        let lost = area(&bag(|_, _| true)) - area(&ripped);
        for border in [named, Border::Auto] {
            let answer = mended(&bytes, &asking(border)).unwrap();
            let share = MendedScan::of(&answer.bytes).patch_area() / lost;
            assert!((0.8..1.2).contains(&share), "{depth}: {share}");
        }
    }
}

#[test]
fn points_far_from_the_cloth_are_refused_with_distance_and_limit() {
    let bytes = packed(
        &torn(|u, v| bitten(u, v) && (u - 0.5).hypot(v - 0.6) > 0.1, 0.0),
        &[],
    );
    let line = |from: [f64; 3], along: Vec<[f64; 3]>| {
        asking(Border::Line {
            from,
            to: [0.64, 0.0, 0.0],
            along,
        })
    };
    let near = |point: [f64; 3]| Constraints {
        holes: vec![HoleSelector::Near(point)],
        ..Constraints::default()
    };
    let at_bite = [0.36, 0.0, 0.0];
    for (asked, told) in [
        (line([1e6, 0.0, 0.0], Vec::new()), "`from` lies 999999.0000"),
        (
            line(at_bite, vec![[0.5, 0.0, 0.0], [-5.0, -5.0, 3.0]]),
            "`along/1` lies",
        ),
        (near([1e9, 0.0, 0.0]), "`near` lies"),
    ] {
        let error = mended(&bytes, &asked).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains(told) && text.contains("diagonal, 1.41"),
            "{text}"
        );
        assert!(error.fields()[0].pointer.starts_with("/holes/0"), "{error}");
    }
    // A click beside the cloth is none of these.
    mended(&bytes, &near([0.5, -0.6, 0.5])).unwrap();
    mended(&bytes, &line([0.36, -0.3, 0.2], Vec::new())).unwrap();
}

#[test]
fn the_lips_of_one_rip_are_mended_as_the_rip() {
    for depth in [0.3, 0.5, 0.8] {
        let ripped = torn(|u, v| (u - 0.5).abs() > 0.035 || v > depth, 0.0);
        let bytes = packed(&ripped, &[]);
        for half in [0.04, 0.0] {
            let (left, right) = (0.5 - half, 0.5 + half);
            let tear = Border::Tear([
                TornEdge {
                    from: [0.46, 0.0, 0.0],
                    to: [left, depth, 0.0],
                },
                TornEdge {
                    from: [right, depth, 0.0],
                    to: [0.54, 0.0, 0.0],
                },
            ]);
            let answer = mended(&bytes, &asking(tear)).unwrap();
            let share = share_mended(&answer.bytes, &ripped, 0.0);
            assert!((0.9..1.1).contains(&share), "{depth} {half}: {share}");
        }
    }
}

#[test]
fn a_tube_torn_in_two_is_refused_with_the_reason() {
    let torn = Arc::unwrap_or_clone(weld(&tube(40, |_, v| (v - 0.5).abs() > 0.06)).mesh);
    let edge = |z: f64| TornEdge {
        from: [1.0, 0.0, z],
        to: [-1.0, 0.0, z],
    };
    let tear = Border::Tear([edge(1.7), edge(2.3)]);
    let error = mended(&packed(&torn, &[]), &asking(tear)).unwrap_err();
    assert_eq!(error.fields()[0].pointer, "/holes/0/border");
    assert!(error.to_string().contains("ends of tubes"), "{error}");
}

#[test]
fn lips_longer_than_the_rest_of_the_edge_are_still_the_way_into_the_cloth() {
    let tooth = |v: f64| 0.1 * f64::from((v * 48.0 / 3.0) as u32 % 2);
    let keep = |u: f64, v: f64| {
        let t = tooth(v);
        !(0.3 + t..0.6 + t).contains(&u) || v > 0.8
    };
    for fold in [0.0, 0.03] {
        let ripped = torn(keep, fold);
        let bytes = packed(&ripped, &[]);
        let line = Border::Line {
            from: [0.3, 0.0, fold * (2.7_f64).sin()],
            to: [0.6, 0.0, fold * (5.4_f64).sin()],
            along: Vec::new(),
        };
        let answer = mended(&bytes, &asking(line)).unwrap();
        let share = share_mended(&answer.bytes, &ripped, fold);
        assert!((0.9..1.1).contains(&share), "fold {fold}: {share}");
    }
}

#[test]
fn stretches_that_overlap_are_told() {
    let bytes = packed(&torn(bitten, 0.0), &[]);
    let line = |half: f64| {
        HoleSelector::Border(Border::Line {
            from: [0.5 - half, 0.0, 0.0],
            to: [0.5 + half, 0.0, 0.0],
            along: Vec::new(),
        })
    };
    let both = |holes| Constraints {
        holes,
        ..Constraints::default()
    };
    let error = mended(&bytes, &both(vec![line(0.15), line(0.2)])).unwrap_err();
    assert_eq!(error.fields()[0].pointer, "/holes/1/border");
    assert!(
        error.to_string().contains("overlaps what /holes/0/border"),
        "{error}"
    );
    // What is found is left where it is named, too, in whatever order.
    let auto = HoleSelector::Border(Border::Auto);
    let answer = mended(&bytes, &both(vec![auto, line(0.15)])).unwrap();
    assert_eq!(answer.report.holes.len(), 1);
    let notes = &answer.report.notes;
    assert!(
        notes.iter().any(|n| n.contains("a bite was left")),
        "{notes:?}"
    );
}
