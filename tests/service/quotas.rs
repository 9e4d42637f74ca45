//! Quotas of keys, and what a key that floods the service leaves to another.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use darn_contract::v1::ScanChunk;
use darn_serve::generated::darn_client::DarnClient;
use reqwest::{
    RequestBuilder, Response,
    multipart::{Form, Part},
};
use serde_json::{Value, json};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tonic::{Code, codegen::tokio_stream};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{problem, until};
use crate::keyed::{Keyed, bearer, limited, with_key};

fn header<'a>(answer: &'a Response, name: &str) -> &'a str {
    let value = answer.headers().get(name);
    value.map_or("(none)", |value| value.to_str().unwrap())
}

/// Checks that a quota refuses an answer, and says so everywhere.
async fn refused(answer: Response, quota: &str) -> Value {
    assert_eq!(answer.status(), 429);
    let left = header(&answer, "ratelimit");
    assert!(left.contains(&format!("\"{quota}\";r=0;t=")), "{left}");
    let policy = header(&answer, "ratelimit-policy");
    assert!(policy.contains(&format!("\"{quota}\";q=")), "{policy}");
    let retry_after: u64 = header(&answer, "retry-after").parse().unwrap();
    assert!(left.contains(&format!("t={retry_after}")), "{left}");
    let problem = problem(answer).await;
    assert_eq!(problem["code"], "quota_exceeded");
    problem
}

#[tokio::test]
async fn requests_of_a_minute_are_counted_by_key() {
    let limits = json!({ "requestsPerMinute": 3 });
    let keys = [limited("a", limits.clone()), limited("b", limits)];
    let keyed = Keyed::start(&keys, &[]).await;
    for left in [2, 1] {
        let answer = with_key(keyed.service.scan("cloth"), "a")
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), 200);
        assert_eq!(header(&answer, "ratelimit-policy"), "\"requests\";q=3;w=60");
        assert_eq!(
            header(&answer, "ratelimit"),
            format!("\"requests\";r={left}")
        );
    }
    // Refusals of the route count, too; those of the door do not.
    let answer = keyed.get("a", "/jobs/0").send().await.unwrap();
    assert_eq!(answer.status(), 404);
    assert!(header(&answer, "ratelimit").starts_with("\"requests\";r=0;t="));
    let answer = keyed.get("a", "/info").send().await.unwrap();
    let problem = refused(answer, "requests").await;
    assert!(
        problem["detail"]
            .as_str()
            .unwrap()
            .contains("3 requests a minute")
    );
    assert_eq!(keyed.get("b", "/info").send().await.unwrap().status(), 200);

    let mut client = DarnClient::connect(keyed.service.url("")).await.unwrap();
    let mut request = tonic::Request::new(tokio_stream::iter(Vec::<ScanChunk>::new()));
    (request.metadata_mut()).insert("authorization", bearer("a").parse().unwrap());
    let status = client.find_holes(request).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert_eq!(
        status.metadata().get("darn-code").unwrap(),
        "quota_exceeded"
    );
    assert!(status.metadata().contains_key("retry-after"));

    // What was used is not forgotten when the file is read again.
    keyed.set(&[
        limited("a", json!({ "requestsPerMinute": 4 })),
        limited("c", json!({})),
    ]);
    keyed.until_status("c", reqwest::StatusCode::OK).await;
    let answer = keyed.get("a", "/info").send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(header(&answer, "ratelimit-policy"), "\"requests\";q=4;w=60");
}

#[tokio::test]
async fn bytes_of_a_day_are_counted_as_they_come() {
    let keyed = Keyed::start(&[limited("a", json!({ "bytesPerDay": 1000 }))], &[]).await;
    let send = |bytes: usize| {
        let request = with_key(keyed.service.post("/inpaint"), "a");
        let request = request.header("content-type", "model/gltf-binary");
        request.body(vec![b' '; bytes]).send()
    };
    let answer = send(400).await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(
        header(&answer, "ratelimit-policy"),
        "\"bytes\";q=1000;qu=\"content-bytes\";w=86400"
    );
    assert!(header(&answer, "ratelimit").starts_with("\"bytes\";r=600"));
    // Refused before it is sent, so that nothing of it counts.
    let too_much = send(700).await.unwrap();
    assert_eq!(too_much.status(), 429);
    assert_eq!(problem(too_much).await["code"], "quota_exceeded");
    // A length that is not declared: counted as it comes, also beyond the quota.
    let mut stream = TcpStream::connect(keyed.service.address).await.unwrap();
    let request = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\nconnection: close\r\nauthorization: {}\r\n\
         content-type: model/gltf-binary\r\ntransfer-encoding: chunked\r\n\r\n384\r\n{}\r\n0\r\n\r\n",
        bearer("a"),
        " ".repeat(900)
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    refused(send(1).await.unwrap(), "bytes").await;
    // What has no body costs no bytes.
    assert_eq!(keyed.get("a", "/info").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_body_that_breaks_off_costs_what_has_come() {
    let keyed = Keyed::start(&[limited("a", json!({ "bytesPerDay": 1000 }))], &[]).await;
    let mut stream = TcpStream::connect(keyed.service.address).await.unwrap();
    let head = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\nauthorization: {}\r\ncontent-length: 900\r\n\r\n",
        bearer("a")
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(&[b' '; 100]).await.unwrap();
    let left = async || {
        let info = keyed.get("a", "/info").send().await.unwrap();
        header(&info, "ratelimit").to_owned()
    };
    until(|| async { left().await.starts_with("\"bytes\";r=100") }).await;
    drop(stream);
    until(|| async { left().await.starts_with("\"bytes\";r=900") }).await;
}

#[tokio::test]
async fn sessions_are_counted_by_key() {
    let limits = json!({ "sessions": 1 });
    let keyed = Keyed::start(&[limited("a", limits.clone()), limited("b", limits)], &[]).await;
    let open = |id: &str| with_key(keyed.service.open("cloth"), id).send();
    let first = open("a").await.unwrap();
    let path = first.headers()["location"].to_str().unwrap().to_owned();
    let problem = refused(open("a").await.unwrap(), "sessions").await;
    assert!(
        problem["detail"]
            .as_str()
            .unwrap()
            .contains("1 sessions of this key")
    );
    assert_eq!(open("b").await.unwrap().status(), 201);
    let closed = with_key(keyed.service.delete(&path), "a").send().await;
    assert_eq!(closed.unwrap().status(), 204);
    assert_eq!(open("a").await.unwrap().status(), 201);
}

fn job(keyed: &Keyed, id: &str, scan: FakeScan) -> RequestBuilder {
    (keyed.post(id, "/jobs"))
        .header("content-type", "model/gltf-binary")
        .body(scan.bytes())
}

async fn states(keyed: &Keyed, id: &str, state: &str) -> usize {
    let path = format!("/jobs?state={state}");
    let list: Value = (keyed.get(id, &path).send().await.unwrap())
        .json()
        .await
        .unwrap();
    list["jobs"].as_array().unwrap().len()
}

#[tokio::test]
async fn jobs_that_wait_and_run_are_counted_by_key() {
    let limits = json!({ "runningJobs": 1, "waitingJobs": 2 });
    let keyed = Keyed::start(
        &[limited("a", limits), limited("b", json!({}))],
        &["--workers", "4"],
    )
    .await;
    let accepted = job(&keyed, "a", FakeScan::holding("first")).send().await;
    assert_eq!(accepted.unwrap().status(), 202);
    keyed.service.fake.wait_for_scan("first").await;
    // Handed over at once: no more wait than may.
    let sent = (0..8).map(|_| tokio::spawn(job(&keyed, "a", "more".into()).send()));
    let mut accepted = 0;
    for answer in sent.collect::<Vec<_>>() {
        let answer = answer.await.unwrap().unwrap();
        if answer.status() == 202 {
            accepted += 1;
        } else {
            refused(answer, "waiting-jobs").await;
        }
    }
    assert_eq!(accepted, 2);
    // Workers are idle, and others' jobs run.
    let other = job(&keyed, "b", "of b".into()).send().await.unwrap();
    assert_eq!(other.status(), 202);
    until(|| async { states(&keyed, "b", "done").await == 1 }).await;
    assert_eq!(states(&keyed, "a", "running").await, 1);
    assert_eq!(states(&keyed, "a", "waiting").await, 2);
    keyed.service.fake.release();
    until(|| async { states(&keyed, "a", "done").await == 3 }).await;
    let again = job(&keyed, "a", "again".into()).send().await.unwrap();
    assert_eq!(again.status(), 202);
}

#[tokio::test]
async fn a_repeated_request_for_a_job_asks_no_quota_of_jobs() {
    let keyed = Keyed::start(
        &[limited("a", json!({ "runningJobs": 1, "waitingJobs": 2 }))],
        &[],
    )
    .await;
    let running = job(&keyed, "a", FakeScan::holding("first")).send().await;
    assert_eq!(running.unwrap().status(), 202);
    keyed.service.fake.wait_for_scan("first").await;
    let named = |path: &str, key: &str, request: fn(RequestBuilder) -> RequestBuilder| {
        let request = request(keyed.post("a", path)).header("idempotency-key", key.to_owned());
        request.header("prefer", "respond-async").send()
    };
    let bare = |request: RequestBuilder| {
        let request = request.header("content-type", "model/gltf-binary");
        request.body(FakeScan::named("cloth").bytes())
    };
    let another = |request: RequestBuilder| {
        let request = request.header("content-type", "model/gltf-binary");
        request.body(FakeScan::named("linen").bytes())
    };
    // The parts of a scan become one file, which is compared.
    let parts = |request: RequestBuilder| {
        let part = |name: &str| Part::bytes(FakeScan::named(name).bytes());
        request.multipart(
            Form::new()
                .part("scan", part("cloth"))
                .part("cloth.bin", part("bin")),
        )
    };
    let mut paths = Vec::new();
    for (key, request) in [("bare", bare as fn(_) -> _), ("parts", parts)] {
        let answer = named("/jobs", key, request).await.unwrap();
        assert_eq!(answer.status(), 202);
        paths.push(answer.headers()["location"].clone());
    }
    refused(named("/jobs", "new", bare).await.unwrap(), "waiting-jobs").await;
    for path in ["/jobs", "/inpaint"] {
        for (first, (key, request)) in paths
            .iter()
            .zip([("bare", bare as fn(_) -> _), ("parts", parts)])
        {
            let again = named(path, key, request).await.unwrap();
            assert_eq!(again.status(), 202, "{path} {key}");
            assert_eq!(&again.headers()["location"], first);
            let other = named(path, key, another).await.unwrap();
            assert_eq!(other.status(), 422);
            assert_eq!(problem(other).await["code"], "idempotency_mismatch");
        }
    }
    assert_eq!(states(&keyed, "a", "waiting").await, 2);
    keyed.service.fake.release();
}

#[tokio::test]
async fn a_key_that_floods_leaves_a_quiet_one_its_share() {
    // Both from one address: only their keys tell them apart.
    let keys = [limited("flood", json!({})), limited("quiet", json!({}))];
    let keyed = Arc::new(Keyed::start(&keys, &["--workers", "1", "--queue", "8"]).await);
    let stop = Arc::new(AtomicBool::new(false));
    let flood = (0..30).map(|_| {
        let (keyed, stop) = (Arc::clone(&keyed), Arc::clone(&stop));
        tokio::spawn(async move {
            let (mut times, mut refused) = (Vec::new(), 0);
            while !stop.load(Relaxed) {
                let request = with_key(keyed.service.scan(Behaviour::TakeTime), "flood");
                let begun = Instant::now();
                match request.send().await.unwrap().status().as_u16() {
                    200 => times.push(begun.elapsed()),
                    503 => {
                        refused += 1;
                        // So that the service has time for others: here both share a thread.
                        tokio::time::sleep(Duration::from_millis(10)).await;
                    }
                    other => panic!("{other}"),
                }
            }
            (times, refused)
        })
    });
    let flood: Vec<_> = flood.collect();
    tokio::time::sleep(Duration::from_millis(300)).await;
    let mut quiet = Vec::new();
    for _ in 0..40 {
        let begun = Instant::now();
        let request = with_key(keyed.service.scan(Behaviour::TakeTime), "quiet");
        let status = request.send().await.unwrap().status();
        assert_eq!(status, 200, "the flood took the quiet one's place");
        quiet.push(begun.elapsed());
    }
    stop.store(true, Relaxed);
    let (mut flooding, mut refused) = (Vec::new(), 0);
    for task in flood {
        let (times, count) = task.await.unwrap();
        flooding.extend(times);
        refused += count;
    }
    assert!(refused > 0, "it was no flood");
    let median = |times: &mut Vec<Duration>| {
        times.sort_unstable();
        times[times.len() / 2]
    };
    // The quiet one waits for the scan that runs, the flood for its own queue, too.
    let (quiet, flooding) = (median(&mut quiet), median(&mut flooding));
    assert!(quiet < flooding, "{quiet:?} beside {flooding:?}");
}
