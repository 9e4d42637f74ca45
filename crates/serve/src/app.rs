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
    time::{Instant, timeout_at},
};
use tracing::error;
use uuid::Uuid;

use super::{
    config::ServeArgs,
    pool::{Pool, PoolError},
    problem::Fault,
    session::Session,
    sessions::{SessionLimits, Sessions},
    telemetry::Metrics,
};
use darn_contract::port::{Cancellation, Class, Mender, Refusal};

/// The running service, apart from its sockets.
pub struct App {
    /// Counts everything.
    pub metrics: Metrics,
    /// What a request may cost.
    pub limits: RequestLimits,
    /// Web pages that may call, by origin; `*` for any.
    pub allow_origin: Vec<String>,
    /// Scans kept for editing.
    pub sessions: Arc<Sessions>,
    pool: Pool,
    /// Bodies that may still be received at once.
    uploads: Arc<Semaphore>,
    mender: Arc<dyn Mender>,
    warm: AtomicBool,
    draining: AtomicBool,
}

/// The right to receive a body, if there is one, and to be put into the queue with it; free again when dropped.
///
/// Apart from the places in the queue: a body that does not come on costs nobody a place. Bodies in memory are at most
/// uploads, waiting and running jobs together, each of at most the body limit; a multipart one twice while it is split.
#[derive(Debug)]
pub struct Upload(#[allow(dead_code, reason = "held for its drop")] OwnedSemaphorePermit);

/// When a request is over.
#[derive(Debug, Clone, Copy)]
struct Deadline {
    at: Instant,
    /// How long it was, for a person.
    length: Duration,
}

impl Deadline {
    fn after(length: Duration) -> Self {
        let at = Instant::now() + length;
        Self { at, length }
    }
}

/// What a request may cost.
#[derive(Debug, Clone, Copy)]
pub struct RequestLimits {
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
    pub fn start(settings: &ServeArgs, mender: Arc<dyn Mender>) -> io::Result<Arc<Self>> {
        let metrics = Metrics::new().map_err(io::Error::other)?;
        let pool = Pool::start(settings.workers(), settings.queue, metrics.pool())?;
        let kept = SessionLimits {
            idle: settings.session_idle,
            memory: settings.session_memory,
        };
        let sessions = Sessions::new(kept, metrics.sessions());
        Ok(Arc::new(Self {
            metrics,
            limits: RequestLimits {
                deadline: settings.deadline,
                body: settings.body_limit,
                body_pause: settings.body_timeout,
                uploads: settings.uploads(),
            },
            allow_origin: settings.allow_origin.clone(),
            sessions,
            pool,
            uploads: Arc::new(Semaphore::new(settings.uploads())),
            mender,
            warm: AtomicBool::new(false),
            draining: AtomicBool::new(false),
        }))
    }

    /// One real mend on a worker; from then on the service is ready. Has no deadline: a cold machine may be slow once.
    ///
    /// # Errors
    /// The mend's, or that of the pool.
    pub async fn warm_up(&self) -> Result<(), Fault> {
        let deadline = Deadline::after(Duration::from_secs(3600));
        self.work(None, deadline, |mender, _| mender.warm_up())
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
        self.serving()?;
        let upload = permit.map(Upload).map_err(|_| Fault::UploadsFull {
            limit: self.limits.uploads,
            retry_after: self.limits.body_pause.as_secs().clamp(1, 60),
        })?;
        (self.pool.room()).map_err(|error| fault(error, self.limits.deadline))?;
        Ok(upload)
    }

    /// Takes a place in the queue and runs a job on a worker, within the deadline.
    ///
    /// # Errors
    /// The job's, `QueueFull`, `Deadline`, `Draining`, or `Internal` when it panicked.
    pub async fn submit<T: Send + 'static>(
        &self,
        upload: Upload,
        job: impl FnOnce(&dyn Mender, Cancellation<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        let deadline = Deadline::after(self.limits.deadline);
        self.work(Some(upload), deadline, job).await
    }

    /// Runs a job on a kept session, on a worker, in the session's turn and within the deadline, which covers waiting for the
    /// turn. Who waits for a turn holds neither worker nor place in the queue: one session cannot keep others from theirs.
    /// The session is kept until the job ends, whether or not its caller still waits.
    ///
    /// # Errors
    /// `Session` when it is not to be had, and all that `submit` has.
    pub async fn submit_to<T: Send + 'static>(
        &self,
        id: Uuid,
        upload: Upload,
        job: impl FnOnce(&Session, Cancellation<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        let deadline = Deadline::after(self.limits.deadline);
        let lease = self.sessions.lease(id, std::time::Instant::now())?;
        let turn = timeout_at(deadline.at, lease.turn()).await;
        let turn = turn.map_err(|_| fault(PoolError::Expired, deadline.length))?;
        self.work(Some(upload), deadline, move |_, cancellation| {
            turn.work(|session| job(session, cancellation))
        })
        .await
    }

    async fn work<T: Send + 'static>(
        &self,
        upload: Option<Upload>,
        deadline: Deadline,
        job: impl FnOnce(&dyn Mender, Cancellation<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Fault> {
        let mender = Arc::clone(&self.mender);
        let outcome = match self.pool.admit() {
            Ok(admission) => {
                let answer = (self.pool).run(admission, deadline.at, move |cancellation| {
                    job(&*mender, cancellation)
                });
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
            Err(error) => Err(fault(error, deadline.length)),
        }
    }

    /// Whether new requests will be mended.
    ///
    /// # Errors
    /// `WarmingUp` or `Draining`.
    pub fn ready(&self) -> Result<(), Fault> {
        self.serving()?;
        match self.warm.load(Relaxed) {
            true => Ok(()),
            false => Err(Fault::WarmingUp),
        }
    }

    /// Whether the service shuts down.
    ///
    /// # Errors
    /// `Draining`.
    pub fn serving(&self) -> Result<(), Fault> {
        match self.draining.load(Relaxed) {
            true => Err(Fault::Draining),
            false => Ok(()),
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

fn fault(error: PoolError, patience: Duration) -> Fault {
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
