//! Measures how long a claim takes when many jobs wait, and how many jobs a second go through, on SQLite and on PostgreSQL.
//!
//! `cargo run --release -p darn-jobs --example claims` prints two Markdown tables. PostgreSQL is started for it, with its durability as installed.

#[path = "../tests/laws/postgres.rs"]
mod postgres;

use std::{
    collections::VecDeque,
    error::Error,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use darn_jobs::{Claimant, Clock, Company, Failure, JobError, Outcome, Store};
use postgres::Server;

/// Claims that are measured in each row of the table.
const CLAIMS: usize = 300;

const LEASE: Duration = Duration::from_secs(30);

const CLAIMANT: Claimant<'static> = Claimant {
    worker: "worker",
    company: Company::Alone,
    limits: None,
};

fn failed() -> Outcome {
    Outcome::Failed {
        failure: Failure {
            code: "no_holes".to_owned(),
            message: "the scan has no holes".to_owned(),
        },
        answer: None,
    }
}

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
            let folder = tempfile::tempdir()?;
            let sqlite = measure(&sqlite(folder.path(), jobs, clients).await?).await?;
            let url = server.database().await;
            let postgres = measure(&postgres(&url, jobs, clients).await?).await?;
            println!("| {jobs} | {clients} | {sqlite} | {postgres} |");
        }
    }
    println!(
        "\n| workers | SQLite, one process: jobs/s | PostgreSQL, connections of their own: jobs/s |"
    );
    println!("|---|---|---|");
    for workers in [1, 2, 4, 8, 16] {
        let folder = tempfile::tempdir()?;
        let store = Arc::new(sqlite(folder.path(), 20_000, 50).await?);
        let sqlite = throughput(vec![store; workers]).await?;
        let url = server.database().await;
        let mut stores = vec![Arc::new(postgres(&url, 20_000, 50).await?)];
        while stores.len() < workers {
            stores.push(Arc::new(
                Store::postgres(&url, LEASE, Clock::OfStore).await?,
            ));
        }
        let postgres = throughput(stores).await?;
        println!("| {workers} | {sqlite:.0} | {postgres:.0} |");
    }
    Ok(())
}

/// A store with jobs that wait, in a folder.
async fn sqlite(folder: &Path, jobs: i64, clients: i64) -> Result<Store, Box<dyn Error>> {
    let store = Store::sqlite(folder, LEASE, Clock::OfStore).await?;
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(folder.join("jobs.sqlite"));
    let pool = sqlx::SqlitePool::connect_with(options).await?;
    sqlx::query(FILL_SQLITE)
        .bind(jobs)
        .bind(clients)
        .execute(&pool)
        .await?;
    pool.close().await;
    Ok(store)
}

/// A store with jobs that wait, on a server.
async fn postgres(url: &str, jobs: i64, clients: i64) -> Result<Store, Box<dyn Error>> {
    let store = Store::postgres(url, LEASE, Clock::OfStore).await?;
    let pool = sqlx::PgPool::connect(url).await?;
    sqlx::query(FILL_POSTGRES)
        .bind(jobs)
        .bind(clients)
        .execute(&pool)
        .await?;
    pool.close().await;
    Ok(store)
}

/// Jobs a second that as many workers as there are stores claim and end, without any work between.
async fn throughput(stores: Vec<Arc<Store>>) -> Result<f64, Box<dyn Error>> {
    const EACH: usize = 100;
    let start = Instant::now();
    let work = |store: Arc<Store>| async move {
        let mut ended = 0;
        for _ in 0..EACH {
            // Many claims at once can find all candidates taken for a moment.
            if let Some(claimed) = store.claim(&CLAIMANT).await? {
                store.end(claimed.lease, &failed()).await?;
                ended += 1;
            }
        }
        Ok::<_, JobError>(ended)
    };
    let tasks: Vec<_> = stores
        .into_iter()
        .map(|store| tokio::spawn(work(store)))
        .collect();
    let mut ended = 0;
    for task in tasks {
        ended += task.await??;
    }
    Ok(f64::from(ended) / start.elapsed().as_secs_f64())
}

/// Claims jobs and ends them, with eight running at any time.
async fn measure(store: &Store) -> Result<String, Box<dyn Error>> {
    let mut running = VecDeque::new();
    let (mut claims, mut ends) = (Vec::new(), Vec::new());
    for _ in 0..CLAIMS {
        let start = Instant::now();
        let claimed = store.claim(&CLAIMANT).await?.ok_or("no job waits")?;
        claims.push(start.elapsed());
        running.push_back(claimed.lease);
        if running.len() > 8
            && let Some(lease) = running.pop_front()
        {
            let start = Instant::now();
            store.end(lease, &failed()).await?;
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
