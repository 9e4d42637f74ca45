//! A process that is killed again and again while it takes and mends scans: nothing that it has acknowledged is lost.

use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::{
    EXAMPLE,
    running::{Service, client},
};

const KILLS: u32 = 20;
const JOBS: usize = 60;
/// Longest time for which a process lives.
const LIFE: Duration = Duration::from_millis(500);
const PATIENCE: Duration = Duration::from_secs(150);

/// The moments of the kills: SplitMix64 (Steele, Lea and Flood 2014), from a fixed seed.
struct Moments(u64);

impl Moments {
    fn next(&mut self) -> Duration {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        LIFE.mul_f64((z >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

fn start(data: &Path) -> Service {
    let data = data.to_str().expect("a name");
    Service::start_with(&["--data", data, "--workers", "2", "--threads", "1"])
}

/// Hands a job over; its path, or nothing where the process ends before it has acknowledged it.
async fn hand_over(client: &reqwest::Client, service: &Service) -> Option<String> {
    let request = client.post(service.url("/jobs"));
    let request = request.header("content-type", "model/gltf-binary");
    let answer = request.body(EXAMPLE).send().await.ok()?;
    assert_eq!(answer.status(), 202);
    Some(answer.headers()["location"].to_str().ok()?.to_owned())
}

/// Hands jobs over until a process is killed at a moment after its start, which is random and the same in every run.
async fn until_killed(data: &Path, moment: Duration, jobs: usize) -> Vec<String> {
    let (client, mut service) = (client(), start(data));
    let mut acknowledged = Vec::new();
    let handing_over = async {
        while acknowledged.len() < jobs {
            match hand_over(&client, &service).await {
                Some(path) => acknowledged.push(path),
                None => tokio::time::sleep(Duration::from_millis(5)).await,
            }
        }
        std::future::pending::<()>().await;
    };
    tokio::time::timeout(moment, handing_over).await.ok();
    service.child.kill().expect("killed");
    service.child.wait().expect("it ends");
    acknowledged
}

/// All jobs, by their path, once none is underway.
async fn finished(client: &reqwest::Client, service: &Service) -> BTreeMap<String, Value> {
    let begun = Instant::now();
    loop {
        let list = service.job(client, "/jobs?limit=200").await;
        assert_eq!(list["next"], Value::Null);
        let jobs = list["jobs"].as_array().expect("a list");
        let is_underway = |job: &Value| job["state"] == "WAITING" || job["state"] == "RUNNING";
        if !jobs.iter().any(is_underway) {
            let path = |job: &Value| format!("/jobs/{}", job["id"].as_str().expect("an id"));
            return jobs.iter().map(|job| (path(job), job.clone())).collect();
        }
        assert!(begun.elapsed() < PATIENCE, "{list}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

fn files(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let count = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.expect("an entry").path();
        if path.is_dir() { files(&path) } else { 1 }
    };
    entries.map(count).sum()
}

#[tokio::test]
async fn twenty_kills_lose_no_job_double_none_and_leave_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let (client, mut moments) = (client(), Moments(22));
    let mut acknowledged = Vec::new();
    for _ in 0..KILLS {
        let jobs = (JOBS - acknowledged.len()).min(4);
        acknowledged.extend(until_killed(&data, moments.next(), jobs).await);
    }
    let service = start(&data);
    while acknowledged.len() < JOBS {
        acknowledged.extend(hand_over(&client, &service).await);
    }
    let mut jobs = finished(&client, &service).await;
    let attempts: Vec<u64> = jobs
        .values()
        .filter_map(|job| job["attempt"].as_u64())
        .collect();
    assert!(
        attempts.iter().any(|attempt| *attempt > 1),
        "no kill met a mend: {attempts:?}"
    );
    for path in &acknowledged {
        assert!(jobs.contains_key(path), "{path} is lost");
    }
    // A job that met three kills is given up, and is done when that is asked for.
    for (path, job) in &jobs {
        if job["state"] != "DONE" {
            assert_eq!(job["problem"]["code"], "job_crashed_worker", "{job}");
            let retried = client.post(service.url(&format!("{path}/retry"))).send();
            assert_eq!(retried.await.expect("an answer").status(), 200);
        }
    }
    jobs = finished(&client, &service).await;
    let answer = client.post(service.url("/inpaint"));
    let answer = answer
        .header("content-type", "model/gltf-binary")
        .body(EXAMPLE);
    let expected = answer.send().await.expect("an answer").bytes().await;
    let expected = expected.expect("a body");
    for (path, job) in &jobs {
        assert_eq!(job["state"], "DONE", "{job}");
        let result = client.get(service.url(&format!("{path}/result"))).send();
        let result = result.await.expect("an answer");
        assert_eq!(result.status(), 200);
        assert!(result.bytes().await.expect("a body") == expected, "{path}");
    }
    // A start sweeps: of each job there is one result with one report, and nothing else.
    drop(service);
    start(&data).ready().await;
    assert_eq!(files(&data.join("blobs")), 2 * jobs.len());
    assert_eq!(files(&data.join("incoming")), 0);
}
