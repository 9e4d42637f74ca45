//! What workers do: claim a job, keep its lease, tell its progress, end the attempt.

use uuid::Uuid;

use super::{Store, first, job, only_job};
use crate::{
    engine::{Row, Urgency, args},
    error::JobError,
    job::{Claimant, Claimed, Company, Job, Lease, Outcome, Product, Progress, Signal},
};

/// Clients that a claim tries in turn when other processes take their jobs before it.
const CANDIDATES: i64 = 16;

/// What every end of an attempt sets.
const RELEASED: &str = "lease = NULL, lease_until = NULL, stage = NULL, hole = NULL, holes = NULL,
    cancel_wanted = 0, version = version + 1";

impl Store {
    /// Gives a waiting job to a worker, fairly between clients. The attempt is counted on disk before this returns.
    ///
    /// The order is exact among the claims of a process. Claims of other machines at the same moment do not see each other's choice of client,
    /// so a client can get as many jobs more than its turn as there are such claims; no job is given out twice.
    pub async fn claim(&self, claimant: &Claimant<'_>) -> Result<Option<Claimed>, JobError> {
        let _turn = self.claims.lock().await;
        // Clients that may run no more stand in front where others run more than they may.
        let limited = claimant.limits.map_or(0, |limits| limits.len());
        let wanted = CANDIDATES.saturating_add(i64::try_from(limited).unwrap_or(i64::MAX));
        let candidates = self
            .engine
            .read(self.engine.dialect().candidates, args![wanted]);
        for candidate in candidates.await? {
            let client = candidate.some("client", Row::text)?;
            if claimant.is_at_limit(&client, candidate.some("running", Row::int)?) {
                continue;
            }
            let has_crashed = candidate.some("attempt", Row::int)? > 0;
            if has_crashed && claimant.company == Company::Shared {
                return Ok(None);
            }
            if let Some(claimed) = self.claim_of(&client, claimant).await? {
                return Ok(Some(claimed));
            }
        }
        Ok(None)
    }

    /// Takes the first job of a client, passing over those that others are just taking.
    async fn claim_of(
        &self,
        client: &str,
        claimant: &Claimant<'_>,
    ) -> Result<Option<Claimed>, JobError> {
        let dialect = self.engine.dialect();
        let (now, skip_locked) = (dialect.now, dialect.skip_locked);
        let which = match claimant.company {
            Company::Alone => "",
            Company::Shared => "AND attempt = 0",
        };
        let sql = format!(
            "UPDATE jobs SET state = 'running', attempt = attempt + 1, lease = $2, lease_until = {now} + $3, worker = $4,
                started_at = {now}, changed_at = {now}, version = version + 1
             WHERE state = 'waiting' AND number = (
                SELECT number FROM jobs WHERE state = 'waiting' AND client = $5 {which}
                ORDER BY priority DESC, number LIMIT 1 {skip_locked})
             RETURNING *"
        );
        let token = Uuid::new_v4();
        let args = args![self.now(), token, self.lease_ms, claimant.worker, client];
        let rows = self.engine.write(Urgency::Ordinary, &sql, args).await?;
        Ok(only_job(rows)?.map(|job| Claimed {
            lease: Lease { job: job.id, token },
            job,
        }))
    }

    /// Begins the lease's time anew.
    ///
    /// A lease that has run out and that nobody has taken can still be renewed, and its job ended: the attempt has lost nothing then.
    ///
    /// # Errors
    /// [`JobError::LeaseLost`] where the job was given to another worker, given up, ended or deleted; so for all that takes a lease.
    pub async fn renew(&self, lease: Lease) -> Result<Signal, JobError> {
        let now = self.engine.dialect().now;
        let sql = format!(
            "UPDATE jobs SET lease_until = {now} + $4 WHERE id = $2 AND lease = $3 RETURNING cancel_wanted"
        );
        let args = args![self.now(), lease.job, lease.token, self.lease_ms];
        let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        signal(first(rows), lease)
    }

    /// Writes how far the attempt is. This renews the lease, too.
    pub async fn progress(&self, lease: Lease, progress: &Progress) -> Result<Signal, JobError> {
        let now = self.engine.dialect().now;
        let sql = format!(
            "UPDATE jobs SET stage = $5, hole = $6, holes = $7, lease_until = {now} + $4, changed_at = {now}, version = version + 1
             WHERE id = $2 AND lease = $3 RETURNING cancel_wanted"
        );
        let Progress { stage, hole, holes } = progress;
        let args = args![
            self.now(),
            lease.job,
            lease.token,
            self.lease_ms,
            stage.as_str(),
            *hole,
            *holes,
        ];
        let rows = self.engine.write(Urgency::Ordinary, &sql, args).await?;
        signal(first(rows), lease)
    }

    /// Ends the attempt; answers with the job as it is then.
    ///
    /// [`Outcome::Done`] may be repeated after an error that left open whether it was written.
    pub async fn end(&self, lease: Lease, outcome: &Outcome) -> Result<Job, JobError> {
        let now = self.engine.dialect().now;
        let mut args = args![self.now(), lease.job, lease.token];
        let change = match outcome {
            Outcome::Done(product) => {
                args.extend(args![
                    product.result.as_str(),
                    product.report.as_str(),
                    product.bytes,
                    product.answer.as_str(),
                ]);
                format!(
                    "state = 'done', finished_at = {now}, input = NULL, result = $4, report = $5, bytes = $6, answer = $7"
                )
            }
            Outcome::Failed { failure, answer } => {
                args.extend(args![
                    failure.code.as_str(),
                    failure.message.as_str(),
                    answer.clone(),
                ]);
                format!(
                    "state = 'error', finished_at = {now}, failure_code = $4, failure_message = $5, answer = $6"
                )
            }
            Outcome::Cancelled => format!("state = 'cancelled', finished_at = {now}"),
            Outcome::GivenBack => format!(
                "state = CASE cancel_wanted WHEN 1 THEN 'cancelled' ELSE 'waiting' END,
                 finished_at = CASE cancel_wanted WHEN 1 THEN {now} END, attempt = attempt - 1"
            ),
        };
        let sql = format!(
            "UPDATE jobs SET {change}, changed_at = {now}, {RELEASED} WHERE id = $2 AND lease = $3 RETURNING *"
        );
        let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        match (first(rows), outcome) {
            (Some(row), _) => job(&row),
            (None, Outcome::Done(product)) => self.already_done(lease, product).await,
            (None, _) => Err(JobError::LeaseLost(lease.job)),
        }
    }

    /// The job, if it is done by this very attempt.
    async fn already_done(&self, lease: Lease, product: &Product) -> Result<Job, JobError> {
        match self.get(lease.job).await {
            Ok(job) if job.result.as_ref() == Some(&product.result) => Ok(job),
            Ok(_) | Err(JobError::NoSuchJob(_)) => Err(JobError::LeaseLost(lease.job)),
            Err(error) => Err(error),
        }
    }
}

/// What [`super::retention`] sets when a lease has run out: the same.
pub(super) const fn released() -> &'static str {
    RELEASED
}

fn signal(row: Option<Row>, lease: Lease) -> Result<Signal, JobError> {
    let row = row.ok_or(JobError::LeaseLost(lease.job))?;
    Ok(match row.some("cancel_wanted", Row::int)? {
        0 => Signal::Continue,
        _ => Signal::Cancel,
    })
}
