//! Training: batches of samples, the loss, AdamW with averaged weights, checkpoints, held-out scores.
//!
//! [`run`] reads sheets and runs the training loop. A `Trainer` takes the steps: burn on any autodiff backend, or the engine of `darn-net`.
//! Sheets come from [`scarffolds`]; nothing here simulates cloth or is reached by a request.
//!
//! The loss is written three times. `loss` has it in burn: the definition, whose gradient is autodiff's. `loss_gradient` has it with
//! derivatives written out, for the engine's trainer; a test compares it with `loss`. `scripts/gpu/loss.py` has it in PyTorch, which trained the
//! weights that ship; `scripts/gpu/check.py` compares it with this program.

mod batch;
mod burn_trainer;
mod checkpoint;
mod engine_trainer;
mod error;
mod loss;
mod loss_gradient;
mod muon;
mod near_pairs;
mod optimiser;
mod options;
mod progress;
mod sample_records;
mod sample_stream;
mod score;
mod snapshot;
mod teacher;
mod trainer;
mod training_curves;
mod training_data;
mod training_loop;

#[cfg(test)]
mod tests;

#[cfg(feature = "cuda")]
use burn::backend::Cuda;
use burn::backend::{Autodiff, Flex};

use crate::scarffolds;
use crate::scarffolds::samples::SampleRotation;
use burn_trainer::BurnTrainer;
use engine_trainer::EngineTrainer;

pub use error::TrainError;
pub use loss::{LossKind, LossTerms, LossWeights};
pub use options::{OptimiserKind, RunStart, TrainOptions, TrainerKind};
pub use progress::TrainProgress;
pub use sample_stream::{SampleStream, StreamedSamples};
pub use score::{HeldOutScores, Score};
pub use training_loop::TrainSummary;

use training_data::{TrainingData, held_out, sampler, source};

/// Trains with the trainer and the sheets of `options`; `progress` is called after every step.
///
/// # Errors
/// Sheets or a checkpoint that cannot be read, files that cannot be written, a loss that is not finite.
pub fn run(
    options: &TrainOptions,
    progress: &mut dyn FnMut(&TrainProgress),
) -> Result<TrainSummary, TrainError> {
    let rotation = match options.upright {
        true => SampleRotation::Upright,
        false => SampleRotation::Any,
    };
    let train = sampler(&options.sheets, rotation)?.roughest_of(options.roughest_of);
    let held_out = held_out(&sampler(&options.held_out, rotation)?);
    let data_seed = scarffolds::sheets::read_manifest(&options.sheets)
        .ok()
        .map(|manifest| manifest.seed);
    let data = TrainingData {
        train: source(train, options.alike),
        held_out,
        data_seed,
    };
    match options.trainer {
        TrainerKind::Burn => {
            training_loop::train::<BurnTrainer<Autodiff<Flex>>>(options, data, progress)
        }
        TrainerKind::Engine => training_loop::train::<EngineTrainer>(options, data, progress),
        #[cfg(feature = "cuda")]
        TrainerKind::Cuda => {
            training_loop::train::<BurnTrainer<Autodiff<Cuda>>>(options, data, progress)
        }
    }
}
