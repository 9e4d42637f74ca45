//! What happens by itself: leases run out, finished jobs lose their files and then their rows, files without a row are found.

use std::{collections::BTreeSet, time::Duration};

use super::{FINISHED, Row, Store, attempts, job, milliseconds};
use crate::{
    blobs::BlobName,
    engine::{Urgency, Value, args},
    error::JobError,
    job::{CRASHED, Job, MAX_ATTEMPTS, Retention},
};

/// Most jobs that one call takes on, so that none holds the database for long.
const BATCH: i64 = 500;

/// Which leases are ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExpiredLeases {
    /// Those whose time is over.
    ByTime,
    /// All: no process can have one. Only for a store that has just been opened by the one process that may use it.
    OfTheDead,
}

/// What was taken from finished jobs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Freed {
    /// Jobs that changed.
    pub jobs: usize,
    /// Files that no row names any more; the caller deletes them.
    pub blobs: Vec<BlobName>,
    /// Whether there was more than one call takes on.
    pub is_more: bool,
}

/// Work that one process does for all of them from time to time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Chore {
    /// Looking through the finished jobs.
    Retention,
    /// Looking for files without a row.
    Sweep,
}

impl Store {
    /// Whether this process is to do a chore now. The answer is yes for one process in each period.
    pub(crate) async fn take_chore(
        &self,
        chore: Chore,
        period: Duration,
    ) -> Result<bool, JobError> {
        let name = match chore {
            Chore::Retention => "retention",
            Chore::Sweep => "sweep",
        };
        let now = self.engine.dialect().now;
        let sql = format!(
            "INSERT INTO chores (name, next_at) VALUES ($2, {now} + $3)
             ON CONFLICT (name) DO UPDATE SET next_at = excluded.next_at WHERE chores.next_at <= {now} RETURNING name"
        );
        let args = args![self.now(), name, milliseconds(period)];
        let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        Ok(!rows.is_empty())
    }

    /// Ends the attempts whose workers do not renew their leases. Their jobs wait again, are cancelled where a client wanted that, or are
    /// given up after [`MAX_ATTEMPTS`] with the code [`CRASHED`]. Answers with these jobs as they are then.
    pub async fn expire_leases(&self, which: ExpiredLeases) -> Result<Vec<Job>, JobError> {
        let now = self.engine.dialect().now;
        let released = attempts::released();
        let condition = match which {
            ExpiredLeases::ByTime => format!("AND lease_until < {now}"),
            ExpiredLeases::OfTheDead => String::new(),
        };
        let sql = format!(
            "UPDATE jobs SET
                state = CASE WHEN cancel_wanted = 1 THEN 'cancelled' WHEN attempt >= $2 THEN 'error' ELSE 'waiting' END,
                finished_at = CASE WHEN cancel_wanted = 1 OR attempt >= $2 THEN {now} END,
                failure_code = CASE WHEN cancel_wanted = 0 AND attempt >= $2 THEN $3 END,
                failure_message = CASE WHEN cancel_wanted = 0 AND attempt >= $2 THEN $4 END,
                changed_at = {now}, {released}
             WHERE state = 'running' {condition} RETURNING *"
        );
        let message = format!(
            "{MAX_ATTEMPTS} workers ended or lost their connection while they ran this job"
        );
        let args = args![self.now(), MAX_ATTEMPTS, CRASHED, message];
        let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        rows.iter().map(job).collect()
    }

    /// Takes the files from finished jobs that are too old or too large for [`Retention`], the oldest first.
    pub async fn expire_files(&self, retention: &Retention) -> Result<Freed, JobError> {
        let now = self.engine.dialect().now;
        let find = format!(
            "SELECT id, version, input, result, report FROM (
                SELECT jobs.*, sum(bytes) OVER (ORDER BY finished_at DESC, number DESC) AS kept FROM jobs
                WHERE {FINISHED} AND expired_at IS NULL) finished
             WHERE finished_at <= {now} - $2 OR kept > $3 - (
                SELECT coalesce(sum(bytes), 0) FROM jobs WHERE state IN ('waiting', 'running'))
             ORDER BY finished_at, number LIMIT $4"
        );
        let args = args![self.now(), retention.files_ms, retention.bytes, BATCH];
        let change = format!(
            "UPDATE jobs SET input = NULL, result = NULL, report = NULL, bytes = 0, expired_at = {now}, changed_at = {now},
                version = version + 1
             WHERE id = $2 AND version = $3 RETURNING id"
        );
        self.free(&find, args, &change).await
    }

    /// Deletes the rows of finished jobs that are too old or too many for [`Retention`], the oldest first.
    pub async fn forget(&self, retention: &Retention) -> Result<Freed, JobError> {
        let now = self.engine.dialect().now;
        let find = format!(
            "SELECT id, version, input, result, report FROM (
                SELECT jobs.*, count(*) OVER (ORDER BY finished_at DESC, number DESC) AS place FROM jobs
                WHERE {FINISHED}) finished
             WHERE finished_at <= {now} - $2 OR place > $3
             ORDER BY finished_at, number LIMIT $4"
        );
        let args = args![self.now(), retention.rows_ms, retention.jobs, BATCH];
        let change = "DELETE FROM jobs WHERE id = $2 AND version = $3 RETURNING id";
        self.free(&find, args, change).await
    }

    /// Makes a change (`$1` the time, `$2` the job, `$3` its version) to each of the jobs found. One that has changed since then, because a client
    /// has just retried or deleted it, is left to the next call.
    async fn free(&self, find: &str, args: Vec<Value>, change: &str) -> Result<Freed, JobError> {
        let found = self.engine.read(find, args).await?;
        let mut freed = Freed {
            is_more: found.len() as i64 == BATCH,
            ..Freed::default()
        };
        for row in found {
            let args = args![
                self.now(),
                row.some("id", Row::id)?,
                row.some("version", Row::int)?,
            ];
            let changed = self
                .engine
                .write(Urgency::EvenWhenFull, change, args)
                .await?;
            if changed.is_empty() {
                continue;
            }
            freed.jobs += 1;
            for column in ["input", "result", "report"] {
                if let Some(name) = row.text(column)? {
                    freed.blobs.push(BlobName::parse(&name)?);
                }
            }
        }
        Ok(freed)
    }

    /// Those of the files that a row names.
    pub async fn named_blobs(&self, blobs: &[BlobName]) -> Result<BTreeSet<BlobName>, JobError> {
        if blobs.is_empty() {
            return Ok(BTreeSet::new());
        }
        let places: Vec<_> = (1..=blobs.len()).map(|place| format!("${place}")).collect();
        let sql = format!(
            "SELECT input, result, report FROM jobs WHERE id IN ({})",
            places.join(", ")
        );
        let args = blobs.iter().map(|blob| blob.job().into()).collect();
        let mut named = BTreeSet::new();
        for row in self.engine.read(&sql, args).await? {
            for column in ["input", "result", "report"] {
                if let Some(name) = row.text(column)? {
                    named.insert(BlobName::parse(&name)?);
                }
            }
        }
        Ok(named)
    }
}
