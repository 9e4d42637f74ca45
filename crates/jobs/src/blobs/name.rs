//! Names of files: the job's id, what the file is, and for what an attempt made, the attempt's token.
//!
//! A late attempt therefore cannot write over the file of another, and the row that may name a file is found by the name alone.

use std::fmt;

use uuid::Uuid;

use crate::{error::JobError, job::Lease};

/// The name of a file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BlobName {
    text: String,
    job: Uuid,
}

impl BlobName {
    /// The input of a job.
    pub fn input(job: Uuid) -> Self {
        Self {
            text: format!("{job}.input"),
            job,
        }
    }

    /// The result of an attempt.
    pub fn result(lease: Lease) -> Self {
        Self::of_attempt(lease, "result")
    }

    /// The report of an attempt.
    pub fn report(lease: Lease) -> Self {
        Self::of_attempt(lease, "report")
    }

    fn of_attempt(lease: Lease, kind: &str) -> Self {
        let Lease { job, token } = lease;
        Self {
            text: format!("{job}.{token}.{kind}"),
            job,
        }
    }

    /// Reads a name.
    pub fn parse(text: &str) -> Result<Self, JobError> {
        let mut parts = text.split('.');
        let mut part = || parts.next().unwrap_or_default();
        let name = match (part().parse(), part(), part()) {
            (Ok(job), "input", "") => Self::input(job),
            (Ok(job), token, "result") => Self::result(lease(job, token)?),
            (Ok(job), token, "report") => Self::report(lease(job, token)?),
            _ => return Err(unexpected(text)),
        };
        // A path, a second spelling or anything more is no name.
        if name.text != text {
            return Err(unexpected(text));
        }
        Ok(name)
    }

    /// The name as it is written.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The job whose file it is.
    pub fn job(&self) -> Uuid {
        self.job
    }
}

impl fmt::Display for BlobName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

fn lease(job: Uuid, token: &str) -> Result<Lease, JobError> {
    let token = token.parse().map_err(|_| unexpected(token))?;
    Ok(Lease { job, token })
}

fn unexpected(text: &str) -> JobError {
    JobError::UnexpectedValue(format!("file name {text:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_read_back_and_nothing_else_is_a_name() {
        let lease = Lease {
            job: Uuid::new_v4(),
            token: Uuid::new_v4(),
        };
        for name in [
            BlobName::input(lease.job),
            BlobName::result(lease),
            BlobName::report(lease),
        ] {
            assert_eq!(BlobName::parse(name.as_str()).unwrap(), name);
            for other in [
                format!("{name}.input"),
                format!("../{name}"),
                format!("{name}/"),
                name.as_str().to_uppercase(),
            ] {
                assert!(BlobName::parse(&other).is_err(), "{other}");
            }
        }
    }
}
