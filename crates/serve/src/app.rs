//! What HTTP and gRPC share: the mender, the worker pool, the sessions, the jobs, the limits, the metrics, and the service's state.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::Duration,
};

use axum::extract::Request;
use darn_jobs::{Jobs, Place};
use tokio::time::{Instant, timeout_at};
use tokio_util::sync::CancellationToken;
use tracing::error;
use uuid::Uuid;

use super::{
    ServeError,
    client::{Caller, Client, Sharing},
    config::ServeArgs,
    connection_table::{ConnectionLimits, ConnectionTable},
    error::RequestError,
    kept_session::KeptSession,
    keys::KeyRing,
    pace::PaceLimits,
    pool::{JobTurn, Pool},
    pool_task::{PoolError, TaskOrder},
    session_store::{SessionLimits, SessionStore},
    telemetry::Metrics,
    uploads::{BodySize, UploadRefusal, UploadSlot, Uploads},
    webhook::Webhooks,
};
use darn_budget::{Budget, Limits, MemoryPool};
use darn_contract::codes;
use darn_contract::port::{Mender, Refusal};

/// Work that a request may cost for each byte of its scan, in nanoseconds of one core. Mends of real scans take up to 1,500.
const WORK_PER_BYTE: u64 = 40_000;
/// Bytes of memory that a request may hold for each byte of its scan.
const MEMORY_PER_BYTE: usize = 150;
/// Bytes of memory that any request may hold: a small scan may have large images.
const LEAST_MEMORY: usize = 1 << 30;
/// Longest time that a durable job may wait for its worker and be mended: nobody waits for its answer, and its work is limited by its size.
const DURABLE_DEADLINE: Duration = Duration::from_secs(60 * 60);
/// What a job costs beside the bytes of its scan, in bytes: it orders small jobs.
const TASK_COST: u64 = 100_000;

/// The running service, apart from its sockets.
pub struct App {
    /// The service's metrics.
    pub metrics: Metrics,
    /// Limits of a request.
    pub limits: RequestLimits,
    /// Origins of web pages that may call; `*` for any.
    pub allow_origin: Vec<String>,
    /// Whether the editor is served.
    pub editor: bool,
    /// The open connections.
    pub connections: Arc<ConnectionTable>,
    /// Scans kept for editing.
    pub sessions: Arc<SessionStore>,
    /// The durable jobs; `None` without a data folder.
    pub jobs: Option<Arc<Jobs>>,
    /// What tells clients of their jobs' ends; there whenever the jobs are.
    pub webhooks: Option<Arc<Webhooks>>,
    /// The keys; `None` where anybody may call.
    pub keys: Option<Arc<KeyRing>>,
    /// Cancelled when the service begins to shut down.
    pub stopping: CancellationToken,
    pool: Pool,
    /// Whether clients are told apart by their address.
    pub sharing: Sharing,
    /// The bodies being received.
    uploads: Uploads,
    mender: Arc<dyn Mender>,
    warm: AtomicBool,
    draining: AtomicBool,
}

/// Allows one request to receive its body and to queue its job; given back when dropped.
///
/// It is not a place in the queue: a body that comes slowly takes no place. Memory holds at most one body per upload permit, waiting job
/// and running job, each within the body limit; a multipart body counts twice while it is split.
#[derive(Debug)]
pub struct UploadPermit {
    /// Whom the request is from.
    client: Client,
    #[allow(dead_code, reason = "held for its drop")]
    slot: UploadSlot,
}

impl UploadPermit {
    /// Whom the request is from.
    pub fn client(&self) -> &Client {
        &self.client
    }
}

/// The size of a request, by which its cost is estimated and limited.
#[derive(Debug)]
struct TaskSize {
    /// Whom it is for.
    client: Client,
    /// Bytes of its scan.
    bytes: usize,
}

/// When a request's result comes too late.
#[derive(Debug, Clone, Copy)]
struct Deadline {
    at: Instant,
    /// The whole time allowed, for the error's text.
    length: Duration,
}

impl Deadline {
    fn after(length: Duration) -> Self {
        let at = Instant::now() + length;
        Self { at, length }
    }
}

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

impl std::fmt::Debug for App {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("App")
            .field("limits", &self.limits)
            .field("pool", &self.pool)
            .finish_non_exhaustive()
    }
}

impl App {
    /// Opens the jobs and starts the workers; binds no socket.
    ///
    /// # Errors
    /// The data folder cannot be used, or a thread cannot be started.
    pub async fn start(
        settings: &ServeArgs,
        mender: Arc<dyn Mender>,
    ) -> Result<Arc<Self>, ServeError> {
        let jobs = match &settings.data {
            Some(folder) => {
                let place = Place::Folder(folder.clone());
                let opened = Jobs::open(&place, darn_jobs::Settings::default()).await;
                Some(opened.map_err(|source| ServeError::Jobs {
                    folder: folder.clone(),
                    source,
                })?)
            }
            None => None,
        };
        let webhooks = match &jobs {
            Some(_) => Some(Arc::new(Webhooks::new(&settings.webhooks)?)),
            None => None,
        };
        let keys = match &settings.keys {
            Some(path) => Some(KeyRing::open(path).await?),
            None => None,
        };
        let metrics = Metrics::new().map_err(std::io::Error::other)?;
        let pool = Pool::start(settings.workers(), settings.queue, metrics.pool())?;
        let session_limits = SessionLimits {
            idle: settings.session_idle,
            memory: settings.session_memory,
        };
        let sessions = SessionStore::new(session_limits, metrics.sessions());
        let limits = RequestLimits {
            deadline: settings.deadline,
            memory: MemoryPool::new(settings.memory()),
            work: settings.work,
            body: settings.body_limit,
            body_pause: settings.body_timeout,
            body_rate: settings.body_rate,
        };
        let connections = ConnectionTable::new(ConnectionLimits {
            in_all: settings.connections(),
            per_address: settings.connections_per_address,
            pace: limits.pace(),
        });
        let sharing = match settings.connections_per_address {
            0 => Sharing::Anybody,
            _ => Sharing::ByAddress,
        };
        Ok(Arc::new(Self {
            metrics,
            limits,
            connections,
            allow_origin: settings.allow_origin.clone(),
            editor: !settings.no_editor,
            sessions,
            jobs,
            webhooks,
            keys,
            stopping: CancellationToken::new(),
            pool,
            sharing,
            uploads: Uploads::new(settings.uploads()),
            mender,
            warm: AtomicBool::new(false),
            draining: AtomicBool::new(false),
        }))
    }

    /// Runs the mender's warm-up on a worker; after it the service is ready. An hour's deadline: the first mend on a machine may be slow.
    ///
    /// # Errors
    /// The mender's refusal or the pool's error.
    pub async fn warm_up(&self) -> Result<(), RequestError> {
        let deadline = Deadline::after(Duration::from_secs(3600));
        let size = TaskSize {
            client: None,
            bytes: 0,
        };
        // The warm-up takes no budget, so its size limits nothing.
        self.run_task(None, size, deadline, |mender, _| mender.warm_up())
            .await?;
        self.warm.store(true, Relaxed);
        Ok(())
    }

    /// Takes an upload permit before a request's body is read, of which at most `limit` bytes count.
    ///
    /// # Errors
    /// `UploadsFull`, `UploadShareFull`, `QueueFull` or `Draining`.
    pub fn upload_permit_of(
        &self,
        request: &Request,
        limit: usize,
    ) -> Result<UploadPermit, RequestError> {
        let client = self.client(&Caller::of(request.extensions()));
        self.upload_permit_for(BodySize::of(request.body(), limit), client)
    }

    /// Takes an upload permit for a body of this size, and only while the queue has room.
    ///
    /// # Errors
    /// `UploadsFull`, `UploadShareFull`, `QueueFull` or `Draining`.
    pub(crate) fn upload_permit_for(
        &self,
        size: BodySize,
        client: Client,
    ) -> Result<UploadPermit, RequestError> {
        let permit = self.upload_slot_for(size, client)?;
        let capacity = self.pool.check_capacity(&permit.client);
        capacity.map_err(|error| of_pool(error, self.limits.deadline))?;
        Ok(permit)
    }

    /// Takes an upload permit for the body of a durable job, which takes no place in the queue.
    ///
    /// # Errors
    /// `UploadsFull`, `UploadShareFull` or `Draining`.
    pub fn job_upload_permit_of(&self, request: &Request) -> Result<UploadPermit, RequestError> {
        let client = self.client(&Caller::of(request.extensions()));
        self.upload_slot_for(BodySize::of(request.body(), self.limits.body), client)
    }

    /// Takes an upload permit whatever waits in the queue.
    ///
    /// # Errors
    /// `UploadsFull`, `UploadShareFull` or `Draining`.
    pub(crate) fn upload_slot_for(
        &self,
        size: BodySize,
        client: Client,
    ) -> Result<UploadPermit, RequestError> {
        let permit = self.uploads.take(size, &client);
        // Checked after the permit was taken: a drain waits for the permits taken before it.
        self.check_serving()?;
        let retry_after = self.limits.body_pause.as_secs().clamp(1, 60);
        let slot = permit.map_err(|refusal| match refusal {
            UploadRefusal::Full(limit) => RequestError::UploadsFull { limit, retry_after },
            UploadRefusal::ShareFull(held) => RequestError::UploadShareFull { held, retry_after },
        })?;
        Ok(UploadPermit { client, slot })
    }

    /// Waits until a durable job may take a worker.
    pub async fn job_turn(&self) -> JobTurn {
        self.pool.job_turn().await
    }

    /// Runs the work of a durable job on a scan of this many bytes, with the work and memory that a request with that scan may cost, but
    /// with a deadline of its own. Dropping the future cancels the work.
    ///
    /// # Errors
    /// `Refused`, `Deadline`, `Draining`, or `Internal` when the mender failed or panicked.
    pub async fn run_durable<T: Send + 'static>(
        &self,
        turn: JobTurn,
        bytes: usize,
        work: impl FnOnce(&dyn Mender, &Budget<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, RequestError> {
        let deadline = Deadline::after(DURABLE_DEADLINE);
        let mender = Arc::clone(&self.mender);
        let order = self.task_order(bytes, deadline);
        let outcome = (self.pool)
            .run_job(turn, order, move |budget| work(&*mender, budget))
            .await;
        result_of(outcome, deadline)
    }

    /// Runs a job on a scan of this many bytes on a worker, within the deadline and the work and memory that such a scan may cost.
    ///
    /// # Errors
    /// `Refused`, `QueueFull`, `Deadline`, `Draining`, or `Internal` when the mender failed or panicked.
    pub async fn submit<T: Send + 'static>(
        &self,
        upload: UploadPermit,
        bytes: usize,
        job: impl FnOnce(&dyn Mender, &Budget<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, RequestError> {
        let deadline = Deadline::after(self.limits.deadline);
        let size = TaskSize {
            client: upload.client.clone(),
            bytes,
        };
        self.run_task(Some(upload), size, deadline, job).await
    }

    /// Runs a job on a session, on a worker, within the deadline, which includes waiting for exclusive use of the session. A request that
    /// waits for it holds neither a worker nor a place in the queue, so one session cannot block others. The session is kept until
    /// the job ends, even when the caller leaves earlier.
    ///
    /// # Errors
    /// `Session` when the session cannot be used, and those of [`App::submit`].
    pub async fn submit_to_session<T: Send + 'static>(
        &self,
        id: Uuid,
        upload: UploadPermit,
        job: impl FnOnce(&KeptSession, &Budget<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, RequestError> {
        let deadline = Deadline::after(self.limits.deadline);
        let lease = (self.sessions).lease(id, &upload.client, std::time::Instant::now())?;
        let guard = timeout_at(deadline.at, lease.exclusive()).await;
        let guard = guard.map_err(|_| of_pool(PoolError::Expired, deadline.length))?;
        let size = TaskSize {
            client: upload.client.clone(),
            bytes: guard.scan_bytes(),
        };
        self.run_task(Some(upload), size, deadline, move |_, budget| {
            guard.run(|session| job(session, budget))
        })
        .await
    }

    /// What a job on a scan of this many bytes may cost.
    fn task_limits(&self, bytes: usize) -> Limits {
        let memory = (MEMORY_PER_BYTE * bytes).max(LEAST_MEMORY);
        Limits {
            work: (WORK_PER_BYTE * bytes as u64).max(self.limits.work.as_nanos() as u64),
            memory,
            // An answer is in memory as a whole.
            output: memory,
            pool: Some(Arc::clone(&self.limits.memory)),
            ..Limits::default()
        }
    }

    fn task_order(&self, bytes: usize, deadline: Deadline) -> TaskOrder {
        TaskOrder {
            cost: TASK_COST + bytes as u64,
            deadline: deadline.at,
            limits: self.task_limits(bytes),
        }
    }

    async fn run_task<T: Send + 'static>(
        &self,
        upload: Option<UploadPermit>,
        size: TaskSize,
        deadline: Deadline,
        job: impl FnOnce(&dyn Mender, &Budget<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, RequestError> {
        let mender = Arc::clone(&self.mender);
        let order = self.task_order(size.bytes, deadline);
        let outcome = match self.pool.reserve(size.client) {
            Ok(permit) => {
                let answer = (self.pool).run(permit, order, move |budget| job(&*mender, budget));
                // Only now that the job is queued: a drain closes the queue once no upload permit is taken.
                drop(upload);
                answer.await
            }
            Err(error) => Err(error),
        };
        result_of(outcome, deadline)
    }

    /// Checks that the service is warm and does not shut down.
    ///
    /// # Errors
    /// `WarmingUp` or `Draining`.
    pub fn ready(&self) -> Result<(), RequestError> {
        self.check_serving()?;
        if self.warm.load(Relaxed) {
            Ok(())
        } else {
            Err(RequestError::WarmingUp)
        }
    }

    /// Checks that the service does not shut down.
    ///
    /// # Errors
    /// `Draining`.
    pub fn check_serving(&self) -> Result<(), RequestError> {
        if self.draining.load(Relaxed) {
            Err(RequestError::Draining)
        } else {
            Ok(())
        }
    }

    /// Refuses new requests, waits for the bodies being received, then closes the queue; its jobs still run.
    pub async fn drain(&self) {
        self.draining.store(true, Relaxed);
        self.stopping.cancel();
        self.uploads.drained().await;
        self.pool.close();
    }

    /// Closes the queue at once.
    pub fn close(&self) {
        self.draining.store(true, Relaxed);
        self.stopping.cancel();
        self.pool.close();
    }
}

/// The result of a task, or the error that its caller receives.
fn result_of<T>(
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
fn of_pool(error: PoolError, deadline: Duration) -> RequestError {
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
