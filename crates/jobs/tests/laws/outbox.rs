//! Ends of jobs that webhooks are told of: each is there, is tried by one at a time, and goes on where a process died.

use std::{collections::BTreeSet, time::Duration};

use darn_jobs::{
    Claimed, ClaimedDelivery, Delivery, DeliveryOutcome, Job, Jobs, Outcome, Retention, State,
    Submission, TryOutcome,
};

use crate::bench::{Bench, claim, failed, law, product, submission, submit};

/// How long a try may take.
const TRY: Duration = Duration::from_secs(60);

/// Makes a job of a client, which wants to be told of its end.
async fn told(jobs: &Jobs, client: &str) -> Job {
    let told = Submission {
        webhook: Some("https://example.org/hook?token=1".to_owned()),
        name: Some("coat 7".to_owned()),
        ..submission(client)
    };
    jobs.submit(told, &b"scan"[..]).await.unwrap().into_job()
}

/// Makes a job and cancels it.
async fn ended(jobs: &Jobs, client: &str) -> Job {
    let job = told(jobs, client).await;
    jobs.cancel(job.id).await.unwrap()
}

async fn next(jobs: &Jobs) -> Option<ClaimedDelivery> {
    jobs.store().claim_delivery(&[], TRY).await.unwrap()
}

async fn end(jobs: &Jobs, claimed: &ClaimedDelivery, outcome: TryOutcome) -> Option<Delivery> {
    jobs.store().end_delivery(claimed, &outcome).await.unwrap()
}

/// The delivery of a job.
async fn delivery(jobs: &Jobs, job: &Job) -> Option<Delivery> {
    let found = jobs.store().deliveries(&[job.id]).await.unwrap();
    found.get(&job.id).cloned()
}

fn failure(again_after: Option<Duration>) -> TryOutcome {
    TryOutcome::Failed {
        status: Some(500),
        error: "the receiver answered with 500".to_owned(),
        again_after,
    }
}

/// Runs what waits, as `outcome` says for the job of this id, until that one has ended an attempt.
async fn run(jobs: &Jobs, id: uuid::Uuid, outcome: impl Fn(&Claimed) -> Outcome) -> Job {
    loop {
        let claimed = claim(jobs.store()).await.unwrap();
        let outcome = match claimed.job.id == id {
            true => outcome(&claimed),
            false => product(&claimed),
        };
        let job = jobs.store().end(claimed.lease, &outcome).await.unwrap();
        if job.id == id {
            return job;
        }
    }
}

law! {
    async fn every_end_is_told_once_and_nothing_else_is(bench: Bench) {
        let jobs = bench.open().await;
        for how in ["cancelled", "done", "error", "deleted"] {
            submit(&jobs, "nobody listens").await;
            let id = told(&jobs, "client").await.id;
            assert_eq!(next(&jobs).await, None);
            let ended = match how {
                "cancelled" => Some(jobs.cancel(id).await.unwrap()),
                "done" => Some(run(&jobs, id, product).await),
                "error" => Some(run(&jobs, id, |_| failed()).await),
                _ => {
                    // What does not end it tells nothing.
                    run(&jobs, id, |_| Outcome::GivenBack).await;
                    jobs.delete(id).await.unwrap();
                    None
                }
            };
            let mut found = Vec::new();
            while let Some(ClaimedDelivery { delivery, .. }) = next(&jobs).await {
                assert_eq!((delivery.client.as_str(), delivery.name.as_deref()), ("client", Some("coat 7")));
                assert_eq!((delivery.tries, delivery.outcome), (1, DeliveryOutcome::Waiting));
                assert_eq!((delivery.state.word(), delivery.ended_at), (how, bench.clock.now()));
                found.push((delivery.job, delivery.version));
            }
            assert_eq!(found, Vec::from_iter(ended.map(|job| (job.id, job.version))), "{how}");
        }
    }
}

law! {
    async fn a_try_has_one_holder_and_a_late_end_changes_nothing(bench: Bench) {
        let jobs = bench.open().await;
        let job = ended(&jobs, "client").await;
        let first = next(&jobs).await.unwrap();
        assert_eq!(next(&jobs).await, None);
        bench.clock.advance(TRY.as_millis() as i64 - 1);
        assert_eq!(next(&jobs).await, None);
        bench.clock.advance(1);
        let second = next(&jobs).await.unwrap();
        assert_eq!((second.delivery.job, second.delivery.tries), (job.id, 2));
        for late in [TryOutcome::Delivered { status: 200 }, failure(None), TryOutcome::Disabled { status: 410 }, TryOutcome::GivenBack] {
            assert_eq!(end(&jobs, &first, late).await, None);
        }
        let delivered = end(&jobs, &second, TryOutcome::Delivered { status: 204 }).await.unwrap();
        assert_eq!((delivered.outcome, delivered.tries), (DeliveryOutcome::Delivered, 2));
        assert_eq!((delivered.last_status, delivered.last_error.as_ref(), delivered.next_try_at), (Some(204), None, None));
        assert_eq!(delivery(&jobs, &job).await, Some(delivered));
        bench.clock.advance(1_000_000_000);
        assert_eq!(next(&jobs).await, None);
        assert_eq!(jobs.store().waiting_deliveries().await.unwrap(), 0);
    }
}

law! {
    async fn claims_at_once_take_different_deliveries(bench: Bench) {
        let jobs = bench.open().await;
        for _ in 0..12 {
            ended(&jobs, "client").await;
        }
        let claims = (0..16).map(|_| {
            let jobs = jobs.clone();
            tokio::spawn(async move {
                // A row that another claim has just locked may be passed over.
                for _ in 0..20 {
                    if let Some(claimed) = next(&jobs).await {
                        return Some(claimed.delivery.job);
                    }
                }
                None
            })
        });
        let mut found = Vec::new();
        for claim in claims.collect::<Vec<_>>() {
            found.extend(claim.await.unwrap());
        }
        assert_eq!(found.len(), 12);
        assert_eq!(found.iter().collect::<BTreeSet<_>>().len(), 12);
    }
}

law! {
    async fn a_failed_try_waits_and_the_last_one_gives_up(bench: Bench) {
        let jobs = bench.open().await;
        let job = ended(&jobs, "client").await;
        let claimed = next(&jobs).await.unwrap();
        let now = bench.clock.now();
        let waiting = end(&jobs, &claimed, failure(Some(Duration::from_secs(5)))).await.unwrap();
        assert_eq!((waiting.outcome, waiting.next_try_at), (DeliveryOutcome::Waiting, Some(now + 5_000)));
        assert_eq!((waiting.last_status, waiting.last_try_at), (Some(500), Some(now)));
        assert_eq!(waiting.last_error.as_deref(), Some("the receiver answered with 500"));
        assert_eq!(jobs.store().waiting_deliveries().await.unwrap(), 1);
        bench.clock.advance(4_999);
        assert_eq!(next(&jobs).await, None);
        bench.clock.advance(1);
        let claimed = next(&jobs).await.unwrap();
        // A try that a shutdown broke off does not count.
        let given_back = end(&jobs, &claimed, TryOutcome::GivenBack).await.unwrap();
        assert_eq!((given_back.tries, given_back.next_try_at), (1, Some(bench.clock.now())));
        let claimed = next(&jobs).await.unwrap();
        let given_up = end(&jobs, &claimed, failure(None)).await.unwrap();
        assert_eq!((given_up.outcome, given_up.next_try_at, given_up.tries), (DeliveryOutcome::GivenUp, None, 2));
        bench.clock.advance(1_000_000_000);
        assert_eq!(next(&jobs).await, None);

        // What it does after a retry is another end.
        jobs.retry(job.id).await.unwrap();
        let again = jobs.cancel(job.id).await.unwrap();
        let claimed = next(&jobs).await.unwrap();
        assert_eq!((claimed.delivery.version, claimed.delivery.tries), (again.version, 1));
        assert_eq!(delivery(&jobs, &job).await.unwrap().version, again.version);
    }
}

law! {
    async fn a_receiver_that_wants_no_more_hears_no_more_of_the_job(bench: Bench) {
        let jobs = bench.open().await;
        let (job, other) = (ended(&jobs, "client").await, ended(&jobs, "client").await);
        let claimed = next(&jobs).await.unwrap();
        jobs.retry(job.id).await.unwrap();
        let again = jobs.cancel(job.id).await.unwrap();
        let disabled = end(&jobs, &claimed, TryOutcome::Disabled { status: 410 }).await.unwrap();
        assert_eq!((disabled.outcome, disabled.last_status), (DeliveryOutcome::Disabled, Some(410)));
        // Neither the end that waited nor one that comes later.
        jobs.retry(job.id).await.unwrap();
        jobs.cancel(job.id).await.unwrap();
        let newest = delivery(&jobs, &job).await.unwrap();
        assert_eq!((newest.version, newest.outcome), (again.version, DeliveryOutcome::Disabled));
        let next_one = next(&jobs).await.unwrap();
        assert_eq!(next_one.delivery.job, other.id);
        assert_eq!(next(&jobs).await, None);
    }
}

law! {
    async fn busy_clients_are_passed_over_and_the_longest_due_comes_first(bench: Bench) {
        let jobs = bench.open().await;
        let mut ids = Vec::new();
        for client in ["a", "a", "b", "c"] {
            ids.push(ended(&jobs, client).await.id);
            bench.clock.advance(10);
        }
        let busy = ["a".to_owned(), "b".to_owned()];
        let claimed = jobs.store().claim_delivery(&busy, TRY).await.unwrap().unwrap();
        assert_eq!(claimed.delivery.job, ids[3]);
        assert_eq!(jobs.store().claim_delivery(&busy, TRY).await.unwrap(), None);
        for id in &ids[..3] {
            assert_eq!(next(&jobs).await.unwrap().delivery.job, *id);
        }
    }
}

law! {
    async fn what_goes_with_its_job_and_what_a_new_process_finds(bench: Bench) {
        let jobs = bench.open().await;
        let (kept, deleted, forgotten) = (ended(&jobs, "c").await, ended(&jobs, "c").await, ended(&jobs, "c").await);
        let claimed = next(&jobs).await.unwrap();
        assert_eq!(claimed.delivery.job, kept.id);
        jobs.delete(deleted.id).await.unwrap();
        assert_eq!(delivery(&jobs, &deleted).await, None);
        jobs.close().await;
        drop(jobs);

        // The process ended in the middle of a try. On a folder nobody else can have it: it is due at once.
        let jobs = bench.open().await;
        if matches!(bench.place, darn_jobs::Place::Shared { .. }) {
            let other = next(&jobs).await.unwrap();
            assert_eq!(other.delivery.job, forgotten.id);
            assert_eq!(next(&jobs).await, None);
            bench.clock.advance(TRY.as_millis() as i64);
        }
        let mut due = BTreeSet::new();
        while let Some(claimed) = next(&jobs).await {
            due.insert(claimed.delivery.job);
        }
        assert_eq!(due, BTreeSet::from([kept.id, forgotten.id]));

        bench.clock.advance(Retention::default().rows_ms);
        jobs.retain().await.unwrap();
        assert_eq!(jobs.counts().await.unwrap()[&State::Cancelled], 0);
        assert_eq!(jobs.store().deliveries(&[kept.id, forgotten.id]).await.unwrap().len(), 0);
        assert_eq!(jobs.store().waiting_deliveries().await.unwrap(), 0);
    }
}

law! {
    async fn whoever_delivers_is_woken_by_an_end(bench: Bench) {
        let mut bench = bench;
        bench.settings.poll = Duration::from_secs(3600);
        let jobs = bench.open().await;
        let job = told(&jobs, "client").await;
        let mut claimed = jobs.claim("worker").await.unwrap().unwrap();
        claimed.fail(darn_jobs::Failure { code: "no_holes".to_owned(), message: "none".to_owned() }, None).await.unwrap();
        let woken = tokio::time::timeout(Duration::from_secs(20), jobs.look_for_deliveries()).await;
        woken.expect("nobody was woken");
        assert_eq!(next(&jobs).await.unwrap().delivery.job, job.id);
    }
}
