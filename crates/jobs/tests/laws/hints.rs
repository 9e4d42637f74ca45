//! Processes on one PostgreSQL tell each other that a job waits, and do without where they cannot.

use std::{sync::Arc, time::Duration};

use darn_jobs::{ClaimedJob, Jobs, Place};
use sqlx::{Connection, PgConnection, Row};
use tokio::{
    task::{JoinHandle, JoinSet},
    time::timeout,
};

use crate::bench::{Bench, Engine, PAST_LEASE, SOON, submit};

/// A bench whose workers look for jobs by themselves only after all tests have ended.
async fn without_polling() -> Bench {
    let mut bench = Bench::new(Engine::Postgres).await;
    bench.settings.poll = Duration::from_secs(3600);
    bench
}

fn url(bench: &Bench) -> &str {
    match &bench.place {
        Place::Shared { url, .. } => url,
        Place::Folder(_) => unreachable!("it is on PostgreSQL"),
    }
}

/// A worker of a process that has looked, found nothing, and waits.
async fn waiting(jobs: &Arc<Jobs>) -> JoinHandle<ClaimedJob> {
    let jobs = Arc::clone(jobs);
    let worker = tokio::spawn(async move { jobs.next_job("worker").await });
    tokio::time::sleep(Duration::from_millis(200)).await;
    worker
}

/// The job that the worker gets.
async fn claimed(worker: JoinHandle<ClaimedJob>) -> ClaimedJob {
    let claimed = timeout(SOON, worker).await;
    claimed.expect("it hears that a job waits").unwrap()
}

/// The server's processes of the connections that listen.
async fn listeners(admin: &mut PgConnection) -> Vec<i32> {
    let rows = sqlx::query(
        "SELECT pid FROM pg_stat_activity WHERE datname = current_database() AND application_name = 'darn, listening'",
    );
    let rows = rows.fetch_all(admin).await.unwrap();
    rows.iter().map(|row| row.get("pid")).collect()
}

async fn end(admin: &mut PgConnection, process: i32) {
    let ended = sqlx::query("SELECT pg_terminate_backend($1)").bind(process);
    ended.execute(admin).await.unwrap();
}

#[tokio::test]
async fn what_makes_a_job_wait_is_heard_by_another_process() {
    let bench = without_polling().await;
    let (here, there) = (bench.open().await, bench.open().await);

    let worker = waiting(&there).await;
    let id = submit(&here, "client").await.id;
    let submitted = claimed(worker).await;
    assert_eq!(submitted.job().id, id);

    // Given back, by a call and by a drop before it began.
    drop(submitted);
    let mut claimed_here = timeout(SOON, here.next_job("worker")).await.unwrap();
    claimed_here.input().await.unwrap();
    let worker = waiting(&there).await;
    claimed_here.give_back().await.unwrap();
    let given_back = claimed(worker).await;
    assert_eq!(given_back.job().id, id);

    // Cancelled and retried.
    here.cancel(id).await.unwrap();
    let mut given_back = given_back;
    given_back.cancelled().await.unwrap();
    let worker = waiting(&there).await;
    here.retry(id).await.unwrap();
    let retried = claimed(worker).await;
    assert_eq!(retried.job().id, id);
}

#[tokio::test]
async fn a_job_whose_worker_died_is_heard_of_by_another_process() {
    let bench = without_polling().await;
    let (here, there) = (bench.open().await, bench.open().await);
    let id = submit(&here, "client").await.id;
    crate::bench::claim(here.store()).await.unwrap();
    let worker = waiting(&there).await;
    bench.clock.advance(PAST_LEASE);
    assert_eq!(here.expire_leases().await.unwrap(), 1);
    assert_eq!(claimed(worker).await.job().id, id);
}

#[tokio::test]
async fn a_notification_wakes_one_worker_of_a_process() {
    let bench = without_polling().await;
    let (here, there) = (bench.open().await, bench.open().await);
    let mut workers = JoinSet::new();
    for _ in 0..3 {
        let there = Arc::clone(&there);
        workers.spawn(async move {
            there.look_again().await;
        });
    }
    tokio::time::sleep(Duration::from_millis(200)).await;
    submit(&here, "client").await;
    timeout(SOON, workers.join_next()).await.unwrap();
    let another = timeout(Duration::from_millis(500), workers.join_next()).await;
    assert!(another.is_err(), "a second worker was woken");
}

#[tokio::test]
async fn a_listener_that_is_cut_off_listens_again() {
    let bench = without_polling().await;
    let (here, there) = (bench.open().await, bench.open().await);
    let mut admin = PgConnection::connect(url(&bench)).await.unwrap();
    let before = listeners(&mut admin).await;
    assert_eq!(before.len(), 2);
    for process in &before {
        end(&mut admin, *process).await;
    }
    let again = timeout(2 * SOON, async {
        loop {
            let now = listeners(&mut admin).await;
            if now.len() == 2 && now.iter().all(|it| !before.contains(it)) {
                break;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    again.await.expect("they connect again");
    let worker = waiting(&there).await;
    let id = submit(&here, "client").await.id;
    assert_eq!(claimed(worker).await.job().id, id);
}

#[tokio::test]
async fn without_a_listener_jobs_are_found_by_looking() {
    let bench = Bench::new(Engine::Postgres).await;
    let (here, there) = (bench.open().await, bench.open().await);
    let mut admin = PgConnection::connect(url(&bench)).await.unwrap();
    let database: String = sqlx::query_scalar("SELECT current_database()")
        .fetch_one(&mut admin)
        .await
        .unwrap();
    // From now on nobody connects.
    let closed = format!("ALTER DATABASE {database} ALLOW_CONNECTIONS false");
    let mut other = PgConnection::connect(&url(&bench).replace(&database, "postgres"))
        .await
        .unwrap();
    sqlx::query(&closed).execute(&mut other).await.unwrap();
    for process in listeners(&mut admin).await {
        end(&mut admin, process).await;
    }
    while !listeners(&mut admin).await.is_empty() {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    for _ in 0..3 {
        let worker = waiting(&there).await;
        let id = submit(&here, "client").await.id;
        let mut found = claimed(worker).await;
        assert_eq!(found.job().id, id);
        found.input().await.unwrap();
        let done = found.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned());
        done.await.unwrap();
    }
    assert!(listeners(&mut admin).await.is_empty());
}
