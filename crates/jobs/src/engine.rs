//! The seam between the store's statements, which are written once, and the two databases that run them.
//!
//! A statement is one transaction: every change that the store makes is a single statement, so nothing is held open between two of them, and
//! the work on a job lies in no transaction at all.

mod candidates;
pub(crate) mod postgres;
mod schema;
pub(crate) mod sqlite;
mod value;

use super::error::JobError;
use postgres::Postgres;
use sqlite::Sqlite;
pub(crate) use value::{Row, Value, args};

/// One of the two databases.
#[derive(Debug)]
pub(crate) enum Engine {
    /// In the process; one process at a time.
    Sqlite(Sqlite),
    /// A server that many machines share.
    Postgres(Postgres),
}

/// Where the statements of the two databases differ.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dialect {
    /// The time, given that `$1` is the injected clock's time or NULL.
    pub now: &'static str,
    /// What makes two claims at once take two rows.
    pub skip_locked: &'static str,
    /// Whose turn it is; see [`candidates`].
    pub candidates: &'static str,
}

/// Whether a change is worth the space that is held back for a full disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Urgency {
    /// It brings more to store.
    Ordinary,
    /// It ends something, or frees space.
    EvenWhenFull,
}

impl Engine {
    pub(crate) fn dialect(&self) -> Dialect {
        match self {
            Self::Sqlite(_) => Dialect {
                now: "$1",
                skip_locked: "",
                candidates: candidates::SQLITE,
            },
            Self::Postgres(_) => Dialect {
                now: "coalesce($1, darn_now())",
                skip_locked: "FOR UPDATE SKIP LOCKED",
                candidates: candidates::POSTGRES,
            },
        }
    }

    /// The rows of a statement that changes nothing.
    pub(crate) async fn read(&self, sql: &str, args: Vec<Value>) -> Result<Vec<Row>, JobError> {
        match self {
            Self::Sqlite(engine) => engine.read(sql, args).await,
            Self::Postgres(engine) => engine.run(sql, args).await,
        }
    }

    /// Makes a change; when this returns, it is on disk. Answers with what the statement's RETURNING names.
    pub(crate) async fn write(
        &self,
        urgency: Urgency,
        sql: &str,
        args: Vec<Value>,
    ) -> Result<Vec<Row>, JobError> {
        match (self, urgency) {
            (Self::Sqlite(engine), Urgency::Ordinary) => engine.write(sql, args).await,
            (Self::Sqlite(engine), Urgency::EvenWhenFull) => {
                engine.write_even_when_full(sql, args).await
            }
            (Self::Postgres(engine), _) => engine.run(sql, args).await,
        }
    }

    /// Whether there is room for more than the changes that must always be possible. Of a server's disk nothing is known beforehand.
    pub(crate) async fn has_room(&self) -> bool {
        match self {
            Self::Sqlite(engine) => engine.has_room().await,
            Self::Postgres(_) => true,
        }
    }

    /// Closes its connections.
    pub(crate) async fn close(&self) {
        match self {
            Self::Sqlite(engine) => engine.close().await,
            Self::Postgres(engine) => engine.close().await,
        }
    }
}
