//! Several processes that serve together: where sessions are, and a process without workers.

use darn_contract::v1::JobQuery;
use darn_serve::{
    ServeError,
    generated::{darn_client::DarnClient, jobs_client::JobsClient},
};
use reqwest::StatusCode;
use serde_json::Value;
use std::sync::Arc;
use tempfile::TempDir;
use tonic::{Code, codegen::tokio_stream};

use crate::{
    fake::{Behaviour, FakeMender, FakeScan},
    grpc_jobs::{is_refused, parts},
    harness::{Service, Settings, problem, until},
    postgres::Server,
    protocols::chunks,
};
use clap::Parser as _;

/// A database and a folder that several services share.
struct Shared {
    url: String,
    folder: TempDir,
}

impl Shared {
    async fn new() -> Self {
        Self {
            url: Server::shared().database().await,
            folder: tempfile::tempdir().unwrap(),
        }
    }

    async fn service(&self, settings: &[&str]) -> Service {
        let folder = self.folder.path().to_str().unwrap();
        let shared = ["--data", folder, "--database", &self.url];
        Service::start(&[&shared, settings].concat()).await
    }
}

async fn code_of(service: &Service, path: &str) -> (StatusCode, String) {
    let answer = service.get(path).send().await.unwrap();
    let status = answer.status();
    (
        status,
        problem(answer).await["code"].as_str().unwrap().to_owned(),
    )
}

#[tokio::test]
async fn a_session_is_sent_to_its_instance_while_that_lives() {
    let shared = Shared::new().await;
    let first = shared.service(&["--instance", "a1"]).await;
    let second = shared.service(&["--instance", "b2"]).await;
    let path = first.session("cloth").await;
    assert!(path.starts_with("/sessions/00000000-00a1-8"), "{path}");
    assert_eq!(first.get(&path).send().await.unwrap().status(), 200);
    let info: Value = first
        .get("/info")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(info["instance"], "0000000000a1");

    let (status, code) = code_of(&second, &path).await;
    assert_eq!((status.as_u16(), code.as_str()), (421, "session_elsewhere"));
    let answer = second
        .ask(&format!("{path}/inpaint"), "{}")
        .send()
        .await
        .unwrap();
    assert!(
        problem(answer).await["detail"]
            .as_str()
            .unwrap()
            .contains("0000000000a1")
    );
    let answer = second.delete(&path).send().await.unwrap();
    assert_eq!(answer.status(), 421);
    assert_eq!(first.get(&path).send().await.unwrap().status(), 200);

    first.stop.cancel();
    first.ended.await.unwrap().unwrap();
    let (status, code) = code_of(&second, &path).await;
    assert_eq!((status.as_u16(), code.as_str()), (410, "session_lost"));
}

#[tokio::test]
async fn without_a_database_only_a_named_instance_supposes_others() {
    let named = Service::start(&["--instance", "1"]).await;
    let path = named.session("cloth").await;
    let again = Service::start(&["--instance", "1"]).await;
    let other = Service::start(&["--instance", "2"]).await;
    let alone = Service::start(&[]).await;
    for (service, status, code) in [
        (&again, 410, "session_lost"),
        (&other, 421, "session_elsewhere"),
        (&alone, 410, "session_lost"),
    ] {
        let answer = code_of(service, &path).await;
        assert_eq!((answer.0.as_u16(), answer.1.as_str()), (status, code));
    }
    for unknown in ["x", "6f1e8b0a-0000-4000-8000-000000000000", "6f1e8b0a"] {
        let answer = code_of(&alone, &format!("/sessions/{unknown}")).await;
        assert_eq!(answer.1, "session_not_found");
    }
}

#[tokio::test]
async fn a_process_without_workers_has_others_mend() {
    let shared = Shared::new().await;
    let hasty = shared
        .service(&["--workers", "0", "--deadline", "300ms"])
        .await;
    let door = shared.service(&["--workers", "0"]).await;
    // Nobody can mend it yet: the client is told where its job is.
    let waiting = hasty.scan("cloth").send().await.unwrap();
    assert_eq!(waiting.status(), 202);
    let job = waiting.headers()["location"].to_str().unwrap().to_owned();

    let worker = shared.service(&["--workers", "1"]).await;
    until(async || {
        door.get(&format!("{job}/result"))
            .send()
            .await
            .unwrap()
            .status()
            == 200
    })
    .await;
    let answer = door.scan("linen").send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["darn-holes-filled"], "1");
    assert_eq!(
        answer.bytes().await.unwrap(),
        FakeScan::named("linen").mended()
    );
    let refused = door.scan(Behaviour::RefuseNotADisk).send().await.unwrap();
    assert_eq!(problem(refused).await["code"], "not_a_disk");

    for path in ["/holes", "/strip", "/optimize-anchor", "/sessions"] {
        let request = door.post(path).header("content-type", "model/gltf-binary");
        let refused = request.body("{}").send().await.unwrap();
        assert_eq!(refused.status(), 421, "{path}");
        assert_eq!(problem(refused).await["code"], "no_workers");
    }
    let mut grpc = DarnClient::connect(door.url("")).await.unwrap();
    let refused = grpc.find_holes(chunks("cloth", None)).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    assert_eq!(refused.metadata().get("darn-code").unwrap(), "no_workers");
    // That of gRPC which is `POST /inpaint` is handed over like it.
    let answer = grpc.inpaint(chunks("wool", None)).await.unwrap();
    let result = answer.metadata().get("darn-result").unwrap();
    assert_eq!(result, "filled=1 skipped=0 doubtful=0");
    let (holes, bytes) = parts(answer.into_inner()).await;
    assert_eq!((holes, bytes), (1, FakeScan::named("wool").mended()));
    let refused = grpc.inpaint(chunks(Behaviour::RefuseNotADisk, None)).await;
    is_refused(refused, Code::FailedPrecondition, "not_a_disk");
    let empty = grpc.inpaint(tokio_stream::iter(Vec::new())).await;
    is_refused(empty, Code::InvalidArgument, "empty_body");
    let mut hasty = DarnClient::connect(hasty.url("")).await.unwrap();
    let late = hasty.inpaint(chunks(Behaviour::Hold, None)).await;
    let late = is_refused(late, Code::DeadlineExceeded, "deadline_exceeded");
    let job = late.metadata().get("darn-job").unwrap().to_str().unwrap();
    let found = door.get(&format!("/jobs/{job}")).send().await.unwrap();
    assert_eq!(found.status(), 200);
    worker.fake.release();
}

#[tokio::test]
async fn a_database_that_is_away_is_said_to_be_so() {
    let server = Server::start(&["-c", "fsync=off"]);
    let (url, folder) = (server.database().await, tempfile::tempdir().unwrap());
    let data = folder.path().to_str().unwrap();
    let service = Service::start(&["--data", data, "--database", &url]).await;
    // It ends with this value.
    drop(server);
    until(async || service.get("/jobs").send().await.unwrap().status() != 200).await;
    let later = service.scan("cloth").header("prefer", "respond-async");
    let scan = service.post("/jobs").body(FakeScan::named("cloth").bytes());
    for request in [
        service.get("/jobs"),
        service.get("/jobs/6f1e8b0a-0000-4000-8000-000000000000"),
        scan.header("content-type", "model/gltf-binary"),
        later,
    ] {
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), 503);
        assert_eq!(answer.headers()["retry-after"], "10");
        assert_eq!(problem(answer).await["code"], "jobs_unavailable");
    }
    let mut grpc = JobsClient::connect(service.url("")).await.unwrap();
    let refused = grpc.list(JobQuery::default()).await;
    let refused = is_refused(refused, Code::Unavailable, "jobs_unavailable");
    assert_eq!(refused.metadata().get("retry-after").unwrap(), "10");
    // What takes no job goes on.
    let answer = service.scan("linen").send().await.unwrap();
    assert_eq!(answer.status(), 200);
}

#[tokio::test]
async fn a_process_without_workers_needs_a_database() {
    let settings = [
        "darn",
        "--listen",
        "127.0.0.1:0",
        "--workers",
        "0",
        "--data",
        "/tmp",
    ];
    let settings = Settings::parse_from(settings).serve;
    let run = move || darn_serve::run(&settings, Arc::new(FakeMender::default()));
    let refused = tokio::task::spawn_blocking(run).await.unwrap();
    assert!(
        matches!(refused, Err(ServeError::AloneWithoutWorkers)),
        "{refused:?}"
    );
}
