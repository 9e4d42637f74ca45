//! Laws of the pool.

use std::sync::mpsc;

use super::*;

fn pool(workers: usize, queue: usize) -> Pool {
    Pool::start(workers, queue, PoolMetrics::unwatched()).unwrap()
}

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

/// A job that runs until told, and tells when it has begun.
fn held() -> (
    impl FnOnce(Cancellation<'_>) + Send + 'static,
    mpsc::Receiver<()>,
    mpsc::Sender<()>,
) {
    let (begun, has_begun) = mpsc::channel();
    let (release, released) = mpsc::channel::<()>();
    let work = move |_: Cancellation<'_>| {
        begun.send(()).ok();
        released.recv().ok();
    };
    (work, has_begun, release)
}

#[tokio::test]
async fn a_full_pool_says_so_and_frees_places_of_those_who_left() {
    let pool = Arc::new(pool(1, 1));
    let (work, begun, release) = held();
    let first = pool.admit().unwrap();
    let running = tokio::spawn({
        let pool = Arc::clone(&pool);
        async move { pool.run(first, soon(), work).await }
    });
    tokio::task::spawn_blocking(move || begun.recv())
        .await
        .unwrap()
        .unwrap();

    let second = pool.admit().unwrap();
    let mut waiting = Box::pin(pool.run(second, soon(), |_| panic!("must be skipped")));
    assert!(futures_poll(&mut waiting).await.is_none());
    assert_eq!(
        pool.admit().unwrap_err(),
        PoolError::Full {
            waiting: 1,
            running: 1,
            retry_after: 1
        }
    );

    drop(waiting);
    let third = pool.admit().unwrap();
    release.send(()).unwrap();
    assert_eq!(running.await.unwrap(), Ok(()));
    assert_eq!(pool.run(third, soon(), |_| 7).await, Ok(7));
}

#[tokio::test]
async fn who_came_first_is_served_first() {
    let pool = pool(1, 8);
    let (work, begun, release) = held();
    let mut first = Box::pin(pool.run(pool.admit().unwrap(), soon(), work));
    assert!(futures_poll(&mut first).await.is_none());
    tokio::task::spawn_blocking(move || begun.recv())
        .await
        .unwrap()
        .unwrap();
    let order = Arc::new(Mutex::new(Vec::new()));
    let waiting: Vec<_> = (0..8)
        .map(|i| {
            let order = Arc::clone(&order);
            let work = move |_: Cancellation<'_>| order.lock().unwrap().push(i);
            pool.run(pool.admit().unwrap(), soon(), work)
        })
        .collect();
    release.send(()).unwrap();
    // Asked for in the other order, run in that of coming.
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
    let admission = pool.admit().unwrap();
    let running = tokio::spawn({
        let pool = Arc::clone(&pool);
        async move {
            pool.run(admission, Instant::now() + Duration::from_millis(200), work)
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
            pool.admit().unwrap(),
            Instant::now() + Duration::from_millis(10),
            move |_| {
                tell.send(()).ok();
            },
        )
        .await;
    assert_eq!(waiting, Err(PoolError::Expired));
    assert_eq!(running.await.unwrap(), Err(PoolError::Expired));
    release.send(()).unwrap();
    assert_eq!(pool.run(pool.admit().unwrap(), soon(), |_| 1).await, Ok(1));
    assert!(told.try_recv().is_err(), "an expired job must not run");
}

#[tokio::test]
async fn a_running_job_learns_that_nobody_waits() {
    let pool = pool(1, 4);
    let (told, hears) = mpsc::channel();
    let working = |told: mpsc::Sender<bool>| {
        move |cancellation: Cancellation<'_>| {
            told.send(!cancellation.is_cancelled()).ok();
            while !cancellation.is_cancelled() {
                std::thread::yield_now();
            }
            told.send(false).ok();
        }
    };
    let mut leaving = Box::pin(pool.run(pool.admit().unwrap(), soon(), working(told.clone())));
    assert!(futures_poll(&mut leaving).await.is_none());
    let hears = tokio::task::spawn_blocking(move || {
        assert_eq!(hears.recv(), Ok(true));
        hears
    });
    let hears = hears.await.unwrap();
    drop(leaving);
    // Its worker is free again, for one whose time is up before it would end by itself.
    let deadline = Instant::now() + Duration::from_millis(100);
    let late = pool.run(pool.admit().unwrap(), deadline, working(told));
    assert_eq!(late.await, Err(PoolError::Expired));
    assert_eq!(pool.run(pool.admit().unwrap(), soon(), |_| 4).await, Ok(4));
    assert_eq!(hears.iter().collect::<Vec<_>>(), [false, true, false]);
}

#[tokio::test]
async fn a_panic_is_its_own_jobs_error_and_a_closed_pool_finishes_what_it_took() {
    let pool = pool(1, 4);
    let panicked = pool
        .run(pool.admit().unwrap(), soon(), |_| panic!("on purpose"))
        .await;
    assert_eq!(panicked, Err::<(), _>(PoolError::Panicked));
    assert_eq!(pool.run(pool.admit().unwrap(), soon(), |_| 2).await, Ok(2));

    let last = pool.admit().unwrap();
    let mut job = Box::pin(pool.run(last, soon(), |_| 3));
    let early = futures_poll(&mut job).await;
    pool.close();
    assert_eq!(pool.admit().unwrap_err(), PoolError::Closed);
    let outcome = match early {
        Some(outcome) => outcome,
        None => job.await,
    };
    assert_eq!(outcome, Ok(3));
}

/// Polls a future once.
async fn futures_poll<F: Future + Unpin>(future: &mut F) -> Option<F::Output> {
    std::future::poll_fn(|cx| {
        std::task::Poll::Ready(match std::pin::Pin::new(&mut *future).poll(cx) {
            std::task::Poll::Ready(output) => Some(output),
            std::task::Poll::Pending => None,
        })
    })
    .await
}
