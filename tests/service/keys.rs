//! Keys: who may call, what a key opens, what of others it sees, and what happens when the file changes.

use std::time::Duration;

use darn_serve::{App, ServeError, generated::darn_client::DarnClient};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use tokio::time::timeout;
use tonic::Code;

use crate::fake::{Behaviour, FakeMender, FakeScan};
use crate::harness::{Service, Settings, problem, until};
use crate::keyed::{Keyed, bearer, entry, secret, with_key};
use crate::protocols::chunks;

fn challenge(answer: &Response) -> &str {
    answer.headers()["www-authenticate"].to_str().unwrap()
}

#[tokio::test]
async fn without_a_valid_key_only_what_is_public_answers() {
    let keyed = Keyed::start(&[entry("lab", &["mend", "jobs"])], &[]).await;
    let document = darn_serve::openapi::document();
    let mut open = Vec::new();
    for (pattern, methods) in document["paths"].as_object().unwrap() {
        let path = pattern.replace("{id}", "0");
        for (method, operation) in methods.as_object().unwrap() {
            let method = Method::from_bytes(method.to_uppercase().as_bytes()).unwrap();
            let answer = keyed.service.request(method, &path).send().await.unwrap();
            if answer.status() != 401 {
                assert_eq!(operation["security"], json!([]), "{path}");
                open.push(path.clone());
                continue;
            }
            assert_ne!(operation["security"], json!([]), "{path}");
            assert_eq!(challenge(&answer), "Bearer realm=\"darn\"");
            assert_eq!(problem(answer).await["code"], "key_missing", "{path}");
        }
    }
    open.sort_unstable();
    assert_eq!(open, ["/livez", "/openapi.json", "/readyz"]);
    for path in ["/", "/editor/main.js"] {
        let page = keyed.service.get(path).send().await.unwrap();
        assert_eq!(page.status(), 200, "{path}");
    }
    let nothing = keyed.service.get("/nothing").send().await.unwrap();
    assert_eq!(nothing.status(), 404);
    // Where there are no keys, whatever a client sends passes.
    let plain = Service::start(&[]).await;
    let answer = with_key(plain.scan("cloth"), "lab").send().await.unwrap();
    assert_eq!(answer.status(), 200);
}

#[tokio::test]
async fn what_is_no_key_is_refused_and_never_repeated() {
    let keyed = Keyed::start(&[entry("lab", &["mend"])], &[]).await;
    let own = secret("lab").text();
    let other = secret("stranger").text();
    let long = format!("Bearer {}", "A".repeat(5000));
    for (header, code) in [
        (format!("Bearer {other}"), "key_unknown"),
        (format!("Bearer {}", own.to_uppercase()), "key_unknown"),
        (format!("Bearer {}x", own), "key_unknown"),
        (format!("Bearer {own} {own}"), "key_unknown"),
        ("Bearer".to_owned(), "key_unknown"),
        ("Bearer ".to_owned(), "key_unknown"),
        ("Bearer darn_".to_owned(), "key_unknown"),
        ("Bearer \u{e4}\u{f6}".to_owned(), "key_unknown"),
        (long, "key_unknown"),
        (own.clone(), "key_missing"),
        (String::new(), "key_missing"),
        (format!("Basic {own}"), "key_missing"),
        (format!("BearerX {own}"), "key_missing"),
    ] {
        let request = keyed.service.scan("cloth");
        let answer = request
            .header("authorization", header.as_bytes())
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), 401, "{header}");
        assert_eq!(
            challenge(&answer).contains("error=\"invalid_token\""),
            code == "key_unknown"
        );
        let problem = problem(answer).await;
        assert_eq!(problem["code"], code, "{header}");
        assert!(!problem.to_string().contains(&own[5..]), "{problem}");
    }
    let twice = with_key(with_key(keyed.service.scan("cloth"), "lab"), "lab");
    assert_eq!(twice.send().await.unwrap().status(), 401);
    assert!(!keyed.service.fake.saw("cloth"));

    for header in [format!("bearer {own}"), format!("BEARER   {own} ")] {
        let request = keyed.service.scan("cloth").header("authorization", header);
        assert_eq!(request.send().await.unwrap().status(), 200);
    }
    // In the query it is no key.
    let path = format!("/inpaint?access_token={own}");
    assert_eq!(
        keyed.service.post(&path).send().await.unwrap().status(),
        401
    );
}

#[tokio::test]
async fn a_key_opens_what_its_scopes_say() {
    let keys = [
        entry("mender", &["mend"]),
        entry("batch", &["jobs"]),
        entry("watch", &["metrics"]),
        entry("chief", &["admin"]),
        entry("nothing", &[]),
    ];
    let keyed = Keyed::start(&keys, &[]).await;
    // With the scope, the route itself answers: 400 to an empty body, 404 to an id that is none.
    let routes = [
        ("POST", "/inpaint", 400, vec!["mender"]),
        ("POST", "/sessions", 400, vec!["mender"]),
        ("GET", "/sessions/0", 404, vec!["mender"]),
        ("POST", "/jobs", 400, vec!["batch"]),
        ("GET", "/jobs/0", 404, vec!["batch", "chief"]),
        ("GET", "/metrics", 200, vec!["watch"]),
        (
            "GET",
            "/info",
            200,
            vec!["mender", "batch", "watch", "chief", "nothing"],
        ),
    ];
    for (method, path, status, allowed) in routes {
        for id in ["mender", "batch", "watch", "chief", "nothing"] {
            let method = Method::from_bytes(method.as_bytes()).unwrap();
            let request = with_key(keyed.service.request(method, path), id);
            let answer = request.send().await.unwrap();
            if allowed.contains(&id) {
                assert_eq!(answer.status(), status, "{id} {path}");
                continue;
            }
            assert_eq!(answer.status(), 403, "{id} {path}");
            assert!(challenge(&answer).contains("error=\"insufficient_scope\", scope=\""));
            assert_eq!(problem(answer).await["code"], "insufficient_scope");
        }
    }
    // A preference for a job is passed over where the key may not hand over any.
    let request = with_key(keyed.service.scan("cloth"), "mender");
    let answer = request.header("prefer", "respond-async").send().await;
    assert_eq!(answer.unwrap().status(), 200);

    let info: Value = (keyed.get("mender", "/info").send().await.unwrap())
        .json()
        .await
        .unwrap();
    assert_eq!(
        info["key"],
        json!({ "id": "mender", "scopes": ["mend"], "limits": {} })
    );
}

#[tokio::test]
async fn a_web_page_of_another_origin_is_told_why_it_is_refused() {
    let keyed = Keyed::start(&[], &["--allow-origin", "https://example.org"]).await;
    let preflight = (keyed.service.request(Method::OPTIONS, "/inpaint"))
        .header("origin", "https://example.org")
        .header("access-control-request-method", "POST")
        .header("access-control-request-headers", "authorization");
    let answer = preflight.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    let allowed = &answer.headers()["access-control-allow-headers"];
    assert!(allowed.to_str().unwrap().contains("authorization"));
    let request = keyed
        .service
        .scan("cloth")
        .header("origin", "https://example.org");
    let refused = request.send().await.unwrap();
    assert_eq!(refused.status(), 401);
    let origin = &refused.headers()["access-control-allow-origin"];
    assert_eq!(origin, "https://example.org");
}

#[tokio::test]
async fn grpc_takes_the_same_keys() {
    let keyed = Keyed::start(&[entry("lab", &["mend"]), entry("batch", &["jobs"])], &[]).await;
    let mut client = DarnClient::connect(keyed.service.url("")).await.unwrap();
    let request = |authorization: Option<String>| {
        let mut request = tonic::Request::new(chunks("cloth", None));
        if let Some(value) = authorization {
            (request.metadata_mut()).insert("authorization", value.parse().unwrap());
        }
        request
    };
    for (authorization, code, word) in [
        (None, Code::Unauthenticated, "key_missing"),
        (
            Some("Bearer x".to_owned()),
            Code::Unauthenticated,
            "key_unknown",
        ),
        (
            Some(bearer("stranger")),
            Code::Unauthenticated,
            "key_unknown",
        ),
        (
            Some(bearer("batch")),
            Code::PermissionDenied,
            "insufficient_scope",
        ),
    ] {
        let refused = client.find_holes(request(authorization.clone())).await;
        let status = refused.expect_err(word);
        assert_eq!(status.code(), code, "{word}");
        assert_eq!(status.metadata().get("darn-code").unwrap(), word);
        let refused = client.inpaint(request(authorization)).await;
        assert_eq!(refused.expect_err(word).code(), code);
    }
    let found = client.find_holes(request(Some(bearer("lab")))).await;
    assert_eq!(found.unwrap().into_inner().loops.len(), 1);
}

#[tokio::test]
async fn sessions_of_another_key_do_not_exist() {
    let keyed = Keyed::start(
        &[entry("a", &["mend"]), entry("b", &["mend", "admin"])],
        &[],
    )
    .await;
    let service = &keyed.service;
    let opened = with_key(service.open("cloth"), "a").send().await.unwrap();
    let path = opened.headers()["location"].to_str().unwrap().to_owned();
    let requests = || {
        [
            service.get(&path),
            service.get(&format!("{path}/result")),
            service.ask(&format!("{path}/inpaint"), "{}"),
            service.ask(
                &format!("{path}/optimize-anchor"),
                r#"{"target": [0, 0, 0]}"#,
            ),
            service.delete(&path),
        ]
    };
    for request in requests() {
        let answer = with_key(request, "b").send().await.unwrap();
        assert_eq!(answer.status(), 404);
        assert_eq!(problem(answer).await["code"], "session_not_found");
    }
    for request in requests() {
        let answer = with_key(request, "a").send().await.unwrap();
        assert!(answer.status().is_success(), "{:?}", answer.status());
    }
    // It has ended: its own key is told so, the other one is not.
    for (id, code) in [("a", "session_deleted"), ("b", "session_not_found")] {
        let answer = keyed.get(id, &path).send().await.unwrap();
        assert_eq!(problem(answer).await["code"], code);
    }
}

/// Hands over a scan; the path of its job.
async fn hand_over(keyed: &Keyed, id: &str, scan: FakeScan) -> String {
    let request = (keyed.post(id, "/jobs"))
        .header("content-type", "model/gltf-binary")
        .header("idempotency-key", "the-same-for-all")
        .body(scan.bytes());
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 202);
    answer.headers()["location"].to_str().unwrap().to_owned()
}

async fn state(keyed: &Keyed, id: &str, path: &str) -> Value {
    let job: Value = (keyed.get(id, path).send().await.unwrap())
        .json()
        .await
        .unwrap();
    job["state"].clone()
}

#[tokio::test]
async fn jobs_of_another_key_do_not_exist_but_for_an_admin() {
    let keys = [
        entry("a", &["mend", "jobs"]),
        entry("b", &["mend", "jobs"]),
        entry("chief", &["admin"]),
    ];
    let keyed = Keyed::start(&keys, &["--workers", "2"]).await;
    let service = &keyed.service;
    let first = hand_over(&keyed, "a", FakeScan::holding("of a")).await;
    // The same idempotency key of another client is another job.
    let second = hand_over(&keyed, "b", Behaviour::UntilCancelled.into()).await;
    assert_ne!(first, second);
    service.fake.wait_for_scan("of a").await;

    let requests = |path: &str| {
        let at = |file: &str| format!("{path}{file}");
        [
            service.get(path),
            service.get(&at("/result")),
            service.get(&at("/report")),
            service.get(&at("/events")),
            service.post(&at("/cancel")),
            service.post(&at("/retry")),
            service.delete(path),
        ]
    };
    for request in requests(&first) {
        let answer = with_key(request, "b").send().await.unwrap();
        assert_eq!(answer.status(), 404);
        assert_eq!(problem(answer).await["code"], "no_such_job");
    }
    let listed = async |id: &str| {
        let list: Value = (keyed.get(id, "/jobs").send().await.unwrap())
            .json()
            .await
            .unwrap();
        let jobs = list["jobs"].as_array().unwrap().clone();
        let path = |job: &Value| format!("/jobs/{}", job["id"].as_str().unwrap());
        jobs.iter().map(path).collect::<Vec<_>>()
    };
    assert_eq!(listed("a").await, [first.as_str()]);
    assert_eq!(listed("b").await, [second.as_str()]);
    assert_eq!(listed("chief").await, [second.as_str(), first.as_str()]);

    let cancelled = keyed
        .post("chief", &format!("{second}/cancel"))
        .send()
        .await;
    assert_eq!(cancelled.unwrap().status(), 200);
    service.fake.release();
    until(|| async { state(&keyed, "a", &first).await == "DONE" }).await;
    until(|| async { state(&keyed, "b", &second).await == "CANCELLED" }).await;
    let result = keyed
        .get("a", &format!("{first}/result"))
        .send()
        .await
        .unwrap();
    assert_eq!(result.status(), 200);
    let deleted = with_key(service.delete(&first), "chief").send().await;
    assert_eq!(deleted.unwrap().status(), 204);
    assert_eq!(listed("a").await, [] as [&str; 0]);
}

#[tokio::test]
async fn the_file_is_read_again_and_a_broken_one_changes_nothing() {
    let keyed = Keyed::start(&[entry("old", &["mend", "jobs"])], &[]).await;
    let service = &keyed.service;
    let job = hand_over(&keyed, "old", FakeScan::holding("held")).await;
    let mut events = keyed
        .get("old", &format!("{job}/events"))
        .send()
        .await
        .unwrap();
    assert!(events.chunk().await.unwrap().is_some());

    std::fs::write(keyed.file(), "{\"keys\": [").unwrap();
    tokio::time::sleep(Duration::from_millis(1500)).await;
    keyed.until_status("old", StatusCode::OK).await;
    std::fs::remove_file(keyed.file()).unwrap();
    tokio::time::sleep(Duration::from_millis(1500)).await;
    keyed.until_status("old", StatusCode::OK).await;

    keyed.set(&[entry("new", &["mend"])]);
    keyed.until_status("new", StatusCode::OK).await;
    keyed.until_status("old", StatusCode::UNAUTHORIZED).await;
    // Whoever listens with a key that is gone hears nothing more.
    service.fake.release();
    let mut rest = Vec::new();
    while let Some(piece) = timeout(Duration::from_secs(20), events.chunk())
        .await
        .unwrap()
        .unwrap()
    {
        rest.extend_from_slice(&piece);
    }
    assert!(!String::from_utf8(rest).unwrap().contains("DONE"));
}

#[tokio::test]
async fn a_key_expires() {
    let expiring = |id: &str, expires: &str| {
        let mut entry = entry(id, &["mend"]);
        entry["expires"] = expires.into();
        entry
    };
    let keys = [
        expiring("past", "2020-01-01T00:00:00Z"),
        expiring("future", "2999-12-31T23:59:59+02:00"),
    ];
    let keyed = Keyed::start(&keys, &[]).await;
    let answer = keyed.get("past", "/info").send().await.unwrap();
    assert_eq!(answer.status(), 401);
    assert!(challenge(&answer).contains("expired"));
    assert_eq!(problem(answer).await["code"], "key_expired");
    keyed.until_status("future", StatusCode::OK).await;
}

#[tokio::test]
async fn a_service_with_a_broken_file_or_open_to_strangers_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.json");
    let fake = || std::sync::Arc::new(FakeMender::default());
    let settings = |options: &[&str]| {
        use clap::Parser;
        Settings::parse_from([&["darn"], options].concat()).serve
    };
    let keys = ["--keys", file.to_str().unwrap()];
    for text in [None, Some("{\n\"keys\": 7}")] {
        if let Some(text) = text {
            std::fs::write(&file, text).unwrap();
        }
        let error = App::start(&settings(&keys), fake()).await.unwrap_err();
        assert!(matches!(error, ServeError::Keys(_)), "{error}");
        let said = error.to_string();
        assert!(said.contains("keys.json"), "{said}");
        assert_eq!(said.contains("line 2 column"), text.is_some(), "{said}");
    }
    let open = settings(&["--listen", "0.0.0.0:0"]);
    let error = tokio::task::spawn_blocking(move || darn_serve::run(&open, fake()));
    let error = error.await.unwrap().unwrap_err().to_string();
    assert!(
        error.contains("--keys") && error.contains("--allow-anonymous"),
        "{error}"
    );
}
