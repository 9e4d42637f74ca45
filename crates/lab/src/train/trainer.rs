//! The training loop: warm-up and cosine over a budget of minutes, averaged weights, scores and checkpoints on the way.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use burn::backend::Flex;

use super::batch::{Ahead, Prepared, Recipe, Source, prepare};
use super::burned::input_fill;
use super::checkpoint::{self, replace};
use super::curves::Curves;
use super::score::{Score, score};
use super::student::{Snapshot, Student};
use super::{Sample, Start, TrainError, TrainOptions};
use darn_net::weights;
use darn_net::{TrainingCard, WeightsCard};

/// Steps over which the learning rate rises.
const WARM_UP: u64 = 100;
/// The learning rate's last value ÷ its highest.
const LAST_RATE: f64 = 0.01;

/// Where samples come from.
pub struct Sources {
    /// Draws samples to learn from.
    pub train: Source,
    /// Samples to be measured on.
    pub held_out: Vec<Sample>,
    /// Seed of the sheets behind `train`, for the model card.
    pub data_seed: Option<u64>,
}

/// What a step tells its listener.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Steps done.
    pub step: u64,
    /// Minutes trained, all sittings together.
    pub minutes: f64,
    /// Share of the budget used, 0 to 1.
    pub share: f64,
    /// The loss, and its terms: data, gradient, stretch, self-penetration.
    pub loss: [f32; 5],
    /// Norm of the whole gradient.
    pub norm: f64,
    /// The newest scores, at the steps that measured them: the network's, and the input fill's on the same samples.
    pub scores: Option<[Score; 2]>,
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct Summary {
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

/// Trains a network; see [`super::run`].
pub fn train<S: Student>(
    options: &TrainOptions,
    sources: Sources,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary, TrainError> {
    check(options)?;
    std::fs::create_dir_all(&options.out).map_err(|source| TrainError::File {
        path: options.out.clone(),
        source,
    })?;
    let (snapshot, before) = match options.resume {
        Start::Fresh => (Snapshot::fresh(options)?, 0.0),
        Start::Resume => checkpoint::load(options, &options.out)?,
    };
    let mut student = S::of(snapshot, options)?;
    let held_out: Vec<Prepared> = sources
        .held_out
        .iter()
        .filter_map(|s| prepare(s, &options.network))
        .collect();
    let fill = score(&held_out, &input_fill::<Flex>(&held_out));
    let recipe = Recipe {
        source: sources.train,
        network: options.network,
        size: options.batch,
        seed: options.seed,
    };
    let mut batches = Ahead::start(&recipe, student.steps(), options.sample_threads);
    let mut curves = Curves::open(&options.out, options.resume)?;
    let started = Instant::now();
    let mut seconds: f64 = before;
    let mut next_export = before + options.every * 60.0;
    let budget = options.minutes * 60.0;
    loop {
        let batch = batches.next_batch().ok_or(TrainError::NoSamples)?;
        let share = (seconds / budget).min(1.0);
        let rate = rate(options.rate, share, student.steps());
        let (terms, norm) = student.step(batch, options, rate)?;
        if !terms[0].is_finite() || !norm.is_finite() {
            return Err(TrainError::Diverged {
                step: student.steps(),
            });
        }
        seconds = before + started.elapsed().as_secs_f64();
        let last = seconds >= budget;
        let mut report = Progress {
            step: student.steps(),
            minutes: seconds / 60.0,
            share,
            loss: terms,
            norm,
            scores: None,
        };
        curves.step(&report, rate)?;
        if last || seconds >= next_export {
            next_export = seconds + options.every * 60.0;
            let scored = score(&held_out, &student.predictions(&held_out)?);
            report.scores = Some([scored, fill]);
            curves.scores(&report)?;
            let snapshot = student.snapshot();
            let path = write_weights(
                &snapshot,
                seconds,
                options,
                (&[scored, fill], sources.data_seed),
            )?;
            checkpoint::save(&snapshot, seconds, options, &options.out)?;
            if last {
                progress(&report);
                return Ok(Summary {
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
    Ok(())
}

/// Learning rate at a share of the budget: a linear rise over the first steps, then half a cosine.
fn rate(highest: f64, share: f64, step: u64) -> f64 {
    let rise = ((step + 1) as f64 / WARM_UP as f64).min(1.0);
    let fall = LAST_RATE + (1.0 - LAST_RATE) * 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
    highest * rise * fall
}

/// Writes the averaged weights: the newest under the run's name, and a copy that is kept.
fn write_weights(
    snapshot: &Snapshot,
    seconds: f64,
    options: &TrainOptions,
    ([scored, fill], data_seed): (&[Score; 2], Option<u64>),
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
                "{:?} data + {} gradient + {} stretch + {} self-penetration",
                options.loss.kind,
                options.loss.gradient,
                options.loss.stretch,
                options.loss.self_penetration
            ),
        },
        scores: named_scores(scored, fill),
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

/// Scores by name, as the card carries them: the network's, and with `fill_` before the name the input fill's.
fn named_scores(scored: &Score, fill: &Score) -> BTreeMap<String, f64> {
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
    named("", scored)
        .into_iter()
        .chain(named("fill_", fill))
        .collect()
}
