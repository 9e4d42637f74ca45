//! Where jobs are, and how they are kept.

use std::{path::PathBuf, time::Duration};

use super::{blobs::Files, job::Retention, store::Clock};

/// Where the jobs are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// All in one folder, rows in SQLite: for one process.
    Folder(PathBuf),
    /// Rows on a PostgreSQL server, files where all machines see them. No other service has its files in the same folder, or in the same bucket
    /// under the same prefix: it would take these for its own that no row names.
    Shared {
        /// `postgres://user:password@host/database`
        url: String,
        /// The files.
        files: Files,
    },
}

impl Place {
    /// Where the files are.
    pub fn files(&self) -> Files {
        match self {
            Self::Folder(folder) => Files::Folder(folder.clone()),
            Self::Shared { files, .. } => files.clone(),
        }
    }
}

/// How the jobs are kept.
#[derive(Debug, Clone)]
pub struct Settings {
    /// After which time without a sign of life a worker counts as dead. The same on all machines.
    pub lease: Duration,
    /// How often a worker gives one.
    pub renewal: Duration,
    /// How often waiting jobs are looked for.
    pub poll: Duration,
    /// What is kept of finished jobs.
    pub retention: Retention,
    /// Where times come from; injected by tests.
    pub clock: Clock,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(30),
            renewal: Duration::from_secs(10),
            poll: Duration::from_secs(1),
            retention: Retention::default(),
            clock: Clock::default(),
        }
    }
}
