//! A bounded queue in front of a few blocking worker threads. Knows jobs as closures; knows no HTTP and no scans.
//!
//! An entry carries its own reply, its tracing span and its place in the queue, so whatever becomes of it is settled in one
//! spot: an entry whose caller went away or whose deadline passed is skipped, a panic is that entry's error, and the place is
//! free again when the entry is dropped.

use std::{
    collections::VecDeque,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed},
    },
    thread,
    time::Duration,
};

use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, oneshot},
    time::{Instant, timeout_at},
};
use tracing::{Span, warn};

use super::telemetry::PoolMetrics;

/// Longest wait ever suggested, in seconds.
const LONGEST_RETRY: u64 = 120;

/// Why a job has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PoolError {
    /// Every place is taken.
    #[error("{waiting} jobs wait and {running} run")]
    Full {
        /// Jobs waiting.
        waiting: usize,
        /// Jobs running.
        running: usize,
        /// Estimated seconds until a place is free, at least 1.
        retry_after: u64,
    },
    /// The pool takes no more jobs.
    #[error("the pool is closed")]
    Closed,
    /// The deadline passed while the job waited or ran.
    #[error("the deadline passed")]
    Expired,
    /// The job panicked.
    #[error("the job panicked")]
    Panicked,
}

/// A place in the queue; free again when dropped.
#[derive(Debug)]
pub struct Admission(#[allow(dead_code, reason = "held for its drop")] OwnedSemaphorePermit);

/// The queue and its workers. Dropping it closes it; running jobs end by themselves.
#[derive(Debug)]
pub struct Pool(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    filled: Condvar,
    places: Arc<Semaphore>,
    workers: usize,
    running: AtomicUsize,
    /// Moving average of a job's run time, in microseconds; 0 before the first.
    typical: AtomicU64,
    metrics: PoolMetrics,
}

#[derive(Default)]
struct Queue {
    entries: VecDeque<Box<dyn Entry>>,
    closed: bool,
}

impl std::fmt::Debug for Queue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Queue")
            .field("entries", &self.entries.len())
            .field("closed", &self.closed)
            .finish()
    }
}

impl Pool {
    /// Starts `workers` threads behind `queue` waiting places.
    ///
    /// # Errors
    /// When a thread cannot be started.
    pub fn start(workers: usize, queue: usize, metrics: PoolMetrics) -> io::Result<Self> {
        let workers = workers.max(1);
        let shared = Arc::new(Shared {
            queue: Mutex::default(),
            filled: Condvar::new(),
            places: Arc::new(Semaphore::new(workers + queue)),
            workers,
            running: AtomicUsize::new(0),
            typical: AtomicU64::new(0),
            metrics,
        });
        let pool = Self(Arc::clone(&shared));
        for index in 0..workers {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name(format!("mend-{index}"))
                .spawn(move || shared.work())?;
        }
        Ok(pool)
    }

    /// Whether a place is free now; takes none.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn room(&self) -> Result<(), PoolError> {
        if self.0.lock().closed {
            return Err(PoolError::Closed);
        }
        if self.0.places.available_permits() == 0 {
            self.0.sweep();
        }
        match self.0.places.available_permits() {
            0 => Err(self.0.full()),
            _ => Ok(()),
        }
    }

    /// Takes a place, for a job that is about to be run.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn admit(&self) -> Result<Admission, PoolError> {
        if self.0.lock().closed {
            return Err(PoolError::Closed);
        }
        let take = || Arc::clone(&self.0.places).try_acquire_owned();
        take()
            .or_else(|_| {
                self.0.sweep();
                take()
            })
            .map(Admission)
            .map_err(|_| self.0.full())
    }

    /// Puts a job into the queue at once; the future waits for its result, until the deadline. Dropping it skips the job if it
    /// has not begun.
    ///
    /// # Errors
    /// `Closed`, `Expired` or `Panicked`.
    pub fn run<T: Send + 'static>(
        &self,
        admission: Admission,
        deadline: Instant,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> impl Future<Output = Result<T, PoolError>> {
        let (reply, answer) = oneshot::channel();
        let pushed = self.0.push(Box::new(Job {
            work,
            reply,
            deadline,
            entered: Instant::now(),
            span: Span::current(),
            admission,
        }));
        async move {
            pushed?;
            match timeout_at(deadline, answer).await {
                Ok(Ok(outcome)) => outcome,
                Ok(Err(_)) | Err(_) => Err(PoolError::Expired),
            }
        }
    }

    /// Takes no more jobs; those that wait still run.
    pub fn close(&self) {
        self.0.lock().closed = true;
        self.0.filled.notify_all();
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.close();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // No foreign code runs under the lock, so a poisoned one is still whole.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, entry: Box<dyn Entry>) -> Result<(), PoolError> {
        let mut queue = self.lock();
        if queue.closed {
            return Err(PoolError::Closed);
        }
        queue.entries.push_back(entry);
        self.metrics.waiting.set(queue.entries.len() as f64);
        drop(queue);
        self.filled.notify_one();
        Ok(())
    }

    /// Drops entries nobody waits for any more.
    fn sweep(&self) {
        let mut queue = self.lock();
        let (kept, stale): (VecDeque<_>, VecDeque<_>) = std::mem::take(&mut queue.entries)
            .into_iter()
            .partition(|entry| entry.is_wanted());
        queue.entries = kept;
        self.metrics.waiting.set(queue.entries.len() as f64);
        drop(queue);
        self.metrics.skipped.increment(stale.len() as u64);
    }

    fn full(&self) -> PoolError {
        let waiting = self.lock().entries.len();
        let running = self.running.load(Relaxed);
        let typical = Duration::from_micros(self.typical.load(Relaxed)).as_secs_f64();
        let until_free = typical * (waiting + 1) as f64 / self.workers as f64;
        PoolError::Full {
            waiting,
            running,
            retry_after: (until_free.ceil() as u64).clamp(1, LONGEST_RETRY),
        }
    }

    fn next(&self) -> Option<Box<dyn Entry>> {
        let mut queue = self.lock();
        loop {
            if let Some(entry) = queue.entries.pop_front() {
                self.metrics.waiting.set(queue.entries.len() as f64);
                return Some(entry);
            }
            if queue.closed {
                return None;
            }
            queue = self
                .filled
                .wait(queue)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn work(&self) {
        while let Some(entry) = self.next() {
            if !entry.is_wanted() {
                self.metrics.skipped.increment(1);
                continue;
            }
            self.metrics
                .running
                .set((self.running.fetch_add(1, Relaxed) + 1) as f64);
            let begun = Instant::now();
            self.metrics
                .waited
                .record(begun.duration_since(entry.entered()).as_secs_f64());
            entry.run(self);
            self.learn(begun.elapsed());
            self.metrics
                .running
                .set((self.running.fetch_sub(1, Relaxed) - 1) as f64);
        }
    }

    fn learn(&self, took: Duration) {
        let took = u64::try_from(took.as_micros()).unwrap_or(u64::MAX).max(1);
        let old = self.typical.load(Relaxed);
        let new = if old == 0 {
            took
        } else {
            old - old / 8 + took / 8
        };
        self.typical.store(new.max(1), Relaxed);
    }
}

trait Entry: Send {
    /// Whether somebody still waits, and still may.
    fn is_wanted(&self) -> bool;
    fn entered(&self) -> Instant;
    fn run(self: Box<Self>, shared: &Shared);
}

struct Job<T, W> {
    work: W,
    reply: oneshot::Sender<Result<T, PoolError>>,
    deadline: Instant,
    entered: Instant,
    span: Span,
    admission: Admission,
}

impl<T: Send, W: FnOnce() -> T + Send> Entry for Job<T, W> {
    fn is_wanted(&self) -> bool {
        !self.reply.is_closed() && Instant::now() < self.deadline
    }

    fn entered(&self) -> Instant {
        self.entered
    }

    fn run(self: Box<Self>, shared: &Shared) {
        let Self {
            work,
            reply,
            span,
            admission,
            ..
        } = *self;
        let _entered = span.enter();
        let outcome = catch_unwind(AssertUnwindSafe(work)).map_err(|_| {
            shared.metrics.panicked.increment(1);
            PoolError::Panicked
        });
        drop(admission);
        if reply.send(outcome).is_err() {
            shared.metrics.discarded.increment(1);
            warn!("nobody waited for the result any more");
        }
    }
}

#[cfg(test)]
mod tests {
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
        impl FnOnce() + Send + 'static,
        mpsc::Receiver<()>,
        mpsc::Sender<()>,
    ) {
        let (begun, has_begun) = mpsc::channel();
        let (release, released) = mpsc::channel::<()>();
        let work = move || {
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
        let mut waiting = Box::pin(pool.run(second, soon(), || panic!("must be skipped")));
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
        assert_eq!(pool.run(third, soon(), || 7).await, Ok(7));
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
                move || {
                    tell.send(()).ok();
                },
            )
            .await;
        assert_eq!(waiting, Err(PoolError::Expired));
        assert_eq!(running.await.unwrap(), Err(PoolError::Expired));
        release.send(()).unwrap();
        assert_eq!(pool.run(pool.admit().unwrap(), soon(), || 1).await, Ok(1));
        assert!(told.try_recv().is_err(), "an expired job must not run");
    }

    #[tokio::test]
    async fn a_panic_is_its_own_jobs_error_and_a_closed_pool_finishes_what_it_took() {
        let pool = pool(1, 4);
        let panicked = pool
            .run(pool.admit().unwrap(), soon(), || panic!("on purpose"))
            .await;
        assert_eq!(panicked, Err::<(), _>(PoolError::Panicked));
        assert_eq!(pool.run(pool.admit().unwrap(), soon(), || 2).await, Ok(2));

        let last = pool.admit().unwrap();
        let mut job = Box::pin(pool.run(last, soon(), || 3));
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
}
