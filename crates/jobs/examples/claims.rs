//! Measures how long a claim takes when many jobs wait, on SQLite and on PostgreSQL.
//!
//! `cargo run --release -p darn-jobs --example claims` prints a Markdown table. PostgreSQL is started for it, with its durability as installed.

#[path = "../tests/laws/postgres.rs"]
mod postgres;

use std::{
    error::Error,
    time::{Duration, Instant},
};

use darn_jobs::{Claimant, Clock, Company, Failure, Outcome, Store};
use postgres::Server;

/// Claims that are measured in each row of the table.
const CLAIMS: usize = 300;

/// Makes `$1` waiting jobs of `$2` clients, in turn.
const FILL_SQLITE: &str = "
    WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < $1)
    INSERT INTO jobs (id, client, digest, priority, request, state, version, attempt, created_at, changed_at, bytes)
    SELECT randomblob(16), 'client ' || (n % $2), 'digest', 0, '{\"contentType\":\"model/gltf-binary\"}', 'waiting', 1, 0, 0, 0, 0 FROM numbers";
const FILL_POSTGRES: &str = "
    INSERT INTO jobs (id, client, digest, priority, request, state, version, attempt, created_at, changed_at, bytes)
    SELECT gen_random_uuid(), 'client ' || (n % $2), 'digest', 0, '{\"contentType\":\"model/gltf-binary\"}', 'waiting', 1, 0, 0, 0, 0
    FROM generate_series(1, $1) AS n";

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let server = Server::start(&[]);
    println!(
        "| waiting | clients | SQLite: claim median, p99 | end median | PostgreSQL: claim median, p99 | end median |"
    );
    println!("|---|---|---|---|---|---|");
    for jobs in [20_000, 100_000] {
        for clients in [1, 50, 1000] {
            let sqlite = on_sqlite(jobs, clients).await?;
            let postgres = on_postgres(server.database().await, jobs, clients).await?;
            println!("| {jobs} | {clients} | {sqlite} | {postgres} |");
        }
    }
    Ok(())
}

async fn on_sqlite(jobs: i64, clients: i64) -> Result<String, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let store = Store::sqlite(folder.path(), Duration::from_secs(30), Clock::OfStore).await?;
    let options =
        sqlx::sqlite::SqliteConnectOptions::new().filename(folder.path().join("jobs.sqlite"));
    let pool = sqlx::SqlitePool::connect_with(options).await?;
    sqlx::query(FILL_SQLITE)
        .bind(jobs)
        .bind(clients)
        .execute(&pool)
        .await?;
    pool.close().await;
    measure(&store).await
}

async fn on_postgres(url: String, jobs: i64, clients: i64) -> Result<String, Box<dyn Error>> {
    let store = Store::postgres(&url, Duration::from_secs(30), Clock::OfStore).await?;
    let pool = sqlx::PgPool::connect(&url).await?;
    sqlx::query(FILL_POSTGRES)
        .bind(jobs)
        .bind(clients)
        .execute(&pool)
        .await?;
    pool.close().await;
    measure(&store).await
}

/// Claims jobs and ends them, with eight running at any time.
async fn measure(store: &Store) -> Result<String, Box<dyn Error>> {
    let claimant = Claimant {
        worker: "worker",
        company: Company::Alone,
    };
    let outcome = Outcome::Failed {
        failure: Failure {
            code: "no_holes".to_owned(),
            message: "the scan has no holes".to_owned(),
        },
        answer: None,
    };
    let mut running = std::collections::VecDeque::new();
    let (mut claims, mut ends) = (Vec::new(), Vec::new());
    for _ in 0..CLAIMS {
        let start = Instant::now();
        let claimed = store.claim(&claimant).await?.ok_or("no job waits")?;
        claims.push(start.elapsed());
        running.push_back(claimed.lease);
        if running.len() > 8
            && let Some(lease) = running.pop_front()
        {
            let start = Instant::now();
            store.end(lease, &outcome).await?;
            ends.push(start.elapsed());
        }
    }
    claims.sort_unstable();
    ends.sort_unstable();
    let ms = |times: &[Duration], part: f64| {
        format!(
            "{:.1}",
            times[(times.len() as f64 * part) as usize].as_secs_f64() * 1e3
        )
    };
    store.close().await;
    Ok(format!(
        "{}, {} ms | {} ms",
        ms(&claims, 0.5),
        ms(&claims, 0.99),
        ms(&ends, 0.5)
    ))
}
