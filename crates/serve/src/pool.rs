//! A bounded queue in front of a few blocking worker threads. Runs closures; knows no HTTP and no scans.
//!
//! Jobs start in the order in which they were queued. A job whose caller left or whose deadline passed is skipped; one that already
//! runs sees its cancellation.

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
    sync::{Semaphore, oneshot},
    time::{Instant, timeout_at},
};
use tracing::Span;

use super::{
    job::{Job, PoolError, QueuePermit, QueuedJob},
    telemetry::PoolMetrics,
};
use darn_contract::port::Cancellation;

/// Longest wait suggested to a caller, in seconds.
const MAX_RETRY_AFTER: u64 = 120;

/// The queue and its workers. Dropping it closes the queue; running jobs run to their end.
#[derive(Debug)]
pub struct Pool(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    filled: Condvar,
    places: Arc<Semaphore>,
    workers: usize,
    running: AtomicUsize,
    /// Moving average of the jobs' run time, in microseconds; 0 before the first.
    mean_run_time: AtomicU64,
    metrics: PoolMetrics,
}

#[derive(Default)]
struct Queue {
    jobs: VecDeque<Box<dyn QueuedJob>>,
    closed: bool,
}

impl std::fmt::Debug for Queue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Queue")
            .field("jobs", &self.jobs.len())
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
            mean_run_time: AtomicU64::new(0),
            metrics,
        });
        let pool = Self(Arc::clone(&shared));
        for index in 0..workers {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name(format!("mend-{index}"))
                .spawn(move || shared.run_jobs())?;
        }
        Ok(pool)
    }

    /// Checks that a place is free now; takes none.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn check_capacity(&self) -> Result<(), PoolError> {
        if self.0.lock().closed {
            return Err(PoolError::Closed);
        }
        if self.0.places.available_permits() == 0 {
            self.0.drop_abandoned();
        }
        match self.0.places.available_permits() {
            0 => Err(self.0.full()),
            _ => Ok(()),
        }
    }

    /// Takes a place for a job.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn reserve(&self) -> Result<QueuePermit, PoolError> {
        if self.0.lock().closed {
            return Err(PoolError::Closed);
        }
        let take = || Arc::clone(&self.0.places).try_acquire_owned();
        take()
            .or_else(|_| {
                self.0.drop_abandoned();
                take()
            })
            .map(QueuePermit::new)
            .map_err(|_| self.0.full())
    }

    /// Queues a job at once; the future waits for its result, until the deadline. Dropping the future skips a job that has not begun,
    /// and cancels one that has.
    ///
    /// # Errors
    /// `Closed`, `Expired` or `Panicked`.
    pub fn run<T: Send + 'static>(
        &self,
        permit: QueuePermit,
        deadline: Instant,
        work: impl FnOnce(Cancellation<'_>) -> T + Send + 'static,
    ) -> impl Future<Output = Result<T, PoolError>> {
        let (reply, answer) = oneshot::channel();
        let pushed = self.0.push(Box::new(Job {
            work,
            reply,
            deadline,
            queued_at: Instant::now(),
            span: Span::current(),
            permit,
        }));
        async move {
            pushed?;
            match timeout_at(deadline, answer).await {
                Ok(Ok(outcome)) => outcome,
                Ok(Err(_)) | Err(_) => Err(PoolError::Expired),
            }
        }
    }

    /// Refuses further jobs; those in the queue still run.
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
        // Nothing under the lock panics halfway through a change, so a poisoned state is still consistent.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, job: Box<dyn QueuedJob>) -> Result<(), PoolError> {
        let mut queue = self.lock();
        if queue.closed {
            return Err(PoolError::Closed);
        }
        queue.jobs.push_back(job);
        self.metrics.waiting.set(queue.jobs.len() as f64);
        drop(queue);
        self.filled.notify_one();
        Ok(())
    }

    /// Drops jobs nobody waits for any more.
    fn drop_abandoned(&self) {
        let mut queue = self.lock();
        let (kept, abandoned): (VecDeque<_>, VecDeque<_>) = std::mem::take(&mut queue.jobs)
            .into_iter()
            .partition(|job| job.is_wanted());
        queue.jobs = kept;
        self.metrics.waiting.set(queue.jobs.len() as f64);
        drop(queue);
        self.metrics.skipped.increment(abandoned.len() as u64);
    }

    /// The error of a full queue, with an estimate of when a place is free.
    fn full(&self) -> PoolError {
        let waiting = self.lock().jobs.len();
        let running = self.running.load(Relaxed);
        let mean_run_time = Duration::from_micros(self.mean_run_time.load(Relaxed)).as_secs_f64();
        let until_free = mean_run_time * (waiting + 1) as f64 / self.workers as f64;
        PoolError::Full {
            waiting,
            running,
            retry_after: (until_free.ceil() as u64).clamp(1, MAX_RETRY_AFTER),
        }
    }

    /// Waits for the next job; `None` once the queue is closed and empty.
    fn next(&self) -> Option<Box<dyn QueuedJob>> {
        let mut queue = self.lock();
        loop {
            if let Some(job) = queue.jobs.pop_front() {
                self.metrics.waiting.set(queue.jobs.len() as f64);
                return Some(job);
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

    /// A worker thread: runs jobs until the queue is closed and empty.
    fn run_jobs(&self) {
        while let Some(job) = self.next() {
            if !job.is_wanted() {
                self.metrics.skipped.increment(1);
                continue;
            }
            self.metrics
                .running
                .set((self.running.fetch_add(1, Relaxed) + 1) as f64);
            let begun = Instant::now();
            self.metrics
                .waited
                .record(begun.duration_since(job.queued_at()).as_secs_f64());
            job.run(&self.metrics);
            self.record_run_time(begun.elapsed());
            self.metrics
                .running
                .set((self.running.fetch_sub(1, Relaxed) - 1) as f64);
        }
    }

    fn record_run_time(&self, took: Duration) {
        let took = u64::try_from(took.as_micros()).unwrap_or(u64::MAX).max(1);
        let old = self.mean_run_time.load(Relaxed);
        let new = if old == 0 {
            took
        } else {
            old - old / 8 + took / 8
        };
        self.mean_run_time.store(new.max(1), Relaxed);
    }
}

#[cfg(test)]
#[path = "pool_tests.rs"]
mod tests;
