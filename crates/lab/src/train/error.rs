//! Why training stopped.

use std::path::PathBuf;

use darn_net::NetError;
use darn_net::engine::EngineError;

/// Why training stopped.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The sheets of a folder could not be read.
    #[error("sheets in {path}: {reason}")]
    Sheets {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A weights file was refused.
    #[error(transparent)]
    Net(#[from] NetError),
    /// The engine refused its input.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A checkpoint was refused.
    #[error("checkpoint {path}: {reason}")]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The loss or its gradient is not finite.
    #[error("the loss is not finite at step {step}; a lower learning rate may help")]
    Diverged {
        /// Steps done.
        step: u64,
    },
    /// An option has a value that cannot be used.
    #[error("{0}")]
    Options(String),
    /// A thread that makes batches has ended.
    #[error("the sample threads stopped")]
    NoSamples,
}
