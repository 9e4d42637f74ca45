//! What clients can do with their jobs.

use darn_jobs::{JobError, ListQuery, State, Submission, Submitted};

use crate::bench::{Bench, claim, failed, law, nobody, product, submission, submit};

fn with_key(client: &str, key: &str) -> Submission {
    Submission {
        idempotency_key: Some(key.to_owned()),
        ..submission(client)
    }
}

law! {
    async fn a_repeated_key_is_answered_with_the_first_job(bench: Bench) {
        let jobs = bench.open().await;
        let first = jobs.submit(with_key("client", "key"), &b"scan"[..]).await.unwrap();
        let Submitted::New(first) = first else { panic!("{first:?}") };
        let claimed = claim(jobs.store()).await.unwrap();
        jobs.store().end(claimed.lease, &failed()).await.unwrap();
        let again = jobs.submit(with_key("client", "key"), &b"scan"[..]).await.unwrap();
        let Submitted::Repeated(again) = again else { panic!("{again:?}") };
        assert_eq!((again.id, again.state), (first.id, State::Error));

        // Where it stands in a trace is no part of the payload.
        let traced = Submission { trace: Some("00-1-2-01".to_owned()), ..with_key("client", "key") };
        let again = jobs.submit(traced, &b"scan"[..]).await.unwrap().into_job();
        assert_eq!((again.id, again.trace), (first.id, None));

        // Any part of the payload makes another one of it.
        let others = [
            (with_key("client", "key"), &b"another scan"[..]),
            (Submission { request: "[]".to_owned(), ..with_key("client", "key") }, &b"scan"[..]),
            (Submission { priority: 1, ..with_key("client", "key") }, &b"scan"[..]),
            (Submission { name: Some("name".to_owned()), ..with_key("client", "key") }, &b"scan"[..]),
            (Submission { webhook: Some("name".to_owned()), ..with_key("client", "key") }, &b"scan"[..]),
        ];
        for (submission, input) in others {
            let refused = jobs.submit(submission, input).await;
            assert!(matches!(refused, Err(JobError::IdempotencyMismatch { job }) if job == first.id), "{refused:?}");
        }
        // Nothing but the one input was kept.
        assert_eq!(bench.files(), [format!("{}.input", first.id)]);

        // The key is the client's own, and free again once its job is gone.
        for client in ["other", "client"] {
            let other = jobs.submit(with_key(client, "key"), &b"scan"[..]).await.unwrap();
            assert_eq!(matches!(other, Submitted::New(_)), client == "other");
        }
        jobs.delete(first.id).await.unwrap();
        let new = jobs.submit(with_key("client", "key"), &b"another scan"[..]).await.unwrap();
        assert!(matches!(new, Submitted::New(_)));
    }
}

law! {
    async fn submissions_at_once_with_one_key_make_one_job(bench: Bench) {
        let jobs = bench.open().await;
        let submissions = (0..8).map(|_| {
            let jobs = jobs.clone();
            tokio::spawn(async move { jobs.submit(with_key("client", "key"), &b"scan"[..]).await.unwrap().into_job().id })
        });
        let mut ids = Vec::new();
        for submission in submissions.collect::<Vec<_>>() {
            ids.push(submission.await.unwrap());
        }
        ids.dedup();
        assert_eq!(ids.len(), 1);
        assert_eq!(bench.files().len(), 1);
    }
}

law! {
    async fn a_state_allows_what_it_allows(bench: Bench) {
        let jobs = bench.open().await;
        let wrong = |result: Result<(), JobError>| assert!(matches!(result, Err(JobError::WrongState { .. })), "{result:?}");
        let id = submit(&jobs, "client").await.id;
        wrong(jobs.retry(id).await.map(drop));
        wrong(jobs.result(id).await.map(drop));
        let cancelled = jobs.cancel(id).await.unwrap();
        assert_eq!(cancelled.state, State::Cancelled);
        assert_eq!(jobs.cancel(id).await.unwrap(), cancelled);
        wrong(jobs.report(id).await.map(drop));
        assert_eq!(jobs.retry(id).await.unwrap().state, State::Waiting);
        let claimed = claim(jobs.store()).await.unwrap();
        wrong(jobs.retry(id).await.map(drop));
        jobs.store().end(claimed.lease, &product(&claimed)).await.unwrap();
        wrong(jobs.cancel(id).await.map(drop));
        wrong(jobs.retry(id).await.map(drop));
        jobs.delete(id).await.unwrap();
        for id in [id, nobody()] {
            let missing = |result: Result<(), JobError>| assert!(matches!(result, Err(JobError::NoSuchJob(_))), "{result:?}");
            missing(jobs.get(id).await.map(drop));
            missing(jobs.cancel(id).await.map(drop));
            missing(jobs.retry(id).await.map(drop));
            missing(jobs.result(id).await.map(drop));
            missing(jobs.delete(id).await);
        }
    }
}

law! {
    async fn pages_list_every_job_once_and_the_newest_first(bench: Bench) {
        let jobs = bench.open().await;
        for number in 0..23 {
            let job = submit(&jobs, ["a", "b"][number % 2]).await;
            if number % 3 == 0 {
                jobs.cancel(job.id).await.unwrap();
            }
        }
        for client in [None, Some("a".to_owned()), Some("nobody".to_owned())] {
            for state in [None, Some(State::Cancelled), Some(State::Running)] {
                let mut query = ListQuery { client: client.clone(), state, before: None, limit: 100 };
                let whole = jobs.list(&query).await.unwrap();
                assert_eq!(whole.next, None);
                assert!(whole.jobs.is_sorted_by_key(|job| -job.number));
                let fits = |job: &&darn_jobs::Job| client.as_ref().is_none_or(|client| job.client == *client)
                    && state.is_none_or(|state| job.state == state);
                assert_eq!(whole.jobs.iter().filter(fits).count(), whole.jobs.len());
                query.limit = 4;
                let mut parts = Vec::new();
                loop {
                    let page = jobs.list(&query).await.unwrap();
                    assert!(page.jobs.len() <= 4);
                    parts.extend(page.jobs);
                    match page.next {
                        Some(next) => query.before = Some(next),
                        None => break,
                    }
                }
                assert_eq!(parts, whole.jobs);
            }
        }
        let counts = jobs.counts().await.unwrap();
        assert_eq!((counts[&State::Waiting], counts[&State::Cancelled], counts[&State::Done]), (15, 8, 0));
        assert_eq!(jobs.client_counts("a").await.unwrap().waiting, 8);
    }
}
