//! Laws of training, on small cylinders: losses computed by hand, repeatable batches, checkpoints without loss, a loss that falls.

use std::path::Path;
use std::sync::Arc;

use burn::backend::{Autodiff, Flex};
use burn::tensor::{Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::batch::{BatchGenerator, BatchPrefetcher, TrainingBatch, augment, prepare};
use super::loss::{LossTarget, loss};
use super::score::score;
use super::snapshot::TrainSnapshot;
use super::trainer::Trainer;
use super::*;
use crate::scarffolds::samples::TrainingSample;
use crate::unet::{BackendKind, load_network};
use darn_geometry::grid::{CELLS, SIDE, cell_centre, cell_index};
use darn_net::{FrameKind, InputKind, UnetConfig};

type B = BurnTrainer<Autodiff<Flex>>;

fn config(frame: FrameKind) -> UnetConfig {
    UnetConfig {
        frame,
        ..UnetConfig::default()
    }
}

/// A cylinder of random radius with a square hole.
pub(super) fn cylinder(rng: &mut ChaCha8Rng) -> TrainingSample {
    let bend = rng.random_range(1.0..5.0f64);
    let size = rng.random_range(4..12usize);
    let truth = (0..CELLS)
        .map(|k| {
            let uv = cell_centre(k);
            let angle = (uv.x - 0.3) * bend;
            [angle.sin() / bend, uv.y, angle.cos() / bend].map(|x| 3.0 * x as f32)
        })
        .collect();
    let hole: Vec<bool> = (0..CELLS)
        .map(|k| (k % SIDE).abs_diff(30) < size && (k / SIDE).abs_diff(34) < size)
        .collect();
    TrainingSample {
        truth,
        valid: vec![true; CELLS],
        known: hole.iter().map(|h| !h).collect(),
        hole,
    }
}

fn cylinders(rng: &mut ChaCha8Rng) -> Vec<TrainingSample> {
    vec![cylinder(rng)]
}

fn options(out: &Path) -> TrainOptions {
    TrainOptions {
        out: out.to_owned(),
        network: UnetConfig {
            width: 2,
            ..UnetConfig::default()
        },
        batch: 2,
        minutes: 0.05,
        every: 0.02,
        ..TrainOptions::default()
    }
}

fn data() -> TrainingData {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    TrainingData {
        train: Arc::new(cylinders),
        held_out: (0..3).map(|_| cylinder(&mut rng)).collect(),
        data_seed: Some(11),
    }
}

/// A batch of one flat sheet, all of it known but the given cells.
fn flat(hole: &[usize]) -> TrainingBatch {
    let truth = (0..CELLS)
        .map(|k| [cell_centre(k).x as f32, cell_centre(k).y as f32, 0.0])
        .collect();
    let hole: Vec<bool> = (0..CELLS).map(|k| hole.contains(&k)).collect();
    let sample = TrainingSample {
        truth,
        valid: vec![true; CELLS],
        known: hole.iter().map(|h| !h).collect(),
        hole,
    };
    TrainingBatch::of(&[prepare(&sample, &config(FrameKind::Given)).unwrap()])
}

#[test]
fn the_loss_is_the_one_computed_by_hand() {
    let cell = cell_index(20, 30);
    let batch = flat(&[cell]);
    let device = Default::default();
    let mut answer = batch.truth.clone();
    // The one hole cell is off by 2 cells along z; everything else is right.
    answer[2 * CELLS + cell] += 2.0 / SIDE as f32;
    let weight = f64::from(batch.weight.iter().sum::<f32>());
    let predicted =
        Tensor::<Flex, 4>::from_data(TensorData::new(answer, [1, 3, SIDE, SIDE]), &device);
    let terms = loss(
        predicted,
        &LossTarget::of(batch, &device),
        &LossWeights {
            gradient: 2.0,
            stretch: 3.0,
            ..LossWeights::default()
        },
    );
    let number = |x: Tensor<Flex, 1>| f64::from(x.into_scalar());
    let (data, gradient, stretch) = (
        number(terms.data),
        number(terms.gradient),
        number(terms.stretch),
    );
    assert!((data - (5f64.sqrt() - 1.0) / weight).abs() < 1e-6, "{data}");
    // Two pairs along u and two along v touch the hole, each with a difference that is off by 2 cells: √(4 + ¼²) − ¼.
    assert!(
        (gradient - ((4.0 + 0.0625f64).sqrt() - 0.25)).abs() < 1e-3,
        "{gradient}"
    );
    // Each is √5 cells long instead of 1.
    assert!(
        (stretch - (5f64.sqrt() - 1.0).powi(2)).abs() < 1e-3,
        "{stretch}"
    );
    assert!((number(terms.total) - (data + 2.0 * gradient + 3.0 * stretch)).abs() < 1e-4);
}

#[test]
fn the_truth_has_no_loss_and_perfect_scores() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let sample = prepare(&cylinder(&mut rng), &config(FrameKind::Canonical)).unwrap();
    let batch = TrainingBatch::of(std::slice::from_ref(&sample));
    let device = Default::default();
    let truth = Tensor::<Flex, 4>::from_data(
        TensorData::new(batch.truth.clone(), [1, 3, SIDE, SIDE]),
        &device,
    );
    let total = loss(
        truth,
        &LossTarget::of(batch, &device),
        &LossWeights::default(),
    )
    .total
    .into_scalar();
    assert!(total.abs() < 1e-5, "{total}");
    let perfect = score(
        std::slice::from_ref(&sample),
        std::slice::from_ref(&sample.truth),
    );
    assert!(
        perfect.rmse == 0.0
            && perfect.normal < 1e-3
            && perfect.spacing == 1.0
            && perfect.area == 1.0,
        "{perfect:?}"
    );
}

#[test]
fn prepared_samples_are_in_the_networks_units() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..20 {
        let sample = cylinder(&mut rng);
        let augmented = augment(&[sample], &config(FrameKind::Canonical), &mut rng);
        let Some(prepared) = augmented.first() else {
            continue;
        };
        let known = || (0..CELLS).filter(|k| prepared.known[*k]);
        let mean: f32 = known()
            .map(|k| prepared.truth[k][0] + prepared.truth[k][1] + prepared.truth[k][2])
            .sum::<f32>()
            / known().count() as f32;
        assert!(mean.abs() < 1e-4);
        assert!(
            (0..CELLS).all(|k| (prepared.input.known[k] > 0.0) == prepared.known[k]
                && !(prepared.known[k] && prepared.hole[k]))
        );
        // The canonical frame lays u along x and v along y.
        let slope =
            |a: usize, b: usize, axis: usize| prepared.truth[b][axis] - prepared.truth[a][axis];
        let along: f32 = (0..CELLS)
            .filter(|k| k % SIDE + 1 < SIDE)
            .map(|k| slope(k, k + 1, 0))
            .sum();
        let across: f32 = (0..CELLS - SIDE).map(|k| slope(k, k + SIDE, 1)).sum();
        assert!(along > 0.0 && across > 0.0);
    }
}

#[test]
fn batches_depend_on_seed_and_index_alone() {
    let generator = BatchGenerator {
        source: Arc::new(cylinders),
        network: config(FrameKind::Canonical),
        size: 2,
        seed: 3,
    };
    let expected: Vec<Vec<f32>> = (4..8).map(|k| generator.batch(k).positions).collect();
    for threads in [1, 3] {
        let mut ahead = BatchPrefetcher::start(&generator, 4, threads);
        for positions in &expected {
            assert_eq!(ahead.next_batch().unwrap().positions, *positions);
        }
    }
    assert_ne!(expected[0], expected[1]);
}

#[test]
fn training_learns_resumes_and_exports_weights_that_load() {
    let dir = tempfile::tempdir().unwrap();
    let mut options = options(dir.path());
    let mut losses = Vec::new();
    let summary =
        training_loop::train::<B>(&options, data(), &mut |p| losses.push(p.loss.total)).unwrap();
    assert!(summary.steps > 0 && summary.weights.exists());
    let network =
        load_network(&std::fs::read(&summary.weights).unwrap(), BackendKind::Flex).unwrap();
    let training = &network.card().training;
    assert_eq!(
        (training.steps, training.data_seed),
        (summary.steps, Some(11))
    );
    assert!(network.card().scores["fill_rmse_cells"] > 0.0);

    let (snapshot, seconds) = checkpoint::load(&options, dir.path()).unwrap();
    assert_eq!(snapshot.step, summary.steps);
    let trained = (snapshot.averaged.iter())
        .filter(|(name, _)| !name.ends_with(".mean") && !name.ends_with(".variance"))
        .map(|(_, (_, values))| values.len());
    let moments = snapshot.moments.iter().flatten().map(Vec::len);
    assert_eq!(moments.collect::<Vec<_>>(), [trained.sum::<usize>(); 2]);
    let copy = tempfile::tempdir().unwrap();
    checkpoint::save(&snapshot, seconds, &options, copy.path()).unwrap();
    let read = |dir: &Path| std::fs::read(dir.join("checkpoint.safetensors")).unwrap();
    assert!(
        read(dir.path()) == read(copy.path()),
        "a checkpoint that is read and written again is the same"
    );

    options.resume = RunStart::Resume;
    options.minutes = 0.08;
    let further = training_loop::train::<B>(&options, data(), &mut |_| {}).unwrap();
    assert!(further.steps > summary.steps);
    options.seed = 99;
    assert!(matches!(
        training_loop::train::<B>(&options, data(), &mut |_| {}),
        Err(TrainError::Checkpoint { .. })
    ));
}

#[test]
fn a_checkpoint_that_is_read_and_written_again_is_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let options = options(dir.path());
    let empty = TrainSnapshot {
        network: Default::default(),
        averaged: Default::default(),
        moments: Vec::new(),
        step: 3,
    };
    let read = || std::fs::read(dir.path().join("checkpoint.safetensors")).unwrap();
    for k in 0..500 {
        checkpoint::save(
            &empty,
            f64::from(k) * 0.37 + 1.0 / 7.0,
            &options,
            dir.path(),
        )
        .unwrap();
        let first = read();
        let (snapshot, seconds) = checkpoint::load(&options, dir.path()).unwrap();
        checkpoint::save(&snapshot, seconds, &options, dir.path()).unwrap();
        assert!(first == read(), "{k}");
    }
}

#[test]
fn the_engine_continues_from_weights_that_burn_has_trained() {
    let (dir, further) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let first = training_loop::train::<B>(&options(dir.path()), data(), &mut |_| {}).unwrap();
    let mut options = TrainOptions {
        from: Some(first.weights),
        trainer: TrainerKind::Engine,
        ..options(further.path())
    };
    // A network that is told the up direction may start from weights of one that is not.
    options.network.frame = FrameKind::Hanging;
    let second = training_loop::train::<EngineTrainer>(&options, data(), &mut |_| {}).unwrap();
    assert!(second.steps > 0 && second.weights.exists());
    let (snapshot, _) = checkpoint::load(&options, further.path()).unwrap();
    let flex = B::of(snapshot.clone(), &options).unwrap();
    let engine = EngineTrainer::of(snapshot, &options).unwrap();
    let held: Vec<_> = (data().held_out.iter())
        .filter_map(|sample| prepare(sample, &options.network))
        .collect();
    let answers = [flex.predictions(&held), engine.predictions(&held)].map(Result::unwrap);
    for (a, b) in answers[0].iter().flatten().zip(answers[1].iter().flatten()) {
        assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-4));
    }
    options.from = None;
    assert!(matches!(
        training_loop::train::<EngineTrainer>(&options, data(), &mut |_| {}),
        Err(TrainError::Options(_))
    ));
}

/// The loss of a batch before the first of 80 steps by the engine, and before the last.
fn learned(optimiser: OptimiserKind) -> [f32; 2] {
    let dir = tempfile::tempdir().unwrap();
    let mut options = options(dir.path());
    let fresh = TrainSnapshot::fresh(&options).unwrap();
    options.from = Some(dir.path().to_owned());
    options.optimiser = optimiser;
    let mut trainer = EngineTrainer::of(fresh, &options).unwrap();
    let generator = BatchGenerator {
        source: Arc::new(cylinders),
        network: options.network,
        size: 6,
        seed: 3,
    };
    let mut learn = || {
        trainer
            .step(generator.batch(0), &options, 2e-3)
            .unwrap()
            .loss
            .total
    };
    let before = learn();
    let after = (0..80).map(|_| learn()).fold(f32::NAN, |_, loss| loss);
    // What a checkpoint keeps must be what it gives back, also where a moment is empty.
    let snapshot = trainer.snapshot();
    checkpoint::save(&snapshot, 1.0, &options, dir.path()).unwrap();
    let (read, _) = checkpoint::load(&options, dir.path()).unwrap();
    assert!(read.moments == snapshot.moments && read.network == snapshot.network);
    [before, after]
}

#[test]
fn the_engine_learns_a_batch() {
    for optimiser in [OptimiserKind::Adamw, OptimiserKind::Muon] {
        let [before, after] = learned(optimiser);
        assert!(after < 0.95 * before, "{optimiser:?} {before} {after}");
    }
}

#[test]
fn bad_options_are_refused_before_work() {
    let dir = tempfile::tempdir().unwrap();
    for bad in [
        TrainOptions {
            batch: 0,
            ..options(dir.path())
        },
        TrainOptions {
            minutes: f64::NAN,
            ..options(dir.path())
        },
        TrainOptions {
            optimiser: OptimiserKind::Muon,
            ..options(dir.path())
        },
        TrainOptions {
            teacher: Some(dir.path().to_owned()),
            ..options(dir.path())
        },
    ] {
        assert!(matches!(
            training_loop::train::<B>(&bad, data(), &mut |_| {}),
            Err(TrainError::Options(_))
        ));
    }
    let zeros = TrainOptions {
        network: UnetConfig {
            width: 2,
            input: InputKind::Zeros,
            frame: FrameKind::Given,
        },
        ..options(dir.path())
    };
    training_loop::train::<B>(&zeros, data(), &mut |_| {}).unwrap();
}
