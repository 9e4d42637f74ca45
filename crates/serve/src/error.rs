//! Every error that a caller can receive, with its row in the contract's table of error codes.

use darn_contract::port::Refusal;
use darn_contract::{Code, FieldError, JsonError, Outcome, codes};
use darn_jobs::{JobError, State};
use tracing::{error, warn};
use uuid::Uuid;

use super::{
    ended_sessions::EndReason, key_file::Scope, quota::Exceeded, session_store::SessionError,
};

/// Why a request was not answered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// The request carries no scan.
    #[error(
        "the request carries no scan; send its bytes as the body, or as the part `scan` of multipart/form-data"
    )]
    EmptyBody,
    /// The request cannot be read.
    #[error("{0}")]
    Malformed(String),
    /// The body is not the one that its digest tells of.
    #[error(
        "the body's {algorithm} is :{found}:, and the header `{header}` says another; it was changed on its way"
    )]
    DigestMismatch {
        /// The header with the digest.
        header: axum::http::HeaderName,
        /// Its algorithm.
        algorithm: &'static str,
        /// The body's digest, in base64.
        found: String,
    },
    /// No such path.
    #[error("there is nothing at this path; /openapi.json lists what there is")]
    NotFound,
    /// The path has other methods.
    #[error("this path does not take this method; the header `allow` lists those it takes")]
    MethodNotAllowed,
    /// The request carries no key.
    #[error("this service takes a key: send the header `authorization: Bearer KEY`")]
    KeyMissing,
    /// The request's key is not known.
    #[error("this service does not know the key in the header `authorization`")]
    KeyUnknown,
    /// The request's key has expired.
    #[error("the key in the header `authorization` has expired")]
    KeyExpired,
    /// The request's key may not do this.
    #[error(
        "the key in the header `authorization` does not have the scope `{scope}`, which this takes"
    )]
    InsufficientScope {
        /// What it would have to have.
        scope: Scope,
    },
    /// The request's key has used up a quota.
    #[error(transparent)]
    Quota(Exceeded),
    /// The body came too slowly.
    #[error(
        "the body came too slowly: no pause may last longer than {seconds} s (DARN_BODY_TIMEOUT), and the whole no longer than {whole} s; over longer than a pause at least {rate} bytes a second must come (DARN_BODY_RATE)"
    )]
    BodyTimeout {
        /// Longest pause, in seconds.
        seconds: f64,
        /// Longest time for the whole body, in seconds.
        whole: f64,
        /// Fewest bytes a second.
        rate: usize,
    },
    /// The body is larger than the limit.
    #[error("the body is larger than {limit} bytes, the limit of this service (DARN_BODY_LIMIT)")]
    TooLarge {
        /// The limit, in bytes.
        limit: usize,
    },
    /// A message of a stream is larger than the limit.
    #[error(
        "a message of the stream is larger than {limit} bytes, the limit; send the scan in several"
    )]
    MessageTooLarge {
        /// The limit, in bytes.
        limit: usize,
    },
    /// The constraints or the query are larger than their own limit.
    #[error("the {kind} larger than {limit} bytes, the limit")]
    ParametersTooLarge {
        /// Which of the two.
        kind: ParameterKind,
        /// The limit, in bytes.
        limit: usize,
    },
    /// The request carries no query.
    #[error("the request carries no query; send it as {place}")]
    NoQuery {
        /// Where it is expected.
        place: &'static str,
    },
    /// The content type is not read here.
    #[error("content type {got} is not read here; send {send}")]
    UnsupportedMediaType {
        /// The one received.
        got: String,
        /// Those that are read.
        send: &'static str,
    },
    /// The body is compressed in a way that is not read.
    #[error("content encoding `{got}` is not read here; send gzip, deflate, or the body as it is")]
    ContentEncoding {
        /// The one received.
        got: String,
    },
    /// Constraints or a query that are invalid whatever the scan.
    #[error("the {kind} not valid; `errors` names every field")]
    Invalid {
        /// Which of the two.
        kind: ParameterKind,
        /// Every invalid field.
        fields: Vec<FieldError>,
    },
    /// The mender refused the scan or the constraints. Internal refusals become `Internal`.
    #[error("{}", .0.detail)]
    Refused(Refusal),
    /// The session does not exist or cannot be used.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The process has no workers.
    #[error(
        "this process has no workers (DARN_WORKERS=0): it takes scans to mend, as jobs, and answers for jobs alone; send this request to a process that has workers"
    )]
    NoWorkers,
    /// There are no jobs here.
    #[error(
        "this service keeps no jobs: it was started without `--data DIR` (DARN_DATA); POST /inpaint mends at once"
    )]
    JobsNotKept,
    /// There is no such job.
    #[error("there is no job of this id, or it is forgotten")]
    NoSuchJob,
    /// The job has no result yet.
    #[error("the job is {state} and has no result yet; /jobs/ID/events tells when it has")]
    JobUnfinished {
        /// Its state.
        state: State,
    },
    /// The job's state does not allow it.
    #[error("the job is {state} and cannot be {asked}")]
    JobWrongState {
        /// Its state.
        state: State,
        /// What was asked, such as "cancelled".
        asked: &'static str,
    },
    /// The job's files are deleted.
    #[error("the job's files were deleted, because of their age or the space they took")]
    JobExpired,
    /// The idempotency key was used for something else.
    #[error(
        "the header `idempotency-key` has a key that came before with another scan or other constraints, for job {job}"
    )]
    IdempotencyMismatch {
        /// The job of the first payload.
        job: Uuid,
    },
    /// A webhook is named, and nothing can sign it.
    #[error(
        "this service tells no webhooks: it has no secret to sign them with (DARN_WEBHOOK_SECRET, or `webhookSecrets` of a key)"
    )]
    WebhooksOff,
    /// The disk is full.
    #[error("the storage in which this service keeps jobs is full (DARN_DATA, DARN_BLOBS)")]
    StorageFull,
    /// The database or the files of the jobs are away.
    #[error(
        "the database, or the storage of files, in which this service keeps jobs cannot be reached; try again in {OUTAGE_WAIT} s, with the same `idempotency-key`"
    )]
    JobsUnavailable,
    /// Too many jobs wait.
    #[error(
        "{waiting} jobs wait and {running} run, which is all this service takes (DARN_QUEUE); try again in {retry_after} s"
    )]
    QueueFull {
        /// Jobs waiting.
        waiting: usize,
        /// Jobs running.
        running: usize,
        /// Estimated seconds until there is room.
        retry_after: u64,
    },
    /// Too many bodies are being received.
    #[error(
        "{limit} requests are being received, which is all this service receives at once (DARN_UPLOADS); try again in {retry_after} s"
    )]
    UploadsFull {
        /// Most bodies received at once.
        limit: usize,
        /// Suggested seconds to wait.
        retry_after: u64,
    },
    /// Too many bodies are being received from one client.
    #[error(
        "{held} requests are being received from this client, and one client may not take more than it leaves free (DARN_UPLOADS); try again in {retry_after} s"
    )]
    UploadShareFull {
        /// Bodies being received from this client.
        held: usize,
        /// Suggested seconds to wait.
        retry_after: u64,
    },
    /// Bodies, jobs and answers take all memory.
    #[error(
        "bodies, jobs and answers take the {} MiB of memory of this service (DARN_MEMORY); try again", .limit >> 20
    )]
    MemoryFull {
        /// Most bytes that they may take together.
        limit: usize,
    },
    /// The service shuts down.
    #[error("the service is shutting down")]
    Draining,
    /// The warm-up mend has not finished.
    #[error("the service is still warming up")]
    WarmingUp,
    /// Waiting and running took too long.
    #[error(
        "waiting and mending took longer than {seconds} s, the limit of this service (DARN_DEADLINE)"
    )]
    Deadline {
        /// The limit, in seconds.
        seconds: f64,
    },
    /// An error of the service itself; logged, not told.
    #[error("an error of the service itself; its log has it under this request id")]
    Internal,
}

/// The two kinds of request parameters; displayed as the beginning of a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// Constraints of a mend.
    Constraints,
    /// The query of an anchor search.
    Query,
}

impl std::fmt::Display for ParameterKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Constraints => "constraints are",
            Self::Query => "query is",
        })
    }
}

impl RequestError {
    /// The error of a text that is not the expected message.
    pub fn of_json(kind: ParameterKind, error: JsonError) -> Self {
        match error {
            JsonError::Syntax { detail } => {
                Self::Malformed(format!("the {kind} not JSON: {detail}"))
            }
            JsonError::Shape(field) => Self::Invalid {
                kind,
                fields: vec![field],
            },
        }
    }

    /// Its row in the table of error codes.
    pub fn code(&self) -> Code {
        match self {
            Self::EmptyBody => codes::EMPTY_BODY,
            Self::DigestMismatch { .. } => codes::DIGEST_MISMATCH,
            Self::Malformed(_) => codes::MALFORMED_REQUEST,
            Self::NotFound => codes::NOT_FOUND,
            Self::MethodNotAllowed => codes::METHOD_NOT_ALLOWED,
            Self::KeyMissing => codes::KEY_MISSING,
            Self::KeyUnknown => codes::KEY_UNKNOWN,
            Self::KeyExpired => codes::KEY_EXPIRED,
            Self::InsufficientScope { .. } => codes::INSUFFICIENT_SCOPE,
            Self::Quota(_) => codes::QUOTA_EXCEEDED,
            Self::BodyTimeout { .. } => codes::BODY_TIMEOUT,
            Self::TooLarge { .. } => codes::BODY_TOO_LARGE,
            Self::MessageTooLarge { .. } => codes::MESSAGE_TOO_LARGE,
            Self::ParametersTooLarge { kind, .. } => match kind {
                ParameterKind::Constraints => codes::CONSTRAINTS_TOO_LARGE,
                ParameterKind::Query => codes::QUERY_TOO_LARGE,
            },
            Self::NoQuery { .. } => codes::NO_QUERY,
            Self::ContentEncoding { .. } => codes::UNSUPPORTED_CONTENT_ENCODING,
            Self::UnsupportedMediaType { .. } => codes::UNSUPPORTED_MEDIA_TYPE,
            Self::Invalid { kind, .. } => match kind {
                ParameterKind::Constraints => codes::INVALID_CONSTRAINTS,
                ParameterKind::Query => codes::INVALID_QUERY,
            },
            Self::Refused(refusal) => refusal.code,
            Self::Session(error) => match error {
                SessionError::Unknown => codes::SESSION_NOT_FOUND,
                SessionError::Ended(EndReason::Idle) => codes::SESSION_EXPIRED,
                SessionError::Ended(EndReason::Evicted) => codes::SESSION_EVICTED,
                SessionError::Ended(EndReason::Deleted) => codes::SESSION_DELETED,
                SessionError::Lost => codes::SESSION_LOST,
                SessionError::Elsewhere(_) => codes::SESSION_ELSEWHERE,
                SessionError::Quota(_) => codes::QUOTA_EXCEEDED,
                SessionError::Busy { .. } => codes::SESSION_BUSY,
                SessionError::TooLarge { .. } => codes::SESSION_TOO_LARGE,
                SessionError::Full { .. } => codes::SESSIONS_FULL,
            },
            Self::JobsNotKept => codes::JOBS_NOT_KEPT,
            Self::NoSuchJob => codes::NO_SUCH_JOB,
            Self::JobUnfinished { .. } => codes::JOB_UNFINISHED,
            Self::JobWrongState { .. } => codes::JOB_WRONG_STATE,
            Self::JobExpired => codes::JOB_EXPIRED,
            Self::IdempotencyMismatch { .. } => codes::IDEMPOTENCY_MISMATCH,
            Self::WebhooksOff => codes::WEBHOOKS_OFF,
            Self::StorageFull => codes::STORAGE_FULL,
            Self::JobsUnavailable => codes::JOBS_UNAVAILABLE,
            Self::QueueFull { .. } => codes::QUEUE_FULL,
            Self::UploadsFull { .. } | Self::UploadShareFull { .. } => codes::UPLOADS_FULL,
            Self::MemoryFull { .. } => codes::MEMORY_FULL,
            Self::Draining => codes::DRAINING,
            Self::NoWorkers => codes::NO_WORKERS,
            Self::WarmingUp => codes::WARMING_UP,
            Self::Deadline { .. } => codes::DEADLINE_EXCEEDED,
            Self::Internal => codes::INTERNAL,
        }
    }

    /// The quota that left no room for the request.
    pub fn exceeded(&self) -> Option<&Exceeded> {
        match self {
            Self::Quota(exceeded) | Self::Session(SessionError::Quota(exceeded)) => Some(exceeded),
            _ => None,
        }
    }

    /// The fields of the constraints or the query at fault.
    pub fn fields(&self) -> &[FieldError] {
        match self {
            Self::Invalid { fields, .. } => fields,
            Self::Refused(refusal) => &refusal.fields,
            _ => &[],
        }
    }

    /// How the mend went, where it came as far as the scan's holes.
    pub fn outcome(&self) -> Option<Outcome> {
        match self {
            Self::Refused(refusal) => refusal.outcome,
            _ => None,
        }
    }

    /// After how many seconds the caller should try again; `None` when that would not help.
    pub fn retry_after(&self) -> Option<u64> {
        match self {
            Self::QueueFull { retry_after, .. }
            | Self::UploadsFull { retry_after, .. }
            | Self::UploadShareFull { retry_after, .. } => Some(*retry_after),
            Self::Quota(exceeded) | Self::Session(SessionError::Quota(exceeded)) => {
                exceeded.retry_after
            }
            Self::Draining
            | Self::WarmingUp
            | Self::MemoryFull { .. }
            | Self::Session(SessionError::Full { .. }) => Some(5),
            Self::Refused(refusal) if refusal.code == codes::MEMORY_FULL => Some(5),
            Self::JobsUnavailable => Some(OUTAGE_WAIT),
            Self::Session(SessionError::Busy { .. }) => Some(1),
            _ => None,
        }
    }
}

impl From<JobError> for RequestError {
    fn from(error: JobError) -> Self {
        match error {
            JobError::NoSuchJob(_) => Self::NoSuchJob,
            JobError::WrongState {
                state, asked: READ, ..
            } if !state.is_finished() => Self::JobUnfinished { state },
            JobError::WrongState { state, asked, .. } => Self::JobWrongState { state, asked },
            JobError::Expired(_) => Self::JobExpired,
            JobError::IdempotencyMismatch { job } => Self::IdempotencyMismatch { job },
            JobError::StorageFull => Self::StorageFull,
            error if error.is_outage() => {
                warn!(?error, "the jobs cannot be reached");
                Self::JobsUnavailable
            }
            error => {
                error!(?error, "the jobs failed");
                Self::Internal
            }
        }
    }
}

/// Suggested seconds to wait for a database or a storage that is away.
const OUTAGE_WAIT: u64 = 10;

/// What [`JobError::WrongState`] says was asked when a file of a job was to be read.
const READ: &str = "read";
