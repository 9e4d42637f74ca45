//! Anchors, gestures, the anchor search and sessions.

use std::sync::Arc;

use darn_budget::Budget;
use darn_contract::{Anchor, Constraints, Edit, Gesture, Search};
use darn_geometry::mesh::{Vec2, Vec3};
use darn_lab::scarffolds::sheets::SimulatedSheet;
use darn_mend::{ScanSession, SessionCall};

use super::cloth::{ROUND, holed, laid, mended, mender, packed, read, sheet};

/// A session on a sheet with a round hole, and its cloth without constraints.
struct EditedSheet {
    session: ScanSession,
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    rim: usize,
    /// Scene units per cell of the grid.
    cell: f64,
    /// The hole's width, scene units.
    extent: f64,
}

impl EditedSheet {
    fn call(&self) -> SessionCall<'_> {
        self.session.call(Budget::unlimited())
    }

    fn of(sheet: &SimulatedSheet) -> EditedSheet {
        let scan = read(&packed(&holed(sheet, &ROUND).mesh, &[]));
        let session = ScanSession::open(
            scan,
            &Constraints::default(),
            Arc::clone(mender()),
            Budget::unlimited(),
        )
        .unwrap();
        let described = session.described();
        let hole = &described.holes[0];
        let (mut positions, report) = session
            .call(Budget::unlimited())
            .positions(&Constraints::default())
            .unwrap();
        let grid = report.holes[0].grid.unwrap();
        let rim: Vec<&[f64]> = hole.rim_uvs.chunks_exact(2).collect();
        let across = |d: usize| {
            let each = || rim.iter().map(move |uv| uv[d]);
            each().fold(f64::MIN, f64::max) - each().fold(f64::MAX, f64::min)
        };
        let extent = across(0).max(across(1)) * 64.0 * grid.spacing_mean;
        EditedSheet {
            positions: positions.remove(0),
            uvs: (hole.patch_uvs.chunks_exact(2))
                .map(|uv| Vec2::new(uv[0], uv[1]))
                .collect(),
            rim: rim.len(),
            cell: grid.spacing_mean,
            extent,
            session,
        }
    }

    /// The inner vertex nearest to a place, given relative to the hole's middle in shares of its half width.
    fn vertex(&self, at: [f64; 2]) -> usize {
        let rim = &self.uvs[..self.rim];
        let middle = rim.iter().sum::<Vec2>() / rim.len() as f64;
        let half = rim.iter().map(|uv| (uv - middle).norm()).sum::<f64>() / rim.len() as f64;
        let place = middle + Vec2::from(at) * half;
        let inner = self.rim..self.uvs.len();
        inner
            .min_by(|a, b| {
                (self.uvs[*a] - place)
                    .norm()
                    .total_cmp(&(self.uvs[*b] - place).norm())
            })
            .unwrap()
    }

    /// An anchor at a vertex, `by` away from where the cloth is.
    fn anchor(&self, vertex: usize, by: Vec3) -> Anchor {
        Anchor {
            hole: None,
            uv: Some(self.uvs[vertex].into()),
            position: (self.positions[vertex] + by).into(),
            hard: false,
        }
    }

    /// A unit vector across the cloth at a vertex, to the side where the cloth has slack.
    fn across(&self, vertex: usize) -> Vec3 {
        let rim = &self.positions[..self.rim];
        let middle = rim.iter().sum::<Vec3>() / rim.len() as f64;
        let turned: Vec3 = (0..self.rim)
            .map(|k| (rim[k] - middle).cross(&(rim[(k + 1) % self.rim] - middle)))
            .sum();
        let normal = turned.normalize();
        let side = (self.positions[vertex] - middle).dot(&normal);
        normal * if side < 0.0 { 1.0 } else { -1.0 }
    }
}

fn anchored(anchors: Vec<Anchor>) -> Constraints {
    Constraints {
        anchors,
        ..Constraints::default()
    }
}

fn edited(gestures: &[Gesture]) -> Constraints {
    let edit = |gesture: &Gesture| Edit {
        hole: None,
        gesture: *gesture,
    };
    Constraints {
        edits: gestures.iter().map(edit).collect(),
        ..Constraints::default()
    }
}

fn rms(a: &[Vec3], b: &[Vec3]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (squares / a.len() as f64).sqrt()
}

#[test]
fn anchors_on_the_unedited_cloth_change_it_by_less_than_a_tenth_of_a_cell() {
    for k in 0..3 {
        let cloth = EditedSheet::of(sheet(k));
        let places = [[0.0, 0.0], [0.5, 0.2], [-0.3, -0.5]];
        let anchors = places.map(|at| cloth.anchor(cloth.vertex(at), Vec3::zeros()));
        let (positions, report) = cloth.call().positions(&anchored(anchors.to_vec())).unwrap();
        let off = rms(&positions[0], &cloth.positions) / cloth.cell;
        assert!(off < 0.1, "sheet {k}: {off} cells");
        assert!(
            report.holes[0]
                .anchors
                .iter()
                .all(|a| a.beyond_reach < 1e-9 * cloth.extent)
        );
    }
}

#[test]
fn an_anchor_two_cells_off_is_met() {
    for k in 0..3 {
        let cloth = EditedSheet::of(sheet(k));
        let vertex = cloth.vertex([0.1, -0.1]);
        let by = cloth.across(vertex) * 2.0 * cloth.cell;
        let asked = anchored(vec![cloth.anchor(vertex, by)]);
        let (positions, report) = cloth.call().positions(&asked).unwrap();
        let told = &report.holes[0].anchors[0];
        let off = (positions[0][vertex] - cloth.positions[vertex] - by).norm();
        assert!((off - told.distance).abs() < 1e-6 * cloth.cell);
        assert!(
            off <= 0.5 * cloth.cell + told.beyond_reach,
            "sheet {k}: {} cells, {} of them beyond reach",
            off / cloth.cell,
            told.beyond_reach / cloth.cell
        );
    }
}

#[test]
fn an_anchor_ten_holes_away_neither_tears_nor_inflates_the_cloth() {
    for k in 0..3 {
        let cloth = EditedSheet::of(sheet(k));
        let vertex = cloth.vertex([0.0, 0.0]);
        let by = cloth.across(vertex) * 10.0 * cloth.extent;
        let asked = anchored(vec![cloth.anchor(vertex, by)]);
        let (positions, report) = cloth.call().positions(&asked).unwrap();
        let hole = &report.holes[0];
        let stretch = hole.patch.as_ref().unwrap().stretch_max;
        let (_, free) = cloth.call().positions(&Constraints::default()).unwrap();
        let usual = free.holes[0].patch.as_ref().unwrap().stretch_max;
        assert!(
            stretch <= 1.25f64.max(1.05 * usual) + 1e-6,
            "sheet {k}: {stretch}, {usual} without it"
        );
        assert!(hole.anchors[0].distance > 8.0 * cloth.extent);
        assert!(hole.anchors[0].beyond_reach > 8.0 * cloth.extent);
        assert!(hole.notes.iter().any(|n| n.starts_with("anchor 0")));
        let farthest = (positions[0].iter().zip(&cloth.positions))
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max);
        assert!(farthest < cloth.extent, "sheet {k}: {farthest}");
    }
}

#[test]
fn a_hard_anchor_is_met_or_refused_with_the_numbers() {
    let cloth = EditedSheet::of(sheet(0));
    let vertex = cloth.vertex([0.0, 0.0]);
    let hard = |by: Vec3| Anchor {
        hard: true,
        ..cloth.anchor(vertex, by)
    };
    let far = hard(cloth.across(vertex) * 10.0 * cloth.extent);
    let soft = cloth.anchor(vertex, Vec3::zeros());
    let error = (cloth.call().positions(&anchored(vec![soft, far]))).unwrap_err();
    assert_eq!(error.code().word, "anchor_out_of_reach");
    assert_eq!(error.fields()[0].pointer, "/anchors/1");
    assert!(error.fields()[0].detail.contains("beyond"), "{error}");

    let near = hard(cloth.across(vertex) * 0.5 * cloth.cell);
    let (_, report) = cloth.call().positions(&anchored(vec![near])).unwrap();
    assert!(report.holes[0].anchors[0].distance <= 1e-3 * cloth.extent);
}

#[test]
fn a_soft_anchor_at_the_rim_does_not_keep_a_hard_one_from_being_met() {
    let cloth = EditedSheet::of(sheet(0));
    let middle = cloth.vertex([0.0, 0.0]);
    let hard = Anchor {
        hard: true,
        ..cloth.anchor(middle, cloth.across(middle) * 0.5 * cloth.cell)
    };
    let faces = cloth.session.described().holes[0].patch_faces.clone();
    let inner = |face: &&[u32]| face.iter().filter(|v| **v as usize >= cloth.rim).count() == 1;
    for face in faces.chunks_exact(3).filter(inner).step_by(5) {
        // Nearly on the rim and half a cell off: more than the triangle's one free vertex can reach.
        let share = |v: u32| if (v as usize) < cloth.rim { 0.44 } else { 0.12 };
        let uv: Vec2 = face
            .iter()
            .map(|v| cloth.uvs[*v as usize] * share(*v))
            .sum();
        let at: Vec3 = face
            .iter()
            .map(|v| cloth.positions[*v as usize] * share(*v))
            .sum();
        let soft = Anchor {
            hole: None,
            uv: Some(uv.into()),
            position: (at + cloth.across(middle) * 0.5 * cloth.cell).into(),
            hard: false,
        };
        let (_, report) = (cloth.call().positions(&anchored(vec![hard, soft]))).unwrap();
        assert!(report.holes[0].anchors[0].distance <= 1e-3 * cloth.extent);
    }
}

#[test]
fn gestures_compose_in_order() {
    let cloth = EditedSheet::of(sheet(1));
    let vertex = cloth.vertex([0.1, 0.1]);
    let (uv, up) = (cloth.uvs[vertex].into(), cloth.across(vertex) * cloth.cell);
    let grab = |share: f64| Gesture::Grab {
        uv,
        offset: (up * share).into(),
    };
    let (once, report) = cloth.call().positions(&edited(&[grab(1.5)])).unwrap();
    let (twice, _) = cloth
        .call()
        .positions(&edited(&[grab(1.0), grab(0.5)]))
        .unwrap();
    assert!(rms(&once[0], &twice[0]) < 1e-6 * cloth.cell);
    assert!(rms(&once[0], &cloth.positions) > 0.01 * cloth.cell);
    assert_eq!(report.holes[0].edits[0].anchors, 1);

    let twist = |angle| Gesture::Twist {
        uv,
        radius: 0.1,
        axis: up.into(),
        angle,
    };
    let asked = edited(&[twist(0.5), twist(-0.5)]);
    let (back, report) = cloth.call().positions(&asked).unwrap();
    let off = rms(&back[0], &cloth.positions) / cloth.cell;
    assert!(off < 0.25, "a twist and its inverse: {off} cells");
    assert!(report.holes[0].edits[0].anchors > 5);
}

#[test]
fn a_gesture_beside_the_hole_is_refused() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let aside = Gesture::Pinch {
        uvs: [[0.5, 0.5], [0.01, 0.99]],
        amount: 0.5,
    };
    let error = mended(&bytes, &edited(&[aside])).unwrap_err();
    assert_eq!(error.fields()[0].pointer, "/edits/0/pinch/uvs/1");
}

#[test]
fn the_search_finds_the_cell_that_trying_all_finds() {
    let cloth = EditedSheet::of(sheet(2));
    let vertex = cloth.vertex([0.3, -0.3]);
    let target = cloth.positions[vertex] + cloth.across(vertex) * 0.5 * cloth.cell;
    let search = Search {
        hole: None,
        target: target.into(),
        start: None,
        exhaustive: false,
        map: false,
        map_gradient: false,
    };
    let found = cloth.call().optimize_anchor(&search).unwrap();
    let all = Search {
        exhaustive: true,
        map: true,
        map_gradient: true,
        ..search
    };
    let best = cloth.call().optimize_anchor(&all).unwrap();
    let apart = |d: usize| f64::from(found.cell[d]) - f64::from(best.cell[d]);
    assert!(
        apart(0).hypot(apart(1)) <= 2.0 || found.loss <= 1.1 * best.loss,
        "{} at {:?}, {} at {:?}",
        found.loss,
        found.cell,
        best.loss,
        best.cell
    );
    assert!(found.evaluations * 3 < best.evaluations);
    assert_eq!(best.map.len(), 64 * 64);
    assert!(best.map.iter().all(|x| x.is_nan() || *x >= best.loss));
    assert!(best.map_png.starts_with(b"\x89PNG"));
    assert_eq!(best.map_gradient.len(), 2 * 64 * 64);
    let alone = Search {
        map_gradient: false,
        ..all
    };
    let alone = cloth.call().optimize_anchor(&alone).unwrap();
    let differ = alone.map.iter().zip(&best.map);
    let differ = differ.filter(|(a, b)| (*a - *b).abs() > 1e-4 * b.abs());
    assert_eq!(differ.count(), 0, "the gradient changes no loss");
    assert!(alone.map_gradient.is_empty() && alone.gradients == 1);

    // An anchor without uv goes to the same place.
    let asked = anchored(vec![Anchor {
        uv: None,
        ..cloth.anchor(vertex, target - cloth.positions[vertex])
    }]);
    let (_, report) = cloth.call().positions(&asked).unwrap();
    assert_eq!(report.holes[0].anchors[0].uv, found.uv);
}

#[test]
fn a_target_of_1e17_is_searched_for() {
    let cloth = EditedSheet::of(sheet(0));
    let search = Search {
        hole: None,
        target: [1e17, 0.0, 0.0],
        start: None,
        exhaustive: false,
        map: false,
        map_gradient: false,
    };
    let found = cloth.call().optimize_anchor(&search).unwrap();
    assert!(found.loss.is_finite() && found.distance > 9e16);
    let asked = anchored(vec![Anchor {
        hole: None,
        uv: None,
        position: search.target,
        hard: false,
    }]);
    let (positions, _) = cloth.call().positions(&asked).unwrap();
    assert!(positions[0].iter().all(|p| p.norm() < 1e3));
}

#[test]
fn a_session_answers_as_single_calls_do() {
    let sheet = laid(|u, v| [u, 0.03 * (9.0 * u).sin(), -v]);
    let bytes = packed(&holed(&sheet, &ROUND).mesh, &[]);
    let session = ScanSession::open(
        read(&bytes),
        &Constraints::default(),
        Arc::clone(mender()),
        Budget::unlimited(),
    )
    .unwrap();
    let cloth = EditedSheet::of(&sheet);
    let asked = Constraints {
        anchors: vec![cloth.anchor(cloth.vertex([0.2, 0.0]), Vec3::y() * cloth.cell)],
        ..edited(&[Gesture::Pinch {
            uvs: [[0.45, 0.5], [0.55, 0.5]],
            amount: 0.3,
        }])
    };
    // The same point of the cloth, dragged on: the session asks the network for less then.
    let dragged = Constraints {
        anchors: vec![cloth.anchor(cloth.vertex([0.2, 0.0]), Vec3::y() * (1.5 * cloth.cell))],
        ..asked.clone()
    };
    for constraints in [
        Constraints::default(),
        asked.clone(),
        dragged,
        asked.clone(),
        Constraints::default(),
    ] {
        let kept = session
            .call(Budget::unlimited())
            .mended(&constraints)
            .unwrap();
        let single = mended(&bytes, &constraints).unwrap();
        assert!(kept.bytes == single.bytes);
        assert_eq!(kept.report.holes[0].patch, single.report.holes[0].patch);
    }

    // The patches alone have the same vertices.
    let (glb, _) = session.call(Budget::unlimited()).glb(&asked).unwrap();
    let (positions, _) = session.call(Budget::unlimited()).positions(&asked).unwrap();
    let alone = read(&glb);
    assert_eq!(alone.surface.positions.len(), positions[0].len());
    assert_eq!(
        alone.surface.faces.len() * 3,
        session.described().holes[0].patch_faces.len()
    );

    let search = Search {
        hole: None,
        target: [0.5, 0.05, -0.5],
        start: Some([0.5, 0.5]),
        exhaustive: false,
        map: false,
        map_gradient: false,
    };
    let kept = session
        .call(Budget::unlimited())
        .optimize_anchor(&search)
        .unwrap();
    let single = darn_mend::optimize_anchor(&read(&bytes), &search, mender()).unwrap();
    assert_eq!((&kept.path, kept.loss), (&single.path, single.loss));
    let to_target = darn_mend::mend_to_target(&read(&bytes), &search, mender()).unwrap();
    assert!(
        to_target.bytes
            == mended(&bytes, &darn_mend::anchor_of(&kept, &search))
                .unwrap()
                .bytes
    );
}

#[test]
fn a_session_describes_its_holes() {
    let cloth = EditedSheet::of(sheet(0));
    let described = cloth.session.described();
    let hole = &described.holes[0];
    assert_eq!(hole.grid_positions.len(), 3 * 64 * 64);
    assert_eq!(hole.rim_positions.len() / 3, cloth.rim);
    let most = hole.patch_faces.iter().max().map(|v| *v as usize);
    assert!(most.unwrap() < cloth.uvs.len());
    assert!(hole.chart_png.starts_with(b"\x89PNG"));
    assert!(described.bytes > 100_000);
    assert_eq!(described.skipped.len(), 1);
    let anchor = cloth.anchor(cloth.vertex([0.0, 0.0]), Vec3::zeros());
    let scan = read(&packed(&holed(sheet(0), &ROUND).mesh, &[]));
    let error = ScanSession::open(
        scan,
        &anchored(vec![anchor]),
        Arc::clone(mender()),
        Budget::unlimited(),
    )
    .err();
    assert_eq!(error.unwrap().fields()[0].pointer, "/anchors");
}

#[test]
fn weights_that_are_not_loaded_are_refused_by_name() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let asked = Constraints {
        weights: Some("silk".into()),
        ..Constraints::default()
    };
    let error = mended(&bytes, &asked).unwrap_err();
    assert_eq!(error.fields()[0].pointer, "/weights");
    assert!(error.fields()[0].detail.contains("`standard`"), "{error}");
}

#[test]
fn up_without_weights_for_it_is_noted() {
    let bytes = packed(&holed(sheet(0), &ROUND).mesh, &[]);
    let asked = Constraints {
        up: Some([0.0, 1.0, 0.0]),
        ..Constraints::default()
    };
    let report = mended(&bytes, &asked).unwrap().report;
    assert!(
        report.notes.iter().any(|n| n.contains("`gravity`")),
        "{:?}",
        report.notes
    );
}
