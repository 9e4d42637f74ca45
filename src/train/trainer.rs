//! The training loop: warm-up and cosine over a budget of minutes, averaged weights, scores and checkpoints on the way.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use burn::module::AutodiffModule;
use burn::optim::GradientsParams;
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::batch::{Ahead, Batch, Prepared, Recipe, prepare};
use super::checkpoint::{self, State, replace};
use super::curves::Curves;
use super::loss::{Loss, Target, loss};
use super::optimiser::{AdamW, average};
use super::score::{Score, score};
use super::{Sample, Start, TrainError, TrainOptions};
use crate::grid::{CELLS, SIDE};
use crate::net::weights::{self, export};
use crate::net::{Convolve, InputKind, TrainingCard, Unet, UnetConfig, WeightsCard, cells, over};

/// Steps over which the learning rate rises.
const WARM_UP: u64 = 100;
/// The learning rate's last value ÷ its highest.
const LAST_RATE: f64 = 0.01;

/// Where samples come from.
pub struct Sources {
    /// Draws a sample to learn from.
    pub train: Arc<dyn Fn(&mut ChaCha8Rng) -> Sample + Send + Sync>,
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
pub fn train<B>(
    options: &TrainOptions,
    sources: Sources,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary, TrainError>
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
    check(options)?;
    let device = B::Device::default();
    std::fs::create_dir_all(&options.out).map_err(|source| TrainError::File {
        path: options.out.clone(),
        source,
    })?;
    let mut state: State<B> = match options.resume {
        Start::Fresh => fresh(options, &device)?,
        Start::Resume => checkpoint::load(options, &options.out, &device)?,
    };
    let held_out: Vec<Prepared> = sources
        .held_out
        .iter()
        .filter_map(|s| prepare(s, &options.network))
        .collect();
    let fill = score(&held_out, &input_fill::<B::InnerBackend>(&held_out));
    let recipe = Recipe {
        source: sources.train,
        network: options.network,
        size: options.batch,
        seed: options.seed,
    };
    let mut batches = Ahead::start(&recipe, state.optimiser.step, options.sample_threads);
    let mut curves = Curves::open(&options.out, options.resume)?;
    let (started, before) = (Instant::now(), state.seconds);
    let mut next_export = before + options.every * 60.0;
    let budget = options.minutes * 60.0;
    loop {
        let batch = batches.next_batch().ok_or(TrainError::NoSamples)?;
        let share = (state.seconds / budget).min(1.0);
        let rate = rate(options.rate, share, state.optimiser.step);
        let (terms, norm) = step(&mut state, batch, options, rate);
        if !terms[0].is_finite() || !norm.is_finite() {
            return Err(TrainError::Diverged {
                step: state.optimiser.step,
            });
        }
        state.seconds = before + started.elapsed().as_secs_f64();
        let last = state.seconds >= budget;
        let mut report = Progress {
            step: state.optimiser.step,
            minutes: state.seconds / 60.0,
            share,
            loss: terms,
            norm,
            scores: None,
        };
        curves.step(&report, rate)?;
        if last || state.seconds >= next_export {
            next_export = state.seconds + options.every * 60.0;
            let scored = score(
                &held_out,
                &predictions(&state.averaged, options.network.input, &held_out),
            );
            report.scores = Some([scored, fill]);
            curves.scores(&report)?;
            let path = write_weights(&state, options, &[scored, fill], sources.data_seed)?;
            checkpoint::save(&state, options, &options.out)?;
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

fn fresh<B>(options: &TrainOptions, device: &B::Device) -> Result<State<B>, TrainError>
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
    B::seed(device, options.seed);
    let network = match &options.from {
        None => options.network.init::<B>(device),
        Some(path) => {
            let bytes = std::fs::read(path).map_err(|source| TrainError::File {
                path: path.clone(),
                source,
            })?;
            let (card, mut tensors) = weights::read(&bytes)?;
            weights::check(&card, &tensors)?;
            let same = UnetConfig {
                input: options.network.input,
                ..card.architecture
            };
            if same != options.network {
                return Err(TrainError::Options(format!(
                    "{} holds another architecture than the one to train",
                    path.display()
                )));
            }
            if card.architecture != options.network {
                // What it has learned to see stays of use; what is to be added to another fill is to be learned anew.
                let last = tensors
                    .iter_mut()
                    .filter(|(name, _)| name.starts_with("last."));
                last.for_each(|(_, (_, values))| values.fill(0.0));
            }
            weights::build::<B>(&options.network, &tensors, device)?
        }
    };
    let averaged = network.valid();
    Ok(State {
        network,
        averaged,
        optimiser: AdamW::default(),
        seconds: 0.0,
    })
}

/// Learning rate at a share of the budget: a linear rise over the first steps, then half a cosine.
fn rate(highest: f64, share: f64, step: u64) -> f64 {
    let rise = ((step + 1) as f64 / WARM_UP as f64).min(1.0);
    let fall = LAST_RATE + (1.0 - LAST_RATE) * 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
    highest * rise * fall
}

/// One step; returns the loss with its terms, and the gradient's norm.
fn step<B>(state: &mut State<B>, batch: Batch, options: &TrainOptions, rate: f64) -> ([f32; 5], f64)
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
    let device = B::Device::default();
    let Inputs {
        positions,
        known,
        base,
    } = Inputs::<B::InnerBackend>::of(&batch);
    // The fill does not depend on the weights: it is computed outside the graph.
    let filled = match options.network.input {
        InputKind::Zeros => positions,
        InputKind::Membrane | InputKind::Plate => over(Some(base), positions, known.clone()),
    };
    let (filled, known) = (
        Tensor::<B, 4>::from_inner(filled),
        Tensor::from_inner(known),
    );
    let predicted = match options.network.input {
        InputKind::Zeros => state.network.predict(InputKind::Zeros, filled, known, None),
        InputKind::Membrane | InputKind::Plate => {
            state.network.residual(filled.clone(), known) + filled
        }
    };
    let target = Target::of(batch, &device);
    let Loss {
        total,
        data,
        gradient,
        stretch,
        self_penetration,
    } = loss(predicted, &target, &options.loss);
    let terms = [&total, &data, &gradient, &stretch, &self_penetration].map(number);
    let gradients = GradientsParams::from_grads(total.backward(), &state.network);
    let (network, norm) = state
        .optimiser
        .step::<B, _>(state.network.clone(), gradients, rate);
    state.network = network;
    state.averaged = average(
        state.averaged.clone(),
        &state.network.valid(),
        state.optimiser.step,
    );
    (terms, norm)
}

fn number<B: Backend>(x: &Tensor<B, 1>) -> f32 {
    x.to_data()
        .convert::<f32>()
        .iter::<f32>()
        .next()
        .unwrap_or(f32::NAN)
}

/// What a batch shows the network.
struct Inputs<B: Backend> {
    /// `[count, 3, 64, 64]`.
    positions: Tensor<B, 4>,
    /// `[count, 1, 64, 64]`.
    known: Tensor<B, 4>,
    /// `[count, 3, 64, 64]`.
    base: Tensor<B, 4>,
}

impl<B: Backend> Inputs<B> {
    fn of(batch: &Batch) -> Self {
        let device = B::Device::default();
        let tensor = |values: &[f32], channels: usize| {
            Tensor::from_data(
                TensorData::new(values.to_vec(), [batch.count, channels, SIDE, SIDE]),
                &device,
            )
        };
        Inputs {
            positions: tensor(&batch.positions, 3),
            known: tensor(&batch.known, 1),
            base: tensor(&batch.base, 3),
        }
    }
}

/// The network's answer for prepared samples, in their own frame.
fn predictions<B: Convolve>(
    network: &Unet<B>,
    input: InputKind,
    samples: &[Prepared],
) -> Vec<Vec<[f32; 3]>> {
    answers(samples, |x: Inputs<B>| {
        network.predict(input, x.positions, x.known, Some(x.base))
    })
}

/// The fill alone, for comparison.
fn input_fill<B: Backend>(samples: &[Prepared]) -> Vec<Vec<[f32; 3]>> {
    answers(samples, |x: Inputs<B>| {
        over(Some(x.base), x.positions, x.known)
    })
}

fn answers<B: Backend>(
    samples: &[Prepared],
    answer: impl Fn(Inputs<B>) -> Tensor<B, 4>,
) -> Vec<Vec<[f32; 3]>> {
    let chunks = samples.chunks(8).flat_map(|chunk| {
        let planes: Vec<f32> = answer(Inputs::of(&Batch::of(chunk)))
            .into_data()
            .convert::<f32>()
            .into_vec()
            .unwrap_or_default();
        planes
            .chunks_exact(3 * CELLS)
            .map(cells)
            .collect::<Vec<_>>()
    });
    chunks.collect()
}

/// Writes the averaged weights: the newest under the run's name, and a copy that is kept.
fn write_weights<B: AutodiffBackend>(
    state: &State<B>,
    options: &TrainOptions,
    [scored, fill]: &[Score; 2],
    data_seed: Option<u64>,
) -> Result<PathBuf, TrainError> {
    let steps = state.optimiser.step;
    let card = WeightsCard {
        name: options.name.clone(),
        sha256: String::new(),
        architecture: options.network,
        training: TrainingCard {
            steps,
            batch: options.batch,
            seed: options.seed,
            samples: steps * options.batch as u64,
            minutes: state.seconds / 60.0,
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
    let bytes = weights::write(&export(&state.averaged), &card)?;
    let newest = options.out.join(format!("{}.safetensors", options.name));
    replace(&newest, &bytes)?;
    replace(
        &options.out.join(format!(
            "{}-{:04.0}min.safetensors",
            options.name,
            state.seconds / 60.0
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
