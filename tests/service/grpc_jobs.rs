//! Jobs over gRPC: the same as over HTTP, with the same codes, keys and quotas.

use darn_contract::v1::{
    Anchor, Constraints, InpaintChunk, Job, JobChunk, JobEventsQuery, JobId, JobLabels, JobQuery,
    JobState, inpaint_chunk::Part,
};
use darn_serve::generated::jobs_client::JobsClient;
use serde_json::json;
use tempfile::TempDir;
use tonic::{
    Code, Request, Status, Streaming,
    codegen::tokio_stream::{self, Iter},
    transport::Channel,
};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::Service;
use crate::keyed::{Keyed, bearer, entry, limited};

type Client = JobsClient<Channel>;

async fn service(folder: &TempDir, settings: &[&str]) -> (Service, Client) {
    let data = ["--data", folder.path().to_str().unwrap()];
    let service = Service::start(&[&data, settings].concat()).await;
    let client = JobsClient::connect(service.url("")).await.unwrap();
    (service, client)
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// A scan in two chunks, the first with what is said of it.
fn chunks(scan: impl Into<FakeScan>, labels: JobLabels) -> Iter<std::vec::IntoIter<JobChunk>> {
    let scan = scan.into().bytes();
    let (head, tail) = scan.split_at(scan.len() / 2);
    let constraints = Constraints {
        anchors: vec![Anchor {
            position: vec![0.125, 1.0, 2.0],
            ..Anchor::default()
        }],
        ..Constraints::default()
    };
    tokio_stream::iter(vec![
        JobChunk {
            labels: Some(labels),
            constraints: Some(constraints),
            data: head.to_vec().into(),
        },
        JobChunk {
            data: tail.to_vec().into(),
            ..JobChunk::default()
        },
    ])
}

async fn submit(client: &mut Client, scan: impl Into<FakeScan>) -> Job {
    let answer = client.submit(chunks(scan, JobLabels::default())).await;
    answer.unwrap().into_inner()
}

fn id(job: &Job) -> JobId {
    JobId { id: job.id.clone() }
}

/// Follows a job to its end; the states that were told.
async fn states(client: &mut Client, job: &Job) -> Vec<JobState> {
    let query = JobEventsQuery {
        id: job.id.clone(),
        last_version: None,
    };
    let mut events = client.events(query).await.unwrap().into_inner();
    let mut states = Vec::new();
    while let Some(job) = events.message().await.unwrap() {
        states.push(job.state());
    }
    states
}

/// Of a mended scan: how many holes its report has, and its bytes.
pub async fn parts(mut chunks: Streaming<InpaintChunk>) -> (usize, Vec<u8>) {
    let Some(Part::Report(report)) = chunks.message().await.unwrap().unwrap().part else {
        panic!("the first chunk has the report");
    };
    let mut scan = Vec::new();
    while let Some(chunk) = chunks.message().await.unwrap() {
        let Some(Part::Data(data)) = chunk.part else {
            panic!("later chunks have bytes");
        };
        scan.extend_from_slice(&data);
    }
    (report.holes.len(), scan)
}

/// The status of a refusal, which has this code, and its word.
#[track_caller]
pub fn is_refused<T: std::fmt::Debug>(answer: Result<T, Status>, code: Code, word: &str) -> Status {
    let status = answer.unwrap_err();
    assert_eq!(status.code(), code, "{status:?}");
    assert_eq!(status.metadata().get("darn-code").unwrap(), word);
    assert!(status.metadata().get_bin("darn-problem-bin").is_some());
    status
}

#[tokio::test]
async fn a_job_lives_over_grpc_as_over_http() {
    let folder = folder();
    let (service, mut client) = service(&folder, &[]).await;
    let labels = JobLabels {
        name: Some("coat 7".to_owned()),
        priority: 5,
        idempotency_key: Some("a-1".to_owned()),
        ..JobLabels::default()
    };
    let scan = FakeScan::holding("cloth");
    let job = client.submit(chunks(scan.clone(), labels.clone())).await;
    let job = job.unwrap().into_inner();
    assert_eq!((job.name.as_deref(), job.priority), (Some("coat 7"), 5));
    assert_eq!(job.state(), JobState::Waiting);
    // A repeated call is answered with the first one's job, one with another payload is refused.
    let again = client.submit(chunks(scan.clone(), labels.clone())).await;
    assert_eq!(again.unwrap().into_inner().id, job.id);
    let other = client.submit(chunks("other", labels)).await;
    is_refused(other, Code::InvalidArgument, "idempotency_mismatch");
    service.fake.wait_for_scan("cloth").await;
    let early = client.result(id(&job)).await;
    is_refused(early, Code::FailedPrecondition, "job_unfinished");

    let mut follower = client.clone();
    let (followed, told) = (job.clone(), service.fake.clone());
    let states = tokio::spawn(async move { states(&mut follower, &followed).await });
    told.release();
    let states = states.await.unwrap();
    assert_eq!(states.last(), Some(&JobState::Done), "{states:?}");
    let done = client.get(id(&job)).await.unwrap().into_inner();
    assert_eq!(
        done.outcome.as_deref(),
        Some("filled=1 skipped=0 doubtful=0")
    );
    // Whoever has seen the end is told no more.
    let seen = JobEventsQuery {
        id: job.id.clone(),
        last_version: Some(done.version),
    };
    let mut events = client.events(seen).await.unwrap().into_inner();
    assert_eq!(events.message().await.unwrap(), None);

    let (holes, mended) = parts(client.result(id(&job)).await.unwrap().into_inner()).await;
    assert_eq!(holes, 1);
    let over_http = service
        .get(&format!("/jobs/{}/result", job.id))
        .send()
        .await;
    assert_eq!(over_http.unwrap().bytes().await.unwrap(), mended);
    let report = client.report(id(&job)).await.unwrap().into_inner();
    assert_eq!(report.notes, ["1 anchors"]);

    client.delete(id(&job)).await.unwrap();
    for unknown in [id(&job), JobId::default(), JobId { id: "7".to_owned() }] {
        is_refused(
            client.get(unknown.clone()).await,
            Code::NotFound,
            "no_such_job",
        );
        is_refused(client.result(unknown).await, Code::NotFound, "no_such_job");
    }
}

#[tokio::test]
async fn a_job_is_cancelled_tried_again_and_listed() {
    let folder = folder();
    let (_service, mut client) = service(&folder, &[]).await;
    let failed = submit(&mut client, Behaviour::RefuseNotADisk).await;
    assert_eq!(
        states(&mut client, &failed).await.last(),
        Some(&JobState::Error)
    );
    let problem = client.get(id(&failed)).await.unwrap().into_inner().problem;
    assert_eq!(problem.unwrap().code, "not_a_disk");
    is_refused(
        client.cancel(id(&failed)).await,
        Code::FailedPrecondition,
        "job_wrong_state",
    );
    let retried = client.retry(id(&failed)).await.unwrap().into_inner();
    assert_eq!(retried.state(), JobState::Waiting);
    states(&mut client, &failed).await;

    let running = submit(&mut client, Behaviour::UntilCancelled).await;
    client.cancel(id(&running)).await.unwrap();
    assert_eq!(
        states(&mut client, &running).await.last(),
        Some(&JobState::Cancelled)
    );

    let page = |limit, from| JobQuery {
        limit: Some(limit),
        from,
        state: None,
    };
    let first = client.list(page(1, None)).await.unwrap().into_inner();
    assert_eq!(first.jobs[0].id, running.id);
    let second = client.list(page(1, first.next)).await.unwrap().into_inner();
    assert_eq!((&second.jobs[0].id, second.next), (&failed.id, None));
    let of_state = JobQuery {
        state: Some(JobState::Cancelled.into()),
        ..JobQuery::default()
    };
    let cancelled = client.list(of_state).await.unwrap().into_inner();
    assert_eq!(cancelled.jobs.len(), 1);
    for bad in [
        page(0, None),
        page(201, None),
        page(1, Some("x".to_owned())),
        JobQuery {
            state: Some(9),
            ..JobQuery::default()
        },
    ] {
        is_refused(
            client.list(bad).await,
            Code::InvalidArgument,
            "malformed_request",
        );
    }
}

#[tokio::test]
async fn what_is_wrong_is_refused_at_once_and_not_kept() {
    let folder = folder();
    let (_service, mut client) = service(&folder, &["--body-limit", "1KiB"]).await;
    let chunk = |data: &[u8]| JobChunk {
        data: data.to_vec().into(),
        ..JobChunk::default()
    };
    let labelled = |labels: JobLabels| JobChunk {
        labels: Some(labels),
        ..chunk(b"{}")
    };
    let bad_anchor = Constraints {
        anchors: vec![Anchor {
            position: vec![1.0],
            ..Anchor::default()
        }],
        ..Constraints::default()
    };
    for (chunks, code, word) in [
        (vec![], Code::InvalidArgument, "empty_body"),
        (
            vec![chunk(&[0; 1025])],
            Code::ResourceExhausted,
            "body_too_large",
        ),
        (
            vec![chunk(b"{"), labelled(JobLabels::default())],
            Code::InvalidArgument,
            "malformed_request",
        ),
        (
            vec![labelled(JobLabels {
                priority: 101,
                ..JobLabels::default()
            })],
            Code::InvalidArgument,
            "malformed_request",
        ),
        (
            vec![labelled(JobLabels {
                webhook: Some("http://127.0.0.1/".to_owned()),
                ..JobLabels::default()
            })],
            Code::InvalidArgument,
            "malformed_request",
        ),
        (
            vec![labelled(JobLabels {
                webhook: Some("https://example.org/".to_owned()),
                ..JobLabels::default()
            })],
            Code::FailedPrecondition,
            "webhooks_off",
        ),
        (
            vec![JobChunk {
                constraints: Some(bad_anchor),
                ..chunk(b"{}")
            }],
            Code::InvalidArgument,
            "invalid_constraints",
        ),
    ] {
        let refused = client.submit(tokio_stream::iter(chunks)).await;
        is_refused(refused, code, word);
    }
    let list = client.list(JobQuery::default()).await.unwrap().into_inner();
    assert_eq!(list.jobs.len(), 0);

    let without = Service::start(&[]).await;
    let mut client = JobsClient::connect(without.url("")).await.unwrap();
    let refused = client.submit(tokio_stream::iter(vec![chunk(b"{}")])).await;
    is_refused(refused, Code::NotFound, "jobs_not_kept");
    is_refused(
        client.list(JobQuery::default()).await,
        Code::NotFound,
        "jobs_not_kept",
    );
}

#[tokio::test]
async fn keys_and_quotas_are_those_of_http() {
    let keys = [
        limited("lab", json!({ "waitingJobs": 1 })),
        entry("other", &["jobs"]),
        entry("mender", &["mend"]),
        entry("chief", &["admin"]),
    ];
    let keyed = Keyed::start(&keys, &["--workers", "1"]).await;
    let mut client = JobsClient::connect(keyed.service.url("")).await.unwrap();
    fn with_key<T>(id: &str, message: T) -> Request<T> {
        let mut request = Request::new(message);
        (request.metadata_mut()).insert("authorization", bearer(id).parse().unwrap());
        request
    }
    let held = |name| chunks(FakeScan::holding(name), JobLabels::default());
    let anonymous = client.list(JobQuery::default()).await;
    is_refused(anonymous, Code::Unauthenticated, "key_missing");
    for id in ["mender", "chief"] {
        // An administrator sees jobs and makes none.
        let refused = client.submit(with_key(id, held("a"))).await;
        is_refused(refused, Code::PermissionDenied, "insufficient_scope");
    }
    let running = client.submit(with_key("lab", held("a"))).await;
    let running = running.unwrap().into_inner();
    keyed.service.fake.wait_for_scan("a").await;
    let labelled = |name| {
        let idempotency_key = Some("second".to_owned());
        let labels = JobLabels {
            idempotency_key,
            ..JobLabels::default()
        };
        chunks(FakeScan::holding(name), labels)
    };
    let waiting = client.submit(with_key("lab", labelled("b"))).await;
    let waiting = waiting.unwrap().into_inner();
    let beyond = client.submit(with_key("lab", held("c"))).await;
    is_refused(beyond, Code::ResourceExhausted, "quota_exceeded");
    // A repeated call makes no job, so there need be no room for one.
    let again = client.submit(with_key("lab", labelled("b"))).await;
    assert_eq!(again.unwrap().into_inner().id, waiting.id);
    let other = client.submit(with_key("lab", labelled("another"))).await;
    is_refused(other, Code::InvalidArgument, "idempotency_mismatch");
    // For another key they do not exist.
    for job in [&running, &waiting] {
        let hidden = client.get(with_key("other", id(job))).await;
        is_refused(hidden, Code::NotFound, "no_such_job");
        let hidden = client.delete(with_key("other", id(job))).await;
        is_refused(hidden, Code::NotFound, "no_such_job");
        assert!(client.get(with_key("chief", id(job))).await.is_ok());
    }
    let none = client.list(with_key("other", JobQuery::default())).await;
    assert_eq!(none.unwrap().into_inner().jobs.len(), 0);
    let all = client.list(with_key("chief", JobQuery::default())).await;
    assert_eq!(all.unwrap().into_inner().jobs.len(), 2);
    keyed.service.fake.release();
}
