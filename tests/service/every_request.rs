//! What every request meets before its route: the check of its host, CORS, its id; and how little of it an error repeats.

use std::time::Duration;

use reqwest::{
    Method,
    multipart::{Form, Part},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::timeout,
};

use crate::fake::FakeScan;
use crate::harness::{Service, problem};

/// The answer to a request of these bytes on a connection of its own.
async fn raw(service: &Service, request: String) -> String {
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    timeout(Duration::from_secs(10), stream.read_to_string(&mut answer))
        .await
        .expect("no answer")
        .unwrap();
    answer
}

#[tokio::test]
async fn a_request_names_exactly_one_host() {
    let service = Service::start(&[]).await;
    let request = |version: &str, hosts: &str| {
        raw(
            &service,
            format!("GET /livez HTTP/{version}\r\nconnection: close\r\n{hosts}\r\n"),
        )
    };
    for (version, hosts) in [
        ("1.1", "host: example.org\r\n"),
        ("1.1", "host: [::1]:8080\r\n"),
        ("1.1", "host:\r\n"),
        ("1.0", ""),
    ] {
        let answer = request(version, hosts).await;
        assert!(answer.contains(" 200 OK"), "{hosts}: {answer}");
    }
    for (version, hosts) in [
        ("1.1", ""),
        ("1.1", "host: a\r\nhost: b\r\n"),
        ("1.1", "host: a\r\nhost: a\r\n"),
        ("1.0", "host: a\r\nhost: b\r\n"),
        ("1.1", "host: a b\r\n"),
        ("1.1", "host: a/b\r\n"),
        ("1.1", "host: user@a\r\n"),
    ] {
        let answer = request(version, hosts).await;
        assert!(answer.contains(" 400 Bad Request"), "{hosts}: {answer}");
        assert!(answer.contains("\"malformed_request\""), "{answer}");
        assert!(answer.contains("x-request-id: "), "{answer}");
    }
    // Before CORS, which answers preflights itself.
    let preflight = "OPTIONS /inpaint HTTP/1.1\r\nconnection: close\r\n\r\n";
    let answer = raw(&service, preflight.to_owned()).await;
    assert!(answer.contains(" 400 Bad Request"), "{answer}");
}

#[tokio::test]
async fn a_preflight_has_an_id_and_is_counted() {
    let service = Service::start(&["--allow-origin", "https://example.org"]).await;
    let preflight = service
        .request(Method::OPTIONS, "/inpaint")
        .header("origin", "https://example.org")
        .header("access-control-request-method", "POST")
        .header("x-request-id", "test");
    let answer = preflight.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["x-request-id"], "test");
    assert_eq!(answer.headers()["access-control-max-age"], "7200");
    let methods = answer.headers()["access-control-allow-methods"].clone();
    assert_eq!(methods, "GET,POST,DELETE");
    let count = "darn_requests_total{route=\"/inpaint\",status=\"200\"}";
    assert_eq!(service.metric(count).await, Some(1.0));

    // Problem documents keep the headers that let a page read them.
    let refused = service
        .post("/inpaint")
        .header("origin", "https://example.org")
        .send()
        .await
        .unwrap();
    let allowed = refused.headers()["access-control-allow-origin"].clone();
    assert_eq!(allowed, "https://example.org");
    assert_eq!(problem(refused).await["request_id"], "test");
}

#[tokio::test]
async fn an_error_repeats_only_the_beginning_of_what_was_sent() {
    let service = Service::start(&[]).await;
    let long = "k".repeat(900_000);
    let header = "k".repeat(50_000);
    let constraints = |text: String| {
        let scan = Part::bytes(FakeScan::named("cloth").bytes());
        let constraints = Part::text(text).mime_str("application/json").unwrap();
        let form = Form::new().part("scan", scan);
        let form = form.part("constraints", constraints);
        service.post("/inpaint").multipart(form)
    };
    for request in [
        constraints(format!(r#"{{"{long}": 0}}"#)),
        constraints(format!(r#"{{"weights": "{long}"}}"#)),
        constraints(format!(r#"{{"holes": "{long}"}}"#)),
        constraints(format!(r#"{{"{long}"#)),
        service
            .post("/inpaint")
            .multipart(Form::new().text(long.clone(), "x")),
        service
            .post("/inpaint")
            .header("content-type", &header)
            .body("x"),
        service.get(&format!("/{header}")),
        service.get(&format!("/sessions/{header}")),
    ] {
        let text = problem(request.send().await.unwrap()).await.to_string();
        assert!(text.len() < 1500, "{} bytes: {:.300}", text.len(), text);
    }
}
