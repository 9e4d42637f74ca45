//! What a request may cost and how long it may take, and what its caller receives when its task ends.

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;
use tracing::error;

use super::{client::Client, error::RequestError, pace::PaceLimits, pool_task::PoolError};
use darn_budget::{Listener, MemoryPool};
use darn_contract::{codes, port::Refusal};

/// Limits of a request.
#[derive(Debug, Clone)]
pub struct RequestLimits {
    /// Longest time for waiting and mending together.
    pub deadline: Duration,
    /// Most bytes of a body.
    pub body: usize,
    /// The memory that bodies, jobs and answers share.
    pub memory: Arc<MemoryPool>,
    /// Work that a request may cost whatever its size, as CPU time.
    pub work: Duration,
    /// Longest time between two pieces of a body.
    pub body_pause: Duration,
    /// Fewest bytes per second of a body; 0 for no such limit.
    pub body_rate: usize,
}

impl RequestLimits {
    /// How slowly a body may move.
    pub fn pace(&self) -> PaceLimits {
        PaceLimits {
            pause: self.body_pause,
            rate: self.body_rate,
        }
    }
}

/// The size of a request, by which its cost is estimated and limited.
#[derive(Debug)]
pub struct TaskSize {
    /// Whom it is for.
    pub client: Client,
    /// Bytes of its scan.
    pub bytes: usize,
}

/// The size of a durable job, and who is told how far it is.
#[derive(Debug)]
pub struct DurableSize {
    /// Bytes of its scan.
    pub bytes: usize,
    /// Who is told.
    pub listener: Listener,
}

/// When a request's result comes too late.
#[derive(Debug, Clone, Copy)]
pub struct Deadline {
    /// From then on.
    pub at: Instant,
    /// The whole time allowed, for the error's text.
    pub length: Duration,
}

impl Deadline {
    /// That of a request that comes now.
    pub fn after(length: Duration) -> Self {
        let at = Instant::now() + length;
        Self { at, length }
    }
}

/// The result of a task, or the error that its caller receives.
pub fn result_of<T>(
    outcome: Result<Result<T, Refusal>, PoolError>,
    deadline: Deadline,
) -> Result<T, RequestError> {
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(refusal)) if refusal.is_internal() => {
            let code = refusal.code.word;
            error!(code, detail = refusal.detail, "mending failed");
            Err(RequestError::Internal)
        }
        // The next step would have ended after the deadline, so it was not begun.
        Ok(Err(refusal)) if refusal.code == codes::DEADLINE_EXCEEDED => {
            Err(of_pool(PoolError::Expired, deadline.length))
        }
        Ok(Err(refusal)) => Err(RequestError::Refused(refusal)),
        Err(error) => Err(of_pool(error, deadline.length)),
    }
}

/// The error that a caller receives when the pool gave no result; `deadline` is the time that was allowed.
pub fn of_pool(error: PoolError, deadline: Duration) -> RequestError {
    match error {
        PoolError::Full {
            waiting,
            running,
            retry_after,
        } => RequestError::QueueFull {
            waiting,
            running,
            retry_after,
        },
        PoolError::Closed => RequestError::Draining,
        PoolError::Expired => RequestError::Deadline {
            seconds: deadline.as_secs_f64(),
        },
        PoolError::Panicked => RequestError::Internal,
    }
}
