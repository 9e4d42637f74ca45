//! Sessions: editing, refusals, eviction, expiry, exclusive use, shutdown.

use std::time::Duration;

use axum::{body::Body, extract::Request};
use darn_serve::router;
use reqwest::{
    Method, Response,
    multipart::{Form, Part},
};
use serde_json::{Value, json};
use tower::ServiceExt as _;
use uuid::Uuid;

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, problem, until};

/// Constraints with an anchor at `x`, which is how the fake mender tells edits apart.
fn edit_at(x: f64) -> String {
    json!({ "anchors": [{ "hole": 2, "uv": [0.5, 0.5], "position": [x, 0, 0] }] }).to_string()
}

/// Waits until so many requests use a session or wait for it.
async fn under_way(service: &Service, requests: f64) {
    until(|| async { service.metric("darn_session_requests").await == Some(requests) }).await;
}

async fn code(response: Response) -> (u16, String) {
    let document = problem(response).await;
    let status = document["status"].as_u64().unwrap() as u16;
    (status, document["code"].as_str().unwrap().to_owned())
}

#[tokio::test]
async fn a_session_is_opened_edited_and_ended() {
    let service = Service::start(&[]).await;
    let opened = service.open("cloth").send().await.unwrap();
    assert_eq!(opened.status(), 201);
    let outcome = &opened.headers()["darn-result"];
    assert_eq!(outcome, "filled=1 skipped=0 doubtful=0");
    let path = opened.headers()["location"].to_str().unwrap().to_owned();
    let session: Value = opened.json().await.unwrap();
    assert_eq!(
        path,
        format!("/sessions/{}", session["id"].as_str().unwrap())
    );
    assert_eq!(session["idleSeconds"], 900.0);
    assert_eq!(session["holes"][0]["rimUvs"], json!([0.25, 0.5]));
    let again = service.get(&path).send().await.unwrap();
    assert_eq!(again.json::<Value>().await.unwrap(), session);
    assert_eq!(service.metric("darn_sessions").await, Some(1.0));

    let result = format!("{path}/result");
    let unedited = service.get(&result).send().await.unwrap();
    assert_eq!(unedited.headers()["content-type"], "model/gltf-binary");
    assert_eq!(unedited.text().await.unwrap(), "glTF cloth []");

    let edit = format!("{path}/inpaint");
    let patches = service.ask(&edit, edit_at(0.5)).send().await.unwrap();
    assert_eq!(patches.status(), 200);
    assert_eq!(patches.headers()["content-type"], "model/gltf-binary");
    assert_eq!(patches.headers()["darn-anchor-distance"], "0.5");
    assert_eq!(patches.bytes().await.unwrap(), "glTF patches");

    let positions = service.ask(&edit, edit_at(0.75));
    let positions = positions.header("accept", "application/octet-stream");
    let positions = positions.send().await.unwrap();
    assert_eq!(
        positions.headers()["content-type"],
        "application/octet-stream"
    );
    let numbers: Vec<u8> = [0.75_f32, 0.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    assert_eq!(positions.bytes().await.unwrap(), numbers);

    let both = service.ask(&edit, edit_at(0.75));
    let both = both.header("accept", "multipart/mixed").send().await;
    let text = both.unwrap().text().await.unwrap();
    assert!(text.contains("name=\"report\"") && text.contains("1 anchors"));
    assert!(text.contains("name=\"patches\"") && text.contains("glTF patches"));

    // The result has the constraints of the last successful edit.
    service.fake.next_edit(Behaviour::RefuseNotADisk);
    let refused = service.ask(&edit, edit_at(3.0)).send().await.unwrap();
    let outcome = &refused.headers()["darn-result"];
    assert_eq!(outcome, "filled=0 skipped=1 doubtful=0");
    assert_eq!(code(refused).await, (422, "not_a_disk".to_owned()));
    let edited = service.get(&result).send().await.unwrap();
    assert_eq!(edited.text().await.unwrap(), "glTF cloth [0.75]");
    // Nor do drafts count.
    let draft = service.ask(&format!("{edit}?draft=true"), edit_at(2.0));
    let draft = draft.send().await.unwrap();
    let media_type = &draft.headers()["content-type"];
    assert_eq!(media_type, "application/octet-stream");
    assert!(draft.headers().get("darn-result").is_none());
    assert_eq!(draft.bytes().await.unwrap()[..4], 2.0_f32.to_le_bytes());
    let edited = service.get(&result).send().await.unwrap();
    assert_eq!(edited.text().await.unwrap(), "glTF cloth [0.75]");
    let unknown = service.ask(&format!("{edit}?draft=perhaps"), edit_at(2.0));
    let unknown = unknown.send().await.unwrap();
    assert_eq!(code(unknown).await, (400, "malformed_request".to_owned()));
    // No body means no constraints.
    let none = service.post(&edit).send().await.unwrap();
    assert_eq!(none.status(), 200);
    assert!(!none.headers().contains_key("darn-anchor-distance"));
    let edited = service.get(&result).send().await.unwrap();
    assert_eq!(edited.text().await.unwrap(), "glTF cloth []");

    let described: Value = (service.get(&path).send().await.unwrap().json().await).unwrap();
    assert_eq!(described["constraints"]["anchors"], json!([]));
    service.ask(&edit, edit_at(0.75)).send().await.unwrap();
    let described: Value = (service.get(&path).send().await.unwrap().json().await).unwrap();
    let met: Value = serde_json::from_str(&edit_at(0.75)).unwrap();
    assert_eq!(
        described["constraints"]["anchors"][0]["position"][0],
        met["anchors"][0]["position"][0]
    );

    let search = format!("{path}/optimize-anchor");
    let found = service.ask(&search, r#"{"target": [0.25, 0, 0]}"#);
    let found: Value = found.send().await.unwrap().json().await.unwrap();
    assert_eq!(found["distance"], 0.25);

    let ended = service.delete(&path).send().await.unwrap();
    assert_eq!(ended.status(), 204);
    assert_eq!(ended.bytes().await.unwrap().len(), 0);
    assert_eq!(service.fake.kept(), 0);
    let gone = service.get(&result).send().await.unwrap();
    assert_eq!(code(gone).await, (410, "session_deleted".to_owned()));
    let ended = "darn_sessions_ended_total{reason=\"deleted\"}";
    assert_eq!(service.metric(ended).await, Some(1.0));
    assert_eq!(service.metric("darn_session_bytes").await, Some(0.0));
}

#[tokio::test]
async fn refusals_of_sessions_are_problem_documents() {
    let service = Service::start(&["--session-memory", "64KiB"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    let search = format!("{path}/optimize-anchor");
    let gone = service.session("gone").await;
    service.delete(&gone).send().await.unwrap();
    let nobody = format!("/sessions/{}", Uuid::from_u128(7));
    let opening = |constraints: &'static str| {
        let constraints = Part::text(constraints).mime_str("application/json");
        let form = Form::new()
            .part("scan", Part::bytes(FakeScan::named("cloth").bytes()))
            .part("constraints", constraints.unwrap());
        service.post("/sessions").multipart(form)
    };
    let get = |path: &str| service.get(path).header("x-request-id", "test");
    let cases = [
        (
            "session_opened_with_edits",
            opening(
                r#"{"anchors": [{"uv": [0, 0], "position": [0, 0, 0]}], "holes": [{"id": 2}]}"#,
            ),
        ),
        ("session_of_a_cone", service.open(Behaviour::RefuseNotADisk)),
        (
            "session_too_large",
            service.open(FakeScan::named("large").keeping(65_536)),
        ),
        ("session_not_found", get(&nobody)),
        ("session_id_is_none", get("/sessions/%ff")),
        (
            "session_deleted",
            service.ask(&format!("{gone}/inpaint"), "{}"),
        ),
        ("session_deleted_twice", service.delete(&gone)),
        (
            "session_constraints_choose",
            service.ask(
                &edit,
                r#"{"holes": [{"id": 2}], "weights": "gravity", "up": [0, 1, 0]}"#,
            ),
        ),
        (
            "session_constraints_invalid",
            service.ask(
                &edit,
                r#"{"anchors": [{"uv": [2, 0], "position": [0, 0, 0]}]}"#,
            ),
        ),
        ("session_constraints_not_json", service.ask(&edit, "{")),
        (
            "session_constraints_too_large",
            service.ask(&edit, vec![b' '; 2 << 20]),
        ),
        (
            "session_wrong_content_type",
            service
                .post(&edit)
                .header("content-type", "model/gltf-binary")
                .body("cloth"),
        ),
        ("session_no_content_type", service.post(&edit).body("{}")),
        ("session_search_without_query", service.post(&search)),
        (
            "session_search_invalid",
            service.ask(&search, r#"{"target": [0]}"#),
        ),
        ("session_panic", service.ask(&edit, edit_at(0.0))),
        ("session_method", service.delete(&edit)),
    ];
    for (name, request) in cases {
        if name == "session_panic" {
            service.fake.next_edit(Behaviour::Panic);
        }
        let response = request.send().await.unwrap();
        let document = format!("{:#}", problem(response).await);
        insta::assert_snapshot!(name, document);
        let next = service.ask(&edit, edit_at(1.0)).send().await.unwrap();
        assert_eq!(next.status(), 200, "after {name}");
    }
}

#[tokio::test]
async fn the_least_recently_used_session_is_evicted() {
    let service = Service::start(&["--session-memory", "35000B"]).await;
    let first = service.session("cloth").await;
    let second = service.session("cloth").await;
    let third = service.session("cloth").await;
    assert_eq!(service.get(&first).send().await.unwrap().status(), 200);
    let fourth = service.session("cloth").await;
    let evicted = service.get(&second).send().await.unwrap();
    assert_eq!(code(evicted).await, (410, "session_evicted".to_owned()));
    for path in [&first, &third, &fourth] {
        assert_eq!(service.get(path).send().await.unwrap().status(), 200);
    }
    let ended = "darn_sessions_ended_total{reason=\"evicted\"}";
    assert_eq!(service.metric(ended).await, Some(1.0));
    assert_eq!(service.fake.kept(), 3);
}

#[tokio::test]
async fn a_thousand_abandoned_sessions_stay_below_the_memory_limit() {
    const CAP: f64 = 1_048_576.0;
    let service = Service::start(&["--session-memory", "1MiB"]).await;
    let first = service.session("first").await;
    for i in 0..125 {
        let batch: Vec<_> = (0..8)
            .map(|j| {
                tokio::spawn(
                    service
                        .open(FakeScan::named("cloth").keeping(5000 + 1000 * j))
                        .send(),
                )
            })
            .collect();
        for opened in batch {
            assert_eq!(opened.await.unwrap().unwrap().status(), 201);
        }
        let bytes = service.metric("darn_session_bytes").await.unwrap();
        assert!(bytes <= CAP, "{bytes} bytes after batch {i}");
    }
    let open = service.metric("darn_sessions").await.unwrap();
    let evicted = "darn_sessions_ended_total{reason=\"evicted\"}";
    assert_eq!(service.metric(evicted).await, Some(1001.0 - open));
    assert_eq!(service.fake.kept() as f64, open, "evicted scans are freed");
    let gone = service.get(&first).send().await.unwrap();
    assert_eq!(code(gone).await, (410, "session_evicted".to_owned()));
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn an_idle_session_expires() {
    let service = Service::start(&["--session-idle", "100ms"]).await;
    let path = service.session("cloth").await;
    let ended = "darn_sessions_ended_total{reason=\"idle\"}";
    until(|| async { service.metric(ended).await == Some(1.0) }).await;
    assert_eq!(service.fake.kept(), 0);
    let gone = service.ask(&format!("{path}/inpaint"), "{}").send().await;
    assert_eq!(
        code(gone.unwrap()).await,
        (410, "session_expired".to_owned())
    );
}

#[tokio::test]
async fn requests_to_one_session_wait_for_each_other_and_block_no_others() {
    let service = Service::start(&["--workers", "2", "--queue", "1"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    service.fake.next_edit(Behaviour::Hold);
    let held = tokio::spawn(service.ask(&edit, edit_at(1.0)).send());
    service.fake.wait_for_edit(1.0).await;
    let mut waiting = Vec::new();
    for x in [2.0, 3.0, 4.0] {
        waiting.push(tokio::spawn(service.ask(&edit, edit_at(x)).send()));
        under_way(&service, x).await;
    }
    let one_more = service.ask(&edit, edit_at(5.0)).send().await.unwrap();
    assert_eq!(one_more.headers()["retry-after"], "1");
    assert_eq!(code(one_more).await, (429, "session_busy".to_owned()));

    // Three wait for the session; one worker and the whole queue are free for others.
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
    let other = service.session("cloth").await;
    assert_eq!(service.get(&other).send().await.unwrap().status(), 200);
    assert_eq!(service.fake.edits(), [1.0]);

    service.fake.release();
    assert_eq!(held.await.unwrap().unwrap().status(), 200);
    for request in waiting {
        assert_eq!(request.await.unwrap().unwrap().status(), 200);
    }
    assert_eq!(service.fake.edits(), [1.0, 2.0, 3.0, 4.0]);
}

#[tokio::test]
async fn a_session_in_use_is_not_evicted_and_is_freed_after_its_jobs() {
    let service = Service::start(&["--workers", "2", "--session-memory", "16KiB"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    service.fake.next_edit(Behaviour::Hold);
    let held = tokio::spawn(service.ask(&edit, edit_at(1.0)).send());
    service.fake.wait_for_edit(1.0).await;

    let refused = service.open("cloth").send().await.unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    assert_eq!(code(refused).await, (503, "sessions_full".to_owned()));
    assert_eq!(service.delete(&path).send().await.unwrap().status(), 204);
    let gone = service.ask(&edit, "{}").send().await.unwrap();
    assert_eq!(code(gone).await, (410, "session_deleted".to_owned()));
    assert_eq!(service.fake.kept(), 1);

    service.fake.release();
    assert_eq!(held.await.unwrap().unwrap().status(), 200);
    until(|| async { service.fake.kept() == 0 }).await;
    service.session("cloth").await;
}

#[tokio::test]
async fn the_deadline_covers_waiting_for_the_session() {
    let service = Service::start(&["--workers", "2", "--deadline", "300ms"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    service.fake.next_edit(Behaviour::Hold);
    let held = tokio::spawn(service.ask(&edit, edit_at(1.0)).send());
    service.fake.wait_for_edit(1.0).await;
    let waited = service.ask(&edit, edit_at(2.0)).send().await.unwrap();
    assert_eq!(code(waited).await, (504, "deadline_exceeded".to_owned()));
    let held = held.await.unwrap().unwrap();
    assert_eq!(code(held).await, (504, "deadline_exceeded".to_owned()));
    // The job whose caller was refused still uses the session; the next request waits for it.
    service.fake.release();
    until(|| async {
        let next = service.ask(&edit, edit_at(3.0)).send().await.unwrap();
        next.status() == 200
    })
    .await;
    assert!(!service.fake.edits().contains(&2.0));
}

#[tokio::test]
async fn a_caller_who_left_keeps_neither_the_session_nor_a_scan() {
    let service = Service::start(&["--workers", "2"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    service.fake.next_edit(Behaviour::Hold);
    let held = tokio::spawn(service.ask(&edit, edit_at(1.0)).send());
    service.fake.wait_for_edit(1.0).await;
    let leaving = tokio::spawn(service.ask(&edit, edit_at(2.0)).send());
    under_way(&service, 2.0).await;
    leaving.abort();
    under_way(&service, 1.0).await;
    let opening = tokio::spawn(service.open(FakeScan::holding("opening")).send());
    service.fake.wait_for_scan("opening").await;
    opening.abort();
    // The service must see the closed connection, which a test cannot observe.
    tokio::time::sleep(Duration::from_millis(200)).await;
    service.fake.release();
    assert_eq!(held.await.unwrap().unwrap().status(), 200);
    let next = service.ask(&edit, edit_at(3.0)).send().await.unwrap();
    assert_eq!(next.status(), 200);
    assert!(!service.fake.edits().contains(&2.0));
    until(|| async { service.fake.kept() == 1 }).await;
    assert_eq!(service.metric("darn_sessions").await, Some(1.0));
}

#[tokio::test]
async fn a_shutdown_refuses_requests_to_sessions() {
    let service = Service::start(&["--workers", "2"]).await;
    let path = service.session("cloth").await;
    let edit = format!("{path}/inpaint");
    service.fake.next_edit(Behaviour::Hold);
    let held = tokio::spawn(service.ask(&edit, edit_at(1.0)).send());
    service.fake.wait_for_edit(1.0).await;
    let waiting = tokio::spawn(service.ask(&edit, edit_at(2.0)).send());
    under_way(&service, 2.0).await;
    let app = service.app.clone();
    service.stop.cancel();
    until(|| async { app.ready().is_err() }).await;
    // A drain accepts no new connections, so the router is called without one.
    for (method, path) in [
        (Method::GET, path.clone()),
        (Method::POST, edit),
        (Method::DELETE, path),
    ] {
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header("host", "x")
            .body(Body::empty());
        let answer = router(&app).oneshot(request.unwrap()).await.unwrap();
        assert_eq!(answer.status(), 503);
    }
    service.fake.release();
    assert_eq!(held.await.unwrap().unwrap().status(), 200);
    assert_eq!(waiting.await.unwrap().unwrap().status(), 200);
    service.ended.await.unwrap().unwrap();
}

#[tokio::test]
async fn web_pages_may_delete_and_see_the_location() {
    let service = Service::start(&["--allow-origin", "https://example.org"]).await;
    let opened = service
        .open("cloth")
        .header("origin", "https://example.org");
    let opened = opened.send().await.unwrap();
    let exposed = opened.headers()["access-control-expose-headers"].to_str();
    assert!(exposed.unwrap().contains("location"));
    let asked = service
        .request(Method::OPTIONS, "/sessions/x")
        .header("origin", "https://example.org")
        .header("access-control-request-method", "DELETE");
    let allowed = asked.send().await.unwrap();
    let methods = allowed.headers()["access-control-allow-methods"].to_str();
    assert!(methods.unwrap().contains("DELETE"));
}
