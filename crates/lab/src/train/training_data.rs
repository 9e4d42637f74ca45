//! The data of a training run: samples to learn from, and held-out samples to measure scores on.

use std::path::Path;
use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::batch::SampleSource;
use super::error::TrainError;
use crate::scarffolds::samples::{SampleRotation, Sampler, TrainingSample};
use crate::scarffolds::sheets;

/// Number of held-out samples.
const HELD_OUT_SAMPLES: usize = 64;
/// Seed of the held-out samples; fixed, so that all runs are measured on the same samples.
const HELD_OUT_SEED: u64 = 0x5ca1_ab1e;

/// The data of a training run.
pub struct TrainingData {
    /// Draws samples to learn from.
    pub train: SampleSource,
    /// Samples that scores are measured on.
    pub held_out: Vec<TrainingSample>,
    /// Seed of the sheets behind `train`, for the model card.
    pub data_seed: Option<u64>,
}

/// The held-out samples: the same sheets always give the same samples.
pub fn held_out(sampler: &Sampler) -> Vec<TrainingSample> {
    let mut rng = ChaCha8Rng::seed_from_u64(HELD_OUT_SEED);
    let samples = (0..HELD_OUT_SAMPLES).flat_map(|_| sampler.alike(1, &mut rng));
    samples.collect()
}

/// A source of samples to learn from, with `alike` samples of each hole.
pub fn source(sampler: Sampler, alike: usize) -> SampleSource {
    let alike = alike.max(1);
    Arc::new(move |rng| sampler.alike(alike, rng))
}

/// A sampler over the sheets of a folder.
///
/// # Errors
/// A folder that cannot be read, or has no sheets.
pub fn sampler(dir: &Path, rotation: SampleRotation) -> Result<Sampler, TrainError> {
    let refuse = |reason: String| TrainError::Sheets {
        path: dir.to_owned(),
        reason,
    };
    let sheets = sheets::read(dir).map_err(|e| refuse(e.to_string()))?;
    if sheets.is_empty() {
        return Err(refuse("there are none".into()));
    }
    Ok(Sampler::new(&sheets, rotation))
}
