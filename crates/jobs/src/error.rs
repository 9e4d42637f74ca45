//! Every way in which a call to the jobs can fail.

use std::io;

use uuid::Uuid;

use super::{blobs::BlobName, job::State};

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// There is no such job, or it is forgotten.
    #[error("there is no job {0}")]
    NoSuchJob(Uuid),
    /// The idempotency key was used for another payload.
    #[error("the idempotency key was used with another payload, for job {job}")]
    IdempotencyMismatch {
        /// The job of the first payload.
        job: Uuid,
    },
    /// The job's state does not allow it.
    #[error("job {job} is {state} and cannot be {asked}")]
    WrongState {
        /// The job.
        job: Uuid,
        /// Its state.
        state: State,
        /// What was asked: "cancelled", "retried", "read".
        asked: &'static str,
    },
    /// The job's files were deleted because of their age or the space they took.
    #[error("the files of job {0} have expired")]
    Expired(Uuid),
    /// The attempt's lease ran out and was taken, or the job was deleted: the worker's work is void.
    #[error("the lease on job {0} is lost")]
    LeaseLost(Uuid),
    /// The disk of the database or of the files is full.
    #[error("the storage is full")]
    StorageFull,
    /// The stream that was to be stored failed, such as a body whose sender is gone; the error is the stream's own.
    #[error("what was to be stored could not be received")]
    Stream(#[source] io::Error),
    /// A file that a row names is not there.
    #[error("the file {0} is missing")]
    BlobMissing(BlobName),
    /// Another process uses the data folder.
    #[error("another process uses the data folder {0}")]
    FolderInUse(std::path::PathBuf),
    /// The database is too old.
    #[error("PostgreSQL {found} is too old; 15 or newer is needed")]
    DatabaseTooOld {
        /// Its version.
        found: String,
    },
    /// The database's tables could not be made or brought up to date.
    #[error("the database's tables cannot be prepared")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// The database failed. Where the connection broke, the change may have been made nevertheless.
    #[error("the database failed")]
    Database(#[source] sqlx::Error),
    /// A file could not be read or written.
    #[error("{doing}")]
    File {
        /// What was tried.
        doing: String,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// A row has a value that this program does not write.
    #[error("the database has an unexpected value in the column {0}")]
    UnexpectedValue(String),
}

impl JobError {
    /// Whether the database or the storage of the files cannot be reached, or takes no work now: the same call may do later.
    pub fn is_outage(&self) -> bool {
        match self {
            Self::Database(error) => is_database_away(error),
            Self::File { source, .. } => is_storage_away(source.kind()),
            _ => false,
        }
    }

    /// The error of a file operation.
    pub(crate) fn file(doing: impl FnOnce() -> String, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::StorageFull,
            _ => Self::File {
                doing: doing(),
                source,
            },
        }
    }
}

/// SQLite's result code for a full disk (<https://www.sqlite.org/rescode.html#full>).
const SQLITE_FULL: &str = "13";
/// The one where the index of its log cannot grow, `SQLITE_IOERR_SHMSIZE`.
const SQLITE_LOG_INDEX_FULL: &str = "4874";
/// PostgreSQL's code for a full disk (<https://www.postgresql.org/docs/15/errcodes-appendix.html>).
const POSTGRES_DISK_FULL: &str = "53100";

/// The classes and codes of a PostgreSQL that takes no work now: connections that fail, a shutdown or a start, too many connections, and a server
/// that only reads, as a standby does (<https://www.postgresql.org/docs/15/errcodes-appendix.html>).
const POSTGRES_AWAY: [&str; 4] = ["08", "57P0", "53300", "25006"];

fn is_database_away(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(_)
        | sqlx::Error::Tls(_)
        | sqlx::Error::Protocol(_)
        | sqlx::Error::PoolTimedOut
        | sqlx::Error::PoolClosed => true,
        sqlx::Error::Database(error) => error.code().is_some_and(|code| {
            // SQLite's codes are shorter numbers.
            code.len() == 5 && POSTGRES_AWAY.iter().any(|away| code.starts_with(away))
        }),
        _ => false,
    }
}

fn is_storage_away(kind: io::ErrorKind) -> bool {
    matches!(
        kind,
        io::ErrorKind::NotConnected
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::TimedOut
            | io::ErrorKind::HostUnreachable
            | io::ErrorKind::NetworkUnreachable
            | io::ErrorKind::NetworkDown
            | io::ErrorKind::StaleNetworkFileHandle
    )
}

impl From<sqlx::Error> for JobError {
    fn from(error: sqlx::Error) -> Self {
        let code = error.as_database_error().and_then(|error| error.code());
        match code.as_deref() {
            Some(SQLITE_FULL | SQLITE_LOG_INDEX_FULL | POSTGRES_DISK_FULL) => Self::StorageFull,
            _ => Self::Database(error),
        }
    }
}
