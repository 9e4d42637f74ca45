//! What has to be done from time to time. Every process looks for dead workers; the rest one process does for all. None disturbs another.

use std::time::Duration;

use tokio::time::sleep;
use tracing::{info, warn};

use super::{
    error::JobError,
    job::State,
    jobs::Jobs,
    store::{Chore, ExpiredLeases, Freed},
};

/// How often leases that ran out are looked for.
const LEASES_EVERY: Duration = Duration::from_secs(5);
/// How often finished jobs are looked through.
const RETENTION_EVERY: Duration = Duration::from_secs(60);
/// How often files without a row are looked for.
const SWEEP_EVERY: Duration = Duration::from_secs(60 * 60);

/// The age of a file without a row at which nobody writes that row any more.
const ORPHAN_AGE: Duration = Duration::from_secs(60 * 60);

/// Files that are compared with the rows at once.
const SWEEP_BATCH: usize = 200;

impl Jobs {
    /// Does what has to be done from time to time, for ever. What fails is logged, and done the next time.
    pub async fn keep_house(&self) {
        loop {
            log(self.expire_leases().await);
            log(self.do_chore(Chore::Retention).await);
            log(self.do_chore(Chore::Sweep).await);
            sleep(LEASES_EVERY).await;
        }
    }

    /// Says, for ever, that an instance lives. Stopped, the instance counts as dead after the time of a lease.
    pub async fn live_as(&self, instance: &str) {
        loop {
            if let Err(error) = self.store().instance_lives(instance).await {
                warn!(?error, "the database was not told that this instance lives");
            }
            sleep(self.settings().renewal).await;
        }
    }

    /// Does a chore, unless this or another process has done it in its present period.
    async fn do_chore(&self, chore: Chore) -> Result<usize, JobError> {
        let period = match chore {
            Chore::Retention => RETENTION_EVERY,
            Chore::Sweep => SWEEP_EVERY,
        };
        match (self.store().take_chore(chore, period).await?, chore) {
            (true, Chore::Retention) => self.retain().await,
            (true, Chore::Sweep) => self.sweep(ORPHAN_AGE).await,
            (false, _) => Ok(0),
        }
    }

    /// Ends the attempts of workers that are dead; see [`Store::expire_leases`](crate::Store::expire_leases). Answers with their number.
    pub async fn expire_leases(&self) -> Result<usize, JobError> {
        let jobs = self.store().expire_leases(ExpiredLeases::ByTime).await?;
        for job in &jobs {
            warn!(job = %job.id, attempt = job.attempt, worker = job.worker, state = %job.state, "a worker did not renew its lease");
            self.announce_end(job);
            match job.state {
                State::Waiting => self.announce_waiting(),
                _ => self.wake(),
            }
        }
        Ok(jobs.len())
    }

    /// Deletes what is kept no longer ([`Retention`](crate::Retention)). Answers with the number of jobs that lost their files or their row.
    pub async fn retain(&self) -> Result<usize, JobError> {
        let retention = self.settings().retention;
        let mut jobs = 0;
        loop {
            let expired = self.store().expire_files(&retention).await?;
            jobs += self.delete_freed(&expired).await;
            let forgotten = self.store().forget(&retention).await?;
            jobs += self.delete_freed(&forgotten).await;
            let went_on = expired.jobs + forgotten.jobs > 0;
            if !(went_on && (expired.is_more || forgotten.is_more)) {
                break;
            }
        }
        Ok(jobs)
    }

    async fn delete_freed(&self, freed: &Freed) -> usize {
        self.discard(&freed.blobs).await;
        freed.jobs
    }

    /// Deletes files that are at least this old and that no row names: what crashes have left. Answers with their number.
    pub async fn sweep(&self, age: Duration) -> Result<usize, JobError> {
        let mut orphans = 0;
        for blobs in self.blobs().unnamed(age).await?.chunks(SWEEP_BATCH) {
            let named = self.store().named_blobs(blobs).await?;
            for orphan in blobs.iter().filter(|blob| !named.contains(blob)) {
                self.blobs().delete(orphan).await?;
                orphans += 1;
            }
        }
        if orphans > 0 {
            info!(orphans, "files without a job were deleted");
        }
        Ok(orphans)
    }
}

fn log(done: Result<usize, JobError>) {
    if let Err(error) = done {
        warn!(?error, "housekeeping failed; it is tried again");
    }
}
