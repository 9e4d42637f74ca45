//! Several processes on one PostgreSQL: one dies or sleeps while it mends, the others take its jobs.
//!
//! No test waits for the thirty seconds of a lease or the day for which results are kept: the times in the rows are set back instead, which is what
//! the passing of time is to them.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sqlx::{Connection as _, PgConnection};
use tempfile::TempDir;

use crate::{
    EXAMPLE,
    postgres::Server,
    running::{Service, client, sheet},
};

/// Longer than anything here takes, on a machine that is busy.
const PATIENCE: Duration = Duration::from_secs(150);
/// How often a process is stopped in the hope that it mends just then.
const TRIES: usize = 10;

struct Shared {
    url: String,
    folder: TempDir,
    client: reqwest::Client,
}

impl Shared {
    async fn new() -> Self {
        Self {
            url: Server::shared().database().await,
            folder: tempfile::tempdir().expect("a folder"),
            client: client(),
        }
    }

    async fn start(&self, workers: &str) -> Service {
        let folder = self.folder.path().to_str().expect("a name");
        let settings = [
            "--data",
            folder,
            "--workers",
            workers,
            "--database",
            &self.url,
        ];
        let service = Service::start_with(&settings);
        service.ready().await;
        service
    }

    /// Hands a job over; its path.
    async fn hand_over(&self, service: &Service, query: &str, scan: &[u8]) -> String {
        let request = self.client.post(service.url(&format!("/jobs{query}")));
        let request = request.header("content-type", "application/octet-stream");
        let answer = request.body(scan.to_vec()).send().await.expect("an answer");
        assert_eq!(answer.status(), 202);
        let path = answer.headers()["location"].to_str().expect("a path");
        path.to_owned()
    }

    /// Runs a statement on the database.
    async fn sql(&self, statement: &str) -> Vec<String> {
        let mut connection = PgConnection::connect(&self.url).await.expect("it runs");
        let rows = sqlx::query_scalar(statement).fetch_all(&mut connection);
        let rows = rows.await.expect("a statement");
        connection.close().await.expect("it runs");
        rows
    }

    /// The paths of the jobs that a process runs.
    async fn running_in(&self, service: &Service) -> Vec<String> {
        let id = service.child.id();
        let sql = format!(
            "SELECT '/jobs/' || id FROM jobs WHERE state = 'running' AND worker LIKE '%, process {id}'"
        );
        self.sql(&sql).await
    }

    /// A job that a process runs, once it runs one.
    async fn job_of(&self, service: &Service) -> String {
        let begun = Instant::now();
        loop {
            if let Some(path) = self.running_in(service).await.pop() {
                return path;
            }
            assert!(begun.elapsed() < PATIENCE, "the process runs no job");
        }
    }

    /// Sets the lease of a job back by an hour.
    async fn end_lease(&self, path: &str) {
        let id = path.trim_start_matches("/jobs/");
        let sql = format!(
            "UPDATE jobs SET lease_until = lease_until - 3600000 WHERE id = '{id}' AND state = 'running' RETURNING id::text"
        );
        assert_eq!(self.sql(&sql).await, [id], "the job does not run");
    }

    /// The job, once it is finished.
    async fn finished(&self, service: &Service, path: &str) -> Value {
        let begun = Instant::now();
        loop {
            let job = service.job(&self.client, path).await;
            if ["DONE", "ERROR", "CANCELLED"]
                .iter()
                .any(|state| job["state"] == *state)
            {
                return job;
            }
            assert!(begun.elapsed() < PATIENCE, "{job}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    /// The bytes of a result, or of the answer of a request.
    async fn bytes(&self, request: reqwest::RequestBuilder) -> Vec<u8> {
        let answer = request.send().await.expect("an answer");
        assert_eq!(answer.status(), 200);
        answer.bytes().await.expect("a body").to_vec()
    }

    /// What the service answers at once for a scan.
    async fn mended(&self, service: &Service, scan: &[u8]) -> Vec<u8> {
        let request = self.client.post(service.url("/inpaint"));
        let request = request.header("content-type", "application/octet-stream");
        self.bytes(request.body(scan.to_vec())).await
    }

    async fn result(&self, service: &Service, path: &str) -> Vec<u8> {
        let result = service.url(&format!("{path}/result"));
        self.bytes(self.client.get(result)).await
    }
}

/// A scan that is large enough for its mend to take a while.
fn large_sheet() -> Vec<u8> {
    sheet(160, 74..86).into_bytes()
}

#[tokio::test]
async fn the_jobs_of_a_process_that_is_killed_are_done_by_another_that_runs() {
    let shared = Shared::new().await;
    let survivor = shared.start("1").await;
    for _ in 0..TRIES {
        let mut first = shared.start("1").await;
        let mut paths = Vec::new();
        for _ in 0..6 {
            paths.push(shared.hand_over(&survivor, "", EXAMPLE).await);
        }
        shared.job_of(&first).await;
        first.child.kill().expect("killed");
        first.child.wait().expect("it ends");
        // What it ran when it was killed.
        let broken_off = shared.running_in(&first).await;
        for path in &broken_off {
            shared.end_lease(path).await;
        }
        for path in &paths {
            let job = shared.finished(&survivor, path).await;
            assert_eq!(job["state"], "DONE", "{job}");
            let attempt = if broken_off.contains(path) { 2 } else { 1 };
            assert_eq!(job["attempt"], attempt, "{job}");
        }
        if !broken_off.is_empty() {
            let expected = shared.mended(&survivor, EXAMPLE).await;
            for path in &broken_off {
                assert!(shared.result(&survivor, path).await == expected);
            }
            return;
        }
    }
    panic!("the process was never killed while it ran a job");
}

#[tokio::test]
async fn what_a_process_finishes_after_its_lease_changes_nothing() {
    let shared = Shared::new().await;
    let scan = large_sheet();
    let sleeper = shared.start("1").await;
    let mut tries = 0;
    let broken_off = loop {
        let path = shared.hand_over(&sleeper, "", &scan).await;
        shared.job_of(&sleeper).await;
        sleeper.signal("STOP");
        // It may have written the end just before: that takes no longer than this.
        tokio::time::sleep(Duration::from_millis(100)).await;
        if shared.running_in(&sleeper).await.contains(&path) {
            break path;
        }
        sleeper.signal("CONT");
        tries += 1;
        assert!(
            tries < TRIES,
            "the process was never stopped while it ran a job"
        );
        shared.finished(&sleeper, &path).await;
    };
    shared.end_lease(&broken_off).await;
    let awake = shared.start("1").await;
    let job = shared.finished(&awake, &broken_off).await;
    assert_eq!(
        (&job["state"], &job["attempt"]),
        (&json!("DONE"), &json!(2))
    );
    let result = shared.result(&awake, &broken_off).await;
    sleeper.signal("CONT");
    let begun = Instant::now();
    while !sleeper.has_logged("the lease is lost") {
        assert!(
            begun.elapsed() < PATIENCE,
            "the sleeper never heard that its lease is lost"
        );
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(shared.finished(&awake, &broken_off).await, job);
    assert!(shared.result(&awake, &broken_off).await == result);
    assert!(shared.mended(&awake, &scan).await == result);
}

#[tokio::test]
async fn a_job_whose_process_ends_three_times_is_given_up_and_its_neighbours_are_not() {
    let shared = Shared::new().await;
    let door = shared.start("0").await;
    // It is the first one that every worker takes.
    let poison = shared
        .hand_over(&door, "?priority=100", &large_sheet())
        .await;
    let neighbours = [
        shared.hand_over(&door, "", EXAMPLE).await,
        shared.hand_over(&door, "", EXAMPLE).await,
    ];
    for attempt in 1..=3 {
        let mut worker = shared.start("1").await;
        // The worker for first jobs may have a neighbour before it.
        let begun = Instant::now();
        while door.job(&shared.client, &poison).await["state"] != "RUNNING" {
            assert!(begun.elapsed() < PATIENCE, "the process does not run it");
        }
        // What a mend that aborts does to its process.
        worker.child.kill().expect("killed");
        worker.child.wait().expect("it ends");
        let job = door.job(&shared.client, &poison).await;
        assert_eq!(
            (&job["state"], &job["attempt"]),
            (&json!("RUNNING"), &json!(attempt))
        );
        shared.end_lease(&poison).await;
        let begun = Instant::now();
        while door.job(&shared.client, &poison).await["state"] == "RUNNING" {
            assert!(begun.elapsed() < PATIENCE, "nobody looks for dead workers");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
    let given_up = door.job(&shared.client, &poison).await;
    assert_eq!(given_up["state"], "ERROR");
    assert_eq!(given_up["problem"]["code"], "job_crashed_worker");
    let worker = shared.start("1").await;
    let expected = shared.mended(&worker, EXAMPLE).await;
    for path in &neighbours {
        let job = shared.finished(&door, path).await;
        assert_eq!(
            (&job["state"], &job["attempt"]),
            (&json!("DONE"), &json!(1))
        );
        assert!(shared.result(&door, path).await == expected);
    }
}

#[tokio::test]
async fn a_result_that_is_kept_no_longer_is_gone() {
    let shared = Shared::new().await;
    let service = shared.start("1").await;
    let path = shared.hand_over(&service, "", EXAMPLE).await;
    assert_eq!(shared.finished(&service, &path).await["state"], "DONE");
    // A day and an hour pass, and the next look is due.
    let hours = 25 * 3_600_000;
    for statement in [
        format!("UPDATE jobs SET finished_at = finished_at - {hours} RETURNING id::text"),
        format!("UPDATE chores SET next_at = next_at - {hours} RETURNING name"),
    ] {
        assert!(!shared.sql(&statement).await.is_empty());
    }
    let begun = Instant::now();
    for part in ["result", "report"] {
        loop {
            let request = shared.client.get(service.url(&format!("{path}/{part}")));
            let answer = request.send().await.expect("an answer");
            if answer.status() != 200 {
                assert_eq!(answer.status(), 410);
                let problem: Value = answer.json().await.expect("JSON");
                assert_eq!(problem["code"], "job_expired");
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "its files are kept");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
    let job = service.job(&shared.client, &path).await;
    assert_eq!(job["state"], "DONE");
    let retried = shared.client.post(service.url(&format!("{path}/retry")));
    let retried = retried.send().await.expect("an answer");
    assert_eq!(retried.status(), 409);
}
