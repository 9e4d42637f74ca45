//! Training samples without end for a trainer outside this program: the work of `darn samples`.

use super::batch::{BatchGenerator, PreparedSample, prepare};
use super::error::TrainError;
use super::sample_records;
use super::training_data::{held_out, sampler, source};
use crate::scarffolds::samples::SampleRotation;
use darn_net::{FrameKind, UnetConfig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

/// Samples written at once.
const TOGETHER: usize = 64;

/// Which samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamedSamples {
    /// Random ones to learn from.
    Random {
        /// How many.
        count: usize,
        /// The same seed gives the same samples.
        seed: u64,
        /// Sheets drawn for a sample, of which the roughest is taken.
        roughest_of: usize,
        /// Samples that share a hole.
        alike: usize,
    },
    /// Those that [`super::run`] measures its scores on.
    HeldOut,
}

/// A stream of samples.
#[derive(Debug, Clone)]
pub struct SampleStream {
    /// Folder of sheets.
    pub sheets: PathBuf,
    /// How samples are rotated; upright ones are in the frame that knows up.
    pub rotation: SampleRotation,
    /// Which samples.
    pub samples: StreamedSamples,
}

impl SampleStream {
    /// Writes the records of `sample_records`; ends early, without an error, when `out` is a closed pipe.
    ///
    /// # Errors
    /// Sheets that cannot be read, an output that cannot be written.
    pub fn write(&self, out: &mut dyn Write) -> Result<(), TrainError> {
        let sampler = sampler(&self.sheets, self.rotation)?;
        let network = UnetConfig {
            frame: match self.rotation {
                SampleRotation::Upright => FrameKind::Hanging,
                SampleRotation::Any => FrameKind::Canonical,
            },
            ..UnetConfig::default()
        };
        let mut records = Vec::new();
        // Returns whether the reader still reads.
        let mut send = |samples: &[PreparedSample]| {
            records.clear();
            sample_records::write(samples, &mut records);
            match out.write_all(&records) {
                Ok(()) => Ok(true),
                Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
                Err(source) => Err(TrainError::File {
                    path: "the output of samples".into(),
                    source,
                }),
            }
        };
        match self.samples {
            StreamedSamples::HeldOut => {
                let samples = held_out(&sampler);
                let samples = samples.iter().filter_map(|s| prepare(s, &network));
                send(&samples.collect::<Vec<_>>())?;
            }
            StreamedSamples::Random {
                count,
                seed,
                roughest_of,
                alike,
            } => {
                let generator = BatchGenerator {
                    source: source(sampler.roughest_of(roughest_of), alike),
                    network,
                    size: TOGETHER,
                    seed,
                };
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let mut left = count;
                while left > 0 {
                    let mut samples = generator.samples(&mut rng);
                    samples.truncate(left);
                    left -= samples.len();
                    if !send(&samples)? {
                        break;
                    }
                }
            }
        }
        Ok(())
    }
}
