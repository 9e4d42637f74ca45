//! Storage that speaks S3 where it refuses, is away, or has much.

use std::{net::TcpListener, time::Duration};

use darn_jobs::{
    JobError, Jobs, State, Submission,
    blobs::{BlobName, Blobs, Bucket, Files},
};
use tempfile::TempDir;
use tokio::{io::AsyncReadExt, time::timeout};

use crate::{
    bench::{Bench, Engine, nobody, submission, submit},
    s3::{KEY, S3, SECRET},
};

/// What opening the files says.
async fn refusal(bucket: Bucket) -> String {
    let error = Blobs::open(&Files::Bucket(bucket)).await.unwrap_err();
    let JobError::File { doing, source } = &error else {
        panic!("{error:?}")
    };
    // The log has all of it.
    let logged = format!("{error:?}");
    assert!(
        !logged.contains(KEY) && !logged.contains(SECRET),
        "{logged}"
    );
    format!("{doing}: {source}")
}

fn with(s3: &S3, bucket: &str, name: &str, value: &str) -> Bucket {
    let bucket: Bucket = bucket.parse().unwrap();
    let settings = s3
        .settings()
        .into_iter()
        .chain([(name.to_owned(), value.to_owned())]);
    bucket.with_settings(settings)
}

#[tokio::test]
async fn a_bucket_that_cannot_be_used_is_named_with_the_cause() {
    let folder = TempDir::new().unwrap();
    let mut s3 = S3::start(folder.path().join("s3"));
    let secret = "AWS_SECRET_ACCESS_KEY";
    let wrong = refusal(with(&s3, "s3://scans/darn", secret, "another-secret")).await;
    assert!(
        wrong.starts_with("cannot use s3://scans/darn: cannot write: SignatureDoesNotMatch"),
        "{wrong}"
    );
    let missing = refusal(with(&s3, "s3://no-such-bucket", secret, SECRET)).await;
    assert!(
        missing.starts_with("cannot use s3://no-such-bucket: ") && missing.contains("NoSuchBucket"),
        "{missing}"
    );
    let insecure = refusal(with(&s3, "s3://scans", "AWS_ALLOW_HTTP", "false")).await;
    assert!(insecure.contains("scheme"), "{insecure}");
    s3.stop();
    let away = refusal(s3.bucket()).await;
    assert!(away.contains("onnection refused"), "{away}");
}

#[tokio::test]
async fn a_storage_that_does_not_answer_is_not_waited_for_for_ever() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", silent.local_addr().unwrap());
    let bucket: Bucket = "s3://scans".parse().unwrap();
    let settings = [
        ("AWS_ENDPOINT_URL", url.as_str()),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_ACCESS_KEY_ID", KEY),
        ("AWS_SECRET_ACCESS_KEY", SECRET),
    ];
    let settings = settings.map(|(name, value)| (name.to_owned(), value.to_owned()));
    let opened = timeout(
        Duration::from_secs(120),
        refusal(bucket.with_settings(settings)),
    );
    let said = opened.await.expect("it gives up");
    assert!(
        said.contains("cannot write: no answer within 20s"),
        "{said}"
    );
}

#[tokio::test]
async fn while_the_storage_is_away_jobs_are_refused_and_nothing_is_lost() {
    let mut bench = Bench::new(Engine::PostgresAndS3).await;
    let jobs = bench.open().await;
    let mended = finish(&jobs, b"mended").await;
    let waiting = submit(&jobs, "client").await.id;
    let s3 = bench.s3.as_mut().unwrap();
    s3.stop();
    let refused = jobs.submit(submission("client"), &b"scan"[..]).await;
    let is_outage = |error: Option<&JobError>| error.is_some_and(JobError::is_outage);
    assert!(is_outage(refused.as_ref().err()), "{refused:?}");
    // It is not told as a file that is missing.
    let unread = jobs.result(mended).await;
    assert!(is_outage(unread.as_ref().err()), "{unread:?}");
    assert_eq!(jobs.get(waiting).await.unwrap().state, State::Waiting);
    s3.go_on();
    assert_eq!(read(&jobs, mended).await, b"mended");
    let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
    assert_eq!(claimed.job().id, waiting);
    claimed.input().await.unwrap();
    submit(&jobs, "client").await;
}

#[tokio::test]
async fn a_file_goes_on_where_the_connection_broke() {
    let mut bench = Bench::new(Engine::PostgresAndS3).await;
    let jobs = bench.open().await;
    // More than sockets buffer.
    let result: Vec<u8> = (0..32_u32 << 20).map(|place| (place % 251) as u8).collect();
    let id = finish(&jobs, &result).await;
    let (_, mut file) = jobs.result(id).await.unwrap();
    assert_eq!(file.bytes(), result.len() as u64);
    let mut found = vec![0; 1 << 20];
    file.read_exact(&mut found).await.unwrap();
    let s3 = bench.s3.as_mut().unwrap();
    s3.stop();
    s3.go_on();
    file.read_to_end(&mut found).await.unwrap();
    assert!(found == result);
}

#[tokio::test]
async fn files_that_are_missing_are_told_apart_and_deleted_already() {
    let folder = TempDir::new().unwrap();
    let s3 = S3::start(folder.path().join("s3"));
    let blobs = Blobs::open(&Files::Bucket(s3.bucket())).await.unwrap();
    let name = BlobName::input(nobody());
    let missing = blobs.open_blob(&name).await;
    assert!(
        matches!(missing, Err(JobError::BlobMissing(_))),
        "{missing:?}"
    );
    blobs.delete(&name).await.unwrap();
    // Nothing of the trial is left.
    let incoming = std::fs::read_dir(s3.objects().join("incoming"));
    assert_eq!(incoming.into_iter().flatten().count(), 0);
    let shown = format!("{blobs:?}");
    assert!(!shown.contains(KEY) && !shown.contains(SECRET), "{shown}");
}

#[tokio::test]
async fn more_files_than_an_answer_lists_are_all_found() {
    let folder = TempDir::new().unwrap();
    let s3 = S3::start(folder.path().join("s3"));
    let blobs = Blobs::open(&Files::Bucket(s3.bucket())).await.unwrap();
    for _ in 0..2100 {
        let name = nobody().to_string();
        let part = s3.objects().join("blobs").join(&name[..2]);
        std::fs::create_dir_all(&part).unwrap();
        std::fs::write(part.join(format!("{name}.input")), "").unwrap();
    }
    let found = blobs.unnamed(Duration::ZERO).await.unwrap();
    assert_eq!(found.len(), 2100);
    let found = blobs.unnamed(Duration::from_secs(60)).await.unwrap();
    assert_eq!(found, []);
}

/// A job that is done, with this result.
async fn finish(jobs: &std::sync::Arc<Jobs>, result: &[u8]) -> uuid::Uuid {
    let first = Submission {
        priority: 1,
        ..submission("client")
    };
    jobs.submit(first, &b"scan"[..]).await.unwrap();
    let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
    claimed.input().await.unwrap();
    let done = claimed.finish(result, &b"{}"[..], "{}".to_owned());
    done.await.unwrap().id
}

async fn read(jobs: &Jobs, id: uuid::Uuid) -> Vec<u8> {
    let (_, mut file) = jobs.result(id).await.unwrap();
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).await.unwrap();
    bytes
}
