//! A task in the pool's queue: its work, its caller, its deadline and its place.
//!
//! A task owns all of these, so dropping it settles them: its caller gets an answer and its place is free again.

use std::panic::{AssertUnwindSafe, catch_unwind};

use opentelemetry::Context;
use tokio::{sync::oneshot, time::Instant};
use tracing::{Span, warn};

use super::{telemetry::PoolMetrics, traces};
use darn_budget::{Budget, Limits};

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

/// What a job is ordered by, and its limits.
#[derive(Debug, Clone)]
pub struct TaskOrder {
    /// Its estimated cost, in any unit that all jobs share.
    pub cost: u64,
    /// When its result comes too late.
    pub deadline: Instant,
    /// What it may cost; its deadline is set by the pool.
    pub limits: Limits,
}

/// A job with any type of result, as the queue sees it.
pub trait QueuedTask: Send {
    /// Whether its caller still waits and its deadline has not passed.
    fn is_wanted(&self) -> bool;
    /// When it was queued.
    fn queued_at(&self) -> Instant;
    /// Runs it and sends its result to its caller.
    fn run(self: Box<Self>, metrics: &PoolMetrics);
}

/// A job with a result of type `T`.
pub struct PoolTask<T, W, P> {
    /// What to run.
    pub work: W,
    /// Where its result goes; closed when nobody waits for it any more.
    pub reply: oneshot::Sender<Result<T, PoolError>>,
    /// When its result comes too late.
    pub deadline: Instant,
    /// What it may cost.
    pub limits: Limits,
    /// When it was queued.
    pub queued_at: Instant,
    /// The log span of its request.
    pub span: Span,
    /// Its place in its request's trace.
    pub trace: Context,
    /// Its place; given back when it ends.
    pub permit: P,
}

/// Whether a caller still waits for a reply and its deadline has not passed.
fn is_waited_for<R>(reply: &oneshot::Sender<R>, deadline: Instant) -> bool {
    !reply.is_closed() && Instant::now() < deadline
}

impl<T: Send, W: FnOnce(&Budget<'_>) -> T + Send, P: Send> QueuedTask for PoolTask<T, W, P> {
    fn is_wanted(&self) -> bool {
        is_waited_for(&self.reply, self.deadline)
    }

    fn queued_at(&self) -> Instant {
        self.queued_at
    }

    fn run(self: Box<Self>, metrics: &PoolMetrics) {
        let Self {
            work,
            reply,
            deadline,
            limits,
            span,
            trace,
            queued_at,
            permit,
        } = *self;
        let _entered = span.enter();
        let _traced = trace.attach();
        traces::past_span("queue", queued_at.elapsed());
        let cancelled = || !is_waited_for(&reply, deadline);
        let limits = Limits {
            deadline: Some(deadline.into_std()),
            ..limits
        };
        let budget = Budget::new(limits, &cancelled);
        let mut outcome = catch_unwind(AssertUnwindSafe(|| work(&budget))).map_err(|_| {
            metrics.panicked.increment(1);
            PoolError::Panicked
        });
        if Instant::now() >= deadline {
            // The work may have been cancelled; its refusal must not hide that the deadline passed.
            outcome = Err(PoolError::Expired);
        }
        drop((permit, budget));
        if reply.send(outcome).is_err() {
            metrics.discarded.increment(1);
            warn!("nobody waited for the result any more");
        }
    }
}
