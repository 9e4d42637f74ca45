//! What HTTP and gRPC share: the mender, the worker pool, the sessions, the jobs, the limits, the metrics, and the service's state.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::Duration,
};

use axum::extract::Request;
use darn_jobs::Jobs;
use tokio::time::timeout_at;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::{
    ServeError,
    client::{Caller, Client, Sharing},
    config::ServeArgs,
    connection_table::{ConnectionLimits, ConnectionTable},
    error::RequestError,
    instance::{Instance, InstanceName, SessionPlace},
    kept_session::KeptSession,
    keys::KeyRing,
    pool::{JobTurn, Pool},
    pool_task::{PoolError, TaskOrder},
    request_limits::{Deadline, DurableSize, RequestLimits, TaskSize, of_pool, result_of},
    result_cache::ResultCache,
    session_store::{SessionError, SessionLimits, SessionStore},
    telemetry::Metrics,
    tls::ServedCertificate,
    uploads::{BodySize, UploadRefusal, UploadSlot, Uploads},
    webhook::Webhooks,
};
use darn_budget::{Budget, Limits, MemoryPool};
use darn_contract::port::{Mender, Refusal};
use darn_contract::v1;

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
    /// Mends of requests that may come again; `None` where none are kept.
    pub results: Option<ResultCache>,
    /// What tells clients of their jobs' ends; there whenever the jobs are.
    pub webhooks: Option<Arc<Webhooks>>,
    /// The keys; `None` where anybody may call.
    pub keys: Option<Arc<KeyRing>>,
    /// The certificate of TLS; `None` for plain connections.
    pub certificate: Option<Arc<ServedCertificate>>,
    /// This process among those that serve together.
    pub instance: Instance,
    /// Whether another process may keep sessions that come here.
    company: Company,
    /// Cancelled when the service begins to shut down.
    pub stopping: CancellationToken,
    pool: Pool,
    /// Whether clients are told apart by their address.
    pub sharing: Sharing,
    /// The bodies being received.
    uploads: Uploads,
    mender: Arc<dyn Mender>,
    has_workers: bool,
    warm: AtomicBool,
    draining: AtomicBool,
}

/// What a process knows of others that serve together with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Company {
    /// There are none: it has no database, and no name among others.
    None,
    /// It has a name among others, but no database that says which of them live.
    Unknown,
    /// The database says which live.
    Known,
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
    /// The database or the files cannot be used, or a thread cannot be started.
    pub async fn start(
        settings: &ServeArgs,
        mender: Arc<dyn Mender>,
    ) -> Result<Arc<Self>, ServeError> {
        let jobs = match settings.place() {
            Some(place) => {
                let opened = Jobs::open(&place, darn_jobs::Settings::default()).await;
                let files = place.files();
                Some(opened.map_err(|source| ServeError::Jobs { files, source })?)
            }
            None => None,
        };
        let webhooks = match &jobs {
            Some(_) => Some(Arc::new(Webhooks::new(&settings.webhooks)?)),
            None => None,
        };
        let keys = match &settings.keys {
            Some(path) => Some(KeyRing::open(path)?),
            None => None,
        };
        let certificate = match settings.tls_files() {
            Some(files) => Some(ServedCertificate::open(files, settings.tls_handshake)?),
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
            results: settings.result_cache.map(ResultCache::new),
            webhooks,
            keys,
            certificate,
            instance: Instance::new(settings.instance.unwrap_or_else(InstanceName::random)),
            company: match (&settings.database, settings.instance) {
                (Some(_), _) => Company::Known,
                (None, Some(_)) => Company::Unknown,
                (None, None) => Company::None,
            },
            stopping: CancellationToken::new(),
            pool,
            sharing,
            uploads: Uploads::new(settings.uploads()),
            mender,
            has_workers: settings.workers() > 0,
            warm: AtomicBool::new(false),
            draining: AtomicBool::new(false),
        }))
    }

    /// The weights that are loaded, those of requests that name none first.
    pub fn weights(&self) -> Vec<v1::Weights> {
        self.mender.weights()
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

    /// Whether anything is mended in this process.
    pub fn has_workers(&self) -> bool {
        self.has_workers
    }

    /// Checks that this process would keep the session of an id, if there is one.
    ///
    /// # Errors
    /// `Unknown` for an id that no instance makes; `Elsewhere` where another instance keeps it; `Lost` where none does any more.
    pub async fn check_session_place(&self, session: Uuid) -> Result<(), RequestError> {
        let name = match self.instance.place_of(session) {
            SessionPlace::Here => return Ok(()),
            SessionPlace::Nowhere => return Err(SessionError::Unknown.into()),
            SessionPlace::BeforeRestart => return Err(SessionError::Lost.into()),
            SessionPlace::At(name) => name,
        };
        let is_alive = match (self.company, &self.jobs) {
            (Company::Known, Some(jobs)) => {
                jobs.store().is_instance_alive(&name.to_string()).await?
            }
            (Company::Unknown, _) => true,
            _ => false,
        };
        Err(match is_alive {
            true => SessionError::Elsewhere(name).into(),
            false => SessionError::Lost.into(),
        })
    }

    /// Waits until a durable job may take a worker.
    pub async fn job_turn(&self) -> JobTurn {
        self.pool.job_turn().await
    }

    /// Runs the work of a durable job on a scan of this size, with the work and memory that a request with that scan may cost, but
    /// with a deadline of its own. Dropping the future cancels the work.
    ///
    /// # Errors
    /// `Refused`, `Deadline`, `Draining`, or `Internal` when the mender failed or panicked.
    pub async fn run_durable<T: Send + 'static>(
        &self,
        turn: JobTurn,
        size: DurableSize,
        work: impl FnOnce(&dyn Mender, &Budget<'_>) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, RequestError> {
        let deadline = Deadline::after(DURABLE_DEADLINE);
        let mender = Arc::clone(&self.mender);
        let mut order = self.task_order(size.bytes, deadline);
        order.limits.listener = Some(size.listener);
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
        if self.warm.load(Relaxed) || !self.has_workers() {
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
