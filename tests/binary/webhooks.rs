//! A webhook is told of a job's end although the process was killed between the two.

use std::{
    io::{Read, Write},
    net::TcpListener,
    path::Path,
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::{
    EXAMPLE,
    running::{Service, client},
};

fn start(folder: &Path) -> Service {
    let text = |path: &Path| path.to_str().expect("a path in UTF-8").to_owned();
    let secret = folder.join("secret");
    std::fs::write(&secret, "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").expect("written");
    Service::start_with(&[
        "--data",
        &text(&folder.join("data")),
        "--webhook-secret",
        &text(&secret),
        "--webhook-http",
        "--webhook-allow",
        "127.0.0.1/32",
    ])
}

/// Takes one request, answers it with 204, and returns its text.
fn take(listener: &TcpListener) -> String {
    let (mut stream, _) = listener.accept().expect("a connection");
    let mut request = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let read = stream.read(&mut piece).expect("a request");
        request.extend_from_slice(&piece[..read]);
        let text = String::from_utf8_lossy(&request);
        let Some((head, body)) = text.split_once("\r\n\r\n") else {
            assert_ne!(read, 0, "the request ends");
            continue;
        };
        let length = head.lines().find_map(|line| {
            let (name, value) = line.split_once(':')?;
            (name.eq_ignore_ascii_case("content-length")).then(|| value.trim().parse::<usize>())
        });
        if length.expect("a length").expect("a number") <= body.len() {
            break;
        }
    }
    let answer = b"HTTP/1.1 204 No Content\r\nconnection: close\r\n\r\n";
    stream.write_all(answer).expect("written");
    String::from_utf8(request).expect("UTF-8")
}

async fn until(service: &Service, path: &str, holds: impl Fn(&Value) -> bool) -> Value {
    let client = client();
    let end = Instant::now() + Duration::from_secs(120);
    loop {
        let job = service.job(&client, path).await;
        if holds(&job) {
            return job;
        }
        assert!(Instant::now() < end, "{job}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kill_between_the_end_and_the_webhook_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let hook = listener.local_addr().expect("an address");
    // Nobody listens there until the second process runs.
    drop(listener);

    let mut first = start(folder.path());
    let url = first.url(&format!("/jobs?webhook=http://{hook}/hook"));
    let request = client()
        .post(url)
        .header("content-type", "model/gltf-binary")
        .body(EXAMPLE);
    let answer = request.send().await.expect("an answer");
    assert_eq!(answer.status(), 202);
    let path = answer.headers()["location"]
        .to_str()
        .expect("ASCII")
        .to_owned();
    until(&first, &path, |job| job["state"] == "DONE").await;
    first.child.kill().expect("killed");
    first.child.wait().expect("ended");

    let listener = TcpListener::bind(hook).expect("the same port");
    let second = start(folder.path());
    let taken = tokio::task::spawn_blocking(move || take(&listener));
    let taken = tokio::time::timeout(Duration::from_secs(60), taken).await;
    let request = taken.expect("no webhook came").expect("a request");
    assert!(request.starts_with("POST /hook HTTP/1.1\r\n"), "{request}");
    assert!(request.contains("webhook-signature: v1,"), "{request}");
    let (_, body) = request.split_once("\r\n\r\n").expect("a body");
    let event: Value = serde_json::from_str(body).expect("JSON");
    assert_eq!(event["type"], "job.done");
    assert_eq!(event["data"]["links"]["job"], path);
    let told = until(&second, &path, |job| job["webhook"]["state"] == "DELIVERED").await;
    assert_eq!(told["webhook"]["lastStatus"], 204);
}
