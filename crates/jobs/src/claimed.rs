//! A job in a worker's hands.

use std::{sync::Arc, time::Duration};

use tokio::{
    io::AsyncRead,
    runtime::Handle,
    task::JoinHandle,
    time::{Instant, sleep},
};
use tracing::warn;

use super::{
    attempt::{self, Attempt},
    blobs::{BlobFile, BlobName},
    company::RunningJob,
    error::JobError,
    job::{Claimed, Failure, Job, Lease, Outcome, Product, State},
    jobs::{Changes, Jobs},
};

/// How long the end of an attempt is tried to be written while the database fails.
const PATIENCE: Duration = Duration::from_secs(60);
/// The longest pause between two tries.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// A job that this process runs, with its lease, which is kept as long as this lives.
///
/// Dropped before its input was asked for, it is given back. Dropped later without an end, as in a panic, its lease runs out, and that is a
/// crashed attempt.
#[derive(Debug)]
pub struct ClaimedJob {
    jobs: Arc<Jobs>,
    job: Job,
    lease: Lease,
    attempt: Arc<Attempt>,
    keeper: JoinHandle<()>,
    /// It may be dropped on a thread that has no runtime.
    runtime: Handle,
    phase: Phase,
    /// As long as it is there, the job counts as running beside others.
    running: Option<RunningJob>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Claimed,
    Begun,
    Ended,
}

impl ClaimedJob {
    pub(crate) fn new(
        jobs: Arc<Jobs>,
        claimed: Claimed,
        running: RunningJob,
        stops: Changes,
    ) -> Self {
        let Claimed { job, lease } = claimed;
        let attempt = Arc::new(Attempt::default());
        let keeper = attempt::keep(Arc::clone(&jobs), lease, Arc::clone(&attempt), stops);
        Self {
            jobs,
            job,
            lease,
            attempt,
            keeper: tokio::spawn(keeper),
            runtime: Handle::current(),
            phase: Phase::Claimed,
            running: Some(running),
        }
    }

    /// The job as it was when it was claimed.
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// The attempt, for the thread that works.
    pub fn attempt(&self) -> Arc<Attempt> {
        Arc::clone(&self.attempt)
    }

    /// Opens the input.
    pub async fn input(&mut self) -> Result<BlobFile, JobError> {
        self.phase = self.phase.max(Phase::Begun);
        // A waiting job has its input; it is gone where the job was deleted meanwhile.
        let input = self.job.input.as_ref();
        let input = input.ok_or(JobError::LeaseLost(self.job.id))?;
        self.jobs.blobs().open_blob(input).await
    }

    /// Stores the result with its report and its answer (JSON), and ends the job as done. The input is deleted.
    ///
    /// # Errors
    /// [`JobError::LeaseLost`]: another worker has the job, or it was deleted; the files just written are deleted.
    /// [`JobError::StorageFull`]: the job still runs, and can be ended by [`Self::fail`].
    pub async fn finish(
        &mut self,
        result: impl AsyncRead,
        report: impl AsyncRead,
        answer: String,
    ) -> Result<Job, JobError> {
        let names = [BlobName::result(self.lease), BlobName::report(self.lease)];
        let [result_name, report_name] = &names;
        let blobs = self.jobs.blobs();
        let stored = async {
            self.jobs.store().check_room().await?;
            let result = blobs.put(result_name, result).await?;
            let report = blobs.put(report_name, report).await?;
            Ok(result.bytes + report.bytes)
        };
        let ended = match stored.await {
            Ok(bytes) => {
                let product = Product {
                    result: result_name.clone(),
                    report: report_name.clone(),
                    bytes: i64::try_from(bytes).unwrap_or(i64::MAX),
                    answer,
                };
                self.end(Outcome::Done(product)).await
            }
            Err(error) => Err(error),
        };
        match &ended {
            Ok(_) => self.jobs.discard(&self.job.input).await,
            Err(
                JobError::LeaseLost(_)
                | JobError::StorageFull
                | JobError::File { .. }
                | JobError::Stream(_),
            ) => self.jobs.discard(&names).await,
            // The end may be written nevertheless: the files stay, and are swept if it was not.
            Err(_) => {}
        }
        ended
    }

    /// Ends the job as failed, with a problem document or the like (JSON) for the client. It keeps its input, for a retry.
    pub async fn fail(
        &mut self,
        failure: Failure,
        answer: Option<String>,
    ) -> Result<Job, JobError> {
        self.end(Outcome::Failed { failure, answer }).await
    }

    /// Ends the job as cancelled, after the client wanted it ([`StopReason::Cancelled`](crate::StopReason)). It keeps its input, for a retry.
    pub async fn cancelled(&mut self) -> Result<Job, JobError> {
        self.end(Outcome::Cancelled).await
    }

    /// Lets the job wait again, as if this attempt had not been.
    pub async fn give_back(&mut self) -> Result<Job, JobError> {
        self.end(Outcome::GivenBack).await
    }

    /// Writes the end; while the database fails, again and again for a minute, with the lease kept.
    async fn end(&mut self, outcome: Outcome) -> Result<Job, JobError> {
        let began = Instant::now();
        let mut pause = Duration::from_millis(100);
        let ended = loop {
            match self.jobs.store().end(self.lease, &outcome).await {
                Err(JobError::Database(error)) if began.elapsed() < PATIENCE => {
                    warn!(job = %self.job.id, ?error, "the end of a job cannot be written");
                    sleep(pause).await;
                    pause = (pause * 2).min(LONGEST_PAUSE);
                }
                ended => break ended,
            }
        };
        if matches!(ended, Ok(_) | Err(JobError::LeaseLost(_))) {
            self.phase = Phase::Ended;
            self.keeper.abort();
            match &ended {
                Ok(job) if job.state == State::Waiting => {
                    self.jobs.announce(job.id);
                    self.jobs.announce_waiting();
                }
                Ok(job) => self.jobs.announce_end(job),
                Err(_) => self.jobs.announce(self.job.id),
            }
        }
        ended
    }
}

impl Drop for ClaimedJob {
    fn drop(&mut self) {
        self.keeper.abort();
        // A job may have waited until this process was free.
        drop(self.running.take());
        self.jobs.wake();
        if self.phase != Phase::Claimed {
            return;
        }
        let (jobs, lease) = (Arc::clone(&self.jobs), self.lease);
        self.runtime.spawn(async move {
            match jobs.store().end(lease, &Outcome::GivenBack).await {
                Ok(_) => jobs.announce_waiting(),
                Err(JobError::LeaseLost(_)) => jobs.wake(),
                Err(error) => warn!(job = %lease.job, ?error, "a job cannot be given back"),
            }
        });
    }
}
