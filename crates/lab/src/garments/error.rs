//! Why a garment could not be made, written or read.

use super::garment::GarmentKind;
use std::path::PathBuf;

/// Why a garment could not be made, written or read.
#[derive(Debug, thiserror::Error)]
pub enum GarmentError {
    /// Two runs of one seam do not exist, or a seam has another number of runs than two.
    #[error("seam {seam} joins {runs} run(s); a seam joins two")]
    Seam {
        /// Number of the seam.
        seam: u16,
        /// Runs found.
        runs: usize,
    },
    /// A panel could not be triangulated.
    #[error("panel {panel} cannot be triangulated: {reason}")]
    Panel {
        /// Number of the panel.
        panel: usize,
        /// Why.
        reason: String,
    },
    /// All seeds that were tried gave cloth that cuts through itself or is stretched.
    #[error("no {kind:?} of seed {seed} came to rest well in {attempts} attempts: {reason}")]
    NoGarment {
        /// Its kind.
        kind: GarmentKind,
        /// Its seed.
        seed: u64,
        /// Drapes simulated.
        attempts: u32,
        /// What was wrong with the last.
        reason: String,
    },
    /// A file or folder could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file has another format.
    #[error("{path} is no file of a garment set: {reason}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}
