//! Where the scan of a job goes as it comes: into a file, or into a digest alone where the job is there already.

use darn_jobs::{Job, Jobs, ReceivedInput, Submission, blobs::Written};
use tokio::io::AsyncRead;

use super::{app::App, client::Caller, error::RequestError, job_quota, job_request::JobLabels};

/// What takes the scan of a request for a job.
#[derive(Debug, Clone, Copy)]
pub enum Inlet<'a> {
    /// Stores it for the job that is to be made.
    Store(&'a Jobs),
    /// Compares it with that of the job that an earlier request with the same idempotency key has made. Takes no space and asks no quota.
    Compare(&'a Jobs),
}

impl<'a> Inlet<'a> {
    /// Opens it for a request with these labels.
    ///
    /// # Errors
    /// `Quota` where no more jobs of the caller may wait, and the request is not a repeated one.
    pub async fn open(
        app: &App,
        jobs: &'a Jobs,
        caller: &Caller,
        labels: &JobLabels,
    ) -> Result<Self, RequestError> {
        if let Some(key) = labels.key()
            && jobs.has_key(&app.job_owner(caller), key).await?
        {
            return Ok(Self::Compare(jobs));
        }
        job_quota::check(jobs, caller).await?;
        Ok(Self::Store(jobs))
    }

    /// Takes the scan.
    ///
    /// # Errors
    /// `StorageFull`, where it is stored; those of the stream.
    pub async fn take(self, scan: impl AsyncRead) -> Result<JobInput, RequestError> {
        Ok(match self {
            Self::Store(jobs) => JobInput::Stored(jobs.receive(scan).await?),
            Self::Compare(jobs) => JobInput::Compared(jobs.measure(scan).await?),
        })
    }
}

/// A scan that an [`Inlet`] has taken.
#[derive(Debug)]
pub enum JobInput {
    /// It is in its file, which goes with this value as long as there is no job.
    Stored(ReceivedInput),
    /// It was read.
    Compared(Written),
}

impl JobInput {
    /// Its bytes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Stored(input) => input.bytes(),
            Self::Compared(written) => written.bytes,
        }
    }

    /// Its job: a new one, or that of an earlier request with the same key.
    ///
    /// # Errors
    /// `IdempotencyMismatch`, `Quota` or `StorageFull`; `NoSuchJob` where the job of the key was deleted while the scan came.
    pub async fn submit(
        self,
        jobs: &Jobs,
        caller: &Caller,
        submission: Submission,
    ) -> Result<Job, RequestError> {
        let input = match self {
            Self::Compared(written) => {
                let first = jobs.repeated(&submission, &written).await?;
                return first.ok_or(RequestError::NoSuchJob);
            }
            Self::Stored(input) => input,
        };
        let turn = job_quota::turn(caller).await;
        if turn.is_some() {
            // The job of the key may have been made while the scan came.
            if let Some(first) = jobs.repeated(&submission, input.written()).await? {
                return Ok(first);
            }
            job_quota::check(jobs, caller).await?;
        }
        let job = jobs.submit_received(submission, input).await?.into_job();
        drop(turn);
        Ok(job)
    }
}
