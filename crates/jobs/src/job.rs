//! What the store keeps of a job, and what callers give it. Every time is in milliseconds since 1970-01-01 UTC.

use std::{fmt, str::FromStr};

use uuid::Uuid;

use super::blobs::BlobName;

/// Attempts that may crash before a job is given up.
pub const MAX_ATTEMPTS: i64 = 3;

/// The code of a job that is given up because [`MAX_ATTEMPTS`] of its attempts crashed.
pub const CRASHED: &str = "job_crashed_worker";

/// Where a job is in its life.
///
/// There is no state for a job whose input is still being received: the input is on disk before the job's row is written, so a job is
/// [`State::Waiting`] from its first moment, and a creation that breaks off leaves at most a file, which is swept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum State {
    /// It waits for a worker.
    Waiting,
    /// A worker has claimed it.
    Running,
    /// It has a result.
    Done,
    /// It has failed.
    Error,
    /// It was cancelled before it had a result.
    Cancelled,
}

impl State {
    /// All states, in the order of a job's life.
    pub const ALL: [Self; 5] = [
        Self::Waiting,
        Self::Running,
        Self::Done,
        Self::Error,
        Self::Cancelled,
    ];

    /// Its word, in the store and for clients.
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Done => "done",
            Self::Error => "error",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether no worker will touch the job again, unless it is retried.
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Done | Self::Error | Self::Cancelled)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A word that is no state.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no state of a job; the states are waiting, running, done, error and cancelled")]
pub struct UnknownState(String);

impl FromStr for State {
    type Err = UnknownState;

    fn from_str(word: &str) -> Result<Self, UnknownState> {
        (Self::ALL.into_iter())
            .find(|state| state.word() == word)
            .ok_or_else(|| UnknownState(word.to_owned()))
    }
}

/// A job as its row shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Job {
    /// Its name in every call.
    pub id: Uuid,
    /// Its place in the order of creation.
    pub number: i64,
    /// Whose it is. Whoever serves clients compares this and hides the jobs of others.
    pub client: String,
    /// The client's name for it.
    pub name: Option<String>,
    /// Higher ones start first among the jobs of a client.
    pub priority: i64,
    /// Where the client wants to be told of its end; opaque here.
    pub webhook: Option<String>,
    /// Where its submission stands in a trace; opaque here.
    pub trace: Option<String>,
    /// What was asked, as JSON; opaque here.
    pub request: String,
    /// Where it is in its life.
    pub state: State,
    /// Starts at 1, and is one more after every change of what is shown here. Renewing a lease shows nothing and counts nothing.
    pub version: i64,
    /// Attempts so far, the present one included; those that were given back do not count.
    pub attempt: i64,
    /// Whether a running job is to stop.
    pub cancel_wanted: bool,
    /// The worker that runs it or ran it last.
    pub worker: Option<String>,
    /// How far the present attempt is.
    pub progress: Option<Progress>,
    /// When it was created.
    pub created_at: i64,
    /// When its row last changed.
    pub changed_at: i64,
    /// When its last attempt began.
    pub started_at: Option<i64>,
    /// When it became done, error or cancelled.
    pub finished_at: Option<i64>,
    /// When its files were deleted because of their age or the space they took.
    pub expired_at: Option<i64>,
    /// Its input, until it is done or expires.
    pub input: Option<BlobName>,
    /// Its result, while it is done and has not expired.
    pub result: Option<BlobName>,
    /// Its report; there whenever the result is.
    pub report: Option<BlobName>,
    /// Bytes of its files.
    pub bytes: i64,
    /// What goes with the result or the failure, as JSON; opaque here.
    pub answer: Option<String>,
    /// Why it failed.
    pub failure: Option<Failure>,
}

impl Job {
    /// Its files.
    pub fn blobs(&self) -> impl Iterator<Item = &BlobName> {
        [&self.input, &self.result, &self.report]
            .into_iter()
            .flatten()
    }
}

/// How far an attempt is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Progress {
    /// The stage that runs.
    pub stage: String,
    /// Holes that are finished.
    pub hole: i64,
    /// Holes in all.
    pub holes: i64,
}

/// Why a job failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// A stable word for programs.
    pub code: String,
    /// What happened, for people.
    pub message: String,
}

/// A job to be created. Its input is on disk already.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewJob {
    /// Its id; fresh.
    pub id: Uuid,
    /// What the client asks for.
    pub submission: Submission,
    /// Digest of all that the client sent. A repeated key with another digest is refused.
    pub digest: String,
    /// Its input.
    pub input: BlobName,
    /// Bytes of its input.
    pub bytes: i64,
}

/// What a client asks for, apart from the input.
///
/// PostgreSQL takes no text with a NUL character, and its indexes no client and key of more than about 2,000 bytes together: the caller checks
/// what clients send.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Submission {
    /// Whose job it is.
    pub client: String,
    /// The client's key: a repeated submission with it is answered with the first one's job, as long as that is remembered.
    pub idempotency_key: Option<String>,
    /// The client's name for it.
    pub name: Option<String>,
    /// Higher ones start first among the jobs of a client.
    pub priority: i64,
    /// Where the client wants to be told of the job's end; opaque here.
    pub webhook: Option<String>,
    /// Where the submission stands in a trace; opaque here, and no part of the payload.
    pub trace: Option<String>,
    /// What is asked, as JSON; opaque here.
    pub request: String,
}

/// What became of a submission.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Submitted {
    /// A job was created.
    New(Job),
    /// The idempotency key is that of an earlier submission with the same payload, and this is its job.
    Repeated(Job),
}

impl Submitted {
    /// The job of either kind.
    pub fn into_job(self) -> Job {
        match self {
            Self::New(job) | Self::Repeated(job) => job,
        }
    }
}

/// Which jobs are listed: the newest first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListQuery {
    /// Only this client's; all clients' where it is left out.
    pub client: Option<String>,
    /// Only those in this state.
    pub state: Option<State>,
    /// Only those created before the job of this number ([`Page::next`]).
    pub before: Option<i64>,
    /// Most jobs of the page.
    pub limit: u32,
}

/// A page of a list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// The jobs, newest first.
    pub jobs: Vec<Job>,
    /// [`ListQuery::before`] of the next page; nothing at the end.
    pub next: Option<i64>,
}

/// One attempt at a job, in a worker's hands. Whoever holds the token may change the job's row; after the lease has run out and another
/// worker has claimed the job, the token is worth nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: Uuid,
    /// The token of this attempt alone.
    pub token: Uuid,
}

/// A worker that asks for a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claimant<'a> {
    /// Its name, for operators.
    pub worker: &'a str,
    /// Whether its process runs other jobs.
    pub company: Company,
    /// How many jobs of some clients may run.
    pub limits: Option<&'a RunningLimits>,
}

impl Claimant<'_> {
    /// Whether no more than the `running` jobs of a client may run.
    pub(crate) fn is_at_limit(&self, client: &str, running: i64) -> bool {
        let limit = self.limits.and_then(|limits| limits.get(client));
        limit.is_some_and(|most| running >= *most)
    }
}

/// Most jobs that may run at once of each of these clients, on all machines; of others, any number may.
pub type RunningLimits = std::collections::BTreeMap<String, i64>;

/// Whether the process of a worker runs other jobs.
///
/// A job that takes its process down takes those beside it down, too. So a job with a crashed attempt runs alone: jobs that were only
/// near the crash succeed then, and cannot be given up for another's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Company {
    /// It runs no other: any job may start.
    Alone,
    /// It runs others: only jobs without a crashed attempt may start. Where a job with one comes next, none starts, so that the process
    /// becomes free for it.
    Shared,
}

/// What a claim gave.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claimed {
    /// The job; it is running.
    pub job: Job,
    /// This attempt's right to change it.
    pub lease: Lease,
}

/// What a worker is told when it renews its lease or tells its progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Go on.
    Continue,
    /// The client wants the job cancelled: stop, and end the attempt by [`Outcome::Cancelled`].
    Cancel,
}

/// How an attempt ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// With a result. It stays even where the client wanted the job cancelled: the wish came too late.
    Done(Product),
    /// With a failure. The job is not tried again by itself.
    Failed {
        /// Why.
        failure: Failure,
        /// What goes with it, as JSON.
        answer: Option<String>,
    },
    /// Because the client wanted so.
    Cancelled,
    /// Without a fault of the job, as when the process shuts down: it waits again, in its old place, and the attempt does not count.
    GivenBack,
}

/// The files of a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Product {
    /// The result.
    pub result: BlobName,
    /// The report.
    pub report: BlobName,
    /// Bytes of both.
    pub bytes: i64,
    /// What goes with the result, as JSON.
    pub answer: String,
}

/// How many jobs of a client wait and run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClientCounts {
    /// Waiting ones.
    pub waiting: i64,
    /// Running ones.
    pub running: i64,
}

/// What is kept of finished jobs, and how long. The oldest go first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Retention {
    /// Milliseconds after which the files of a finished job are deleted.
    pub files_ms: i64,
    /// Milliseconds after which its row is deleted, too; until then its result is known to have expired.
    pub rows_ms: i64,
    /// Most bytes of the files of all jobs. Files of finished jobs are deleted until the rest fits; those of others stay.
    pub bytes: i64,
    /// Most finished jobs.
    pub jobs: i64,
}

impl Default for Retention {
    fn default() -> Self {
        const DAY_MS: i64 = 24 * 60 * 60 * 1000;
        Self {
            files_ms: DAY_MS,
            rows_ms: 7 * DAY_MS,
            bytes: 10 << 30,
            jobs: 100_000,
        }
    }
}
