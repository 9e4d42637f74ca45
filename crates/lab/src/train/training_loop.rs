//! The training loop: a learning rate that warms up and then follows a cosine over a budget of minutes, with scores, checkpoints and
//! exported weights at intervals.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use burn::backend::Flex;

use super::batch::{BatchGenerator, BatchPrefetcher, PreparedSample, prepare};
use super::burn_trainer::input_fill;
use super::checkpoint::{self, replace};
use super::error::TrainError;
use super::options::{OptimiserKind, RunStart, TrainOptions, TrainerKind};
use super::progress::TrainProgress;
use super::score::{HeldOutScores, Score, score};
use super::snapshot::TrainSnapshot;
use super::trainer::{StepOutcome, Trainer};
use super::training_curves::TrainingCurves;
use super::training_data::TrainingData;
use darn_net::weights;
use darn_net::{TrainingCard, WeightsCard};

/// Steps over which the learning rate rises.
const WARM_UP: u64 = 100;
/// The learning rate's last value ÷ its highest.
const LAST_RATE: f64 = 0.01;

/// The result of a run.
#[derive(Debug, Clone)]
pub struct TrainSummary {
    /// Steps done.
    pub steps: u64,
    /// Minutes trained.
    pub minutes: f64,
    /// The network's last scores.
    pub score: Score,
    /// The input fill's scores on the same samples.
    pub fill: Score,
    /// The weights file.
    pub weights: PathBuf,
}

/// Trains a network with a trainer of kind `S`; see [`super::run`].
pub(super) fn train<S: Trainer>(
    options: &TrainOptions,
    data: TrainingData,
    progress: &mut dyn FnMut(&TrainProgress),
) -> Result<TrainSummary, TrainError> {
    check(options)?;
    std::fs::create_dir_all(&options.out).map_err(|source| TrainError::File {
        path: options.out.clone(),
        source,
    })?;
    let (snapshot, before) = match options.resume {
        RunStart::Fresh => (TrainSnapshot::fresh(options)?, 0.0),
        RunStart::Resume => checkpoint::load(options, &options.out)?,
    };
    let mut trainer = S::of(snapshot, options)?;
    let held_out: Vec<PreparedSample> = data
        .held_out
        .iter()
        .filter_map(|s| prepare(s, &options.network))
        .collect();
    let fill = score(&held_out, &input_fill::<Flex>(&held_out));
    let generator = BatchGenerator {
        source: data.train,
        network: options.network,
        size: options.batch,
        seed: options.seed,
    };
    let mut batches = BatchPrefetcher::start(&generator, trainer.steps(), options.sample_threads);
    let mut curves = TrainingCurves::open(&options.out, options.resume)?;
    let started = Instant::now();
    let mut seconds: f64 = before;
    let mut next_export = before + options.every * 60.0;
    let budget = options.minutes * 60.0;
    loop {
        let batch = batches.next_batch().ok_or(TrainError::NoSamples)?;
        let share = (seconds / budget).min(1.0);
        let rate = rate(options.rate, share, trainer.steps());
        let StepOutcome { loss, norm } = trainer.step(batch, options, rate)?;
        if !loss.total.is_finite() || !norm.is_finite() {
            return Err(TrainError::Diverged {
                step: trainer.steps(),
            });
        }
        seconds = before + started.elapsed().as_secs_f64();
        let last = seconds >= budget;
        let mut report = TrainProgress {
            step: trainer.steps(),
            minutes: seconds / 60.0,
            share,
            loss,
            norm,
            scores: None,
        };
        curves.step(&report, rate)?;
        if last || seconds >= next_export {
            next_export = seconds + options.every * 60.0;
            let scored = score(&held_out, &trainer.predictions(&held_out)?);
            let scores = HeldOutScores {
                network: scored,
                fill,
            };
            report.scores = Some(scores);
            curves.scores(&report)?;
            let snapshot = trainer.snapshot();
            let path = write_weights(&snapshot, seconds, options, &scores, data.data_seed)?;
            checkpoint::save(&snapshot, seconds, options, &options.out)?;
            if last {
                progress(&report);
                return Ok(TrainSummary {
                    steps: report.step,
                    minutes: report.minutes,
                    score: scored,
                    fill,
                    weights: path,
                });
            }
        }
        progress(&report);
    }
}

fn check(options: &TrainOptions) -> Result<(), TrainError> {
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if options.batch == 0 || !(1..=256).contains(&options.network.width) {
        return Err(TrainError::Options(
            "batch must be at least 1 and width in 1..=256".into(),
        ));
    }
    if !positive(options.minutes) || !positive(options.every) || !positive(options.rate) {
        return Err(TrainError::Options(
            "minutes, interval and learning rate must be positive".into(),
        ));
    }
    let engines_own = options.optimiser == OptimiserKind::Muon || options.teacher.is_some();
    if engines_own && options.trainer != TrainerKind::Engine {
        return Err(TrainError::Options(
            "only the engine's trainer has muon and a teacher".into(),
        ));
    }
    Ok(())
}

/// Learning rate at a share of the budget: a linear rise over the first steps, times half a cosine.
fn rate(highest: f64, share: f64, step: u64) -> f64 {
    let rise = ((step + 1) as f64 / WARM_UP as f64).min(1.0);
    let fall = LAST_RATE + (1.0 - LAST_RATE) * 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
    highest * rise * fall
}

/// Writes the averaged weights twice: under the name of the run, which later exports replace, and under a name with the minutes.
fn write_weights(
    snapshot: &TrainSnapshot,
    seconds: f64,
    options: &TrainOptions,
    scores: &HeldOutScores,
    data_seed: Option<u64>,
) -> Result<PathBuf, TrainError> {
    let steps = snapshot.step;
    let card = WeightsCard {
        name: options.name.clone(),
        sha256: String::new(),
        architecture: options.network,
        training: TrainingCard {
            steps,
            batch: options.batch,
            seed: options.seed,
            samples: steps * options.batch as u64,
            minutes: seconds / 60.0,
            data_seed,
            loss: format!(
                "{:?} data + {} gradient + {} stretch + {} self-penetration{}",
                options.loss.kind,
                options.loss.gradient,
                options.loss.stretch,
                options.loss.self_penetration,
                match options.teacher {
                    Some(_) => ", to the mean of a teacher's answers to eight symmetries",
                    None => "",
                }
            ),
        },
        scores: named_scores(scores),
        errors: None,
        darn_version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    let bytes = weights::write(&snapshot.averaged, &card)?;
    let newest = options.out.join(format!("{}.safetensors", options.name));
    replace(&newest, &bytes)?;
    replace(
        &options.out.join(format!(
            "{}-{:04.0}min.safetensors",
            options.name,
            seconds / 60.0
        )),
        &bytes,
    )?;
    Ok(newest)
}

/// Scores by name for the model card: the network's, and with the prefix `fill_` those of the input fill.
fn named_scores(scores: &HeldOutScores) -> BTreeMap<String, f64> {
    let named = |prefix: &str, s: &Score| {
        [
            ("rmse_cells", s.rmse),
            ("rmse_median_cells", s.rmse_median),
            ("normal_degrees", s.normal),
            ("spacing_ratio", s.spacing),
            ("area_ratio", s.area),
        ]
        .map(|(name, value)| (format!("{prefix}{name}"), value))
    };
    named("", &scores.network)
        .into_iter()
        .chain(named("fill_", &scores.fill))
        .collect()
}
