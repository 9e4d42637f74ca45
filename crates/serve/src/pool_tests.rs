//! Tests of the pool: order, limits, deadlines, budget, panics.

use std::sync::mpsc;

use darn_budget::Limits;

use super::*;
use crate::telemetry::Metrics;
use crate::{client::ClientId, client_address::ClientAddress};

fn pool(workers: usize, queue: usize) -> Pool {
    Pool::start(workers, queue, Metrics::new().unwrap().pool()).unwrap()
}

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

/// A job that costs 1 and has no limits but its deadline.
fn by(deadline: Instant) -> TaskOrder {
    TaskOrder {
        cost: 1,
        deadline,
        limits: Limits::default(),
    }
}

/// A job that reports when it has begun, and runs until it is released.
fn held() -> (
    impl FnOnce(&Budget<'_>) + Send + 'static,
    mpsc::Receiver<()>,
    mpsc::Sender<()>,
) {
    let (begun, has_begun) = mpsc::channel();
    let (release, released) = mpsc::channel::<()>();
    let work = move |_: &Budget<'_>| {
        begun.send(()).ok();
        released.recv().ok();
    };
    (work, has_begun, release)
}

#[tokio::test]
async fn a_full_pool_refuses_and_frees_the_places_of_callers_who_left() {
    let pool = Arc::new(pool(1, 1));
    let (work, begun, release) = held();
    let first = pool.reserve(None).unwrap();
    let running = tokio::spawn({
        let pool = Arc::clone(&pool);
        async move { pool.run(first, by(soon()), work).await }
    });
    tokio::task::spawn_blocking(move || begun.recv())
        .await
        .unwrap()
        .unwrap();

    let second = pool.reserve(None).unwrap();
    let mut waiting = Box::pin(pool.run(second, by(soon()), |_| panic!("must be skipped")));
    assert!(poll_once(&mut waiting).await.is_none());
    assert_eq!(
        pool.reserve(None).unwrap_err(),
        PoolError::Full {
            waiting: 1,
            running: 1,
            retry_after: 1
        }
    );

    drop(waiting);
    let third = pool.reserve(None).unwrap();
    release.send(()).unwrap();
    assert_eq!(running.await.unwrap(), Ok(()));
    assert_eq!(pool.run(third, by(soon()), |_| 7).await, Ok(7));
}

#[tokio::test]
async fn jobs_start_in_the_order_they_were_queued() {
    let pool = pool(1, 12);
    let (work, begun, release) = held();
    let mut first = Box::pin(pool.run(pool.reserve(None).unwrap(), by(soon()), work));
    assert!(poll_once(&mut first).await.is_none());
    tokio::task::spawn_blocking(move || begun.recv())
        .await
        .unwrap()
        .unwrap();
    let order = Arc::new(Mutex::new(Vec::new()));
    let waiting: Vec<_> = (0..8)
        .map(|i| {
            let order = Arc::clone(&order);
            let work = move |_: &Budget<'_>| order.lock().unwrap().push(i);
            pool.run(pool.reserve(None).unwrap(), by(soon()), work)
        })
        .collect();
    release.send(()).unwrap();
    // Awaited in the opposite order.
    for job in waiting.into_iter().rev() {
        assert_eq!(job.await, Ok(()));
    }
    assert_eq!(first.await, Ok(()));
    assert_eq!(*order.lock().unwrap(), [0, 1, 2, 3, 4, 5, 6, 7]);
}

#[tokio::test]
async fn a_deadline_covers_waiting_and_running() {
    let pool = Arc::new(pool(1, 4));
    let (work, begun, release) = held();
    let permit = pool.reserve(None).unwrap();
    let running = tokio::spawn({
        let pool = Arc::clone(&pool);
        async move {
            pool.run(
                permit,
                by(Instant::now() + Duration::from_millis(200)),
                work,
            )
            .await
        }
    });
    tokio::task::spawn_blocking(move || begun.recv())
        .await
        .unwrap()
        .unwrap();
    let (tell, told) = mpsc::channel();
    let waiting = pool
        .run(
            pool.reserve(None).unwrap(),
            by(Instant::now() + Duration::from_millis(10)),
            move |_| {
                tell.send(()).ok();
            },
        )
        .await;
    assert_eq!(waiting, Err(PoolError::Expired));
    assert_eq!(running.await.unwrap(), Err(PoolError::Expired));
    release.send(()).unwrap();
    assert_eq!(
        pool.run(pool.reserve(None).unwrap(), by(soon()), |_| 1)
            .await,
        Ok(1)
    );
    assert!(told.try_recv().is_err(), "an expired job must not run");
}

#[tokio::test]
async fn a_running_job_is_cancelled_when_nobody_waits() {
    let pool = pool(1, 4);
    let (told, events) = mpsc::channel();
    let working = |told: mpsc::Sender<bool>| {
        move |budget: &Budget<'_>| {
            told.send(budget.check().is_ok()).ok();
            while budget.check().is_ok() {
                std::thread::yield_now();
            }
            told.send(false).ok();
        }
    };
    let mut leaving = Box::pin(pool.run(
        pool.reserve(None).unwrap(),
        by(soon()),
        working(told.clone()),
    ));
    assert!(poll_once(&mut leaving).await.is_none());
    let events = tokio::task::spawn_blocking(move || {
        assert_eq!(events.recv(), Ok(true));
        events
    });
    let events = events.await.unwrap();
    drop(leaving);
    // Its worker is free again. The next job ends because its deadline passes.
    let deadline = Instant::now() + Duration::from_millis(100);
    let late = pool.run(pool.reserve(None).unwrap(), by(deadline), working(told));
    assert_eq!(late.await, Err(PoolError::Expired));
    assert_eq!(
        pool.run(pool.reserve(None).unwrap(), by(soon()), |_| 4)
            .await,
        Ok(4)
    );
    assert_eq!(events.iter().collect::<Vec<_>>(), [false, true, false]);
}

#[tokio::test]
async fn a_panic_fails_only_its_job_and_a_closed_pool_finishes_queued_jobs() {
    let pool = pool(1, 4);
    let panicked = pool
        .run(pool.reserve(None).unwrap(), by(soon()), |_| {
            panic!("on purpose")
        })
        .await;
    assert_eq!(panicked, Err::<(), _>(PoolError::Panicked));
    assert_eq!(
        pool.run(pool.reserve(None).unwrap(), by(soon()), |_| 2)
            .await,
        Ok(2)
    );

    let last = pool.reserve(None).unwrap();
    let mut job = Box::pin(pool.run(last, by(soon()), |_| 3));
    let early = poll_once(&mut job).await;
    pool.close();
    assert_eq!(pool.reserve(None).unwrap_err(), PoolError::Closed);
    let outcome = match early {
        Some(outcome) => outcome,
        None => job.await,
    };
    assert_eq!(outcome, Ok(3));
}

/// Polls a future once.
async fn poll_once<F: Future + Unpin>(future: &mut F) -> Option<F::Output> {
    std::future::poll_fn(|cx| {
        std::task::Poll::Ready(match std::pin::Pin::new(&mut *future).poll(cx) {
            std::task::Poll::Ready(output) => Some(output),
            std::task::Poll::Pending => None,
        })
    })
    .await
}

#[tokio::test]
async fn one_client_cannot_take_every_place() {
    let pool = pool(1, 7);
    let client = |n: u8| {
        let address = std::net::Ipv4Addr::new(192, 0, 2, n).into();
        Some(ClientId::Address(ClientAddress::of(address)))
    };
    let flood: Vec<_> = (0..8).map_while(|_| pool.reserve(client(1)).ok()).collect();
    assert_eq!(flood.len(), 6);
    assert!(pool.check_capacity(&client(1)).is_err());
    assert!(pool.check_capacity(&client(2)).is_ok());
    let others: Vec<_> = (0..8).map_while(|_| pool.reserve(client(2)).ok()).collect();
    assert_eq!(others.len(), 2);
    drop(flood);
    assert!(pool.reserve(client(1)).is_ok());
}

#[tokio::test]
async fn a_job_has_a_turn_while_a_worker_is_idle_and_one_in_any_case() {
    let pool = pool(2, 2);
    let places: Vec<_> = (0..3).map(|_| pool.reserve(None).unwrap()).collect();
    // More requests than workers: jobs keep one turn all the same.
    let first = pool.job_turn().await;
    let mut second = Box::pin(pool.job_turn());
    assert!(poll_once(&mut second).await.is_none());
    assert!(
        poll_once(&mut Box::pin(first.needed_by_requests()))
            .await
            .is_none()
    );
    drop(places);
    let second = second.await;
    assert!(
        poll_once(&mut Box::pin(second.needed_by_requests()))
            .await
            .is_none()
    );
    // A request needs the worker of the second one.
    let _place = pool.reserve(None).unwrap();
    second.needed_by_requests().await;
    drop(second);
    assert!(
        poll_once(&mut Box::pin(first.needed_by_requests()))
            .await
            .is_none()
    );
    let answer = pool.run_job(first, by(soon()), |_| 7).await;
    assert_eq!(answer, Ok(7));
    pool.job_turn().await;
}
