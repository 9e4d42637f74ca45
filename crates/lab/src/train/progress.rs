//! What a training run reports after every step.

use super::loss::LossTerms;
use super::score::HeldOutScores;

/// The state of a run after a step.
#[derive(Debug, Clone, Copy)]
pub struct TrainProgress {
    /// Steps done.
    pub step: u64,
    /// Minutes trained, all sessions together.
    pub minutes: f64,
    /// Share of the budget used, 0 to 1.
    pub share: f64,
    /// The loss of the step.
    pub loss: LossTerms,
    /// Norm of the whole gradient.
    pub norm: f64,
    /// The scores, at the steps that measured them.
    pub scores: Option<HeldOutScores>,
}
