//! The queue, the deadline, callers who leave, fairness, shutdown.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, problem, until};

#[tokio::test]
async fn a_full_queue_refuses_with_an_estimate() {
    let service = Service::start(&["--workers", "1", "--queue", "1"]).await;
    let running = tokio::spawn(service.scan(FakeScan::holding("first")).send());
    service.fake.wait_for_scan("first").await;
    let waiting = tokio::spawn(service.scan(FakeScan::holding("second")).send());
    until(|| async { service.metric("darn_jobs{state=\"waiting\"}").await == Some(1.0) }).await;

    let refused = service.scan("cloth").send().await.unwrap();
    let retry_after: u64 = refused.headers()["retry-after"]
        .to_str()
        .unwrap()
        .parse()
        .unwrap();
    assert!((1..=120).contains(&retry_after));
    insta::assert_snapshot!("queue_full", format!("{:#}", problem(refused).await));
    assert_eq!(service.get("/livez").send().await.unwrap().status(), 200);

    service.fake.release();
    assert_eq!(running.await.unwrap().unwrap().status(), 200);
    assert_eq!(waiting.await.unwrap().unwrap().status(), 200);
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn the_deadline_covers_waiting_and_running() {
    let service = Service::start(&["--workers", "1", "--deadline", "300ms"]).await;
    let running = tokio::spawn(service.scan(FakeScan::holding("held")).send());
    service.fake.wait_for_scan("held").await;
    let begun = Instant::now();
    let waited = service.scan("waits").send().await.unwrap();
    assert!(
        begun.elapsed() < Duration::from_secs(10),
        "the deadline waited for the running job"
    );
    insta::assert_snapshot!("deadline", format!("{:#}", problem(waited).await));
    assert_eq!(running.await.unwrap().unwrap().status(), 504);

    service.fake.release();
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
    assert!(!service.fake.saw("waits"), "an expired job ran");
}

#[tokio::test]
async fn a_job_whose_caller_left_does_not_run() {
    let service = Service::start(&["--workers", "1"]).await;
    let running = tokio::spawn(service.scan(FakeScan::holding("held")).send());
    service.fake.wait_for_scan("held").await;
    let leaving = tokio::spawn(service.scan("leaves").send());
    until(|| async { service.metric("darn_jobs{state=\"waiting\"}").await == Some(1.0) }).await;
    leaving.abort();
    // The place is free once the server sees the closed connection, which a test cannot observe.
    tokio::time::sleep(Duration::from_millis(200)).await;
    service.fake.release();
    assert_eq!(running.await.unwrap().unwrap().status(), 200);
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
    assert!(!service.fake.saw("leaves"));
    assert_eq!(
        service.metric("darn_jobs_total{end=\"skipped\"}").await,
        Some(1.0)
    );
}

#[tokio::test]
async fn no_caller_starves() {
    const REQUESTS: usize = 200;
    let service = Arc::new(Service::start(&["--workers", "1", "--queue", "8"]).await);
    let edit = format!("{}/inpaint", service.session("cloth").await);
    service.fake.every_edit(Behaviour::TakeTime);
    // Two send scans, two edit the same session; each sends the next request as soon as it is answered.
    let answered: Arc<[AtomicUsize; 4]> = Arc::default();
    let callers = (0..4).map(|caller| {
        let (service, edit, answered) = (service.clone(), edit.clone(), answered.clone());
        tokio::spawn(async move {
            while answered.iter().map(|n| n.load(Relaxed)).sum::<usize>() < REQUESTS {
                let request = match caller {
                    0 | 1 => service.scan(Behaviour::TakeTime),
                    _ => service.ask(&edit, "{}"),
                };
                assert_eq!(request.send().await.unwrap().status(), 200);
                answered[caller].fetch_add(1, Relaxed);
            }
        })
    });
    for caller in callers.collect::<Vec<_>>() {
        caller.await.unwrap();
    }
    for caller in answered.iter() {
        // Two callers who share a session get a sixth of one worker each.
        assert!(caller.load(Relaxed) > REQUESTS / 12, "{answered:?}");
    }
}

#[tokio::test]
async fn a_shutdown_waits_for_running_jobs() {
    let service = Service::start(&["--workers", "1"]).await;
    let running = tokio::spawn(service.scan(FakeScan::holding("held")).send());
    service.fake.wait_for_scan("held").await;
    service.stop.cancel();
    service.fake.release();
    assert_eq!(running.await.unwrap().unwrap().status(), 200);
    service.ended.await.unwrap().unwrap();
}

#[tokio::test]
async fn a_shutdown_waits_no_longer_than_the_drain() {
    let service = Service::start(&["--workers", "1", "--drain", "100ms"]).await;
    let running = tokio::spawn(service.scan(FakeScan::holding("held")).send());
    service.fake.wait_for_scan("held").await;
    service.stop.cancel();
    let ended = tokio::time::timeout(Duration::from_secs(10), service.ended).await;
    ended.expect("the drain was not bounded").unwrap().unwrap();
    service.fake.release();
    running.abort();
}
