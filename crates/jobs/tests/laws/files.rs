//! Rows and files belong together, whatever broke off between two steps.

use std::{
    collections::BTreeSet,
    io::{Error, ErrorKind},
    pin::Pin,
    task::{Context, Poll},
    time::Duration,
};

use darn_jobs::{
    JobError, Jobs, ListQuery, Outcome, Place, Product, Retention, State, Submitted,
    blobs::BlobName,
};
use tokio::{
    io::{AsyncRead, AsyncReadExt, ReadBuf},
    time::timeout,
};

use crate::bench::{Bench, Engine, claim, failed, law_of_files, submission, submit, until};

/// The files that rows name.
async fn named(jobs: &Jobs) -> Vec<String> {
    let query = ListQuery {
        client: None,
        state: None,
        before: None,
        limit: 1000,
    };
    let page = jobs.list(&query).await.unwrap();
    let names: BTreeSet<_> = (page.jobs.iter())
        .flat_map(|job| job.blobs().map(ToString::to_string))
        .collect();
    names.into_iter().collect()
}

/// Opens the jobs after a crash, and takes everything without a row for old.
async fn reopen(bench: &Bench) -> std::sync::Arc<Jobs> {
    let jobs = bench.open().await;
    if matches!(bench.place, Place::Shared { .. }) {
        bench.clock.advance(crate::bench::PAST_LEASE);
        jobs.expire_leases().await.unwrap();
        jobs.sweep(Duration::ZERO).await.unwrap();
    }
    jobs
}

law_of_files! {
    async fn a_crash_between_two_steps_leaves_nothing_behind_and_loses_nothing(bench: Bench) {
        let jobs = bench.open().await;
        // Submitting: while the input is received, and between its rename and its row.
        bench.plant("incoming/torn", "half a sc");
        jobs.blobs().put(&BlobName::input(crate::bench::nobody()), &b"scan"[..]).await.unwrap();
        // Finishing: between the result's rename and the row, and between the row and the deletion of the input.
        let unfinished = submit(&jobs, "a").await.id;
        let finished = submit(&jobs, "b").await.id;
        for _ in 0..2 {
            let claimed = claim(jobs.store()).await.unwrap();
            let product = Product {
                result: BlobName::result(claimed.lease),
                report: BlobName::report(claimed.lease),
                bytes: 7,
                answer: "{}".to_owned(),
            };
            jobs.blobs().put(&product.result, &b"mended"[..]).await.unwrap();
            jobs.blobs().put(&product.report, &b"{"[..]).await.unwrap();
            if claimed.job.id == finished {
                jobs.store().end(claimed.lease, &Outcome::Done(product)).await.unwrap();
            }
        }
        // Deleting, and taking the files of old jobs: between the row and the files.
        let deleted = submit(&jobs, "c").await.id;
        jobs.store().delete(deleted).await.unwrap();
        let kept = submit(&jobs, "d").await.id;
        assert_ne!(bench.files(), named(&jobs).await);
        drop(jobs);

        let jobs = reopen(&bench).await;
        assert_eq!(bench.files(), named(&jobs).await);
        for (id, state, blobs) in [(unfinished, State::Waiting, 1), (finished, State::Done, 2), (kept, State::Waiting, 1)] {
            let job = jobs.get(id).await.unwrap();
            assert_eq!((job.state, job.blobs().count()), (state, blobs));
            for blob in job.blobs() {
                jobs.blobs().open_blob(blob).await.unwrap();
            }
        }
        assert_eq!(jobs.get(unfinished).await.unwrap().attempt, 1);
    }
}

law_of_files! {
    async fn files_that_are_young_or_not_ours_are_not_swept(bench: Bench) {
        let jobs = bench.open().await;
        bench.plant("blobs/00/README", "not ours");
        // Another machine is between the rename and the row.
        let input = BlobName::input(crate::bench::nobody());
        jobs.blobs().put(&input, &b"scan"[..]).await.unwrap();
        assert_eq!(jobs.sweep(Duration::from_secs(60)).await.unwrap(), 0);
        jobs.blobs().open_blob(&input).await.unwrap();
        assert_eq!(jobs.sweep(Duration::ZERO).await.unwrap(), 1);
        assert!(bench.path("blobs/00/README").exists());
    }
}

/// A body whose sender goes away after some bytes.
struct Broken(usize);

impl AsyncRead for Broken {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        if self.0 == 0 {
            return Poll::Ready(Err(Error::new(
                ErrorKind::ConnectionReset,
                "the client is gone",
            )));
        }
        let bytes = self.0.min(buf.remaining());
        buf.put_slice(&vec![7; bytes]);
        self.0 -= bytes;
        Poll::Ready(Ok(()))
    }
}

/// A body that never ends, and gives nothing after some bytes.
struct Stuck(usize);

impl AsyncRead for Stuck {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        if self.0 == 0 {
            return Poll::Pending;
        }
        let bytes = self.0.min(buf.remaining());
        buf.put_slice(&vec![7; bytes]);
        self.0 -= bytes;
        Poll::Ready(Ok(()))
    }
}

law_of_files! {
    async fn a_submission_that_breaks_off_leaves_nothing(bench: Bench) {
        let jobs = bench.open().await;
        // Within the first part of an upload, and after some.
        for bytes in [0, 1 << 20, 12 << 20] {
            let broken = jobs.submit(submission("client"), Broken(bytes)).await;
            assert!(matches!(broken, Err(JobError::Stream(_))), "{broken:?}");
            let dropped = jobs.submit(submission("client"), Stuck(bytes));
            timeout(Duration::from_millis(300), dropped).await.unwrap_err();
        }
        // An upload is aborted by a task.
        until(async || bench.files().is_empty()).await;
    }
}

law_of_files! {
    async fn what_went_in_comes_out(bench: Bench) {
        let jobs = bench.open().await;
        // Beside and across the sizes of the chunks that are written, and of the parts of an upload.
        for bytes in [0, 1, (256 << 10) - 1, 256 << 10, (256 << 10) + 1, 3 << 20, 5 << 20, (5 << 20) + 1, 11 << 20] {
            let input: Vec<u8> = (0..bytes).map(|place: u32| (place % 251) as u8).collect();
            let submitted = jobs.submit(submission("client"), &input[..]).await.unwrap();
            let Submitted::New(job) = submitted else { panic!("{submitted:?}") };
            assert_eq!(job.bytes, i64::from(bytes));
            let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
            let mut read = Vec::new();
            claimed.input().await.unwrap().read_to_end(&mut read).await.unwrap();
            assert!(read == input);
            read.reverse();
            let done = claimed.finish(&read[..], &b"report"[..], "answer".to_owned()).await.unwrap();
            assert_eq!((done.state, done.bytes, done.input), (State::Done, i64::from(bytes) + 6, None));
            let (job, mut file) = jobs.result(job.id).await.unwrap();
            let mut result = Vec::new();
            file.read_to_end(&mut result).await.unwrap();
            assert!(result == read);
            assert_eq!(job.answer.as_deref(), Some("answer"));
            let mut report = String::new();
            jobs.report(job.id).await.unwrap().1.read_to_string(&mut report).await.unwrap();
            assert_eq!(report, "report");
        }
        assert_eq!(bench.files(), named(&jobs).await);
    }
}

law_of_files! {
    async fn old_jobs_lose_their_files_and_then_their_rows(bench: Bench) {
        let mut bench = bench;
        bench.settings.retention = Retention { files_ms: 1000, rows_ms: 5000, ..Retention::default() };
        let jobs = bench.open().await;
        let finished = submit(&jobs, "a").await.id;
        let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
        claimed.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned()).await.unwrap();
        drop(claimed);
        let cancelled = submit(&jobs, "b").await.id;
        jobs.cancel(cancelled).await.unwrap();
        let waiting = submit(&jobs, "c").await.id;
        bench.clock.advance(999);
        assert_eq!(jobs.retain().await.unwrap(), 0);
        bench.clock.advance(1);
        assert_eq!(jobs.retain().await.unwrap(), 2);
        assert_eq!(bench.files(), [format!("{waiting}.input")]);
        assert!(matches!(jobs.result(finished).await, Err(JobError::Expired(_))));
        assert!(matches!(jobs.retry(cancelled).await, Err(JobError::Expired(_))));
        bench.clock.advance(4000);
        assert_eq!(jobs.retain().await.unwrap(), 2);
        for id in [finished, cancelled] {
            assert!(matches!(jobs.get(id).await, Err(JobError::NoSuchJob(_))));
        }
        // A job that waits is never too old.
        assert_eq!(jobs.get(waiting).await.unwrap().state, State::Waiting);
    }
}

law_of_files! {
    async fn the_caps_take_the_oldest_finished_jobs_first(bench: Bench) {
        let mut bench = bench;
        // Room for three inputs of four bytes, one of them of a job that waits; for four finished jobs.
        bench.settings.retention = Retention { bytes: 12, jobs: 4, ..Retention::default() };
        let jobs = bench.open().await;
        let mut ids = Vec::new();
        for _ in 0..6 {
            let id = submit(&jobs, "client").await.id;
            let claimed = claim(jobs.store()).await.unwrap();
            bench.clock.advance(1);
            jobs.store().end(claimed.lease, &failed()).await.unwrap();
            ids.push(id);
        }
        let waiting = submit(&jobs, "client").await.id;
        jobs.retain().await.unwrap();
        let mut expected: Vec<_> = [ids[4], ids[5], waiting].iter().map(|id| format!("{id}.input")).collect();
        expected.sort();
        assert_eq!(bench.files(), expected);
        for (place, id) in ids.iter().enumerate() {
            match jobs.get(*id).await {
                Ok(job) => assert_eq!((place >= 2, job.expired_at.is_some()), (true, place < 4)),
                Err(error) => assert!(matches!(error, JobError::NoSuchJob(_)) && place < 2, "{error}"),
            }
        }
    }
}

#[tokio::test]
async fn a_folder_is_one_processs_alone() {
    let bench = Bench::new(Engine::Sqlite).await;
    let jobs = bench.open().await;
    let second = Jobs::open(&bench.place, bench.settings.clone()).await;
    assert!(
        matches!(second, Err(JobError::FolderInUse(_))),
        "{second:?}"
    );
    drop(jobs);
    bench.open().await;
}
