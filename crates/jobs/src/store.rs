//! The rows of the jobs: one set of statements over both databases.
//!
//! Every change is one statement that names the state it expects, so two processes that change a job at the same time cannot both succeed.
//! What a worker changes is fenced by its [`Lease`]. The files of the jobs are not touched here: a caller writes a file before the
//! row that names it, and deletes it after the row that names it no more.

mod attempts;
mod instances;
mod outbox;
mod requests;
mod retention;

use std::{
    collections::BTreeMap,
    fmt,
    path::Path,
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use tokio::sync::{Mutex, Notify};
use uuid::Uuid;

use super::{
    blobs::BlobName,
    engine::{Engine, Row, Urgency, args, postgres::Postgres, sqlite::Sqlite},
    error::JobError,
    hints::Hints,
    job::{
        ClientCounts, Failure, Job, ListQuery, NewJob, Page, Progress, State, Submission, Submitted,
    },
};
pub(crate) use retention::Chore;
pub use retention::{ExpiredLeases, Freed};

#[cfg(doc)]
use super::job::Lease;

/// The condition of the indexes of finished jobs, in the words in which they have it.
const FINISHED: &str = "state IN ('done', 'error', 'cancelled')";

/// Where the times in rows come from.
#[derive(Clone, Default)]
pub enum Clock {
    /// For PostgreSQL the server, because the clocks of machines differ; for SQLite the system.
    #[default]
    OfStore,
    /// A function that answers with milliseconds since 1970; for tests.
    Injected(Arc<dyn Fn() -> i64 + Send + Sync>),
}

impl fmt::Debug for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OfStore => "OfStore",
            Self::Injected(_) => "Injected",
        })
    }
}

/// A job that was made with an idempotency key.
#[derive(Debug)]
pub(crate) struct Keyed {
    job: Job,
    /// Digest of the payload that made it.
    digest: String,
}

impl Keyed {
    /// The job, if a payload of this digest made it.
    ///
    /// # Errors
    /// [`JobError::IdempotencyMismatch`].
    pub(crate) fn of(self, digest: &str) -> Result<Job, JobError> {
        if self.digest == digest {
            Ok(self.job)
        } else {
            Err(JobError::IdempotencyMismatch { job: self.job.id })
        }
    }
}

/// All jobs.
#[derive(Debug)]
pub struct Store {
    engine: Engine,
    clock: Clock,
    lease_ms: i64,
    /// One claim of this process at a time, so that each sees what those before it took.
    claims: Mutex<()>,
}

impl Store {
    /// The store in a data folder, in SQLite. One process at a time may have it open; the caller sees to that.
    pub async fn sqlite(folder: &Path, lease: Duration, clock: Clock) -> Result<Self, JobError> {
        let engine = Engine::Sqlite(Sqlite::open(folder).await?);
        Ok(Self::new(engine, lease, clock))
    }

    /// The store on a PostgreSQL server, 15 or newer: `postgres://user:password@host/database`.
    pub async fn postgres(url: &str, lease: Duration, clock: Clock) -> Result<Self, JobError> {
        let engine = Engine::Postgres(Postgres::open(url).await?);
        Ok(Self::new(engine, lease, clock))
    }

    fn new(engine: Engine, lease: Duration, clock: Clock) -> Self {
        Self {
            engine,
            clock,
            lease_ms: milliseconds(lease),
            claims: Mutex::new(()),
        }
    }

    /// Listens for jobs that other processes make wait, where there are others.
    pub(crate) async fn start_hints(&self, waiting: &Arc<Notify>) -> Option<Hints> {
        match &self.engine {
            Engine::Sqlite(_) => None,
            Engine::Postgres(postgres) => Some(Hints::start(postgres.pool(), waiting).await),
        }
    }

    /// Closes the connections, after the statements that run.
    pub async fn close(&self) {
        self.engine.close().await;
    }

    /// Fails where the disk has room only for ends, cancellations and deletions: no more files may be written then.
    ///
    /// # Errors
    /// [`JobError::StorageFull`].
    pub async fn check_room(&self) -> Result<(), JobError> {
        match self.engine.has_room().await {
            true => Ok(()),
            false => Err(JobError::StorageFull),
        }
    }

    /// Writes the row of a new job, which waits from then on, or finds the job of an earlier submission with the same idempotency key.
    ///
    /// # Errors
    /// [`JobError::IdempotencyMismatch`] where the key is that of another payload.
    pub async fn create(&self, new: &NewJob) -> Result<Submitted, JobError> {
        let NewJob {
            id,
            submission,
            digest,
            input,
            bytes,
        } = new;
        let Submission {
            client,
            idempotency_key,
            name,
            priority,
            webhook,
            trace,
            request,
        } = submission;
        let now = self.engine.dialect().now;
        let insert = format!(
            "INSERT INTO jobs (id, client, idempotency_key, digest, name, priority, webhook, request, input, bytes, trace,
                state, version, attempt, created_at, changed_at)
             VALUES ($2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, 'waiting', 1, 0, {now}, {now})
             ON CONFLICT (client, idempotency_key) WHERE idempotency_key IS NOT NULL DO NOTHING
             RETURNING *"
        );
        loop {
            let args = args![
                self.now(),
                *id,
                client.as_str(),
                idempotency_key.clone(),
                digest.as_str(),
                name.clone(),
                *priority,
                webhook.clone(),
                request.as_str(),
                input.as_str(),
                *bytes,
                trace.clone(),
            ];
            if let Some(row) = first(self.engine.write(Urgency::Ordinary, &insert, args).await?) {
                return Ok(Submitted::New(job(&row)?));
            }
            let key = idempotency_key.as_deref().unwrap_or_default();
            if let Some(first) = self.keyed(client, key).await? {
                return first.of(digest).map(Submitted::Repeated);
            }
            // The earlier job was deleted between the two statements: the key is free again.
        }
    }

    /// The job of a client's idempotency key.
    pub(crate) async fn keyed(&self, client: &str, key: &str) -> Result<Option<Keyed>, JobError> {
        let find = "SELECT * FROM jobs WHERE client = $1 AND idempotency_key = $2";
        let Some(row) = first(self.engine.read(find, args![client, key]).await?) else {
            return Ok(None);
        };
        Ok(Some(Keyed {
            job: job(&row)?,
            digest: row.some("digest", Row::text)?,
        }))
    }

    /// A job.
    pub async fn get(&self, id: Uuid) -> Result<Job, JobError> {
        let rows = self
            .engine
            .read("SELECT * FROM jobs WHERE id = $1", args![id]);
        only_job(rows.await?)?.ok_or(JobError::NoSuchJob(id))
    }

    /// A page of jobs, the newest first.
    ///
    /// On PostgreSQL a job can be written a moment after one with a higher number; a list that is read meanwhile lacks it, the next one has it.
    pub async fn list(&self, query: &ListQuery) -> Result<Page, JobError> {
        let limit = i64::from(query.limit);
        let mut args = args![limit.saturating_add(1)];
        let mut conditions = Vec::new();
        if let Some(client) = &query.client {
            args.push(client.as_str().into());
            conditions.push(format!("client = ${}", args.len()));
        }
        if let Some(before) = query.before {
            args.push(before.into());
            conditions.push(format!("number < ${}", args.len()));
        }
        if let Some(state) = query.state {
            // A word in the statement, not an argument: partial indexes are chosen by it.
            conditions.push(format!("state = '{state}'"));
            if state.is_finished() {
                conditions.push(FINISHED.to_owned());
            }
        }
        let conditions = match conditions.is_empty() {
            true => String::new(),
            false => format!("WHERE {}", conditions.join(" AND ")),
        };
        let sql = format!("SELECT * FROM jobs {conditions} ORDER BY number DESC LIMIT $1");
        let rows = self.engine.read(&sql, args).await?;
        let mut jobs = rows.iter().map(job).collect::<Result<Vec<_>, _>>()?;
        let is_more = jobs.len() > query.limit as usize;
        jobs.truncate(query.limit as usize);
        let next = jobs.last().map(|job| job.number).filter(|_| is_more);
        Ok(Page { jobs, next })
    }

    /// How many jobs are in each state; every state is listed.
    pub async fn counts(&self) -> Result<BTreeMap<State, i64>, JobError> {
        // Each part is answered by a partial index alone.
        let sql = format!(
            "SELECT 'waiting' AS state, count(*) AS jobs FROM jobs WHERE state = 'waiting'
             UNION ALL SELECT 'running', count(*) FROM jobs WHERE state = 'running'
             UNION ALL SELECT state, count(*) FROM jobs WHERE {FINISHED} GROUP BY state"
        );
        let mut counts: BTreeMap<_, _> = State::ALL.map(|state| (state, 0)).into();
        for row in self.engine.read(&sql, args![]).await? {
            counts.insert(state(&row)?, row.some("jobs", Row::int)?);
        }
        Ok(counts)
    }

    /// How many jobs of a client wait and run.
    pub async fn client_counts(&self, client: &str) -> Result<ClientCounts, JobError> {
        let sql = "SELECT
            (SELECT count(*) FROM jobs WHERE client = $1 AND state = 'waiting') AS waiting,
            (SELECT count(*) FROM jobs WHERE client = $1 AND state = 'running') AS running";
        let rows = self.engine.read(sql, args![client]).await?;
        let count = |name| match rows.first() {
            Some(row) => row.some(name, Row::int),
            None => Ok(0),
        };
        Ok(ClientCounts {
            waiting: count("waiting")?,
            running: count("running")?,
        })
    }

    /// The time for `$1`; nothing where the database's own counts.
    fn now(&self) -> Option<i64> {
        match (&self.clock, &self.engine) {
            (Clock::Injected(clock), _) => Some(clock()),
            (Clock::OfStore, Engine::Postgres(_)) => None,
            (Clock::OfStore, Engine::Sqlite(_)) => {
                let since = SystemTime::now().duration_since(UNIX_EPOCH);
                Some(since.map_or(0, |since| since.as_millis() as i64))
            }
        }
    }
}

/// Milliseconds of a time, at most a thousand years, which can be added to any time of a row.
fn milliseconds(time: Duration) -> i64 {
    const MOST: i64 = 1000 * 366 * 24 * 60 * 60 * 1000;
    i64::try_from(time.as_millis()).unwrap_or(MOST).min(MOST)
}

fn first(rows: Vec<Row>) -> Option<Row> {
    rows.into_iter().next()
}

fn only_job(rows: Vec<Row>) -> Result<Option<Job>, JobError> {
    rows.first().map(job).transpose()
}

fn state(row: &Row) -> Result<State, JobError> {
    let word = row.some("state", Row::text)?;
    word.parse()
        .map_err(|_| JobError::UnexpectedValue("state".to_owned()))
}

/// The job of a row with all columns.
fn job(row: &Row) -> Result<Job, JobError> {
    let blob = |name| {
        row.text(name)?
            .map(|text| BlobName::parse(&text))
            .transpose()
    };
    let progress = match row.text("stage")? {
        Some(stage) => Some(Progress {
            stage,
            hole: row.some("hole", Row::int)?,
            holes: row.some("holes", Row::int)?,
        }),
        None => None,
    };
    let failure = match row.text("failure_code")? {
        Some(code) => Some(Failure {
            code,
            message: row.some("failure_message", Row::text)?,
        }),
        None => None,
    };
    Ok(Job {
        id: row.some("id", Row::id)?,
        number: row.some("number", Row::int)?,
        client: row.some("client", Row::text)?,
        name: row.text("name")?,
        priority: row.some("priority", Row::int)?,
        webhook: row.text("webhook")?,
        trace: row.text("trace")?,
        request: row.some("request", Row::text)?,
        state: state(row)?,
        version: row.some("version", Row::int)?,
        attempt: row.some("attempt", Row::int)?,
        cancel_wanted: row.some("cancel_wanted", Row::int)? != 0,
        worker: row.text("worker")?,
        progress,
        created_at: row.some("created_at", Row::int)?,
        changed_at: row.some("changed_at", Row::int)?,
        started_at: row.int("started_at")?,
        finished_at: row.int("finished_at")?,
        expired_at: row.int("expired_at")?,
        input: blob("input")?,
        result: blob("result")?,
        report: blob("report")?,
        bytes: row.some("bytes", Row::int)?,
        answer: row.text("answer")?,
        failure,
    })
}
