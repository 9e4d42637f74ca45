//! Two processes on one PostgreSQL: one dies or sleeps while it mends, the other takes its jobs.

use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    EXAMPLE,
    postgres::Server,
    running::{Service, client},
};

/// Longer than a lease, on a machine that is busy.
const PATIENCE: Duration = Duration::from_secs(150);

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

    async fn start(&self) -> Service {
        let folder = self.folder.path().to_str().expect("a name");
        let settings = ["--data", folder, "--workers", "1", "--database", &self.url];
        let service = Service::start_with(&settings);
        service.ready().await;
        service
    }

    /// Hands jobs over; their paths.
    async fn hand_over(&self, service: &Service, jobs: usize) -> Vec<String> {
        let mut paths = Vec::new();
        for _ in 0..jobs {
            let request = self.client.post(service.url("/jobs"));
            let request = request.header("content-type", "model/gltf-binary");
            let answer = request.body(EXAMPLE).send().await.expect("an answer");
            let path = answer.headers()["location"].to_str().expect("a path");
            paths.push(path.to_owned());
        }
        paths
    }

    /// A job of these that runs, once one does.
    async fn running(&self, service: &Service, paths: &[String]) -> String {
        for path in paths.iter().cycle() {
            if service.job(&self.client, path).await["state"] == "RUNNING" {
                return path.clone();
            }
        }
        unreachable!("the cycle has no end")
    }

    async fn done(&self, service: &Service, path: &str) -> Value {
        let begun = Instant::now();
        loop {
            let job = service.job(&self.client, path).await;
            if job["state"] == "DONE" {
                return job;
            }
            let is_underway = job["state"] == "WAITING" || job["state"] == "RUNNING";
            assert!(is_underway && begun.elapsed() < PATIENCE, "{job}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

#[tokio::test]
async fn the_jobs_of_a_process_that_is_killed_are_done_by_another() {
    let shared = Shared::new().await;
    let mut first = shared.start().await;
    let paths = shared.hand_over(&first, 4).await;
    shared.running(&first, &paths).await;
    first.child.kill().expect("killed");
    first.child.wait().expect("it ends");
    let second = shared.start().await;
    let mut attempts = Vec::new();
    for path in &paths {
        let job = shared.done(&second, path).await;
        attempts.push(job["attempt"].as_u64());
    }
    assert!(attempts.contains(&Some(2)), "{attempts:?}");
}

#[tokio::test]
async fn what_a_process_finishes_after_its_lease_changes_nothing() {
    let shared = Shared::new().await;
    let sleeper = shared.start().await;
    let paths = shared.hand_over(&sleeper, 4).await;
    let broken_off = shared.running(&sleeper, &paths).await;
    sleeper.signal("STOP");
    let awake = shared.start().await;
    for path in &paths {
        shared.done(&awake, path).await;
    }
    let job = shared.done(&awake, &broken_off).await;
    // The process may have ended it just before it was stopped.
    let was_taken_over = job["attempt"] == 2;
    sleeper.signal("CONT");
    if was_taken_over {
        let begun = Instant::now();
        while !sleeper.has_logged("lease") {
            assert!(begun.elapsed() < PATIENCE, "the sleeper never heard of it");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
    let later = shared.done(&awake, &broken_off).await;
    assert_eq!(later, job);
    let result = shared
        .client
        .get(awake.url(&format!("{broken_off}/result")));
    assert_eq!(result.send().await.expect("an answer").status(), 200);
}
