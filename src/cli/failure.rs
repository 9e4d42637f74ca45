//! How a command fails: one line that says what went wrong and why, and an exit code.

use std::error::Error;
use std::fmt;

/// Why a command did not do its work.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage or settings; exit 64.
    Usage(String),
    /// The work itself failed; exit 1.
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
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(what) => f.write_str(what),
            Self::Failed { doing, cause } => {
                write!(f, "cannot {doing}")?;
                let mut said = String::new();
                let mut next: Option<&(dyn Error + 'static)> = Some(cause.as_ref());
                while let Some(error) = next {
                    let text = error.to_string();
                    // Many errors repeat their source in their own text.
                    if !said.contains(&text) {
                        write!(f, ": {text}")?;
                        said.push_str(&text);
                    }
                    next = error.source();
                }
                Ok(())
            }
        }
    }
}

/// `result.or_fail("read in.glb")?`: an error of any kind becomes a [`Failure`] that says what was being done.
pub trait OrFail<T> {
    /// Turns the error into a failure to do `doing`.
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
