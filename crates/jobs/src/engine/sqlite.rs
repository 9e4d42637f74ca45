//! SQLite: a file in the data folder, for one process.
//!
//! One connection writes, so that writers wait in a queue instead of failing as busy; others read beside it (write-ahead log). A change is a
//! single statement that begins as a write, which is what BEGIN IMMEDIATE around it would give. It is on disk before it is acknowledged
//! (`synchronous = FULL`).

use std::path::Path;

use sqlx::{
    SqlitePool,
    sqlite::{
        SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteRow, SqliteSynchronous,
    },
};

use super::{
    Row, Value, schema,
    value::{bound, decoded},
};
use crate::{error::JobError, reserve::Reserve};

/// Connections that read.
const READERS: u32 = 4;

/// The database of a data folder.
#[derive(Debug)]
pub(crate) struct Sqlite {
    writer: SqlitePool,
    readers: SqlitePool,
    reserve: Reserve,
}

impl Sqlite {
    /// Opens or makes the database in a folder.
    pub(crate) async fn open(folder: &Path) -> Result<Self, JobError> {
        let options = SqliteConnectOptions::new()
            .filename(folder.join("jobs.sqlite"))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full);
        let writer = pool(1).connect_with(options.clone()).await?;
        schema::prepare_sqlite(&writer).await?;
        let readers = pool(READERS)
            .connect_with(options.pragma("query_only", "ON"))
            .await?;
        Ok(Self {
            writer,
            readers,
            reserve: Reserve::open(folder).await,
        })
    }

    pub(crate) async fn read(&self, sql: &str, args: Vec<Value>) -> Result<Vec<Row>, JobError> {
        run(&self.readers, sql, args).await
    }

    pub(crate) async fn write(&self, sql: &str, args: Vec<Value>) -> Result<Vec<Row>, JobError> {
        run(&self.writer, sql, args).await
    }

    /// Like [`Self::write`]; where the disk is full, the reserve is given up for it.
    pub(crate) async fn write_even_when_full(
        &self,
        sql: &str,
        args: Vec<Value>,
    ) -> Result<Vec<Row>, JobError> {
        match self.write(sql, args.clone()).await {
            Err(JobError::StorageFull) => {
                self.reserve.release().await;
                self.write(sql, args).await
            }
            written => written,
        }
    }

    /// Whether there is room for more than the changes that must always be possible.
    pub(crate) async fn has_room(&self) -> bool {
        self.reserve.is_held().await
    }

    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}

/// Connections that stay open: a file does not go away, and opening it again would need space on a full disk.
fn pool(connections: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new()
        .max_connections(connections)
        .test_before_acquire(false)
        .idle_timeout(None)
        .max_lifetime(None)
}

/// All rows are fetched even where one is expected: a statement is committed when it has run to its end.
async fn run(pool: &SqlitePool, sql: &str, args: Vec<Value>) -> Result<Vec<Row>, JobError> {
    let rows = bound!(sql, args).fetch_all(pool).await?;
    rows.iter().map(decode).collect()
}

fn decode(row: &SqliteRow) -> Result<Row, JobError> {
    decoded!(row, int: "INTEGER", text: "TEXT", id: "BLOB")
}
