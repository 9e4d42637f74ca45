//! Webhooks: receivers that take them, fail, redirect, hang or want no more; where they may go; who signs them; what of them outlives the service.

use std::time::{Duration, Instant};

use reqwest::RequestBuilder;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::time::timeout;

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, job, problem, until, until_state};
use crate::keyed::{Keyed, entry, limited};
use crate::webhook_sink::{Reply, Sink};

const SECRET: &[u8] = b"a secret of twenty-nine bytes";
const LOCAL: [&str; 3] = ["--webhook-http", "--webhook-allow", "127.0.0.0/8"];

fn text(secret: &[u8]) -> String {
    use base64::{Engine as _, engine::general_purpose::STANDARD};
    format!("whsec_{}", STANDARD.encode(secret))
}

/// A service that keeps jobs in a folder and signs webhooks.
async fn service(folder: &TempDir, settings: &[&str]) -> Service {
    let (data, secret) = (folder.path().join("data"), folder.path().join("secret"));
    std::fs::write(&secret, text(SECRET)).unwrap();
    let own = [
        "--data",
        data.to_str().unwrap(),
        "--webhook-secret",
        secret.to_str().unwrap(),
    ];
    Service::start(&[&own, settings].concat()).await
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// The body of a request that hands over a scan.
fn with_scan(request: RequestBuilder, scan: impl Into<FakeScan>) -> RequestBuilder {
    let request = request.header("content-type", "model/gltf-binary");
    request.body(scan.into().bytes())
}

/// The path of a job with a webhook.
fn path(url: &str) -> String {
    let parameters = [("name", "coat 7"), ("webhook", url)];
    let built = reqwest::Url::parse_with_params("http://service/jobs", parameters).unwrap();
    format!("/jobs?{}", built.query().unwrap())
}

async fn accepted(request: RequestBuilder) -> String {
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 202);
    answer.headers()["location"].to_str().unwrap().to_owned()
}

async fn hand_over(service: &Service, url: &str, scan: impl Into<FakeScan>) -> String {
    accepted(with_scan(service.post(&path(url)), scan)).await
}

async fn webhook(service: &Service, path: &str) -> Value {
    job(service, path).await["webhook"].clone()
}

/// Waits until a job's webhook is so.
async fn until_told(service: &Service, path: &str, holds: impl Fn(&Value) -> bool) -> Value {
    until(|| async { holds(&webhook(service, path).await) }).await;
    webhook(service, path).await
}

#[tokio::test]
async fn the_end_of_a_job_is_told_and_signed() {
    let folder = folder();
    let service = service(&folder, &LOCAL).await;
    let sink = Sink::start(&[Reply::Status(200)]).await;
    let url = sink.url("/hook/a%20b?token=t0k3n");
    for (scan, kind, state) in [
        (Behaviour::Mend, "job.done", "DONE"),
        (Behaviour::RefuseNotADisk, "job.error", "ERROR"),
        (Behaviour::UntilCancelled, "job.cancelled", "CANCELLED"),
    ] {
        let before = sink.received().len();
        let job = hand_over(&service, &url, scan).await;
        if scan == Behaviour::UntilCancelled {
            service.post(&format!("{job}/cancel")).send().await.unwrap();
        }
        let received = sink.wait_for(before + 1).await.remove(before);
        assert_eq!(received.path, "/hook/a%20b?token=t0k3n");
        assert_eq!(received.header("content-type"), "application/json");
        assert!(received.header("user-agent").starts_with("darn/"));
        assert_eq!(received.header("host"), sink.address.to_string());
        assert!(received.is_signed_with(SECRET), "{received:?}");
        assert!(!received.is_signed_with(b"another secret of some bytes"));
        let told = until_told(&service, &job, |it| it["state"] == "DELIVERED").await;
        assert_eq!(
            (&told["tries"], &told["lastStatus"]),
            (&json!(1), &json!(200))
        );
        // The query may have secrets, and every client sees the jobs.
        assert_eq!(told["url"], sink.url("/hook/a%20b"));
        assert_eq!(told.get("nextTryAt"), None);

        let shown: Value = service
            .get(&job)
            .send()
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        let file = |name: &str| (state == "DONE").then(|| json!(format!("{job}/{name}")));
        let mut links = json!({ "job": job });
        for name in ["result", "report"] {
            if let Some(file) = file(name) {
                links[name] = file;
            }
        }
        let event = received.json();
        let (id, version) = (shown["id"].as_str().unwrap(), &shown["version"]);
        let expected = json!({
            "type": kind,
            "timestamp": shown["finishedAt"],
            "data": { "id": id, "name": "coat 7", "state": state, "version": version, "links": links },
        });
        assert_eq!(event, expected);
        assert_eq!(received.header("webhook-id"), format!("{id}-{version}"));
    }
    let delivered = service
        .metric("darn_webhooks_total{end=\"delivered\"}")
        .await;
    assert_eq!(delivered, Some(3.0));
    assert_eq!(service.metric("darn_webhooks_waiting").await, Some(0.0));
    // Nobody is told of a job that names no webhook.
    let silent = accepted(with_scan(service.post("/jobs"), "cloth")).await;
    until_state(&service, &silent, "DONE").await;
    assert_eq!(webhook(&service, &silent).await, Value::Null);
    assert_eq!(sink.received().len(), 3);
}

#[tokio::test]
async fn a_receiver_that_fails_is_told_again_later() {
    let folder = folder();
    let service = service(&folder, &LOCAL).await;
    let sink = Sink::start(&[Reply::Status(500), Reply::Status(204)]).await;
    let began = Instant::now();
    let job = hand_over(&service, &sink.url("/hook"), "cloth").await;
    let failed = until_told(&service, &job, |it| it["lastStatus"] == 500).await;
    assert_eq!(failed["state"], "PENDING");
    assert_eq!(failed["lastError"], "the receiver answered with 500");
    assert!(failed["nextTryAt"].is_string(), "{failed}");
    assert_eq!(service.metric("darn_webhooks_waiting").await, Some(1.0));

    let told = until_told(&service, &job, |it| it["state"] == "DELIVERED").await;
    assert!(
        began.elapsed() > Duration::from_secs(4),
        "{:?}",
        began.elapsed()
    );
    assert_eq!(
        (&told["tries"], &told["lastStatus"]),
        (&json!(2), &json!(204))
    );
    assert_eq!(told.get("lastError"), None);
    let [first, second] = &sink.received()[..] else {
        panic!("{:?}", sink.received());
    };
    // The same message, signed at another time.
    assert_eq!(first.body, second.body);
    assert_eq!(first.header("webhook-id"), second.header("webhook-id"));
    assert_ne!(
        first.header("webhook-timestamp"),
        second.header("webhook-timestamp")
    );
    assert!(second.is_signed_with(SECRET));
}

#[tokio::test]
async fn a_receiver_that_asks_for_time_is_given_it() {
    let folder = folder();
    let service = service(&folder, &LOCAL).await;
    let sink = Sink::start(&[Reply::Busy(1200)]).await;
    let job = hand_over(&service, &sink.url("/hook"), "cloth").await;
    let failed = until_told(&service, &job, |it| it["lastStatus"] == 503).await;
    // Seconds of the day, of a time such as 2026-11-29T12:34:56Z.
    let at = |what: &str| {
        let time = failed[what].as_str().unwrap().split('T').nth(1).unwrap();
        let parts = time[..8].split(':');
        parts.fold(0, |sum, part| 60 * sum + part.parse::<i64>().unwrap())
    };
    let pause = (at("nextTryAt") - at("lastTryAt")).rem_euclid(24 * 3600);
    // Without the header it would be five seconds.
    assert!((1195..1210).contains(&pause), "{failed}");
}

#[tokio::test]
async fn a_new_secret_signs_once_its_file_has_changed() {
    let folder = folder();
    let service = service(&folder, &LOCAL).await;
    let sink = Sink::start(&[Reply::Status(200)]).await;
    let new = b"another secret of the service";
    std::fs::write(folder.path().join("secret"), text(new)).unwrap();
    let url = sink.url("/hook");
    until(|| async {
        let before = sink.received().len();
        hand_over(&service, &url, "cloth").await;
        let received = sink.wait_for(before + 1).await;
        received[before].is_signed_with(new)
    })
    .await;
}

#[tokio::test]
async fn redirects_are_not_followed_and_nobody_is_waited_for() {
    let folder = folder();
    let settings = [&LOCAL[..], &["--webhook-timeout", "300ms"]].concat();
    let service = service(&folder, &settings).await;
    let redirecting = Sink::start(&[Reply::Redirect]).await;
    let silent = Sink::start(&[Reply::Silence]).await;
    // A port that is taken, and at which nobody listens.
    let taken = tokio::net::TcpSocket::new_v4().unwrap();
    taken.bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let closed = taken.local_addr().unwrap();
    for (url, status, error) in [
        (
            redirecting.url("/hook"),
            json!(302),
            "redirects are not followed",
        ),
        (
            silent.url("/hook"),
            Value::Null,
            "no answer within 0.3 s (DARN_WEBHOOK_TIMEOUT)",
        ),
        (
            format!("http://{closed}/hook"),
            Value::Null,
            "no connection",
        ),
        (
            "http://name.invalid/hook".to_owned(),
            Value::Null,
            "cannot be resolved",
        ),
    ] {
        let job = hand_over(&service, &url, "cloth").await;
        let failed = until_told(&service, &job, |it| it["lastError"].is_string()).await;
        assert!(
            failed["lastError"].as_str().unwrap().contains(error),
            "{failed}"
        );
        assert_eq!(failed["lastStatus"], status, "{url}");
        assert_eq!(failed["state"], "PENDING");
    }
    let paths: Vec<_> = redirecting
        .received()
        .into_iter()
        .map(|it| it.path)
        .collect();
    assert_eq!(paths, ["/hook"]);
}

#[tokio::test]
async fn a_receiver_that_answers_410_hears_no_more_of_the_job() {
    let folder = folder();
    let service = service(&folder, &LOCAL).await;
    let sink = Sink::start(&[Reply::Status(410)]).await;
    let job = hand_over(&service, &sink.url("/hook"), Behaviour::RefuseNotADisk).await;
    let told = until_told(&service, &job, |it| it["state"] == "DISABLED").await;
    assert_eq!(told["lastStatus"], 410);
    assert_eq!(told.get("nextTryAt"), None);
    let retried = service.post(&format!("{job}/retry")).send().await.unwrap();
    assert_eq!(retried.status(), 200);
    until_state(&service, &job, "ERROR").await;
    // Another one is told nevertheless, and by then this one would have been.
    let other = hand_over(&service, &sink.url("/other"), "cloth").await;
    until_told(&service, &other, |it| it["state"] == "DISABLED").await;
    let paths: Vec<_> = sink.received().into_iter().map(|it| it.path).collect();
    assert_eq!(paths, ["/hook", "/other"]);
    assert_eq!(service.metric("darn_webhooks_waiting").await, Some(0.0));
}

#[tokio::test]
async fn a_url_that_may_not_be_is_refused_with_the_job() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let long = format!("https://example.org/{}", "a".repeat(2000));
    for (url, part) in [
        ("http://example.org/hook", "must begin with https"),
        ("https://127.0.0.1/hook", "loopback"),
        ("https://169.254.169.254/latest", "link-local"),
        ("https://[::ffff:10.0.0.1]/hook", "a private network"),
        ("https://user:secret@example.org/", "a user's name"),
        ("example.org", "must be a URL"),
        (long.as_str(), "the limit is 2000"),
    ] {
        let refused = with_scan(service.post(&path(url)), "cloth")
            .send()
            .await
            .unwrap();
        assert_eq!(refused.status(), 400, "{url}");
        let refused = problem(refused).await;
        assert_eq!(refused["code"], "malformed_request");
        let detail = refused["detail"].as_str().unwrap();
        assert!(
            detail.starts_with("`webhook` ") && detail.contains(part),
            "{detail}"
        );
    }
    let list: Value = service
        .get("/jobs")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(list["jobs"], json!([]));
    // The key is that of the whole payload.
    let keyed = |url: &str| {
        let request = service.post(&path(url)).header("idempotency-key", "a-1");
        with_scan(request, "cloth").send()
    };
    assert_eq!(keyed("https://name.invalid/a").await.unwrap().status(), 202);
    assert_eq!(keyed("https://name.invalid/a").await.unwrap().status(), 202);
    assert_eq!(keyed("https://name.invalid/b").await.unwrap().status(), 422);
}

#[tokio::test]
async fn a_name_that_leads_inside_is_not_connected_to() {
    let folder = folder();
    let service = service(&folder, &["--webhook-http"]).await;
    let sink = Sink::start(&[Reply::Status(200)]).await;
    let url = format!("http://localhost:{}/hook", sink.address.port());
    let job = hand_over(&service, &url, "cloth").await;
    let failed = until_told(&service, &job, |it| it["lastError"].is_string()).await;
    let error = failed["lastError"].as_str().unwrap();
    assert!(
        error.contains("no public address") && error.contains("loopback"),
        "{error}"
    );
    assert_eq!(sink.received().len(), 0);
}

#[tokio::test]
async fn a_receiver_shows_a_certificate_that_is_trusted() {
    let (sink, authority) = Sink::start_tls(&[Reply::Status(200)]).await;
    let url = format!("https://localhost:{}/hook", sink.address.port());
    let other = format!("https://127.0.0.1:{}/hook", sink.address.port());
    let (trusting, doubting) = (folder(), folder());
    let file = trusting.path().join("authority.pem");
    std::fs::write(&file, authority).unwrap();
    let settings = ["--webhook-allow", "127.0.0.0/8,::1/128"];
    let own = ["--webhook-ca", file.to_str().unwrap()];
    let trusted = service(&trusting, &[&settings[..], &own].concat()).await;
    let doubted = service(&doubting, &settings).await;
    for (service, url) in [(&doubted, &url), (&trusted, &other)] {
        let job = hand_over(service, url, "cloth").await;
        let failed = until_told(service, &job, |it| it["lastError"].is_string()).await;
        let error = failed["lastError"].as_str().unwrap();
        assert!(error.contains("no TLS connection"), "{error}");
    }
    assert_eq!(sink.received().len(), 0);
    let job = hand_over(&trusted, &url, "cloth").await;
    until_told(&trusted, &job, |it| it["state"] == "DELIVERED").await;
    assert!(sink.received()[0].is_signed_with(SECRET));
}

#[tokio::test]
async fn a_shutdown_gives_a_try_back_and_the_next_start_makes_it() {
    let folder = folder();
    let sink = Sink::start(&[Reply::Silence, Reply::Status(200)]).await;
    let first = service(&folder, &LOCAL).await;
    let job = hand_over(&first, &sink.url("/hook"), "cloth").await;
    sink.wait_for(1).await;
    first.stop.cancel();
    let stopped = timeout(Duration::from_secs(10), first.ended).await;
    stopped
        .expect("a webhook holds the shutdown up")
        .unwrap()
        .unwrap();
    drop(first.app);

    let second = service(&folder, &LOCAL).await;
    let told = until_told(&second, &job, |it| it["state"] == "DELIVERED").await;
    assert_eq!(
        told["tries"], 1,
        "the try that was broken off does not count"
    );
    assert_eq!(sink.received().len(), 2);
}

#[tokio::test]
async fn each_key_signs_with_its_own_secret() {
    let own = b"the textile lab's own secret";
    let mut lab = entry("lab", &["jobs"]);
    lab["webhookSecrets"] = json!([text(own)]);
    let keyed = Keyed::start(&[lab, entry("other", &["jobs"])], &LOCAL).await;
    let sink = Sink::start(&[Reply::Status(200)]).await;
    let path = path(&sink.url("/hook"));
    accepted(with_scan(keyed.post("lab", &path), "cloth")).await;
    let received = sink.wait_for(1).await.remove(0);
    assert!(received.is_signed_with(own));
    assert!(!received.is_signed_with(SECRET));
    // This key has none, and neither has the service.
    let refused = with_scan(keyed.post("other", &path), "cloth");
    let refused = refused.send().await.unwrap();
    assert_eq!(refused.status(), 422);
    let refused = problem(refused).await;
    assert_eq!(refused["code"], "webhooks_off");
    assert!(
        refused["detail"]
            .as_str()
            .unwrap()
            .contains("webhookSecrets")
    );
}

#[tokio::test]
async fn a_client_whose_receiver_hangs_holds_up_no_other() {
    let folder = folder();
    let secret = folder.path().join("secret");
    std::fs::write(&secret, text(SECRET)).unwrap();
    let settings = [&LOCAL[..], &["--webhook-secret", secret.to_str().unwrap()]].concat();
    let keys = ["a", "b"].map(|id| limited(id, json!({})));
    let keyed = Keyed::start(&keys, &settings).await;
    let (hanging, prompt) = (
        Sink::start(&[Reply::Silence]).await,
        Sink::start(&[Reply::Status(200)]).await,
    );
    let slow = path(&hanging.url("/hook"));
    for _ in 0..40 {
        accepted(with_scan(keyed.post("a", &slow), "cloth")).await;
    }
    hanging.wait_for(4).await;
    let began = Instant::now();
    accepted(with_scan(
        keyed.post("b", &path(&prompt.url("/hook"))),
        "cloth",
    ))
    .await;
    prompt.wait_for(1).await;
    assert!(
        began.elapsed() < Duration::from_secs(10),
        "{:?}",
        began.elapsed()
    );
    assert_eq!(
        hanging.received().len(),
        4,
        "more tries of one client at once than four"
    );
}
