//! The steps that bring a database's tables up to date, built into the program. A step never changes once released: a change is a new step.

use std::{borrow::Cow, future::Future, pin::Pin};

use sqlx::{
    error::BoxDynError,
    migrate::{Migration, MigrationSource, MigrationType, Migrator},
};

use crate::error::JobError;

/// The steps of one database, oldest first.
#[derive(Debug)]
struct Steps(&'static [&'static str]);

/// The tables in SQLite.
const SQLITE: Steps = Steps(&[
    include_str!("../../migrations/sqlite/1.sql"),
    include_str!("../../migrations/sqlite/2.sql"),
    include_str!("../../migrations/sqlite/3.sql"),
]);
/// The tables in PostgreSQL.
const POSTGRES: Steps = Steps(&[
    include_str!("../../migrations/postgres/1.sql"),
    include_str!("../../migrations/postgres/2.sql"),
    include_str!("../../migrations/postgres/3.sql"),
]);

impl MigrationSource<'static> for Steps {
    fn resolve(
        self,
    ) -> Pin<Box<dyn Future<Output = Result<Vec<Migration>, BoxDynError>> + Send + 'static>> {
        let steps = (1..).zip(self.0).map(|(version, sql)| {
            Migration::new(
                version,
                Cow::Borrowed("jobs"),
                MigrationType::Simple,
                Cow::Borrowed(*sql),
                false,
            )
        });
        let steps = steps.collect();
        Box::pin(async { Ok(steps) })
    }
}

/// Brings SQLite's tables up to date.
pub(super) async fn prepare_sqlite(pool: &sqlx::SqlitePool) -> Result<(), JobError> {
    Ok(Migrator::new(SQLITE).await?.run(pool).await?)
}

/// Brings PostgreSQL's tables up to date; machines that start at the same time wait for each other.
pub(super) async fn prepare_postgres(pool: &sqlx::PgPool) -> Result<(), JobError> {
    Ok(Migrator::new(POSTGRES).await?.run(pool).await?)
}
