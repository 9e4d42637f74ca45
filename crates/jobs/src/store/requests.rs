//! What clients do with a job that exists: cancel, retry, delete.

use uuid::Uuid;

use super::{Store, only_job};
use crate::{
    engine::{Urgency, args},
    error::JobError,
    job::{Job, State},
};

impl Store {
    /// Cancels a job: a waiting one at once, a running one when its worker hears of it ([`Signal::Cancel`](crate::Signal)). Cancelling twice is
    /// the same as once.
    ///
    /// # Errors
    /// [`JobError::WrongState`] for one that is done or has failed.
    pub async fn cancel(&self, id: Uuid) -> Result<Job, JobError> {
        let now = self.engine.dialect().now;
        let sql = format!(
            "UPDATE jobs SET state = CASE state WHEN 'waiting' THEN 'cancelled' ELSE state END,
                finished_at = CASE state WHEN 'waiting' THEN {now} END,
                cancel_wanted = CASE state WHEN 'running' THEN 1 ELSE 0 END,
                changed_at = {now}, version = version + 1
             WHERE id = $2 AND (state = 'waiting' OR (state = 'running' AND cancel_wanted = 0)) RETURNING *"
        );
        loop {
            let args = args![self.now(), id];
            let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
            if let Some(job) = only_job(rows)? {
                return Ok(job);
            }
            let job = self.get(id).await?;
            match job.state {
                State::Cancelled => return Ok(job),
                State::Running if job.cancel_wanted => return Ok(job),
                State::Done | State::Error => return Err(wrong_state(&job, "cancelled")),
                // It was retried between the two statements.
                State::Waiting | State::Running => {}
            }
        }
    }

    /// Lets a job that failed or was cancelled wait again, with all its attempts, in its old place.
    ///
    /// # Errors
    /// [`JobError::WrongState`] for another one, [`JobError::Expired`] where its input is gone.
    pub async fn retry(&self, id: Uuid) -> Result<Job, JobError> {
        let now = self.engine.dialect().now;
        let sql = format!(
            "UPDATE jobs SET state = 'waiting', attempt = 0, started_at = NULL, finished_at = NULL, worker = NULL,
                answer = NULL, failure_code = NULL, failure_message = NULL, changed_at = {now}, version = version + 1
             WHERE id = $2 AND state IN ('error', 'cancelled') AND expired_at IS NULL RETURNING *"
        );
        loop {
            let args = args![self.now(), id];
            let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
            if let Some(job) = only_job(rows)? {
                return Ok(job);
            }
            let job = self.get(id).await?;
            match job.state {
                State::Error | State::Cancelled if job.expired_at.is_some() => {
                    return Err(JobError::Expired(id));
                }
                // It ended between the two statements.
                State::Error | State::Cancelled => {}
                _ => return Err(wrong_state(&job, "retried")),
            }
        }
    }

    /// Deletes the row of a job in any state, and answers with what it was; its files are the caller's to delete. The worker of a running
    /// one hears that its lease is lost.
    pub async fn delete(&self, id: Uuid) -> Result<Job, JobError> {
        let sql = "DELETE FROM jobs WHERE id = $1 RETURNING *";
        let rows = self
            .engine
            .write(Urgency::EvenWhenFull, sql, args![id])
            .await?;
        only_job(rows)?.ok_or(JobError::NoSuchJob(id))
    }
}

fn wrong_state(job: &Job, asked: &'static str) -> JobError {
    JobError::WrongState {
        job: job.id,
        state: job.state,
        asked,
    }
}
