//! Digests of bodies: those of an upload are checked, and an answer says its own.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest as _, Sha256};

use crate::fake::FakeScan;
use crate::harness::{Service, problem};

fn sha256(bytes: &[u8]) -> String {
    format!("sha-256=:{}:", STANDARD.encode(Sha256::digest(bytes)))
}

#[tokio::test]
async fn an_upload_that_is_not_what_its_digest_says_is_refused() {
    let service = Service::start(&[]).await;
    let right = sha256(&FakeScan::named("cloth").bytes());
    let wrong = sha256(b"another scan");
    for header in ["content-digest", "repr-digest"] {
        let answer = service.scan("cloth").header(header, &right).send().await;
        assert_eq!(answer.unwrap().status(), 200);
        let answer = service.scan("other").header(header, &right).send().await;
        let answer = answer.unwrap();
        assert_eq!(answer.status(), 400);
        let problem = problem(answer).await;
        assert_eq!(problem["code"], "digest_mismatch");
        assert!(problem["detail"].as_str().unwrap().contains(header));
    }
    assert!(!service.fake.saw("other"), "it never reaches a worker");
    let session = service.open("cloth").header("content-digest", &wrong);
    assert_eq!(session.send().await.unwrap().status(), 400);
    let strip = service.post("/strip").header("content-digest", &wrong);
    let strip = strip
        .header("content-type", "model/gltf-binary")
        .body("glTF");
    assert_eq!(strip.send().await.unwrap().status(), 400);
}

#[tokio::test]
async fn an_answer_says_the_digests_of_its_body() {
    let service = Service::start(&[]).await;
    for accept in ["model/gltf-binary", "multipart/mixed"] {
        let answer = service.scan("cloth").header("accept", accept).send().await;
        let answer = answer.unwrap();
        let said = answer.headers()["repr-digest"].to_str().unwrap().to_owned();
        let body = answer.bytes().await.unwrap();
        assert!(said.starts_with(&sha256(&body)), "{accept}: {said}");
        assert!(said.contains(", sha-512=:"), "{said}");
    }
}
