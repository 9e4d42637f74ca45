//! A job in the queue of the pool: the work, who waits for it and until when, and its place.
//!
//! It carries all that belongs to it, so whatever becomes of it is settled in one spot: whoever dropped the reply does not wait,
//! a panic is this job's error, and the place is free again when the job is dropped.

use std::panic::{AssertUnwindSafe, catch_unwind};

use tokio::{sync::oneshot, time::Instant};
use tracing::{Span, warn};

use super::{
    pool::{Admission, PoolError},
    telemetry::PoolMetrics,
};
use darn_contract::port::Cancellation;

/// A job of any type, in the queue.
pub trait Entry: Send {
    /// Whether somebody still waits, and still may.
    fn is_wanted(&self) -> bool;
    /// When it came into the queue.
    fn entered(&self) -> Instant;
    /// Runs it and sends its result to who waits.
    fn run(self: Box<Self>, metrics: &PoolMetrics);
}

/// A job of one type, with all that belongs to it.
pub struct Job<T, W> {
    /// What is to be done.
    pub work: W,
    /// Where its result goes; closed when nobody waits for it any more.
    pub reply: oneshot::Sender<Result<T, PoolError>>,
    /// When its result is too late.
    pub deadline: Instant,
    /// When it came into the queue.
    pub entered: Instant,
    /// The request it belongs to.
    pub span: Span,
    /// Its place.
    pub admission: Admission,
}

/// Whether somebody still waits, and still may.
fn is_waited_for<R>(reply: &oneshot::Sender<R>, deadline: Instant) -> bool {
    !reply.is_closed() && Instant::now() < deadline
}

impl<T: Send, W: FnOnce(Cancellation<'_>) -> T + Send> Entry for Job<T, W> {
    fn is_wanted(&self) -> bool {
        is_waited_for(&self.reply, self.deadline)
    }

    fn entered(&self) -> Instant {
        self.entered
    }

    fn run(self: Box<Self>, metrics: &PoolMetrics) {
        let Self {
            work,
            reply,
            deadline,
            span,
            admission,
            ..
        } = *self;
        let _entered = span.enter();
        let cancelled = || !is_waited_for(&reply, deadline);
        let cancellation = Cancellation::new(&cancelled);
        let mut outcome = catch_unwind(AssertUnwindSafe(|| work(cancellation))).map_err(|_| {
            metrics.panicked.increment(1);
            PoolError::Panicked
        });
        if Instant::now() >= deadline {
            // The work may have been given up for it: then what it says is not what its caller should hear.
            outcome = Err(PoolError::Expired);
        }
        drop(admission);
        if reply.send(outcome).is_err() {
            metrics.discarded.increment(1);
            warn!("nobody waited for the result any more");
        }
    }
}
