//! A bounded queue in front of a few blocking worker threads. Runs closures; knows no HTTP and no scans.
//!
//! A [`FairQueue`] says which job starts next. One worker more than is said takes jobs of clients that have nothing running; all others, and what
//! they start, leave the processors to it. A job whose caller left or whose deadline passed is skipped; one that already
//! runs sees its budget.

use std::{
    collections::HashMap,
    io,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed},
    },
    thread,
    time::Duration,
};

use opentelemetry::Context;
use tokio::{
    sync::{Notify, oneshot},
    time::{Instant, timeout_at},
};
use tracing::Span;

use super::{
    client::Client,
    fair_queue::{FairQueue, Started, WorkerKind},
    pool_task::{PoolError, PoolTask, QueuedTask, TaskOrder},
    telemetry::PoolMetrics,
};
use darn_budget::{Budget, priority};

/// Longest wait suggested to a caller, in seconds.
const MAX_RETRY_AFTER: u64 = 120;
/// One client leaves one in this many places to others, and large jobs as many workers to small ones.
const SHARE_OF_OTHERS: usize = 4;

/// The queue and its workers. Dropping it closes the queue; running jobs run to their end.
#[derive(Debug)]
pub struct Pool(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    filled: Condvar,
    /// Places in the queue and at the workers together.
    places: usize,
    /// Most places that one client may take.
    places_per_client: usize,
    workers: usize,
    running: AtomicUsize,
    /// Moving average of the jobs' run time, in microseconds; 0 before the first.
    mean_run_time: AtomicU64,
    metrics: PoolMetrics,
    /// A place or a turn was taken or given back.
    places_changed: Notify,
}

struct Queue {
    jobs: FairQueue<Box<dyn QueuedTask>>,
    /// Places taken, in all and by each client.
    taken: usize,
    taken_by: HashMap<Client, usize>,
    /// Turns of durable jobs, which take no places.
    turns: usize,
    closed: bool,
}

/// A place in the queue, or at a worker; given back when dropped.
#[derive(Debug)]
pub struct QueuePermit {
    shared: Arc<Shared>,
    client: Client,
}

impl Drop for QueuePermit {
    fn drop(&mut self) {
        let mut queue = self.shared.lock();
        queue.taken -= 1;
        if let Some(taken) = queue.taken_by.get_mut(&self.client) {
            *taken -= 1;
            if *taken == 0 {
                queue.taken_by.remove(&self.client);
            }
        }
        drop(queue);
        self.shared.places_changed.notify_one();
    }
}

/// A durable job's right to a worker; given back when dropped.
#[derive(Debug)]
pub struct JobTurn {
    shared: Arc<Shared>,
}

impl JobTurn {
    /// Waits until requests need the worker that was idle when this turn was given. The only turn keeps its worker, so that jobs have one
    /// however many requests come.
    pub async fn needed_by_requests(&self) {
        loop {
            let changed = self.shared.places_changed.notified();
            let is_needed = {
                let queue = self.shared.lock();
                queue.turns > 1 && queue.taken + queue.turns > self.shared.workers
            };
            if is_needed {
                return;
            }
            changed.await;
        }
    }
}

impl Drop for JobTurn {
    fn drop(&mut self) {
        self.shared.lock().turns -= 1;
        self.shared.places_changed.notify_one();
    }
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
    /// Starts `workers` threads, and one for first jobs, behind `queue` waiting places.
    ///
    /// # Errors
    /// When a thread cannot be started.
    pub fn start(workers: usize, queue: usize, metrics: PoolMetrics) -> io::Result<Self> {
        let workers = workers.max(1);
        let places = workers + queue;
        let shared = Arc::new(Shared {
            queue: Mutex::new(Queue {
                jobs: FairQueue::new(workers - workers / SHARE_OF_OTHERS),
                taken: 0,
                taken_by: HashMap::new(),
                turns: 0,
                closed: false,
            }),
            filled: Condvar::new(),
            places,
            places_per_client: places - places / SHARE_OF_OTHERS,
            workers,
            running: AtomicUsize::new(0),
            mean_run_time: AtomicU64::new(0),
            metrics,
            places_changed: Notify::new(),
        });
        let pool = Self(Arc::clone(&shared));
        let first = Arc::clone(&shared);
        thread::Builder::new()
            .name("mend-first".to_owned())
            .spawn(move || first.run_jobs(WorkerKind::First))?;
        for index in 0..workers {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name(format!("mend-{index}"))
                .spawn(move || {
                    priority::lower_this_thread();
                    shared.run_jobs(WorkerKind::Any);
                })?;
        }
        Ok(pool)
    }

    /// Checks that a place is free for a client now; takes none.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn check_capacity(&self, client: &Client) -> Result<(), PoolError> {
        self.0.with_place(client, |_| ())
    }

    /// Takes a place for a job.
    ///
    /// # Errors
    /// `Full` with an estimate, or `Closed`.
    pub fn reserve(&self, client: Client) -> Result<QueuePermit, PoolError> {
        self.0.with_place(&client, |queue| {
            queue.taken += 1;
            *queue.taken_by.entry(client.clone()).or_default() += 1;
        })?;
        self.0.places_changed.notify_one();
        Ok(QueuePermit {
            shared: Arc::clone(&self.0),
            client,
        })
    }

    /// Queues a job at once; the future waits for its result, until the deadline. Dropping the future skips a job that has not begun,
    /// and cancels one that has.
    ///
    /// # Errors
    /// `Closed`, `Expired` or `Panicked`.
    pub fn run<T: Send + 'static>(
        &self,
        permit: QueuePermit,
        order: TaskOrder,
        work: impl FnOnce(&Budget<'_>) -> T + Send + 'static,
    ) -> impl Future<Output = Result<T, PoolError>> {
        let client = permit.client.clone();
        self.queue(client, permit, order, work)
    }

    /// Waits for a durable job's turn: until a worker is idle, or no job has a turn. One task alone waits for turns.
    pub async fn job_turn(&self) -> JobTurn {
        loop {
            let changed = self.0.places_changed.notified();
            {
                let mut queue = self.0.lock();
                if queue.turns == 0 || queue.taken + queue.turns < self.0.workers {
                    queue.turns += 1;
                    let shared = Arc::clone(&self.0);
                    return JobTurn { shared };
                }
            }
            changed.await;
        }
    }

    /// Queues the work of a durable job, as [`Pool::run`] does that of a request. It stands beside the requests of clients without an address.
    ///
    /// # Errors
    /// `Closed`, `Expired` or `Panicked`.
    pub fn run_job<T: Send + 'static>(
        &self,
        turn: JobTurn,
        order: TaskOrder,
        work: impl FnOnce(&Budget<'_>) -> T + Send + 'static,
    ) -> impl Future<Output = Result<T, PoolError>> {
        self.queue(None, turn, order, work)
    }

    fn queue<T: Send + 'static, P: Send + 'static>(
        &self,
        client: Client,
        permit: P,
        order: TaskOrder,
        work: impl FnOnce(&Budget<'_>) -> T + Send + 'static,
    ) -> impl Future<Output = Result<T, PoolError>> {
        let (reply, answer) = oneshot::channel();
        let TaskOrder {
            cost,
            deadline,
            limits,
        } = order;
        let job = PoolTask {
            work,
            reply,
            deadline,
            limits,
            queued_at: Instant::now(),
            span: Span::current(),
            trace: Context::current(),
            permit,
        };
        let pushed = self.0.push(client, cost, Box::new(job));
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

    fn push(&self, client: Client, cost: u64, job: Box<dyn QueuedTask>) -> Result<(), PoolError> {
        let mut queue = self.lock();
        if queue.closed {
            // Not under the lock: the job's place locks the queue when it is given back.
            drop(queue);
            return Err(PoolError::Closed);
        }
        queue.jobs.push(client, cost, job);
        self.metrics.waiting.set(queue.jobs.len() as f64);
        drop(queue);
        // Not every worker may start it.
        self.filled.notify_all();
        Ok(())
    }

    /// Calls `take` if a place is free for a client; drops the jobs of callers who left if there is none.
    fn with_place(&self, client: &Client, take: impl FnOnce(&mut Queue)) -> Result<(), PoolError> {
        let is_free = |queue: &Queue| {
            let taken_by = queue.taken_by.get(client).copied().unwrap_or_default();
            queue.taken < self.places && taken_by < self.places_per_client
        };
        if !is_free(&self.lock()) {
            self.drop_abandoned();
        }
        let mut queue = self.lock();
        if queue.closed {
            return Err(PoolError::Closed);
        }
        if !is_free(&queue) {
            drop(queue);
            return Err(self.full());
        }
        take(&mut queue);
        Ok(())
    }

    /// Drops jobs nobody waits for any more.
    fn drop_abandoned(&self) {
        let mut queue = self.lock();
        let abandoned = queue.jobs.take_unwanted(|job| job.is_wanted());
        self.metrics.waiting.set(queue.jobs.len() as f64);
        // Not under the lock: their places lock the queue when they are given back.
        drop(queue);
        self.metrics.skipped.increment(abandoned.len() as u64);
        drop(abandoned);
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

    /// Waits for the next job that a worker may start; `None` once the queue is closed and empty.
    fn next(&self, worker: WorkerKind) -> Option<(Started, Box<dyn QueuedTask>)> {
        let mut queue = self.lock();
        loop {
            // What the worker for first jobs runs counts, so that no client has more jobs running than there are other workers.
            let is_free = worker == WorkerKind::First || queue.jobs.running() < self.workers;
            if is_free && let Some(next) = queue.jobs.pop(worker) {
                self.metrics.waiting.set(queue.jobs.len() as f64);
                return Some(next);
            }
            if queue.closed && queue.jobs.len() == 0 {
                return None;
            }
            queue = self
                .filled
                .wait(queue)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// A worker thread: runs jobs until the queue is closed and empty.
    fn run_jobs(&self, worker: WorkerKind) {
        while let Some((started, job)) = self.next(worker) {
            self.run_job(job);
            self.lock().jobs.ended(started);
            // Large jobs may have waited for it to end, and workers for such jobs.
            self.filled.notify_all();
        }
    }

    fn run_job(&self, job: Box<dyn QueuedTask>) {
        if !job.is_wanted() {
            self.metrics.skipped.increment(1);
            return;
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
