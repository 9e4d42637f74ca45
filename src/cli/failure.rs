//! How a command fails: one line of text and an exit code.

use darn_contract::{Code, codes, error_chain};
use darn_gltf_scan::ScanError;
use darn_mend::MendError;
use std::error::Error;
use std::io;

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

    /// The row of the table of error codes: that of an error of mending or of reading a scan; `not_found` and `storage_full` of files; `internal` of
    /// files that cannot be read or written for another reason; `malformed_request` of wrong usage.
    pub fn row(&self) -> Code {
        let Self::Failed { cause, .. } = self else {
            return codes::MALFORMED_REQUEST;
        };
        let mending = cause.downcast_ref::<MendError>().map(MendError::code);
        let reading = cause.downcast_ref::<ScanError>();
        let file = cause.downcast_ref::<io::Error>().map(io::Error::kind);
        mending
            .or_else(|| reading.map(darn_mend::reading_code))
            .unwrap_or(match file {
                Some(io::ErrorKind::NotFound) => codes::NOT_FOUND,
                Some(io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded) => {
                    codes::STORAGE_FULL
                }
                _ => codes::INTERNAL,
            })
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
    fn every_failure_has_a_row_of_the_table() {
        let of = |kind: io::ErrorKind| Err::<(), _>(io::Error::from(kind)).or_fail("read a.glb");
        for (kind, code) in [
            (io::ErrorKind::NotFound, "not_found"),
            (io::ErrorKind::StorageFull, "storage_full"),
            (io::ErrorKind::PermissionDenied, "internal"),
        ] {
            assert_eq!(of(kind).unwrap_err().row().word, code);
        }
        let usage = Failure::Usage("no such option".to_owned());
        assert_eq!(usage.row().word, "malformed_request");
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
