//! A service whose disk is full: a file system of a few megabytes, in a mount namespace of its own.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use reqwest::{RequestBuilder, StatusCode};
use serde_json::Value;

use crate::{
    EXAMPLE,
    running::{Service, client},
    small_disk::on_small_disk,
};

/// Scans that wait while the disk fills.
const WAITING: usize = 30;
/// What fills it: no scans, so that their jobs fail at once; their inputs are kept for a retry.
const FILLERS: [usize; 2] = [2 << 20, 64 << 10];
const PATIENCE: Duration = Duration::from_secs(100);

struct Site {
    service: Service,
    client: reqwest::Client,
}

impl Site {
    fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(self.service.url(path))
    }

    /// A request for a job.
    fn job(&self, scan: &[u8]) -> RequestBuilder {
        let request = self
            .post("/jobs")
            .header("content-type", "model/gltf-binary");
        request.body(scan.to_vec())
    }

    /// The path of a job that is handed over, or the code of the refusal.
    async fn hand_over(&self, request: RequestBuilder) -> Result<String, Value> {
        let answer = request.send().await.expect("an answer");
        if answer.status() == StatusCode::ACCEPTED {
            let path = answer.headers()["location"].to_str().expect("a path");
            return Ok(path.to_owned());
        }
        assert_eq!(answer.status(), StatusCode::INSUFFICIENT_STORAGE);
        let problem: Value = answer.json().await.expect("JSON");
        Err(problem["code"].clone())
    }

    async fn list(&self) -> Vec<Value> {
        let page = self.service.job(&self.client, "/jobs?limit=200").await;
        assert_eq!(page["next"], Value::Null);
        page["jobs"].as_array().expect("a list").clone()
    }

    async fn delete(&self, path: &str) {
        let deleted = self.client.delete(self.service.url(path)).send().await;
        assert_eq!(deleted.expect("an answer").status(), StatusCode::NO_CONTENT);
    }
}

fn path(job: &Value) -> String {
    format!("/jobs/{}", job["id"].as_str().expect("an id"))
}

#[tokio::test]
async fn a_full_disk_refuses_new_jobs_and_lets_all_others_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = Path::new(env!("CARGO_BIN_EXE_darn"));
    let Some(mut command) = on_small_disk(folder.path(), "24m", program) else {
        return;
    };
    command.args([
        "serve",
        "--listen",
        "127.0.0.1:0",
        "--workers",
        "1",
        "--data",
    ]);
    command.arg(folder.path().join("data"));
    let site = Site {
        service: Service::of(command),
        client: client(),
    };
    site.service.ready().await;
    let keyed = |place: usize| {
        let request = site.job(EXAMPLE);
        request.header("idempotency-key", format!("scan-{place}"))
    };
    let mut acknowledged = Vec::new();
    for place in 0..WAITING {
        acknowledged.push(site.hand_over(keyed(place)).await.expect("room"));
    }
    for size in FILLERS {
        let filler = vec![b' '; size];
        let refused = loop {
            match site.hand_over(site.job(&filler)).await {
                Ok(path) => acknowledged.push(path),
                Err(code) => break code,
            }
        };
        assert_eq!(refused, "storage_full");
    }

    let refused = site.hand_over(site.job(EXAMPLE)).await;
    assert_eq!(refused, Err("storage_full".into()));
    // A repeated request makes no job.
    let last = &acknowledged[WAITING - 1];
    let repeated = site.hand_over(keyed(WAITING - 1)).await;
    assert_eq!(repeated.as_ref(), Ok(last));
    let waiting: Vec<String> = (site.list().await.iter())
        .filter(|job| job["state"] == "WAITING")
        .map(path)
        .collect();
    assert!(
        waiting.len() >= 4,
        "all scans were mended before the disk was full"
    );
    for path in &waiting[..2] {
        let cancelled = site.post(&format!("{path}/cancel")).send().await;
        let cancelled: Value = cancelled.expect("an answer").json().await.expect("JSON");
        assert_eq!(cancelled["state"], "CANCELLED");
    }
    for path in &waiting[2..4] {
        site.delete(path).await;
        acknowledged.retain(|it| it != path);
    }

    // Every other job ends, and none is lost.
    let begun = Instant::now();
    let jobs = loop {
        let jobs = site.list().await;
        let is_underway = |job: &Value| job["state"] == "WAITING" || job["state"] == "RUNNING";
        if !jobs.iter().any(is_underway) {
            break jobs;
        }
        assert!(begun.elapsed() < PATIENCE, "{jobs:?}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    let mut kept: Vec<String> = jobs.iter().map(path).collect();
    kept.sort_unstable();
    acknowledged.sort_unstable();
    assert_eq!(kept, acknowledged);
    for job in &jobs {
        let code = job["problem"]["code"].as_str();
        let failed_so = ["storage_full", "not_a_gltf", "empty_body"];
        let is_known = code.is_none_or(|code| failed_so.contains(&code));
        assert!(is_known, "{job}");
    }

    // With space again, work goes on.
    for job in &jobs {
        if job["state"] == "ERROR" {
            site.delete(&path(job)).await;
        }
    }
    let begun = Instant::now();
    let again = loop {
        match site.hand_over(site.job(EXAMPLE)).await {
            Ok(path) => break path,
            Err(code) => assert_eq!(code, "storage_full"),
        }
        assert!(begun.elapsed() < PATIENCE, "the space is never taken again");
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    while site.service.job(&site.client, &again).await["state"] != "DONE" {
        assert!(begun.elapsed() < PATIENCE, "it is not mended");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
