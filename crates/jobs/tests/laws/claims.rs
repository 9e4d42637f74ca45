//! Who is served next.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use darn_jobs::{Claimant, Company, RunningLimits, Submission};

use crate::bench::{Bench, PAST_LEASE, claim, law, product, submission, submit};

law! {
    async fn a_flood_does_not_hold_up_another_client(bench: Bench) {
        let jobs = bench.open().await;
        for _ in 0..1000 {
            submit(&jobs, "flood").await;
        }
        let only = submit(&jobs, "polite").await;
        assert_eq!(claim(jobs.store()).await.unwrap().job.client, "flood");
        assert_eq!(claim(jobs.store()).await.unwrap().job.id, only.id);
        // Nobody else waits: the flood may have all the workers.
        assert_eq!(claim(jobs.store()).await.unwrap().job.client, "flood");
        assert_eq!(jobs.client_counts("flood").await.unwrap().running, 2);
    }
}

law! {
    async fn workers_are_shared_out_evenly(bench: Bench) {
        let jobs = bench.open().await;
        // The greedy one is older, larger and more urgent.
        for (client, count, priority) in [("greedy", 40, 9), ("b", 12, 0), ("c", 12, 5)] {
            for _ in 0..count {
                let submission = Submission { priority, ..submission(client) };
                jobs.submit(submission, &b"scan"[..]).await.unwrap();
            }
        }
        let mut running: BTreeMap<String, Vec<_>> = BTreeMap::new();
        for step in 0..30 {
            let claimed = claim(jobs.store()).await.unwrap();
            running.entry(claimed.job.client.clone()).or_default().push(claimed);
            // Jobs end in another order than they began.
            if step % 3 == 2 {
                let longest = running.values_mut().max_by_key(|jobs| jobs.len()).unwrap();
                let ended = longest.remove(0);
                jobs.store().end(ended.lease, &product(&ended)).await.unwrap();
            }
            let counts: Vec<_> = running.values().map(Vec::len).collect();
            let spread = counts.iter().max().unwrap() - counts.iter().min().unwrap();
            assert!(spread <= 1, "step {step}: {counts:?}");
        }
    }
}

law! {
    async fn a_clients_jobs_start_by_priority_and_then_by_age(bench: Bench) {
        let jobs = bench.open().await;
        let mut submitted = Vec::new();
        for priority in [0, 5, -1, 5, 0] {
            let submission = Submission { priority, ..submission("client") };
            let job = jobs.submit(submission, &b"scan"[..]).await.unwrap().into_job();
            submitted.push((-priority, job.number));
        }
        submitted.sort_unstable();
        for place in submitted {
            let job = claim(jobs.store()).await.unwrap().job;
            assert_eq!((-job.priority, job.number), place);
        }
    }
}

law! {
    async fn claims_at_once_never_give_an_attempt_out_twice(bench: Bench) {
        const JOBS: usize = 120;
        let first = bench.open().await;
        // A second machine, where there can be one.
        let second = match bench.place {
            darn_jobs::Place::Folder(_) => first.clone(),
            darn_jobs::Place::Shared { .. } => bench.open().await,
        };
        for number in 0..JOBS {
            submit(&first, &format!("client {}", number % 3)).await;
        }
        let tasks = (0..8).map(|task| {
            let jobs = if task % 2 == 0 { first.clone() } else { second.clone() };
            tokio::spawn(async move {
                let mut mine = Vec::new();
                // Another task may have taken the one row that this one tried for: only an empty queue is the end.
                while jobs.counts().await.unwrap()[&darn_jobs::State::Waiting] > 0 {
                    mine.extend(claim(jobs.store()).await);
                }
                mine
            })
        });
        let mut attempts = BTreeSet::new();
        for task in tasks.collect::<Vec<_>>() {
            for claimed in task.await.unwrap() {
                assert!(attempts.insert((claimed.job.id, claimed.job.attempt)), "{claimed:?}");
            }
        }
        assert_eq!(attempts.len(), JOBS);
    }
}

law! {
    async fn a_job_that_was_near_a_crash_runs_alone(bench: Bench) {
        let jobs = bench.open().await;
        let suspect = submit(&jobs, "client").await.id;
        claim(jobs.store()).await.unwrap();
        bench.clock.advance(PAST_LEASE);
        jobs.expire_leases().await.unwrap();
        submit(&jobs, "client").await;
        let shared = Claimant { worker: "worker", company: Company::Shared, limits: None };
        // It is next, and it must be alone: so nothing starts beside the jobs that run.
        assert_eq!(jobs.store().claim(&shared).await.unwrap(), None);

        let mut alone = jobs.claim("worker").await.unwrap().unwrap();
        assert_eq!(alone.job().id, suspect);
        assert!(jobs.claim("worker").await.unwrap().is_none(), "nothing starts beside it");
        alone.cancelled().await.unwrap();
        drop(alone);
        submit(&jobs, "another").await;
        let mut beside = Vec::new();
        for _ in 0..2 {
            beside.push(jobs.claim("worker").await.unwrap().unwrap());
        }
        assert!(jobs.claim("worker").await.unwrap().is_none());
    }
}

law! {
    async fn no_more_jobs_of_a_client_run_than_may(bench: Bench) {
        let jobs = bench.open().await;
        // More clients than a claim tries in turn where none has a limit, all of them in front of the last one.
        let limits: Arc<RunningLimits> = Arc::new((0..40).map(|n| (format!("client {n:02}"), 1)).collect());
        for client in limits.keys() {
            submit(&jobs, client).await;
            submit(&jobs, client).await;
        }
        submit(&jobs, "without a limit").await;
        submit(&jobs, "without a limit").await;
        let mut running = BTreeMap::new();
        let mut claimed = Vec::new();
        while let Some(job) = jobs.claim_within("worker", &limits).await.unwrap() {
            *running.entry(job.job().client.clone()).or_insert(0) += 1;
            claimed.push(job);
        }
        assert_eq!(running.remove("without a limit"), Some(2));
        assert!(running.len() == limits.len() && running.values().all(|count| *count == 1), "{running:?}");
        // One that ends makes room for the next of its client.
        let mut first = claimed.remove(0);
        let client = first.job().client.clone();
        first.cancelled().await.unwrap();
        let next = jobs.claim_within("worker", &limits).await.unwrap().unwrap();
        assert_eq!(next.job().client, client);
        assert!(jobs.claim_within("worker", &limits).await.unwrap().is_none());
    }
}
