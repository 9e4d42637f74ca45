//! Every refusal over HTTP: its status and document, and that the service keeps working.

use std::time::Duration;

use reqwest::multipart::{Form, Part};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, problem};

fn form(constraints: &'static str) -> Form {
    let scan = Part::bytes(FakeScan::named("cloth").bytes()).file_name("a.glb");
    let constraints = Part::text(constraints)
        .mime_str("application/json")
        .unwrap();
    Form::new()
        .part("scan", scan)
        .part("constraints", constraints)
}

#[tokio::test]
async fn refusals_are_problem_documents() {
    let service = Service::start(&["--body-limit", "1KiB"]).await;
    let asked = |constraints| service.post("/inpaint").multipart(form(constraints));
    let cases = [
        ("not_found", service.post("/nope")),
        (
            "method_not_allowed",
            service.get("/inpaint").header("x-request-id", "test"),
        ),
        ("empty_body", service.scan("cloth").body("")),
        ("no_content_type", service.post("/inpaint").body("cloth")),
        (
            "wrong_content_type",
            service
                .post("/holes")
                .header("content-type", "image/png")
                .body("cloth"),
        ),
        (
            "no_boundary",
            service
                .post("/inpaint")
                .header("content-type", "multipart/form-data")
                .body("x"),
        ),
        (
            "unknown_part",
            service
                .post("/inpaint")
                .multipart(Form::new().text("mesh", "x")),
        ),
        (
            "no_scan_part",
            service
                .post("/inpaint")
                .multipart(Form::new().text("constraints", "{}")),
        ),
        ("constraints_not_json", asked("{\"holes\": [}")),
        (
            "constraints_unknown_field",
            asked(r#"{"holes": [{"id": 1}, {"hole": 2}]}"#),
        ),
        (
            "constraints_invalid",
            asked(r#"{"anchors": [{"uv": [0.5, 2], "position": [0, 0]}], "weights": "other"}"#),
        ),
        (
            "constraints_invalid_cuts",
            asked(
                r#"{"holes": [{"cut": {"center": [0, 0, 0], "radius": 0}}, {"cut": {"polygon": [[0, 0, 0]], "depth": 1}}, {"cut": {}}]}"#,
            ),
        ),
        (
            "holes_with_constraints",
            service.post("/holes").multipart(form("{}")),
        ),
        ("truncated_scan", service.scan(Behaviour::RefuseTruncated)),
        ("huge_scan", service.scan(Behaviour::RefuseHuge)),
        ("geometry", service.scan(Behaviour::RefuseNotADisk)),
        ("unknown_hole", service.scan(Behaviour::RefuseUnknownHole)),
        (
            "internal_is_opaque",
            service.scan(Behaviour::FailInternally),
        ),
        ("panic", service.scan(Behaviour::Panic)),
    ];
    for (name, request) in cases {
        let response = request.send().await.unwrap();
        assert_eq!(response.headers()["x-request-id"], "test", "{name}");
        insta::assert_snapshot!(name, format!("{:#}", problem(response).await));
        let next = service.scan("cloth").send().await.unwrap();
        assert_eq!(next.status(), 200, "after {name}");
    }
}

#[tokio::test]
async fn a_wrong_method_is_answered_with_the_allowed_ones() {
    let service = Service::start(&[]).await;
    let response = service.get("/inpaint").send().await.unwrap();
    assert_eq!(response.headers()["allow"], "POST");
}

#[tokio::test]
async fn a_request_id_with_other_characters_is_replaced() {
    let service = Service::start(&[]).await;
    let response = service
        .get("/nope")
        .header("x-request-id", "a b{}")
        .send()
        .await
        .unwrap();
    let id = response.headers()["x-request-id"]
        .to_str()
        .unwrap()
        .to_owned();
    assert_eq!(id.len(), 36);
    assert_eq!(problem(response).await["request_id"], id);
}

#[tokio::test]
async fn a_client_that_sends_too_much_receives_the_answer() {
    let service = Service::start(&["--body-limit", "1MiB"]).await;
    let body = vec![7_u8; 3 << 20];
    let sized = service
        .post("/inpaint")
        .header("content-type", "model/gltf-binary")
        .body(body.clone());
    insta::assert_snapshot!(
        "body_too_large",
        format!("{:#}", problem(sized.send().await.unwrap()).await)
    );

    // Without a declared length the limit applies while the body is read.
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream
        .write_all(b"POST /holes HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ntransfer-encoding: chunked\r\n\r\n")
        .await
        .unwrap();
    for piece in body.chunks(1 << 16) {
        stream
            .write_all(format!("{:x}\r\n", piece.len()).as_bytes())
            .await
            .unwrap();
        stream.write_all(piece).await.unwrap();
        stream.write_all(b"\r\n").await.unwrap();
    }
    stream.write_all(b"0\r\n\r\n").await.unwrap();
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).await.unwrap();
    assert_eq!(&answer, b"HTTP/1.1 413");
}

#[tokio::test]
async fn a_body_that_stops_coming_times_out() {
    let service = Service::start(&["--body-timeout", "50ms"]).await;
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream
        .write_all(b"POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: 9\r\n\r\nclo")
        .await
        .unwrap();
    let mut answer = [0; 12];
    tokio::time::timeout(Duration::from_secs(10), stream.read_exact(&mut answer))
        .await
        .unwrap()
        .unwrap();
    assert_eq!(&answer, b"HTTP/1.1 408");
}
