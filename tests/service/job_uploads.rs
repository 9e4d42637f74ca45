//! Scans of jobs go straight to disk: large ones need no memory, and what is refused leaves nothing.

use std::{io::Write as _, path::Path};

use flate2::{Compression, write::GzEncoder};
use reqwest::{
    RequestBuilder,
    multipart::{Form, Part},
};
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tokio::io::AsyncWriteExt as _;

use crate::fake::FakeScan;
use crate::harness::{Service, job, problem, until};

/// Bytes of a large scan: many times what may be in memory.
const LARGE: usize = 24 << 20;
const SMALL_MEMORY: [&str; 2] = ["--memory", "6MiB"];

async fn service(folder: &TempDir, settings: &[&str]) -> Service {
    let data = ["--data", folder.path().to_str().unwrap()];
    Service::start(&[&data, settings].concat()).await
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// A scan with so many bytes: JSON may have spaces behind it.
fn large() -> Vec<u8> {
    let mut scan = FakeScan::named("cloth").bytes();
    scan.resize(LARGE, b' ');
    scan
}

/// All files of the jobs, whole ones and others.
fn files(folder: &Path) -> Vec<std::path::PathBuf> {
    // By which housekeeping asks the storage for its time; there for a moment only.
    let is_clock = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with("clock-"))
    };
    let mut found = Vec::new();
    let mut open = vec![folder.join("blobs"), folder.join("incoming")];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if !is_clock(&path) {
                found.push(path);
            }
        }
    }
    found
}

fn bare(service: &Service, scan: Vec<u8>) -> RequestBuilder {
    service
        .post("/jobs")
        .header("content-type", "model/gltf-binary")
        .body(scan)
}

fn part(text: impl Into<String>, media_type: &str) -> Part {
    Part::text(text.into()).mime_str(media_type).unwrap()
}

fn form(scan: Vec<u8>) -> Form {
    Form::new().part("scan", Part::bytes(scan))
}

#[tokio::test]
async fn a_scan_may_be_larger_than_the_memory() {
    let scan = large();
    let constraints = || {
        part(
            r#"{"anchors": [{"position": [0.125, 1, 2]}]}"#,
            "application/json",
        )
    };
    for kind in ["bare", "first", "last"] {
        let folder = folder();
        // Its jobs only wait: what they take later is another matter.
        let service = service(&folder, &SMALL_MEMORY).await;
        let request = match kind {
            "bare" => bare(&service, scan.clone()),
            "first" => {
                let form = Form::new().part("constraints", constraints());
                let form = form.part("scan", Part::bytes(scan.clone()));
                service.post("/jobs").multipart(form)
            }
            _ => {
                let form = form(scan.clone()).part("constraints", constraints());
                service.post("/jobs").multipart(form)
            }
        };
        let answer = request.send().await.unwrap();
        assert_eq!(
            answer.status(),
            202,
            "{kind}: {}",
            answer.text().await.unwrap()
        );
        let files = files(folder.path());
        let [file] = &files[..] else {
            panic!("{kind}: {files:?}");
        };
        assert!(std::fs::read(file).unwrap() == scan, "{kind}");
        // The same scan does not fit where it is read at once.
        if kind == "bare" {
            let at_once = service
                .post("/inpaint")
                .header("content-type", "model/gltf-binary");
            let refused = at_once.body(scan.clone()).send().await.unwrap();
            assert_eq!(problem(refused).await["code"], "memory_full");
        }
    }
}

#[tokio::test]
async fn a_scan_is_the_same_however_it_comes() {
    let folder = folder();
    let service = service(&folder, &[]).await;
    let scan = FakeScan::named("cloth").bytes();
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(&scan).unwrap();
    let gzip = gzip.finish().unwrap();
    let digest = |body: &[u8]| {
        use base64::{Engine as _, engine::general_purpose::STANDARD};
        format!("sha-256=:{}:", STANDARD.encode(Sha256::digest(body)))
    };
    let untold = service.post("/jobs").body(scan.clone());
    let compressed = bare(&service, gzip.clone())
        .header("content-encoding", "gzip")
        .header("content-digest", digest(&gzip));
    let several = || {
        let texture = Part::bytes(vec![1, 2, 3]);
        form(scan.clone()).part("cloth.png", texture)
    };
    let asked_at_once = service.post("/inpaint").multipart(several()).send().await;
    let mended_at_once = asked_at_once.unwrap().bytes().await.unwrap();
    for (kind, request, expected) in [
        (
            "digest",
            bare(&service, scan.clone()).header("content-digest", digest(&scan)),
            FakeScan::named("cloth").mended().into(),
        ),
        ("untold", untold, FakeScan::named("cloth").mended().into()),
        ("gzip", compressed, FakeScan::named("cloth").mended().into()),
        (
            "several",
            service.post("/jobs").multipart(several()),
            mended_at_once,
        ),
    ] {
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), 202, "{kind}");
        let path = answer.headers()["location"].to_str().unwrap().to_owned();
        until(|| async {
            let job = job(&service, &path).await;
            assert_ne!(job["state"], "ERROR", "{kind}: {job}");
            job["state"] == "DONE"
        })
        .await;
        let result = service.get(&format!("{path}/result")).send().await.unwrap();
        assert_eq!(result.bytes().await.unwrap(), expected, "{kind}");
    }
}

#[tokio::test]
async fn what_is_refused_leaves_no_file() {
    let folder = folder();
    let service = service(
        &folder,
        &["--body-limit", "64KiB", "--body-timeout", "300ms"],
    )
    .await;
    let scan = || FakeScan::named("cloth").bytes();
    let wrong = "sha-512=:AAAA:";
    let multipart = |form: Form| service.post("/jobs").multipart(form);
    let json = "application/json";
    for (request, status, code) in [
        (bare(&service, Vec::new()), 400, "empty_body"),
        (bare(&service, vec![b' '; 65_537]), 413, "body_too_large"),
        (
            bare(&service, scan()).header("repr-digest", wrong),
            400,
            "digest_mismatch",
        ),
        (
            multipart(form(scan())).header("content-digest", wrong),
            400,
            "digest_mismatch",
        ),
        (
            service.post("/jobs").body("no scan"),
            415,
            "unsupported_media_type",
        ),
        (multipart(Form::new()), 400, "malformed_request"),
        (multipart(form(Vec::new())), 400, "empty_body"),
        (
            multipart(Form::new().part("constraints", part("{}", json))),
            400,
            "empty_body",
        ),
        (
            multipart(form(scan()).part("scan", Part::bytes(scan()))),
            400,
            "malformed_request",
        ),
        (
            multipart(form(scan()).part("colour", part("red", json))),
            400,
            "malformed_request",
        ),
        (
            multipart(form(scan()).part("constraints", part("{", json))),
            400,
            "malformed_request",
        ),
        (
            multipart(form(scan()).part(
                "constraints",
                part(r#"{"anchors": [{"position": [1]}]}"#, json),
            )),
            422,
            "invalid_constraints",
        ),
        (
            multipart(form(scan()).part("constraints", part("{}", "text/html"))),
            415,
            "unsupported_media_type",
        ),
        (
            service
                .post("/jobs")
                .header("content-type", "multipart/form-data")
                .body("x"),
            400,
            "malformed_request",
        ),
    ] {
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), status, "{code}");
        assert_eq!(problem(answer).await["code"], code);
        assert_eq!(
            files(folder.path()),
            Vec::<std::path::PathBuf>::new(),
            "{code}"
        );
    }

    // A body that stops, and one whose sender goes.
    let head = "POST /jobs HTTP/1.1\r\nhost: darn\r\ncontent-type: model/gltf-binary\r\ncontent-length: 1000\r\n\r\nglTF";
    for stays in [true, false] {
        let mut stream = tokio::net::TcpStream::connect(service.address)
            .await
            .unwrap();
        stream.write_all(head.as_bytes()).await.unwrap();
        if stays {
            let mut answer = Vec::new();
            tokio::io::AsyncReadExt::read_to_end(&mut stream, &mut answer)
                .await
                .unwrap();
            assert!(answer.starts_with(b"HTTP/1.1 408"), "{answer:?}");
        }
        drop(stream);
        until(|| async { files(folder.path()).is_empty() }).await;
    }
    let list: Value = service
        .get("/jobs")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(list["jobs"].as_array().unwrap().len(), 0);
}
