//! What both doors share: the pool, the one who mends, the limits, the metrics, and whether the service is ready.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    time::Instant,
};
use tracing::error;

use super::{
    config::ServeArgs,
    errors::{Class, Menders, Refusal},
    pool::{Pool, PoolError},
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
    /// Bodies that may still be received at once.
    uploads: Arc<Semaphore>,
    menders: Arc<dyn Menders>,
    warm: AtomicBool,
    draining: AtomicBool,
}

/// The right to receive a body and to be put into the queue with it; free again when dropped.
///
/// Apart from the places in the queue: a body that does not come on costs nobody a place. Bodies in memory are at most
/// uploads, waiting and running jobs together, each of at most the body limit; a multipart one twice while it is split.
#[derive(Debug)]
pub struct Upload(#[allow(dead_code, reason = "held for its drop")] OwnedSemaphorePermit);

/// What a request may cost.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Waiting and mending together.
    pub deadline: Duration,
    /// Bytes of a body.
    pub body: usize,
    /// Between two pieces of a body.
    pub body_pause: Duration,
    /// Bodies received at once.
    pub uploads: usize,
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
                uploads: settings.uploads(),
            },
            allow_origin: settings.allow_origin.clone(),
            pool,
            uploads: Arc::new(Semaphore::new(settings.uploads())),
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
        let patience = Duration::from_secs(3600);
        self.work(None, patience, |menders| menders.warm_up())
            .await?;
        self.warm.store(true, Relaxed);
        Ok(())
    }

    /// Takes the right to receive a body; before it is read, and only while the queue has room for it.
    ///
    /// # Errors
    /// `UploadsFull`, `QueueFull` or `Draining`.
    pub fn upload(&self) -> Result<Upload, Fault> {
        let permit = Arc::clone(&self.uploads).try_acquire_owned();
        // Asked after the permit was taken: who has one from before the drain is waited for.
        if self.draining.load(Relaxed) {
            return Err(Fault::Draining);
        }
        let upload = permit.map(Upload).map_err(|_| Fault::UploadsFull {
            limit: self.limits.uploads,
            retry_after: self.limits.body_pause.as_secs().clamp(1, 60),
        })?;
        (self.pool.room()).map_err(|error| self.fault(error, self.limits.deadline))?;
        Ok(upload)
    }

    /// Takes a place in the queue and runs a job on a worker, within the deadline.
    ///
    /// # Errors
    /// The job's, `QueueFull`, `Deadline`, `Draining`, or `Internal` when it panicked.
    pub async fn submit<T: Send + 'static>(
        &self,
        upload: Upload,
        job: impl FnOnce(&dyn Menders) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        self.work(Some(upload), self.limits.deadline, job).await
    }

    async fn work<T: Send + 'static>(
        &self,
        upload: Option<Upload>,
        patience: Duration,
        job: impl FnOnce(&dyn Menders) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        let menders = Arc::clone(&self.menders);
        let outcome = match self.pool.admit() {
            Ok(admission) => {
                let deadline = Instant::now() + patience;
                let answer = (self.pool).run(admission, deadline, move || job(&*menders));
                // Not before the job is in the queue, which a drain closes when no upload is left.
                drop(upload);
                answer.await
            }
            Err(error) => Err(error),
        };
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

    /// Stops being ready and takes no more requests; those whose bodies are still coming, and jobs taken, go on.
    pub async fn drain(&self) {
        self.draining.store(true, Relaxed);
        let all = u32::try_from(self.limits.uploads).unwrap_or(u32::MAX);
        // Never closed, so never an error.
        self.uploads.acquire_many(all).await.ok();
        self.pool.close();
    }

    /// Takes no more jobs at all.
    pub fn close(&self) {
        self.draining.store(true, Relaxed);
        self.pool.close();
    }
}
