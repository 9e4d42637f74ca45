//! A worker's view: claimed jobs, kept leases, news.

use std::time::Duration;

use darn_jobs::{Failure, JobError, Place, Progress, State, StopReason, Submission};
use sqlx::{Connection, PgConnection};
use tokio::time::{sleep, timeout};

use crate::bench::{Bench, Engine, SOON, law_of_files, submission, submit, until};

law_of_files! {
    async fn a_worker_waits_for_a_job_and_keeps_its_lease(bench: Bench) {
        let jobs = bench.open().await;
        let worker = tokio::spawn({
            let jobs = jobs.clone();
            async move { jobs.next_job("worker").await }
        });
        let id = submit(&jobs, "client").await.id;
        let mut claimed = timeout(SOON, worker).await.unwrap().unwrap();
        claimed.input().await.unwrap();
        assert_eq!(claimed.job().worker.as_deref(), Some("worker"));
        for _ in 0..4 {
            // A third of a lease at a time, with time for some renewals after each.
            bench.clock.advance(10_000);
            sleep(Duration::from_millis(500)).await;
            assert_eq!(jobs.expire_leases().await.unwrap(), 0);
        }
        claimed.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned()).await.unwrap();
        assert_eq!(jobs.get(id).await.unwrap().state, State::Done);
    }
}

law_of_files! {
    async fn progress_and_the_end_are_news(bench: Bench) {
        let jobs = bench.open().await;
        let submitted = submit(&jobs, "client").await;
        let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
        claimed.input().await.unwrap();
        let running = jobs.changed_since(submitted.id, submitted.version).await.unwrap();
        assert_eq!((running.state, running.version), (State::Running, 2));
        let news_since = |version| {
            let (jobs, id) = (jobs.clone(), submitted.id);
            let news = tokio::spawn(async move { jobs.changed_since(id, version).await });
            async { timeout(SOON, news).await.unwrap().unwrap() }
        };
        let progress = |hole| Progress { stage: "patch".to_owned(), hole, holes: 900 };
        let news = news_since(running.version);
        // Far more often than it is written: the last one counts.
        for hole in 0..=900 {
            claimed.attempt().report(progress(hole));
        }
        let told = news.await.unwrap();
        assert_eq!((told.progress, told.version), (Some(progress(900)), 3));
        let news = news_since(told.version);
        let failure = Failure { code: "no_holes".to_owned(), message: "none".to_owned() };
        claimed.fail(failure.clone(), Some("[]".to_owned())).await.unwrap();
        let ended = news.await.unwrap();
        assert_eq!((ended.state, ended.failure, ended.progress), (State::Error, Some(failure), None));
        let news = news_since(ended.version);
        jobs.delete(submitted.id).await.unwrap();
        assert!(matches!(news.await, Err(JobError::NoSuchJob(_))));
    }
}

law_of_files! {
    async fn a_worker_hears_of_cancellation_and_of_deletion(bench: Bench) {
        let mut bench = bench;
        // The next renewal is far: the news is what it hears.
        bench.settings.renewal = Duration::from_secs(3600);
        let jobs = bench.open().await;
        for reason in [StopReason::Cancelled, StopReason::LeaseLost] {
            let id = submit(&jobs, "client").await.id;
            let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
            claimed.input().await.unwrap();
            let attempt = claimed.attempt();
            assert_eq!(attempt.stop_reason(), None);
            match reason {
                StopReason::Cancelled => drop(jobs.cancel(id).await.unwrap()),
                StopReason::LeaseLost => jobs.delete(id).await.unwrap(),
            }
            until(async || attempt.stop_reason() == Some(reason)).await;
            match reason {
                StopReason::Cancelled => assert_eq!(claimed.cancelled().await.unwrap().state, State::Cancelled),
                StopReason::LeaseLost => {
                    let ended = claimed.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned()).await;
                    assert!(matches!(ended, Err(JobError::LeaseLost(_))), "{ended:?}");
                }
            }
        }
        // The files of the attempt that came too late are gone; the cancelled job's input is kept.
        assert_eq!(bench.files().len(), 1);
    }
}

law_of_files! {
    async fn a_claim_that_nobody_takes_is_given_back(bench: Bench) {
        let jobs = bench.open().await;
        let id = submit(&jobs, "client").await.id;
        // Given up before it is answered, at the first moments that there are.
        for polls in 0..20_u64 {
            let claim = jobs.claim("worker");
            let _ = timeout(Duration::from_micros(100 * polls), claim).await;
        }
        until(async || {
            let job = jobs.get(id).await.unwrap();
            (job.state, job.attempt) == (State::Waiting, 0)
        }).await;
        let claimed = timeout(SOON, jobs.next_job("worker")).await.unwrap();
        assert_eq!(claimed.job().attempt, 1);
    }
}

law_of_files! {
    async fn poison_is_given_up_and_its_neighbours_succeed(bench: Bench) {
        let jobs = bench.open().await;
        let poison = Submission { name: Some("poison".to_owned()), ..submission("a") };
        let poison = jobs.submit(poison, &b"scan"[..]).await.unwrap().into_job().id;
        let mut neighbours = Vec::new();
        for client in ["a", "b", "c", "d"] {
            neighbours.push(submit(&jobs, client).await.id);
        }
        let mut crashes = 0;
        // A process with three workers that runs what it may get, and dies with all of it when the poison is among it.
        loop {
            let mut claimed = Vec::new();
            for _ in 0..3 {
                claimed.extend(jobs.claim("worker").await.unwrap());
            }
            if claimed.is_empty() {
                break;
            }
            for job in &mut claimed {
                job.input().await.unwrap();
            }
            if claimed.iter().any(|job| job.job().id == poison) {
                crashes += 1;
                drop(claimed);
                bench.clock.advance(crate::bench::PAST_LEASE);
                jobs.expire_leases().await.unwrap();
            } else {
                for mut job in claimed {
                    job.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned()).await.unwrap();
                }
            }
        }
        assert_eq!(crashes, 3);
        assert_eq!(jobs.get(poison).await.unwrap().failure.unwrap().code, darn_jobs::CRASHED);
        for id in neighbours {
            assert_eq!(jobs.get(id).await.unwrap().state, State::Done);
        }
    }
}

#[tokio::test]
async fn connections_to_postgres_may_break() {
    const BREAK: &str = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
        WHERE datname = current_database() AND pid <> pg_backend_pid()";
    let bench = Bench::new(Engine::Postgres).await;
    let Place::Shared { url, .. } = &bench.place else {
        unreachable!("it is on PostgreSQL")
    };
    let jobs = bench.open().await;
    let mut other = PgConnection::connect(url).await.unwrap();
    for _ in 0..3 {
        submit(&jobs, "client").await;
        let mut claimed = timeout(SOON, jobs.next_job("worker")).await.unwrap();
        claimed.input().await.unwrap();
        sqlx::query(BREAK).execute(&mut other).await.unwrap();
        let result = claimed.finish(&b"mended"[..], &b"{}"[..], "{}".to_owned());
        let job = result.await.unwrap();
        sqlx::query(BREAK).execute(&mut other).await.unwrap();
        assert_eq!(jobs.get(job.id).await.unwrap().state, State::Done);
    }
}
