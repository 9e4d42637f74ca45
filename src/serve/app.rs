//! What both doors share: the pool, the one who mends, the limits, the metrics, and whether the service is ready.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::time::Instant;
use tracing::error;

use super::{
    config::ServeArgs,
    errors::{Class, Menders, Refusal},
    pool::{Admission, Pool, PoolError},
    problem::Fault,
    telemetry::Metrics,
};

/// The running service, apart from its sockets.
pub struct App {
    /// Counts everything.
    pub metrics: Metrics,
    /// What a request may cost.
    pub limits: Limits,
    /// Web pages that may call, by origin; `*` for any.
    pub allow_origin: Vec<String>,
    pool: Pool,
    menders: Arc<dyn Menders>,
    warm: AtomicBool,
    draining: AtomicBool,
}

/// What a request may cost.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Waiting and mending together.
    pub deadline: Duration,
    /// Bytes of a body.
    pub body: usize,
    /// Between two pieces of a body.
    pub body_pause: Duration,
}

impl std::fmt::Debug for App {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("App")
            .field("limits", &self.limits)
            .field("pool", &self.pool)
            .finish_non_exhaustive()
    }
}

impl App {
    /// Starts the workers; nothing is bound yet.
    ///
    /// # Errors
    /// When a thread cannot be started.
    pub fn start(settings: &ServeArgs, menders: Arc<dyn Menders>) -> io::Result<Arc<Self>> {
        let metrics = Metrics::new().map_err(io::Error::other)?;
        let pool = Pool::start(settings.workers(), settings.queue, metrics.pool())?;
        Ok(Arc::new(Self {
            metrics,
            limits: Limits {
                deadline: settings.deadline,
                body: settings.body_limit,
                body_pause: settings.body_timeout,
            },
            allow_origin: settings.allow_origin.clone(),
            pool,
            menders,
            warm: AtomicBool::new(false),
            draining: AtomicBool::new(false),
        }))
    }

    /// One real mend on a worker; from then on the service is ready. Has no deadline: a cold machine may be slow once.
    ///
    /// # Errors
    /// The mend's, or that of the pool.
    pub async fn warm_up(&self) -> Result<(), Fault> {
        let admission = self.admit()?;
        let patience = Duration::from_secs(3600);
        self.work(admission, patience, |menders| menders.warm_up())
            .await?;
        self.warm.store(true, Relaxed);
        Ok(())
    }

    /// Takes a place in the queue, before the body is read: so places bound memory, too.
    ///
    /// # Errors
    /// `QueueFull` or `Draining`.
    pub fn admit(&self) -> Result<Admission, Fault> {
        self.pool
            .admit()
            .map_err(|error| self.fault(error, self.limits.deadline))
    }

    /// Runs a job on a worker, within the deadline.
    ///
    /// # Errors
    /// The job's, `Deadline`, `Draining`, or `Internal` when it panicked.
    pub async fn submit<T: Send + 'static>(
        &self,
        admission: Admission,
        job: impl FnOnce(&dyn Menders) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        self.work(admission, self.limits.deadline, job).await
    }

    async fn work<T: Send + 'static>(
        &self,
        admission: Admission,
        patience: Duration,
        job: impl FnOnce(&dyn Menders) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        let menders = Arc::clone(&self.menders);
        let outcome = self
            .pool
            .run(admission, Instant::now() + patience, move || job(&*menders))
            .await;
        match outcome {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(refusal)) => {
                if refusal.class == Class::Internal {
                    error!(
                        code = refusal.code,
                        detail = refusal.detail,
                        "mending failed"
                    );
                }
                Err(Fault::Refused(refusal))
            }
            Err(error) => Err(self.fault(error, patience)),
        }
    }

    fn fault(&self, error: PoolError, patience: Duration) -> Fault {
        match error {
            PoolError::Full {
                waiting,
                running,
                retry_after,
            } => Fault::QueueFull {
                waiting,
                running,
                retry_after,
            },
            PoolError::Closed => Fault::Draining,
            PoolError::Expired => Fault::Deadline {
                seconds: patience.as_secs_f64(),
            },
            PoolError::Panicked => Fault::Internal,
        }
    }

    /// Whether new requests will be mended.
    ///
    /// # Errors
    /// `WarmingUp` or `Draining`.
    pub fn ready(&self) -> Result<(), Fault> {
        if self.draining.load(Relaxed) {
            Err(Fault::Draining)
        } else if self.warm.load(Relaxed) {
            Ok(())
        } else {
            Err(Fault::WarmingUp)
        }
    }

    /// Stops being ready and takes no more jobs; those taken go on.
    pub fn drain(&self) {
        self.draining.store(true, Relaxed);
        self.pool.close();
    }
}
