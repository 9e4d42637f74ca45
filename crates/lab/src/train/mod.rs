//! Training: samples to batches, the losses, AdamW with averaged weights, checkpoints, held-out scores.
//! Generic over burn's autodiff backend; knows the network and where samples come from.
//! No cloth simulation, no HTTP: sheets come from `scarffolds`, and nothing here is reached by a request.

pub mod batch;
mod burned;
pub mod checkpoint;
pub mod curves;
mod engined;
pub mod loss;
mod near;
pub mod optimiser;
pub mod record;
pub mod score;
mod slopes;
mod student;
pub mod trainer;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(feature = "cuda")]
use burn::backend::Cuda;
use burn::backend::{Autodiff, Flex};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::scarffolds;
use crate::scarffolds::samples::{Sampler, Turning};
use darn_net::engine::EngineError;
use darn_net::{NetError, UnetConfig};

pub use crate::scarffolds::samples::Sample;
pub use batch::Source;
pub use burned::Burned;
pub use engined::Engined;
pub use loss::{LossKind, LossWeights};
pub use score::Score;
pub use student::{Snapshot, Student, Trainer};
pub use trainer::{Progress, Sources, Summary};

/// Samples that scores are measured on.
const HELD_OUT_SAMPLES: usize = 64;
/// Stream of the generator that draws the held-out samples; fixed, so that all runs are measured on the same ones.
const HELD_OUT_SEED: u64 = 0x5ca1_ab1e;

/// Why training stopped.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error("{path}: {source}")]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("sheets in {path}: {reason}")]
    Sheets { path: PathBuf, reason: String },
    #[error(transparent)]
    Net(#[from] NetError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error("checkpoint {path}: {reason}")]
    Checkpoint { path: PathBuf, reason: String },
    #[error("the loss is not finite at step {step}; a lower learning rate may help")]
    Diverged { step: u64 },
    #[error("{0}")]
    Options(String),
    #[error("the sample threads stopped")]
    NoSamples,
}

/// What to train, on what, for how long.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrainOptions {
    /// Name on the model card.
    pub name: String,
    /// Directory of sheets to learn from.
    pub sheets: PathBuf,
    /// Directory of sheets to be measured on; none of them may be in `sheets`.
    pub held_out: PathBuf,
    /// Where checkpoints, curves and weights go.
    pub out: PathBuf,
    /// Continue from the checkpoint in `out`.
    pub resume: Start,
    /// A fresh run starts from these weights instead of random ones.
    #[serde(default)]
    pub from: Option<PathBuf>,
    /// What computes the steps.
    #[serde(default)]
    pub trainer: Trainer,
    /// The network.
    pub network: UnetConfig,
    /// Whether sheets stay upright, or are turned anyhow.
    #[serde(default)]
    pub upright: bool,
    /// Whether a fresh network's attention gates are open for good, as if there were none.
    #[serde(default)]
    pub open_gates: bool,
    /// Weights of the loss's terms.
    pub loss: LossWeights,
    /// Samples a step.
    pub batch: usize,
    /// Sheets drawn for a sample to learn from, of which the roughest is taken.
    #[serde(default = "one")]
    pub roughest_of: usize,
    /// Samples to learn from that share a hole, and so the plate's factor, which is most of the work of making them.
    #[serde(default = "one")]
    pub alike: usize,
    /// Highest learning rate.
    pub rate: f64,
    /// How long; the learning rate falls to zero at the end.
    pub minutes: f64,
    /// Minutes between checkpoints, scores and exported weights.
    pub every: f64,
    /// Seed of weights and samples.
    pub seed: u64,
    /// Threads that make samples.
    pub sample_threads: usize,
}

fn one() -> usize {
    1
}

/// Where a run starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Start {
    /// From random weights.
    Fresh,
    /// From the checkpoint in the output directory.
    Resume,
}

impl Default for TrainOptions {
    fn default() -> Self {
        TrainOptions {
            name: "standard".into(),
            sheets: "sheets/train".into(),
            held_out: "sheets/held".into(),
            out: "train".into(),
            resume: Start::Fresh,
            from: None,
            trainer: Trainer::Burn,
            network: UnetConfig::default(),
            upright: false,
            open_gates: false,
            loss: LossWeights::default(),
            batch: 16,
            roughest_of: 1,
            alike: 1,
            rate: 1e-3,
            minutes: 60.0,
            every: 5.0,
            seed: 1,
            sample_threads: 1,
        }
    }
}

/// Trains by the trainer in `options` with the sheets in `options.sheets`, reporting after every step.
///
/// # Errors
/// Unreadable sheets or checkpoint, files that cannot be written, a loss that is not finite.
pub fn run(
    options: &TrainOptions,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary, TrainError> {
    let turning = Turning::keeping_up(options.upright);
    let train = sampler(&options.sheets, turning)?.roughest_of(options.roughest_of);
    let held_out = held_out(&sampler(&options.held_out, turning)?);
    let data_seed = scarffolds::sheets::read_manifest(&options.sheets)
        .ok()
        .map(|manifest| manifest.seed);
    let sources = Sources {
        train: source(train, options.alike),
        held_out,
        data_seed,
    };
    match options.trainer {
        Trainer::Burn => trainer::train::<Burned<Autodiff<Flex>>>(options, sources, progress),
        Trainer::Engine => trainer::train::<Engined>(options, sources, progress),
        #[cfg(feature = "cuda")]
        Trainer::Cuda => trainer::train::<Burned<Autodiff<Cuda>>>(options, sources, progress),
    }
}

/// The samples that scores are measured on: always the same of the same sheets.
pub fn held_out(sheets: &Sampler) -> Vec<Sample> {
    let mut rng = ChaCha8Rng::seed_from_u64(HELD_OUT_SEED);
    let samples = (0..HELD_OUT_SAMPLES).flat_map(|_| sheets.alike(1, &mut rng));
    samples.collect()
}

/// Draws samples to learn from, so many of each hole.
pub fn source(sheets: Sampler, alike: usize) -> Source {
    let alike = alike.max(1);
    Arc::new(move |rng| sheets.alike(alike, rng))
}

/// A sampler over the sheets of a folder.
///
/// # Errors
/// An unreadable folder, or an empty one.
pub fn sampler(dir: &Path, turning: Turning) -> Result<Sampler, TrainError> {
    let refuse = |reason: String| TrainError::Sheets {
        path: dir.to_owned(),
        reason,
    };
    let sheets = scarffolds::sheets::read(dir).map_err(|e| refuse(e.to_string()))?;
    if sheets.is_empty() {
        return Err(refuse("there are none".into()));
    }
    Ok(Sampler::new(&sheets, turning))
}
