//! PostgreSQL 15 or newer: a database that many machines share.

use std::time::Duration;

use sqlx::{
    PgPool,
    postgres::{PgPoolOptions, PgRow},
};
use tokio::time::timeout;

use super::{
    Row, Value, schema,
    value::{bound, decoded},
};
use crate::error::JobError;

/// Connections of a process. Statements are short; a thousand processes hold eight thousand, for which PostgreSQL needs a pooler in front.
const CONNECTIONS: u32 = 8;

/// How long an answer is waited for. After that the server, or the way to it, is gone; the system may take a quarter of an hour to say so.
const PATIENCE: Duration = Duration::from_secs(20);

/// The oldest version that is tested, as PostgreSQL numbers it.
const OLDEST: i32 = 150_000;

/// A pool of connections to the server.
#[derive(Debug)]
pub(crate) struct Postgres {
    pool: PgPool,
}

impl Postgres {
    /// Connects to the server at the URL and prepares its tables.
    pub(crate) async fn open(url: &str) -> Result<Self, JobError> {
        let pool = PgPoolOptions::new()
            .max_connections(CONNECTIONS)
            .connect(url)
            .await?;
        let (number, found): (i32, String) = sqlx::query_as(
            "SELECT current_setting('server_version_num')::int, current_setting('server_version')",
        )
        .fetch_one(&pool)
        .await?;
        if number < OLDEST {
            return Err(JobError::DatabaseTooOld { found });
        }
        schema::prepare_postgres(&pool).await?;
        Ok(Self { pool })
    }

    pub(crate) async fn run(&self, sql: &str, args: Vec<Value>) -> Result<Vec<Row>, JobError> {
        let answer = timeout(PATIENCE, bound!(sql, args).fetch_all(&self.pool)).await;
        let rows = answer.map_err(|late| sqlx::Error::Io(late.into()))??;
        rows.iter().map(decode).collect()
    }

    pub(crate) fn pool(&self) -> &PgPool {
        &self.pool
    }

    pub(crate) async fn close(&self) {
        self.pool.close().await;
    }
}

fn decode(row: &PgRow) -> Result<Row, JobError> {
    decoded!(row, int: "INT8", text: "TEXT", id: "UUID")
}
