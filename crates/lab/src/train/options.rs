//! The options of a training run. They are written into checkpoints, so fields keep their names and new ones have defaults.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::loss::LossWeights;
use darn_net::UnetConfig;

/// What computes the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainerKind {
    /// burn: batch norm with the statistics of each batch; from random weights or given ones.
    #[default]
    Burn,
    /// burn on an NVIDIA GPU.
    #[cfg(feature = "cuda")]
    Cuda,
    /// darn's own kernels, several times as fast. Batch norm keeps its statistics, so it starts from weights that burn has trained.
    Engine,
}

/// What turns gradients into steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OptimiserKind {
    /// AdamW on all tensors.
    #[default]
    Adamw,
    /// Muon on kernels between the first and the last layer, AdamW on the rest; by the engine's trainer.
    Muon,
}

/// The options of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrainOptions {
    /// Name on the model card.
    pub name: String,
    /// Directory of sheets to learn from.
    pub sheets: PathBuf,
    /// Directory of sheets that scores are measured on; none of them may be in `sheets`.
    pub held_out: PathBuf,
    /// Directory for checkpoints, curves and weights.
    pub out: PathBuf,
    /// Whether the run is new or continues from the checkpoint in `out`.
    pub resume: RunStart,
    /// A fresh run starts from these weights instead of random ones.
    #[serde(default)]
    pub from: Option<PathBuf>,
    /// What computes the steps.
    #[serde(default)]
    pub trainer: TrainerKind,
    /// What turns gradients into steps.
    #[serde(default)]
    pub optimiser: OptimiserKind,
    /// Weights whose mean answer to a grid's eight symmetries is learned instead of the truth; by the engine's trainer.
    #[serde(default)]
    pub teacher: Option<PathBuf>,
    /// The network.
    pub network: UnetConfig,
    /// Whether sheets stay upright; otherwise they are rotated at random.
    #[serde(default)]
    pub upright: bool,
    /// Whether the attention gates of a fresh network stay open, as if there were none.
    #[serde(default)]
    pub open_gates: bool,
    /// Weights of the loss's terms.
    pub loss: LossWeights,
    /// Samples in a step.
    pub batch: usize,
    /// Each training sample comes from the roughest of this many random sheets.
    #[serde(default = "one")]
    pub roughest_of: usize,
    /// Training samples that share a hole, and with it the factor of the plate, which is most of the work of making samples.
    #[serde(default = "one")]
    pub alike: usize,
    /// Highest learning rate.
    pub rate: f64,
    /// Duration, minutes; the learning rate falls to nearly zero at the end.
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
pub enum RunStart {
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
            resume: RunStart::Fresh,
            from: None,
            trainer: TrainerKind::Burn,
            optimiser: OptimiserKind::Adamw,
            teacher: None,
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
