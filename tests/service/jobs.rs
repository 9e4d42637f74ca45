//! Durable jobs: handed over, looked at, waited for, cancelled; and what of them outlives the service.

use std::time::Duration;

use reqwest::{
    Method, RequestBuilder, Response,
    multipart::{Form, Part},
};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::time::timeout;

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, job, problem, until, until_state};

/// A service that keeps jobs in a folder.
async fn service(folder: &TempDir, settings: &[&str]) -> Service {
    let data = ["--data", folder.path().to_str().unwrap()];
    Service::start(&[&data, settings].concat()).await
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn hand_over(service: &Service, scan: impl Into<FakeScan>) -> RequestBuilder {
    service
        .post("/jobs")
        .header("content-type", "model/gltf-binary")
        .body(scan.into().bytes())
}

/// The path of a job that was handed over.
async fn accepted(request: RequestBuilder) -> String {
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 202);
    let path = answer.headers()["location"].to_str().unwrap().to_owned();
    let job: Value = answer.json().await.unwrap();
    assert_eq!(format!("/jobs/{}", job["id"].as_str().unwrap()), path);
    path
}

async fn send(service: &Service, method: Method, path: &str) -> Response {
    service.request(method, path).send().await.unwrap()
}

/// What must be the same in the answers of a job and of a request.
async fn parts(answer: Response) -> (Vec<(String, String)>, Vec<u8>) {
    assert_eq!(answer.status(), 200);
    let names = [
        "content-type",
        "content-length",
        "cache-control",
        "darn-holes-filled",
        "darn-loops-skipped",
        "darn-result",
        "darn-anchor-distance",
        "repr-digest",
    ];
    let text = |name: &str| {
        let value = answer.headers().get(name).map(|value| value.to_str());
        (
            name.to_owned(),
            value.unwrap_or(Ok("(none)")).unwrap().to_owned(),
        )
    };
    let headers = names.map(text).to_vec();
    (headers, answer.bytes().await.unwrap().to_vec())
}

#[tokio::test]
async fn without_a_folder_there_are_no_jobs_and_that_is_said() {
    let service = Service::start(&[]).await;
    for (method, path) in [
        (Method::POST, "/jobs"),
        (Method::GET, "/jobs"),
        (Method::GET, "/jobs/0"),
        (Method::GET, "/jobs/0/result"),
        (Method::POST, "/jobs/0/cancel"),
        (Method::DELETE, "/jobs/0"),
    ] {
        let refused = problem(send(&service, method, path).await).await;
        assert_eq!(refused["code"], "jobs_not_kept", "{path}");
        assert!(refused["detail"].as_str().unwrap().contains("--data"));
    }
    let info: Value = (service.get("/info").send().await.unwrap())
        .json()
        .await
        .unwrap();
    assert_eq!(info["jobs"], false);
    // A preference that cannot be followed is passed over.
    let answer = service.scan("cloth").header("prefer", "respond-async");
    assert_eq!(answer.send().await.unwrap().status(), 200);
    assert_eq!(service.metric("darn_jobs_waiting").await, None);
}

#[tokio::test]
async fn the_result_is_the_answer_of_the_request() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let info: Value = (service.get("/info").send().await.unwrap())
        .json()
        .await
        .unwrap();
    assert_eq!(info["jobs"], true);
    let form = || {
        let scan = Part::bytes(FakeScan::named("cloth").bytes());
        let constraints = Part::text(r#"{"anchors": [{"position": [0.125, 1, 2]}]}"#);
        Form::new()
            .part("scan", scan.mime_str("model/gltf-binary").unwrap())
            .part(
                "constraints",
                constraints.mime_str("application/json").unwrap(),
            )
    };
    let path = accepted(
        service
            .post("/jobs?name=Coat%207&priority=5")
            .multipart(form()),
    )
    .await;
    let done = until_state(&service, &path, "DONE").await;
    assert_eq!(done["name"], "Coat 7");
    assert_eq!(done["priority"], 5);
    assert_eq!(done["attempt"], 1);
    assert_eq!(done["outcome"], "filled=1 skipped=0 doubtful=0");
    assert!(
        done["createdAt"].as_str().unwrap().starts_with("20"),
        "{done}"
    );
    assert_eq!(done["result"], format!("{path}/result"));

    let request = service
        .post("/inpaint")
        .multipart(form())
        .send()
        .await
        .unwrap();
    let request = parts(request).await;
    assert_eq!(request.0[6].1, "0.125");
    let result = service.get(&format!("{path}/result")).send().await.unwrap();
    assert_eq!(parts(result).await, request);

    let report: Value = (service.get(&format!("{path}/report")).send().await.unwrap())
        .json()
        .await
        .unwrap();
    assert_eq!(report["holes"][0]["id"], 2);
    let both = service
        .get(&format!("{path}/result"))
        .header("accept", "multipart/mixed");
    let both = both.send().await.unwrap();
    assert!(
        both.headers()["content-type"]
            .to_str()
            .unwrap()
            .starts_with("multipart/mixed")
    );
    assert!(both.text().await.unwrap().contains("name=\"scan\""));
    assert_eq!(service.metric("darn_jobs_waiting").await, Some(0.0));
    assert_eq!(service.metric("darn_jobs_running").await, Some(0.0));
}

#[tokio::test]
async fn what_is_wrong_whatever_the_scan_is_refused_at_once_and_not_kept() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let form = |constraints: &'static str| {
        let part = Part::text(constraints)
            .mime_str("application/json")
            .unwrap();
        let scan = Part::bytes(FakeScan::named("cloth").bytes());
        service
            .post("/jobs")
            .multipart(Form::new().part("scan", scan).part("constraints", part))
    };
    for (request, status, code) in [
        (form("{"), 400, "malformed_request"),
        (
            form(r#"{"anchors": [{"position": [1]}]}"#),
            422,
            "invalid_constraints",
        ),
        (service.post("/jobs"), 400, "empty_body"),
        (
            service
                .post("/jobs")
                .header("content-type", "text/html")
                .body("x"),
            415,
            "unsupported_media_type",
        ),
        (
            hand_over(&service, "cloth").header("content-digest", "sha-256=:AAAA:"),
            400,
            "digest_mismatch",
        ),
        (
            hand_over(&service, "cloth").header("idempotency-key", "two words"),
            400,
            "malformed_request",
        ),
        (
            service
                .post("/jobs?colour=red")
                .header("content-type", "model/gltf-binary")
                .body("{}"),
            400,
            "malformed_request",
        ),
        (service.get("/jobs?state=lost"), 400, "malformed_request"),
        (service.get("/jobs?limit=0"), 400, "malformed_request"),
        (service.get("/jobs/7"), 404, "no_such_job"),
    ] {
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), status, "{code}");
        assert_eq!(problem(answer).await["code"], code);
    }
    let list: Value = (service.get("/jobs").send().await.unwrap())
        .json()
        .await
        .unwrap();
    assert_eq!(list["jobs"], json!([]));
}

#[tokio::test]
async fn a_repeated_key_is_answered_with_the_first_job() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let keyed = |scan: &str| hand_over(&service, scan).header("idempotency-key", "a-1");
    let first = accepted(keyed("cloth")).await;
    assert_eq!(accepted(keyed("cloth")).await, first);
    let other = keyed("another").send().await.unwrap();
    assert_eq!(other.status(), 422);
    assert_eq!(problem(other).await["code"], "idempotency_mismatch");
    assert_ne!(accepted(hand_over(&service, "cloth")).await, first);
}

#[tokio::test]
async fn a_job_that_fails_ends_with_the_problem_of_the_request() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    for behaviour in [
        Behaviour::RefuseNotADisk,
        Behaviour::RefuseUnknownHole,
        Behaviour::RefuseTruncated,
        Behaviour::FailInternally,
        Behaviour::Panic,
    ] {
        let refused = problem(service.scan(behaviour).send().await.unwrap()).await;
        let path = accepted(hand_over(&service, behaviour)).await;
        let failed = until_state(&service, &path, "ERROR").await;
        let told = &failed["problem"];
        for member in ["status", "code", "detail", "errors"] {
            // A problem document leaves out what is empty.
            let expected = refused.get(member).cloned().unwrap_or(json!([]));
            assert_eq!(told[member], expected, "{behaviour:?}");
        }
        assert_eq!(failed["attempt"], 1, "{behaviour:?} is not tried again");
        let result = service.get(&format!("{path}/result")).send().await.unwrap();
        assert_eq!(result.status(), 409);
        assert_eq!(problem(result).await["code"], "job_wrong_state");
        // A client may try it again.
        let retried = send(&service, Method::POST, &format!("{path}/retry")).await;
        assert_eq!(retried.status(), 200);
        let retried: Value = retried.json().await.unwrap();
        assert_eq!(retried["state"], "WAITING");
        until_state(&service, &path, "ERROR").await;
    }
}

#[tokio::test]
async fn a_running_job_is_cancelled_and_a_deleted_one_is_gone() {
    let folder = folder();
    let service = service(&folder, &["--workers", "1"]).await;
    let running = accepted(hand_over(&service, Behaviour::UntilCancelled)).await;
    let told = until_state(&service, &running, "RUNNING").await;
    assert_eq!(told["attempt"], 1);
    until(|| async { job(&service, &running).await["stage"] == "flattening" }).await;
    let progress = job(&service, &running).await;
    assert_eq!(
        (&progress["holes"], &progress["holesDone"]),
        (&json!(3), &json!(1))
    );
    let waiting = accepted(hand_over(&service, "cloth")).await;
    assert_eq!(job(&service, &waiting).await["stage"], "waiting");
    let early = service
        .get(&format!("{waiting}/result"))
        .send()
        .await
        .unwrap();
    assert_eq!(early.status(), 409);
    assert_eq!(problem(early).await["code"], "job_unfinished");

    let cancelled = send(&service, Method::POST, &format!("{running}/cancel")).await;
    assert_eq!(cancelled.status(), 200);
    until_state(&service, &running, "CANCELLED").await;
    // Its worker is free for the next one.
    until_state(&service, &waiting, "DONE").await;
    let late = send(&service, Method::POST, &format!("{waiting}/cancel")).await;
    assert_eq!(late.status(), 409);
    assert_eq!(problem(late).await["code"], "job_wrong_state");

    let deleted = send(&service, Method::DELETE, &waiting).await;
    assert_eq!(deleted.status(), 204);
    let gone = service.get(&waiting).send().await.unwrap();
    assert_eq!(problem(gone).await["code"], "no_such_job");
}

#[tokio::test]
async fn jobs_are_listed_newest_first_page_by_page() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let mut paths = Vec::new();
    for name in ["a", "b", "c"] {
        paths.push(accepted(hand_over(&service, name)).await);
    }
    for path in &paths {
        until_state(&service, path, "DONE").await;
    }
    let page = |query: String| {
        let request = service.get(&format!("/jobs?{query}"));
        async move { request.send().await.unwrap().json::<Value>().await.unwrap() }
    };
    let ids = |page: &Value| -> Vec<String> {
        let jobs = page["jobs"].as_array().cloned().unwrap_or_default();
        jobs.iter()
            .map(|job| format!("/jobs/{}", job["id"].as_str().unwrap()))
            .collect()
    };
    let first = page("limit=2&state=done".to_owned()).await;
    assert_eq!(ids(&first), [paths[2].clone(), paths[1].clone()]);
    let from = first["next"].as_str().unwrap();
    let second = page(format!("limit=2&state=done&from={from}")).await;
    assert_eq!(ids(&second), [paths[0].clone()]);
    assert_eq!(second.get("next"), None);
    assert!(ids(&page("state=error".to_owned()).await).is_empty());
}

#[tokio::test]
async fn no_job_is_ever_created_and_pipelines_may_ask() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    accepted(hand_over(&service, "cloth")).await;
    let list = |query: &str| service.get(&format!("/jobs?{query}")).send();
    let page: Value = list("state=created").await.unwrap().json().await.unwrap();
    assert_eq!(page, json!({ "jobs": [] }));
    let refused = problem(list("state=made").await.unwrap()).await;
    assert!(refused["detail"].as_str().unwrap().contains("`created`"));
    let refused = list("state=created&limit=0").await.unwrap();
    assert_eq!(refused.status(), 400);
}

#[tokio::test]
async fn requests_go_first_and_jobs_keep_one_worker() {
    let folder = folder();
    let service = service(&folder, &["--workers", "2", "--queue", "8"]).await;
    let first = tokio::spawn(service.scan(FakeScan::holding("live 1")).send());
    service.fake.wait_for_scan("live 1").await;
    let job_1 = accepted(hand_over(&service, FakeScan::holding("job 1"))).await;
    service.fake.wait_for_scan("job 1").await;
    // Both workers are busy: another job is not even claimed, and requests come to wait before it.
    let job_2 = accepted(hand_over(&service, "job 2")).await;
    let second = tokio::spawn(service.scan("live 2").send());
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(job(&service, &job_2).await["state"], "WAITING");
    service.fake.release();
    for live in [first, second] {
        assert_eq!(live.await.unwrap().unwrap().status(), 200);
    }
    for path in [job_1, job_2] {
        until_state(&service, &path, "DONE").await;
    }
}

#[tokio::test]
async fn a_shutdown_gives_jobs_back_and_the_next_start_finishes_them() {
    let folder = folder();
    let first = service(&folder, &["--workers", "2"]).await;
    let running = accepted(hand_over(&first, Behaviour::UntilCancelled)).await;
    until_state(&first, &running, "RUNNING").await;
    let events = first
        .get(&format!("{running}/events"))
        .send()
        .await
        .unwrap();
    first.stop.cancel();
    let stopped = timeout(Duration::from_secs(5), first.ended).await;
    stopped
        .expect("events or jobs hold the shutdown up")
        .unwrap()
        .unwrap();
    drop((events, first.app));

    let second = service(&folder, &["--workers", "2"]).await;
    let again = until_state(&second, &running, "RUNNING").await;
    assert_eq!(
        again["attempt"], 1,
        "the attempt that was broken off does not count"
    );
    let cancelled = send(&second, Method::POST, &format!("{running}/cancel")).await;
    assert_eq!(cancelled.status(), 200);
    until_state(&second, &running, "CANCELLED").await;
}

/// Reads events until one has this text.
async fn events_until(answer: &mut Response, text: &str) -> String {
    let mut seen = String::new();
    while !seen.contains(text) {
        let piece = timeout(Duration::from_secs(10), answer.chunk()).await;
        let piece = piece.expect("no event").unwrap();
        let piece = piece.unwrap_or_else(|| panic!("the events end: {seen}"));
        seen.push_str(&String::from_utf8_lossy(&piece));
    }
    seen
}

#[tokio::test]
async fn events_tell_of_every_state_and_end_with_the_job() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let path = accepted(hand_over(&service, FakeScan::holding("cloth"))).await;
    let events = format!("{path}/events");
    let mut answer = service.get(&events).send().await.unwrap();
    assert_eq!(answer.headers()["content-type"], "text/event-stream");
    assert_eq!(answer.headers()["x-accel-buffering"], "no");
    events_until(&mut answer, "\"RUNNING\"").await;
    service.fake.release();
    let last = events_until(&mut answer, "\"DONE\"").await;
    assert_eq!(answer.chunk().await.unwrap(), None);
    let version = job(&service, &path).await["version"].to_string();
    assert!(
        last.contains(&format!("id: {version}\nevent: job\ndata: {{")),
        "{last}"
    );

    // Who has seen the end is told that there is no more.
    let seen = service.get(&events).header("last-event-id", version);
    assert_eq!(seen.send().await.unwrap().status(), 204);
    let mut anew = service
        .get(&events)
        .header("last-event-id", "1")
        .send()
        .await
        .unwrap();
    events_until(&mut anew, "\"DONE\"").await;
    assert_eq!(
        service.get("/jobs/0/events").send().await.unwrap().status(),
        404
    );
}

#[tokio::test]
async fn a_client_that_prefers_it_is_answered_with_a_job() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let plain = parts(service.scan("cloth").send().await.unwrap()).await;
    let prefer = |scan: FakeScan, prefer: &'static str| service.scan(scan).header("prefer", prefer);

    let within = prefer("cloth".into(), "respond-async, wait=20")
        .send()
        .await
        .unwrap();
    assert_eq!(
        within.headers()["preference-applied"],
        "respond-async, wait=20"
    );
    assert!(
        within.headers()["content-location"]
            .to_str()
            .unwrap()
            .starts_with("/jobs/")
    );
    assert_eq!(parts(within).await, plain);

    let refused = prefer(Behaviour::RefuseNotADisk.into(), "respond-async, wait=20");
    let refused = problem(refused.send().await.unwrap()).await;
    assert_eq!(refused["code"], "not_a_disk");
    assert_eq!(refused["request_id"], "test");

    let later = prefer(FakeScan::holding("cloth"), "respond-async")
        .send()
        .await
        .unwrap();
    assert_eq!(later.status(), 202);
    assert_eq!(later.headers()["preference-applied"], "respond-async");
    let path = later.headers()["location"].to_str().unwrap().to_owned();
    service.fake.release();
    until_state(&service, &path, "DONE").await;
}
