//! Measures how long a file takes to be written and read, in a folder and in S3, and how soon another process claims a job.
//!
//! `cargo run --release -p darn-jobs --example storage` prints two Markdown tables. PostgreSQL and the S3 server are started for it.

#[path = "../tests/laws/postgres.rs"]
mod postgres;
#[path = "../tests/laws/s3.rs"]
#[allow(dead_code)]
mod s3;

use std::{
    error::Error,
    sync::Arc,
    time::{Duration, Instant},
};

use darn_jobs::{
    Jobs, Place, Settings, Submission,
    blobs::{BlobName, Blobs, Files},
};
use rand::Rng;
use sqlx::{Connection, PgConnection};
use tokio::{io::AsyncReadExt, sync::mpsc, time::sleep};
use uuid::Uuid;

/// Times that everything is measured.
const ROUNDS: usize = 40;

/// Bytes of a file.
const BYTES: usize = 20_000_000;

/// Cuts off what listens, for good.
const DEAFEN: &str = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
    WHERE datname = current_database() AND application_name = 'darn, listening'";

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let server = s3::S3::start(folder.path().join("s3"));
    let file: Vec<u8> = (0..BYTES).map(|_| rand::random()).collect();
    println!("| 20 MB | write, median | read, median |\n|---|---|---|");
    let places = [
        ("folder", Files::Folder(folder.path().join("data"))),
        ("S3", Files::Bucket(server.bucket())),
    ];
    for (name, files) in places {
        let blobs = Blobs::open(&files).await?;
        let (mut writes, mut reads) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS / 4 {
            let blob = BlobName::input(Uuid::new_v4());
            let began = Instant::now();
            blobs.put(&blob, &file[..]).await?;
            writes.push(began.elapsed());
            let began = Instant::now();
            let mut read = Vec::new();
            blobs.open_blob(&blob).await?.read_to_end(&mut read).await?;
            reads.push(began.elapsed());
            assert!(read == file);
            blobs.delete(&blob).await?;
        }
        println!(
            "| {name} | {:.0?} | {:.0?} |",
            median(writes),
            median(reads)
        );
    }

    let database = postgres::Server::start(&[]);
    let url = database.database().await;
    let place = Place::Shared {
        url: url.clone(),
        files: Files::Folder(folder.path().join("shared")),
    };
    let here = Jobs::open(&place, Settings::default()).await?;
    let there = Jobs::open(&place, Settings::default()).await?;
    println!("\n| from submission to another process's claim | median | most |\n|---|---|---|");
    measure("with notifications", &here, &there).await?;
    let mut admin = PgConnection::connect(&url).await?;
    let name: String = sqlx::query_scalar("SELECT current_database()")
        .fetch_one(&mut admin)
        .await?;
    let close = format!("ALTER DATABASE {name} ALLOW_CONNECTIONS false");
    let mut other = PgConnection::connect(&url.replace(&name, "postgres")).await?;
    sqlx::query(&close).execute(&mut other).await?;
    sqlx::query(DEAFEN).execute(&mut admin).await?;
    measure("without", &here, &there).await
}

/// Jobs that one process hands over at random moments, and the other, idle one claims.
async fn measure(name: &str, here: &Jobs, there: &Arc<Jobs>) -> Result<(), Box<dyn Error>> {
    let (claims, mut claimed) = mpsc::channel(1);
    let worker = tokio::spawn({
        let there = Arc::clone(there);
        async move {
            loop {
                let mut job = there.next_job("worker").await;
                let at = Instant::now();
                if claims.send(at).await.is_err() || job.input().await.is_err() {
                    return;
                }
                let done = job.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned());
                if done.await.is_err() {
                    return;
                }
            }
        }
    });
    let mut times = Vec::new();
    for _ in 0..ROUNDS {
        let pause = rand::rng().random_range(500..1500);
        sleep(Duration::from_millis(pause)).await;
        let submission = Submission {
            request: "{}".to_owned(),
            ..Submission::default()
        };
        here.submit(submission, &b"scan"[..]).await?;
        let submitted = Instant::now();
        let at = claimed.recv().await.ok_or("the worker ended")?;
        times.push(at.saturating_duration_since(submitted));
    }
    worker.abort();
    let most = times.iter().max().copied().unwrap_or_default();
    println!("| {name} | {:.1?} | {most:.1?} |", median(times));
    Ok(())
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort();
    times[times.len() / 2]
}
