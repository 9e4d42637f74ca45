//! Laws of measuring: the truth is without error, smooth fills reproduce what their energy does not see, patches keep the rim.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::metrics::{Measurement, measure};
use super::patched::patched;
use super::shaded_views::ShadedViews;
use super::*;
use crate::scarffolds::masks::{self, MaskShape, SHAPES};
use crate::scarffolds::samples::{SampleRotation, Sampler, TrainingSample};
use crate::scarffolds::sheets::SimulatedSheet;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE, cell_centre};
use darn_geometry::mesh::Vec3;
use darn_geometry::patch::PatchOptions;
use darn_geometry::smooth::{Smooth, smooth};
use darn_net::FilledGrid;

/// A case on a surface over the unit square, with a hole of the given shape.
fn case(surface: impl Fn(f64, f64) -> Vec3, shape: MaskShape, seed: u64) -> EvaluationCase {
    let hole = masks::draw_shape(shape, &mut ChaCha8Rng::seed_from_u64(seed));
    let truth = (0..CELLS).map(cell_centre).map(|uv| {
        let p = surface(uv.x, uv.y);
        [p.x as f32, p.y as f32, p.z as f32]
    });
    EvaluationCase {
        sample: TrainingSample {
            truth: truth.collect(),
            valid: vec![true; CELLS],
            known: hole.iter().map(|h| !h).collect(),
            hole,
        },
        shape,
        size: HoleSize::Middle,
    }
}

fn measured(case: &EvaluationCase, composed: &[Vec3]) -> Measurement {
    measure(case, &ShadedViews::of(case), composed)
}

fn plane(u: f64, v: f64) -> Vec3 {
    Vec3::new(0.6 * u, v, 0.8 * u)
}

/// Unit circumference speed: isometric to the plane.
fn cylinder(u: f64, v: f64) -> Vec3 {
    Vec3::new(0.3 * (u / 0.3).sin(), v, 0.3 * (u / 0.3).cos())
}

#[test]
fn the_truth_has_no_error_and_its_own_spacing() {
    for (shape, _) in SHAPES {
        let case = case(cylinder, shape, 4);
        let found = measured(&case, &case.answer(&case.observed(0.0, 1)));
        let m = found.metrics;
        assert!(m.rmse < 1e-6 && m.normal < 1e-3, "{m:?}");
        assert!((m.spacing_mean * 64.0 - 1.0).abs() < 1e-3 && m.spacing_variance < 1e-10);
        assert!((m.area - 1.0).abs() < 1e-9 && m.self_intersections == 0.0);
        assert!((m.ssim - 1.0).abs() < 1e-9, "{}", m.ssim);
        // A cylinder is developable: no defect beyond what f32 leaves.
        assert!(
            m.curvature < 1e-4 && !found.defects.is_empty(),
            "{}",
            m.curvature
        );
    }
}

#[test]
fn errors_are_in_cells() {
    let case = case(plane, MaskShape::Circle, 2);
    let mut answer = case.answer(&case.observed(0.0, 1));
    for k in (0..CELLS).filter(|&k| case.sample.hole[k]) {
        answer[k] += Vec3::new(0.0, 0.0, 3.0 / SIDE as f64);
    }
    assert!((measured(&case, &answer).metrics.rmse - 3.0).abs() < 1e-6);
}

#[test]
fn pictures_of_folds_tell_flat_cloth_and_deeper_folds_from_the_truth() {
    let folds = |depth: f64| move |u: f64, v: f64| Vec3::new(u, v, depth * (30.0 * u).sin());
    let truth = case(folds(0.03), MaskShape::Circle, 2);
    // Hole cells of another surface, known cells of the truth.
    let similarity = |depth: f64| {
        let mut answer = truth.answer(&truth.observed(0.0, 1));
        for k in (0..CELLS).filter(|&k| truth.sample.hole[k]) {
            let uv = cell_centre(k);
            answer[k] = folds(depth)(uv.x, uv.y);
        }
        measured(&truth, &answer).metrics.ssim
    };
    let [flat, shallow, right, deep] = [0.0, 0.024, 0.03, 0.036].map(similarity);
    assert!((right - 1.0).abs() < 1e-9, "{right}");
    assert!(shallow > 0.9 && deep > 0.9, "{shallow} {deep}");
    assert!(flat < 0.8 && similarity(-0.03) < 0.8, "{flat}");
}

#[test]
fn cloth_through_cloth_is_counted() {
    let case = case(plane, MaskShape::Circle, 2);
    let mut answer = case.answer(&case.observed(0.0, 1));
    let inner: Vec<usize> = (0..CELLS).filter(|&k| case.sample.hole[k]).collect();
    let (middle, away) = (inner[inner.len() / 2], Vec3::new(0.8, 0.0, -0.6));
    // One cell is pulled through the sheet some cells further on.
    answer[middle] = case.truth(middle + 8) - away * 0.01;
    answer[middle + 1] = case.truth(middle + 8) + away * 0.01;
    assert!(measured(&case, &answer).metrics.self_intersections > 0.0);
}

#[test]
fn both_smooth_fills_keep_a_plane_and_only_the_plate_keeps_a_bend() {
    let worst = |case: &EvaluationCase, energy| {
        let seen = case.observed(0.0, 1);
        let filled = smooth(&seen.positions, &seen.known, &case.sample.hole, energy, 1).unwrap();
        measured(case, &filled).metrics.rmse
    };
    let parabola = |u: f64, v: f64| Vec3::new(u, v, (u - 0.5) * (v - 0.5));
    for shape in [MaskShape::Circle, MaskShape::Percolation, MaskShape::Ring] {
        for energy in [Smooth::Membrane, Smooth::ThinPlate] {
            assert!(worst(&case(plane, shape, 7), energy) < 1e-4);
            // u·v is harmonic and biharmonic, discretely too.
            assert!(worst(&case(parabola, shape, 7), energy) < 1e-4);
        }
    }
    let bent = case(|u, v| Vec3::new(u, v, u * u + v * v), MaskShape::Circle, 7);
    let (membrane, plate) = (
        worst(&bent, Smooth::Membrane),
        worst(&bent, Smooth::ThinPlate),
    );
    assert!(plate < 0.05 * membrane, "{plate} {membrane}");
}

#[test]
fn patches_reach_every_hole_cell_and_keep_flat_cloth_flat() {
    for (shape, _) in SHAPES {
        let case = case(plane, shape, 12);
        let grid = case.observed(0.0, 1);
        let mut filled = case.answer(&grid);
        let nowhere = Vec3::new(9.0, 9.0, 9.0);
        let truth = filled.clone();
        let found = patched(&grid, &case.sample.hole, &truth, &PatchOptions::default()).unwrap();
        for k in 0..CELLS {
            assert!(
                (found[k] - truth[k]).norm() < 1e-3 / SIDE as f64,
                "{shape:?} {k}"
            );
        }
        // A fill from nowhere is pulled to the rim: nothing is left where it was.
        for k in (0..CELLS).filter(|&k| case.sample.hole[k]) {
            filled[k] = nowhere;
        }
        let found = patched(&grid, &case.sample.hole, &filled, &PatchOptions::default()).unwrap();
        assert!((0..CELLS).all(|k| found[k] != nowhere), "{shape:?}");
    }
}

#[test]
fn noise_is_on_known_cells_alone_and_of_the_strength_asked_for() {
    let case = case(cylinder, MaskShape::Blob, 3);
    let (clean, noisy) = (case.observed(0.0, 5), case.observed(0.2, 5));
    let known: Vec<usize> = (0..CELLS).filter(|&k| clean.known[k]).collect();
    let squares: f64 = known
        .iter()
        .map(|&k| (noisy.positions[k] - clean.positions[k]).norm_squared())
        .sum();
    let sigma = (squares / (3 * known.len()) as f64).sqrt() * SIDE as f64;
    assert!((sigma - 0.2).abs() < 0.01, "{sigma}");
    assert_eq!(case.observed(0.2, 5), noisy);
}

fn rolled() -> SimulatedSheet {
    let positions = (0..51 * 51).map(|k| {
        let p = cylinder((k % 51) as f64 / 50.0, (k / 51) as f64 / 50.0);
        [p.x as f32, p.y as f32, p.z as f32]
    });
    SimulatedSheet {
        positions: positions.collect(),
    }
}

#[test]
fn a_whole_evaluation_has_its_tables_and_pictures() {
    let sampler = Sampler::new(&[rolled()], SampleRotation::Any);
    let cases = draw(&sampler, 3, 9);
    let plan = EvaluationPlan {
        noises: vec![0.0, 0.2],
        seed: 1,
        options: PatchOptions::default(),
    };
    let zeros = |grids: &[NormalGrid]| {
        let unchanged = |grid: &NormalGrid| FilledGrid {
            positions: grid.positions.clone(),
            spread: vec![0.0; CELLS],
        };
        Ok(grids.iter().map(unchanged).collect())
    };
    let report = run(&cases, &plan, &zeros, &|_| ()).unwrap();
    assert_eq!(report.rows.len() + report.not_patched, 3 * 2 * 4 * 2);
    let of = |fill, stage| {
        report
            .mean(|r| r.fill == fill && r.stage == stage && r.noise == 0.0)
            .unwrap()
    };
    assert!(of(FillMethod::Truth, EvaluationStage::Filled).rmse < 1e-6);
    assert!(
        of(FillMethod::Network, EvaluationStage::Filled).rmse
            > of(FillMethod::ThinPlate, EvaluationStage::Filled).rmse
    );
    let text = report.markdown();
    for word in ["truth", "network", "thin plate", "after patch", "By noise"] {
        assert!(text.contains(word), "{text}");
    }
    assert!(picture(&report).contains("viewBox=\"0 0 1100 1560\""));
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["rows"][0]["fill"], "truth");
    assert!(json["rows"][0]["rmse"].is_number());
}

#[test]
fn shares_of_samples_and_scans_are_shares() {
    let sampler = Sampler::new(&[rolled()], SampleRotation::Any);
    let trained = of_samples(&draw(&sampler, 5, 2));
    for cut in HoleKind::ALL {
        for share in of_flattened(&[rolled()], cut, 3)
            .into_iter()
            .flatten()
            .chain(trained.clone())
        {
            assert!(share.hole > 0.0 && share.extent < 1.0, "{share:?}");
            assert!((share.unknown - share.hole - share.outside).abs() < 1e-9);
        }
    }
}
