//! Laws of samples: units, rims, seeds.

use super::super::lattice::{SIDE as SHEET, VERTICES};
use super::*;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A sheet rolled on a cylinder of the given radius: isometric to the flat one.
fn rolled(radius: f32) -> SimulatedSheet {
    let step = 1.0 / (SHEET - 1) as f32;
    let positions = (0..VERTICES)
        .map(|k| {
            let (u, v) = ((k % SHEET) as f32 * step, (k / SHEET) as f32 * step);
            [radius * (u / radius).sin(), v, radius * (u / radius).cos()]
        })
        .collect();
    SimulatedSheet { positions }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_sample_is_in_the_networks_units(seed: u64, radius in 0.15f32..2.0) {
        let sampler = Sampler::new(&[rolled(radius)], SampleRotation::Any);
        let sample = sampler.alike(1, &mut ChaCha8Rng::seed_from_u64(seed)).remove(0);
        let known: Vec<usize> = (0..CELLS).filter(|&k| sample.known[k]).collect();
        prop_assert!(known.len() > 150, "{} known cells", known.len());
        for axis in 0..3 {
            let mean: f32 = known.iter().map(|&k| sample.truth[k][axis]).sum::<f32>() / known.len() as f32;
            prop_assert!(mean.abs() < 1e-3);
        }
        for k in 0..CELLS {
            prop_assert!(!sample.hole[k] || (sample.valid[k] && !sample.known[k]));
            prop_assert!(!sample.known[k] || sample.valid[k]);
            if k % SIDE + 1 < SIDE && sample.hole[k] && sample.hole[k + 1] {
                let [a, b] = [k, k + 1].map(|k| Vector3::from(sample.truth[k]));
                // Holes have no noise; a chord is less than 1 % shorter than its arc here.
                prop_assert!(((a - b).norm() * 64.0 - 1.0).abs() < 0.03, "{}", (a - b).norm() * 64.0);
            }
        }
    }

    #[test]
    fn every_rim_lies_on_the_sheet(seed: u64) {
        let sampler = Sampler::new(&[rolled(1.0)], SampleRotation::Any);
        let sample = sampler.alike(1, &mut ChaCha8Rng::seed_from_u64(seed)).remove(0);
        let away = distances_to(&sample.hole);
        for k in (0..CELLS).filter(|&k| away[k] > 0.0 && away[k] < 1.5) {
            prop_assert!(sample.known[k]);
        }
    }
}

#[test]
fn the_spline_goes_through_the_vertices() {
    let sheet = rolled(0.3);
    let spline = SheetSpline::new(&sheet);
    for (k, p) in sheet.positions.iter().enumerate() {
        let place = [k % SHEET, k / SHEET].map(|i| i as f32 / (SHEET - 1) as f32);
        assert!((spline.at(place) - Vector3::from(*p)).norm() < 2e-5);
    }
}

#[test]
fn upright_samples_keep_their_height_order() {
    let sheet = rolled(0.4);
    let sampler = Sampler::new(&[sheet], SampleRotation::Upright);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let q = draw_rotation(sampler.rotation, &mut rng);
    assert!((q * Vector3::z() - Vector3::z()).norm() < 1e-6);
}

#[test]
fn samples_drawn_together_share_their_cells_and_nothing_else() {
    let sampler = Sampler::new(&[rolled(0.5), rolled(0.2)], SampleRotation::Any);
    let samples = sampler.alike(3, &mut ChaCha8Rng::seed_from_u64(12));
    let [first, others @ ..] = &samples[..] else {
        panic!("three were asked for")
    };
    for sample in others {
        let cells = |s: &TrainingSample| (s.valid.clone(), s.known.clone(), s.hole.clone());
        assert_eq!(cells(sample), cells(first));
        assert_ne!(sample.truth, first.truth);
    }
}

#[test]
fn the_same_seed_draws_the_same_sample() {
    let sampler = Sampler::new(&[rolled(0.5), rolled(0.2)], SampleRotation::Any);
    let draw = || sampler.alike(3, &mut ChaCha8Rng::seed_from_u64(11));
    assert_eq!(draw(), draw());
}
