//! Why sheets could not be made, read or written.

use super::manifest::VERSION;
use std::path::PathBuf;

/// Why sheets could not be made, read or written.
#[derive(Debug, thiserror::Error)]
pub enum ScarfError {
    /// A file or folder could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file has another format.
    #[error("{path} is no file of sheets: {reason}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file was made with another seed or by another version of the generator.
    #[error(
        "{path} was made with seed {found} by generator version {version}, not with seed {seed} by version {VERSION}"
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The seed in the file.
        found: u64,
        /// The version in the file.
        version: u32,
        /// The seed asked for.
        seed: u64,
    },
    /// All simulated scenes failed the checks.
    #[error(
        "no scene of sheet {index} came to rest without self-intersection in {attempts} attempts"
    )]
    NoSheet {
        /// Number of the sheet.
        index: usize,
        /// Scenes simulated.
        attempts: u32,
    },
    /// A folder holds no sheets.
    #[error("no sheets in {path}")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
}
