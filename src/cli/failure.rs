//! How a command fails: one line of text and an exit code.

use darn_contract::{Code, error_chain};
use darn_gltf_scan::ScanError;
use darn_mend::MendError;
use std::error::Error;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Wrong usage or settings; exit 64.
    #[error("{0}")]
    Usage(String),
    /// The work failed; exit 1.
    #[error("cannot {doing}: {}", error_chain(.cause.as_ref()))]
    Failed {
        /// What was being done; completes "cannot …".
        doing: String,
        /// Why it failed.
        cause: Box<dyn Error + Send + Sync>,
    },
}

impl Failure {
    /// The process's exit code.
    pub fn code(&self) -> u8 {
        match self {
            Self::Usage(_) => super::USAGE,
            Self::Failed { .. } => 1,
        }
    }

    /// The code of an error of mending, or of reading a scan.
    pub fn mend_code(&self) -> Option<Code> {
        let Self::Failed { cause, .. } = self else {
            return None;
        };
        let mending = cause.downcast_ref::<MendError>().map(MendError::code);
        let reading = cause.downcast_ref::<ScanError>();
        mending.or_else(|| reading.map(darn_mend::reading_code))
    }
}

/// Turns any error into a [`Failure`]: `result.or_fail("read in.glb")?`.
pub trait OrFail<T> {
    /// An error becomes a failure whose text begins with "cannot `doing`".
    fn or_fail(self, doing: impl Into<String>) -> Result<T, Failure>;
}

impl<T, E: Into<Box<dyn Error + Send + Sync>>> OrFail<T> for Result<T, E> {
    fn or_fail(self, doing: impl Into<String>) -> Result<T, Failure> {
        self.map_err(|error| Failure::Failed {
            doing: doing.into(),
            cause: error.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("outer: {source}")]
    struct Outer {
        source: std::io::Error,
    }

    #[test]
    fn a_cause_is_said_once() {
        let result: Result<(), Outer> = Err(Outer {
            source: std::io::Error::other("disk on fire"),
        });
        let failure = result.or_fail("write out.glb").unwrap_err();
        assert_eq!(
            failure.to_string(),
            "cannot write out.glb: outer: disk on fire"
        );
        assert_eq!(failure.code(), 1);
    }
}
