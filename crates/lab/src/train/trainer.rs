//! The interface between the training loop and what takes its steps: burn on any backend, or the engine of `darn-net`.

use super::batch::{PreparedSample, TrainingBatch};
use super::error::TrainError;
use super::loss::LossTerms;
use super::options::TrainOptions;
use super::snapshot::TrainSnapshot;

/// The result of one training step.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepOutcome {
    /// The loss before the step.
    pub loss: LossTerms,
    /// Norm of the whole gradient before clipping.
    pub norm: f64,
}

/// A network with its optimiser.
pub(super) trait Trainer: Sized {
    /// Continues from a snapshot.
    ///
    /// # Errors
    /// Tensors of another network.
    fn of(snapshot: TrainSnapshot, options: &TrainOptions) -> Result<Self, TrainError>;

    /// One step on a batch.
    ///
    /// # Errors
    /// A network that cannot be evaluated.
    fn step(
        &mut self,
        batch: TrainingBatch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<StepOutcome, TrainError>;

    /// Steps taken.
    fn steps(&self) -> u64;

    /// The state that a later session continues from.
    fn snapshot(&self) -> TrainSnapshot;

    /// The averaged network's predictions for prepared samples, in the frame of each sample: `CELLS` positions each.
    ///
    /// # Errors
    /// A network that cannot be evaluated.
    fn predictions(&self, samples: &[PreparedSample]) -> Result<Vec<Vec<[f32; 3]>>, TrainError>;
}
