//! A bounded queue in front of a few blocking worker threads. Knows jobs as closures; knows no HTTP and no scans.
//!
//! First come, first served, so whoever has a place gets a worker once those before it are done: nobody is overtaken. A job
//! whose caller went away or whose deadline passed is skipped, or told so while it runs.

use std::{
    collections::VecDeque,
    io,
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
use tracing::Span;

use super::{
    job::{Entry, Job},
    telemetry::PoolMetrics,
};
use darn_contract::port::Cancellation;

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
    /// has not begun, and tells it that nobody waits if it has.
    ///
    /// # Errors
    /// `Closed`, `Expired` or `Panicked`.
    pub fn run<T: Send + 'static>(
        &self,
        admission: Admission,
        deadline: Instant,
        work: impl FnOnce(Cancellation<'_>) -> T + Send + 'static,
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
            entry.run(&self.metrics);
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

#[cfg(test)]
#[path = "pool_tests.rs"]
mod tests;
