//! Leases, and what becomes of attempts that crash.

use darn_jobs::{CRASHED, ExpiredLeases, JobError, Outcome, Progress, Signal, State};

use crate::bench::{Bench, Engine, PAST_LEASE, claim, failed, law, product, submit};

fn progress() -> Progress {
    Progress {
        stage: "flatten".to_owned(),
        hole: 1,
        holes: 3,
    }
}

law! {
    async fn a_late_worker_changes_nothing(bench: Bench) {
        let jobs = bench.open().await;
        let store = jobs.store();
        submit(&jobs, "client").await;
        let late = claim(store).await.unwrap();
        bench.clock.advance(PAST_LEASE);
        store.expire_leases(ExpiredLeases::ByTime).await.unwrap();
        let winner = claim(store).await.unwrap();
        assert_eq!(winner.job.id, late.job.id);
        assert_eq!(winner.job.attempt, 2);

        let before = jobs.get(late.job.id).await.unwrap();
        let lost = |result: Result<(), JobError>| assert!(matches!(result, Err(JobError::LeaseLost(_))), "{result:?}");
        lost(store.renew(late.lease).await.map(drop));
        lost(store.progress(late.lease, &progress()).await.map(drop));
        for outcome in [product(&late), failed(), Outcome::Cancelled, Outcome::GivenBack] {
            lost(store.end(late.lease, &outcome).await.map(drop));
        }
        assert_eq!(jobs.get(late.job.id).await.unwrap(), before);

        let done = store.end(winner.lease, &product(&winner)).await.unwrap();
        assert_eq!(done.state, State::Done);
        lost(store.end(late.lease, &product(&late)).await.map(drop));
    }
}

law! {
    async fn an_end_that_was_written_may_be_written_again(bench: Bench) {
        let jobs = bench.open().await;
        submit(&jobs, "client").await;
        let claimed = claim(jobs.store()).await.unwrap();
        let first = jobs.store().end(claimed.lease, &product(&claimed)).await.unwrap();
        let second = jobs.store().end(claimed.lease, &product(&claimed)).await.unwrap();
        assert_eq!(first, second);
    }
}

law! {
    async fn a_renewed_lease_does_not_run_out(bench: Bench) {
        let jobs = bench.open().await;
        submit(&jobs, "client").await;
        let claimed = claim(jobs.store()).await.unwrap();
        for _ in 0..5 {
            bench.clock.advance(20_000);
            assert_eq!(jobs.store().renew(claimed.lease).await.unwrap(), Signal::Continue);
            assert_eq!(jobs.expire_leases().await.unwrap(), 0);
        }
        bench.clock.advance(20_000);
        jobs.store().progress(claimed.lease, &progress()).await.unwrap();
        bench.clock.advance(20_000);
        assert_eq!(jobs.expire_leases().await.unwrap(), 0);
        let running = jobs.get(claimed.job.id).await.unwrap();
        // Renewing shows nothing, telling progress does.
        assert_eq!(running.version, claimed.job.version + 1);
        assert_eq!(running.progress, Some(progress()));
        bench.clock.advance(PAST_LEASE);
        assert_eq!(jobs.expire_leases().await.unwrap(), 1);
        assert_eq!(jobs.expire_leases().await.unwrap(), 0);
    }
}

law! {
    async fn a_job_that_crashes_three_workers_is_given_up_and_can_be_retried(bench: Bench) {
        let jobs = bench.open().await;
        let id = submit(&jobs, "client").await.id;
        for attempt in 1..=3 {
            let claimed = claim(jobs.store()).await.unwrap();
            assert_eq!((claimed.job.id, claimed.job.attempt), (id, attempt));
            bench.clock.advance(PAST_LEASE);
            assert_eq!(jobs.expire_leases().await.unwrap(), 1);
        }
        let job = jobs.get(id).await.unwrap();
        assert_eq!(job.state, State::Error);
        assert_eq!(job.failure.unwrap().code, CRASHED);
        assert!(claim(jobs.store()).await.is_none());

        let job = jobs.retry(id).await.unwrap();
        assert_eq!((job.state, job.attempt, job.failure), (State::Waiting, 0, None));
        let claimed = claim(jobs.store()).await.unwrap();
        let done = jobs.store().end(claimed.lease, &product(&claimed)).await.unwrap();
        assert_eq!((done.state, done.attempt), (State::Done, 1));
    }
}

law! {
    async fn giving_back_costs_nothing(bench: Bench) {
        let jobs = bench.open().await;
        let first = submit(&jobs, "client").await;
        submit(&jobs, "client").await;
        for _ in 0..10 {
            let claimed = claim(jobs.store()).await.unwrap();
            // Its place in the queue stays, and no attempt counts.
            assert_eq!((claimed.job.id, claimed.job.attempt), (first.id, 1));
            let job = jobs.store().end(claimed.lease, &Outcome::GivenBack).await.unwrap();
            assert_eq!((job.state, job.attempt), (State::Waiting, 0));
        }
    }
}

law! {
    async fn a_running_job_is_cancelled_through_its_worker(bench: Bench) {
        let jobs = bench.open().await;
        let how_it_ends = [Some(Outcome::Cancelled), Some(Outcome::GivenBack), None];
        for outcome in how_it_ends {
            let id = submit(&jobs, "client").await.id;
            let claimed = claim(jobs.store()).await.unwrap();
            let told = jobs.cancel(id).await.unwrap();
            assert_eq!((told.state, told.cancel_wanted), (State::Running, true));
            // Twice is the same as once.
            assert_eq!(jobs.cancel(id).await.unwrap(), told);
            assert_eq!(jobs.store().renew(claimed.lease).await.unwrap(), Signal::Cancel);
            assert_eq!(jobs.store().progress(claimed.lease, &progress()).await.unwrap(), Signal::Cancel);
            match outcome {
                Some(outcome) => drop(jobs.store().end(claimed.lease, &outcome).await.unwrap()),
                // The worker dies instead.
                None => {
                    bench.clock.advance(PAST_LEASE);
                    assert_eq!(jobs.expire_leases().await.unwrap(), 1);
                }
            }
            let job = jobs.get(id).await.unwrap();
            assert_eq!((job.state, job.cancel_wanted), (State::Cancelled, false));
            assert!(claim(jobs.store()).await.is_none());
        }
    }
}

law! {
    async fn a_deleted_job_takes_the_lease_with_it(bench: Bench) {
        let jobs = bench.open().await;
        let id = submit(&jobs, "client").await.id;
        let claimed = claim(jobs.store()).await.unwrap();
        jobs.delete(id).await.unwrap();
        let ended = jobs.store().end(claimed.lease, &product(&claimed)).await;
        assert!(matches!(ended, Err(JobError::LeaseLost(_))), "{ended:?}");
        assert!(matches!(jobs.get(id).await, Err(JobError::NoSuchJob(_))));
    }
}

#[tokio::test]
async fn postgres_tells_the_time_itself() {
    let mut bench = Bench::new(Engine::Postgres).await;
    bench.settings.clock = darn_jobs::Clock::OfStore;
    let jobs = bench.open().await;
    let before = std::time::UNIX_EPOCH.elapsed().unwrap().as_millis() as i64;
    let job = submit(&jobs, "client").await;
    // The server of the tests runs on this machine.
    let after = std::time::UNIX_EPOCH.elapsed().unwrap().as_millis() as i64;
    assert!(
        (before..=after).contains(&job.created_at),
        "{before} {job:?} {after}"
    );
    let claimed = claim(jobs.store()).await.unwrap();
    assert_eq!(jobs.expire_leases().await.unwrap(), 0);
    jobs.store()
        .end(claimed.lease, &Outcome::GivenBack)
        .await
        .unwrap();
}
