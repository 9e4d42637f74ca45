//! Damaged cloth that is cut out before its hole is filled.

use std::collections::HashSet;
use std::sync::Arc;

use super::cloth::{MendedScan, ROUND, holed, laid, mended, mender, packed, read, sheet};
use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::{Anchor, Constraints, Cut, HoleSelector};
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::index::VertexId;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::shapes::tube;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::weld;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_lab::scarffolds::holed_scan::HoleShape;
use darn_mend::{ScanSession, find_holes};

fn asking(cuts: Vec<Cut>) -> Constraints {
    Constraints {
        holes: cuts.into_iter().map(HoleSelector::Cut).collect(),
        ..Constraints::default()
    }
}

/// A sheet without a hole.
fn whole(k: usize) -> TriMesh {
    let none = HoleShape::Circle {
        centre: Vec2::new(0.5, 0.5),
        radius: 0.0,
    };
    holed(sheet(k), &none).mesh
}

/// The place of the vertex farthest from a sheet's borders, and the least distance of a border's vertex from it.
fn middle(mesh: &TriMesh) -> (Vec3, f64) {
    let mesh = weld(mesh).mesh;
    let topology = Topology::new(&mesh);
    let at_border = topology.boundary_vertices();
    let ids = || (0..mesh.positions.len() as u32).map(VertexId);
    let mut reached = at_border.clone();
    let mut front: Vec<VertexId> = ids().filter(|v| at_border[v.index()]).collect();
    let mut last = front[0];
    while let Some(first) = front.first() {
        last = *first;
        let next = front.iter().flat_map(|v| topology.neighbours(*v));
        let mut next: Vec<VertexId> = next.filter(|v| !reached[v.index()]).collect();
        next.sort_unstable();
        next.dedup();
        next.iter().for_each(|v| reached[v.index()] = true);
        front = next;
    }
    let center = mesh.positions[last.index()];
    let border = ids().filter(|v| at_border[v.index()]);
    let distances = border.map(|v| (mesh.positions[v.index()] - center).norm());
    (center, distances.fold(f64::INFINITY, f64::min))
}

fn ball(center: Vec3, radius: f64) -> Cut {
    Cut::Ball {
        center: center.into(),
        radius,
    }
}

/// The detail of a refusal at this place.
fn refused(bytes: &[u8], constraints: &Constraints, pointer: &str) -> String {
    let error = mended(bytes, constraints).expect_err("a refusal");
    assert_eq!(error.code().word, "constraints_do_not_fit");
    let fields = error.fields();
    assert_eq!(fields[0].pointer, pointer, "{error}");
    fields[0].detail.clone()
}

#[test]
fn a_ball_of_cloth_is_cut_out_and_mended() {
    for k in 0..3 {
        let mesh = whole(k);
        let (center, room) = middle(&mesh);
        let radius = 0.4 * room;
        let bytes = packed(&mesh, &[]);
        let answer = mended(&bytes, &asking(vec![ball(center, radius)])).unwrap();
        let [hole] = &answer.report.holes[..] else {
            panic!("one hole");
        };
        assert_eq!(answer.report.notes, [""; 0]);
        let cut = hole.cut.expect("a cut");
        let after = MendedScan::of(&answer.bytes);
        assert!(after.loops.iter().all(|l| l.kind != LoopKind::Hole));
        assert!(after.topology.non_manifold.is_empty());
        let kept = after.welded.mesh.faces.len() - after.patch.len();
        assert_eq!(kept + cut.faces as usize, mesh.faces.len());
        // What is left of the cloth that was cut does not reach into the ball; other layers of the fold may.
        let faces = &after.welded.mesh.faces;
        let of_patch = after.patch.iter().flat_map(|f| faces[*f]);
        let of_patch: HashSet<u32> = of_patch.collect();
        let beside = |f: &usize| faces[*f].iter().any(|v| of_patch.contains(v));
        let kept = (0..faces.len()).filter(|f| !after.patch.contains(f));
        for f in kept.filter(beside) {
            let corners = after.welded.mesh.triangle(f);
            assert!(darn_geometry::mesh::cut::distance(&corners, &center) >= radius * 0.9999);
        }
        let share = after.patch_area() / cut.area;
        assert!((0.8..1.2).contains(&share), "sheet {k}: area {share}");
        let total: f64 = face_areas(&mesh).iter().sum();
        assert!(cut.area < 0.3 * total);
    }
}

#[test]
fn a_cut_of_known_cloth_comes_back_as_it_was() {
    let flat = holed(&laid(|u, v| [u, 0.25, -v]), &ROUND);
    let bytes = packed(&flat.mesh, &[]);
    // The hole's damaged edge: every triangle that touches its rim.
    let holes = find_holes(&read(&bytes), HolesQuery::default(), Budget::unlimited()).unwrap();
    let hole = holes
        .loops
        .iter()
        .find(|l| l.kind() == darn_contract::v1::LoopKind::Hole);
    let id = hole.expect("a hole").id;
    let answer = mended(&bytes, &asking(vec![Cut::Rims(vec![id])])).unwrap();
    assert_eq!(
        answer.report.holes[0].id, id,
        "the enlarged hole keeps its id"
    );
    let cut = answer.report.holes[0].cut.expect("a cut");
    let after = MendedScan::of(&answer.bytes);
    let lost: f64 = face_areas(&flat.lost).iter().sum();
    assert!((after.patch_area() / (lost + cut.area) - 1.0).abs() < 2e-3);
    for p in after.new_positions() {
        assert!((p.y - 0.25).abs() < 2e-3, "{p:?}");
    }
}

/// Two flat layers, one above the other.
fn layers(apart: f64) -> TriMesh {
    let below = holed(
        &laid(|u, v| [u, v, 0.0]),
        &HoleShape::Circle {
            centre: Vec2::new(0.5, 0.5),
            radius: 0.0,
        },
    )
    .mesh;
    let base = below.positions.len() as u32;
    let above = below.positions.iter().map(|p| p + Vec3::z() * apart);
    TriMesh {
        positions: below.positions.iter().copied().chain(above).collect(),
        faces: (below.faces.iter().copied())
            .chain(below.faces.iter().map(|f| f.map(|v| v + base)))
            .collect(),
    }
}

#[test]
fn a_cut_leaves_the_layer_behind() {
    let bytes = packed(&layers(0.1), &[]);
    let corners = [[0.4, 0.4], [0.6, 0.42], [0.62, 0.58], [0.41, 0.6]];
    let prism = |depth| Cut::Prism {
        polygon: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
        depth,
    };
    let one = mended(&bytes, &asking(vec![prism(0.05)])).unwrap();
    assert_eq!(one.report.holes.len(), 1);
    assert_eq!(one.report.notes, [""; 0]);
    // Both reach through both layers.
    let deep = mended(&bytes, &asking(vec![prism(0.5)])).unwrap();
    assert!(deep.bytes == one.bytes);
    let above = ball(Vec3::new(0.5, 0.5, 0.09), 0.15);
    let through = mended(&bytes, &asking(vec![above.clone()])).unwrap();
    assert_eq!(through.report.holes.len(), 1);
    let patch = MendedScan::of(&through.bytes).new_positions();
    assert!(patch.iter().all(|p| (p.z - 0.1).abs() < 0.01));
    let below = ball(Vec3::new(0.5, 0.5, 0.01), 0.15);
    let both = mended(&bytes, &asking(vec![above, below])).unwrap();
    assert_eq!(both.report.holes.len(), 2);
}

#[test]
fn ids_are_those_of_the_scan_and_new_holes_are_numbered_on() {
    let sheet = holed(
        sheet(0),
        &HoleShape::Circle {
            centre: Vec2::new(0.3, 0.3),
            radius: 0.08,
        },
    );
    let bytes = packed(&sheet.mesh, &[]);
    let found = find_holes(&read(&bytes), HolesQuery::default(), Budget::unlimited()).unwrap();
    let hole = (found.loops.iter()).find(|l| l.kind() == darn_contract::v1::LoopKind::Hole);
    let hole = hole.expect("a hole");
    let (center, room) = middle(&sheet.mesh);
    let new = found.loops.len() as u32;
    let constraints = Constraints {
        holes: vec![
            HoleSelector::Cut(ball(center, 0.4 * room)),
            HoleSelector::Id(hole.id),
        ],
        anchors: vec![Anchor {
            hole: Some(new),
            uv: None,
            position: center.into(),
            hard: false,
        }],
        ..Constraints::default()
    };
    let report = mended(&bytes, &constraints).unwrap().report;
    let ids: Vec<(u32, bool)> = report
        .holes
        .iter()
        .map(|h| (h.id, h.cut.is_some()))
        .collect();
    assert_eq!(ids, [(hole.id, false), (new, true)]);
    assert_eq!(report.holes[1].anchors.len(), 1);

    // A cut over all of the old hole's rim keeps its id.
    let at = Vec3::from_column_slice(&hole.centroid);
    let over = ball(at, 0.55 * hole.diameter);
    let kept = mended(&bytes, &asking(vec![over.clone()])).unwrap().report;
    assert_eq!(kept.holes[0].id, hole.id);

    // Where an old loop goes, it is accounted for.
    let both = asking(vec![over, Cut::Rims(vec![hole.id])]);
    let both = mended(&bytes, &both).unwrap().report;
    assert_eq!(both.holes.len(), 1);
    assert_eq!(both.skipped.len(), 1, "{:?}", both.skipped);
}

#[test]
fn a_cut_that_leaves_nothing_to_mend_is_refused() {
    let mesh = whole(0);
    let bytes = packed(&mesh, &[]);
    let (center, room) = middle(&mesh);
    let refused = |cut: Cut, at: &str| refused(&bytes, &asking(vec![cut]), at);
    let nothing = refused(
        ball(center + Vec3::repeat(90.0 * room), room),
        "/holes/0/cut",
    );
    assert!(nothing.contains("nearest triangle is"), "{nothing}");
    let all = refused(ball(center, 90.0 * room), "/holes/0/cut");
    assert!(all.contains("all of the scan's cloth"), "{all}");
    let corner = mesh.positions[0];
    let edge = refused(ball(corner, 0.4 * room), "/holes/0/cut");
    assert!(edge.contains("the cloth's own edge (loop 0)"), "{edge}");
    let missing = refused(Cut::Rims(vec![0, 7]), "/holes/0/cut/loops/0");
    assert!(missing.contains("own edge"), "{missing}");
    let missing = refused(Cut::Rims(vec![7]), "/holes/0/cut/loops/0");
    assert!(missing.contains("no loop 7"), "{missing}");
    let away = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| [90.0 + x, y, 0.0]);
    let prism = Cut::Prism {
        polygon: away.to_vec(),
        depth: 0.1,
    };
    let nothing = refused(prism, "/holes/0/cut");
    assert!(
        nothing.contains("under the polygon within 0.1"),
        "{nothing}"
    );
}

#[test]
fn a_cut_all_around_a_tube_is_refused() {
    let bytes = packed(&tube(24, |_, _| true), &[]);
    // The tube's axis is z, its radius 1, its length 4.
    let corners = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
    let cut = Cut::Prism {
        polygon: corners.map(|[x, y]| [x, y, 2.0]).to_vec(),
        depth: 0.3,
    };
    let detail = refused(&bytes, &asking(vec![cut]), "/holes/0/cut");
    assert!(detail.contains("all around the cloth"), "{detail}");
}

#[test]
fn a_session_mends_what_was_cut_as_a_single_call_does() {
    let mesh = whole(1);
    let bytes = packed(&mesh, &[]);
    let (center, room) = middle(&mesh);
    let asked = asking(vec![ball(center, 0.4 * room)]);
    let never = Budget::unlimited();
    let session = ScanSession::open(read(&bytes), &asked, Arc::clone(mender()), never).unwrap();
    assert!(
        session.described().holes[0]
            .report
            .as_ref()
            .unwrap()
            .cut
            .is_some()
    );
    let kept = session.call(never).mended(&Constraints::default()).unwrap();
    let single = mended(&bytes, &asked).unwrap();
    assert!(kept.bytes == single.bytes);
    let late = session.call(never).mended(&asked).unwrap_err();
    assert_eq!(late.fields()[0].pointer, "/holes/0/cut");
}

#[test]
fn what_a_mesher_sealed_is_listed_with_a_cut_that_takes_it_out() {
    let holed = holed(sheet(0), &ROUND);
    let bytes = packed(&holed.mesh, &[]);
    let never = Budget::unlimited();
    let wanted = HolesQuery { suspects: true };
    let untouched = find_holes(&read(&bytes), wanted, never).unwrap();
    assert_eq!(untouched.suspects, []);
    // A fan from one vertex of the rim, as ear clipping leaves it.
    let seen = MendedScan::of(&bytes);
    let rim = seen
        .loops
        .iter()
        .find(|l| l.kind == LoopKind::Hole)
        .expect("a hole");
    let mut sealed = TriMesh::clone(&seen.welded.mesh);
    let ends = rim.vertices[1..].windows(2);
    sealed
        .faces
        .extend(ends.map(|e| [rim.vertices[0].0, e[1].0, e[0].0]));
    let bytes = packed(&sealed, &[]);
    let found = find_holes(&read(&bytes), wanted, never).unwrap();
    assert!(
        find_holes(&read(&bytes), HolesQuery::default(), never)
            .unwrap()
            .suspects
            .is_empty()
    );
    let [suspect] = &found.suspects[..] else {
        panic!("{:?}", found.suspects);
    };
    assert_eq!(suspect.reason, "stretched", "{}", suspect.detail);
    let message = darn_contract::v1::Constraints {
        holes: vec![darn_contract::v1::HoleSelector {
            cut: suspect.cut.clone(),
            ..Default::default()
        }],
        ..Default::default()
    };
    let constraints = Constraints::check(&message).expect("a cut that can be sent");
    let answer = mended(&bytes, &constraints).unwrap();
    let cut = answer.report.holes[0].cut.expect("a cut");
    let lid = rim.vertices.len() as u32 - 2;
    assert!(
        (lid..2 * lid).contains(&cut.faces),
        "{} of {lid}",
        cut.faces
    );
    let after = MendedScan::of(&answer.bytes);
    let lost: f64 = face_areas(&holed.lost).iter().sum();
    let share = after.patch_area() / lost;
    assert!((0.85..1.3).contains(&share), "{share}");
}
