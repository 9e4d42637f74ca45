//! The service: HTTP and gRPC in front of any [`Mender`], with settings, a worker pool, sessions, problem documents, metrics, logs
//! and shutdown.
//!
//! It knows no geometry, no glTF and no networks, and nothing in it blocks an async thread.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod accept;
mod anchor_lines;
mod answer;
mod app;
mod authorization;
mod body;
mod client;
mod client_address;
mod config;
mod connection_table;
mod connections;
mod content_coding;
mod counted;
mod digest;
mod door;
mod editor;
mod ended_sessions;
mod entity_tag;
mod error;
mod fair_queue;
/// The gRPC service of `proto/darn/v1/darn.proto` and a client of it, as generated.
#[allow(missing_docs, clippy::all, clippy::pedantic, rustdoc::all)]
pub mod generated {
    include!(concat!(env!("OUT_DIR"), "/darn.v1.rs"));
}
mod grpc;
mod grpc_chunks;
mod grpc_handover;
mod grpc_jobs;
mod healthcheck;
mod instance;
mod job_answer;
mod job_events;
mod job_input;
mod job_message;
mod job_quota;
mod job_request;
mod job_routes;
mod job_upload;
mod job_worker;
mod kept_session;
mod key_file;
mod key_secret;
mod keys;
mod log_queue;
mod media_types;
pub mod openapi;
mod pace;
mod parameters;
mod pool;
mod pool_task;
mod prefer;
mod problem;
mod quota;
mod quota_check;
mod request_body;
mod request_limits;
mod response;
mod result_cache;
mod routes;
mod scan_files;
mod schema;
mod service_info;
mod session_routes;
mod session_store;
mod shutdown;
mod telemetry;
mod threads;
mod tls;
mod traces;
mod uploads;
mod watched_files;
mod webhook;

use std::{
    io,
    net::SocketAddr,
    num::NonZero,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use axum::Router;
use tokio::{net::TcpListener, runtime, task, time};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

pub use self::{
    app::App,
    config::{ServeArgs, duration},
    healthcheck::{HealthError, Listening, healthcheck},
    key_file::{EntryDigest, Expiry, KeyEntry, KeyId, Scope},
    key_secret::{Secret, SecretDigest},
    keys::KeyFileError,
    log_queue::{LogGuard, write_to_stderr},
    telemetry::{LogDelivery, LogError, LogFormat, start_logging},
    tls::TlsError,
    traces::{TraceGuard, start_traces},
    webhook::{WebhookArgs, WebhookSettingsError},
};
use self::{connections::Listener, job_worker::JobWorker};
use darn_contract::{error_chain, port::Mender};
use darn_jobs::blobs::Files;

/// How often metric samples are aggregated and idle sessions ended.
const UPKEEP_INTERVAL: Duration = Duration::from_secs(5);

/// Longest time in which jobs are given back at the end.
const JOBS_END: Duration = Duration::from_secs(5);

/// Why the service could not start, or ended.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// An address cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address of the settings.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// The system does not let the service start its threads.
    #[error(
        "{count} threads cannot be started: {source}; raise the limit of processes (ulimit -u) or of the control group, or lower DARN_WORKERS"
    )]
    Threads {
        /// How many were tried.
        count: usize,
        /// Why not.
        source: io::Error,
    },
    /// Threads, signals or sockets failed.
    #[error("the service failed: {0}")]
    Io(#[from] io::Error),
    /// A process without workers would be alone with its jobs.
    #[error(
        "a process without workers (--workers 0, DARN_WORKERS) hands all its work to others: it needs the database that it shares with them (--database, DARN_DATABASE)"
    )]
    AloneWithoutWorkers,
    /// The files or the database of the jobs cannot be used.
    #[error("the jobs in {files} cannot be opened: {}", error_chain(.source))]
    Jobs {
        /// The place of the files in the settings (DARN_DATA, DARN_BLOBS).
        files: Files,
        /// Why not.
        source: darn_jobs::JobError,
    },
    /// Strangers might call.
    #[error(
        "{address} can be reached from other machines, and whoever reaches it could use this service: give it keys (--keys FILE, DARN_KEYS; `darn key new` makes one), or say that anybody may call (--allow-anonymous, DARN_ALLOW_ANONYMOUS=true)"
    )]
    Exposed {
        /// The address of the settings.
        address: SocketAddr,
    },
    /// The file of the keys cannot be used.
    #[error(transparent)]
    Keys(#[from] KeyFileError),
    /// The certificate cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The settings of webhooks cannot be used.
    #[error(transparent)]
    Webhooks(#[from] WebhookSettingsError),
    /// The warm-up mend failed, so no request could succeed.
    #[error("the warm-up mend failed: {0}")]
    WarmUp(String),
}

/// Serves until SIGTERM or SIGINT, or until something fails; blocks. Must not be called from an async runtime.
///
/// # Errors
/// An address that cannot be bound or that no key guards, a file of keys or a certificate that is not valid, a failed warm-up, or an I/O error; see
/// [`ServeError`].
pub fn run(settings: &ServeArgs, mender: Arc<dyn Mender>) -> Result<(), ServeError> {
    if let Some(address) = settings.exposed() {
        return Err(ServeError::Exposed { address });
    }
    let async_threads = thread::available_parallelism().map_or(1, NonZero::get);
    if settings.workers() == 0 && settings.database.is_none() {
        return Err(ServeError::AloneWithoutWorkers);
    }
    // One more for what blocks: the runtime starts others only if it can.
    let count = async_threads + settings.workers() + 2;
    threads::check(count).map_err(|source| ServeError::Threads { count, source })?;
    let runtime = runtime::Builder::new_multi_thread()
        .worker_threads(async_threads)
        .enable_all()
        .build()?;
    let outcome = runtime.block_on(async {
        let sockets = Sockets::bind(settings.listen, settings.grpc_listen).await?;
        let app = App::start(settings, mender).await?;
        let (stop, abort) = (CancellationToken::new(), CancellationToken::new());
        shutdown::on_signal(stop.clone(), abort.clone())?;
        tokio::select! {
            outcome = serve(sockets, app, stop, settings.drain) => outcome,
            () = abort.cancelled() => Ok(()),
        }
    });
    // An abandoned mend may still run; the process does not wait for it.
    runtime.shutdown_background();
    outcome
}

/// The bound sockets of a service.
#[derive(Debug)]
pub struct Sockets {
    /// HTTP, and gRPC unless it has its own.
    pub http: TcpListener,
    /// gRPC alone.
    pub grpc: Option<TcpListener>,
}

impl Sockets {
    /// Binds the addresses; port 0 lets the system choose one.
    ///
    /// # Errors
    /// [`ServeError::Bind`], naming the address.
    pub async fn bind(http: SocketAddr, grpc: Option<SocketAddr>) -> Result<Self, ServeError> {
        let listen = async |address| {
            TcpListener::bind(address)
                .await
                .map_err(|source| ServeError::Bind { address, source })
        };
        Ok(Self {
            http: listen(http).await?,
            grpc: match grpc {
                Some(address) => Some(listen(address).await?),
                None => None,
            },
        })
    }
}

/// Serves on bound sockets until `stop` is cancelled, then waits at most `drain` for the requests under way.
///
/// # Errors
/// An I/O error, or a failed warm-up.
pub async fn serve(
    sockets: Sockets,
    app: Arc<App>,
    stop: CancellationToken,
    drain: Duration,
) -> Result<(), ServeError> {
    let tls = app.certificate.is_some();
    let instance = app.instance.name();
    info!(address = %sockets.http.local_addr()?, tls, %instance, "listening");
    let mut listeners = tokio::task::JoinSet::new();
    let listen = |socket, router| {
        let listener = Listener {
            router,
            table: Arc::clone(&app.connections),
            certificate: app.certificate.clone(),
        };
        connections::serve(socket, listener, stop.clone())
    };
    if let Some(socket) = sockets.grpc {
        info!(address = %socket.local_addr()?, "listening for grpc alone");
        listeners.spawn(listen(socket, grpc_router(&app)));
        listeners.spawn(listen(sockets.http, http_router(&app)));
    } else {
        listeners.spawn(listen(sockets.http, router(&app)));
    }
    let upkeep = tokio::spawn(upkeep(Arc::clone(&app)));
    // Their drop ends them.
    let mut watching = tokio::task::JoinSet::new();
    if let Some(keys) = app.keys.clone() {
        watching.spawn(keys.watch());
    }
    if let Some(certificate) = app.certificate.clone() {
        watching.spawn(certificate.watch());
    }
    if let Some(webhooks) = app.webhooks.clone() {
        watching.spawn(async move { webhooks.watch().await });
    }
    let drained = tokio::spawn({
        let (app, stop) = (Arc::clone(&app), stop.clone());
        async move {
            stop.cancelled().await;
            app.drain().await;
        }
    });

    let warm = CancellationToken::new();
    let working = app.jobs.as_ref().map(|jobs| {
        let worker = JobWorker::new(&app, jobs, stop.clone());
        // Only a worker of this process makes it warm: without one it claims no job.
        tokio::spawn(worker.work_once(warm.clone().cancelled_owned()))
    });
    let warm_up = {
        let (app, stop) = (Arc::clone(&app), stop.clone());
        async move {
            if !app.has_workers() {
                info!("ready without workers");
                return Ok(());
            }
            let outcome = app.warm_up().await;
            match &outcome {
                Ok(()) => {
                    info!("ready");
                    warm.cancel();
                }
                Err(error::RequestError::Draining) => return Ok(()),
                Err(error) => {
                    error!(fault = %error, "the warm-up mend failed");
                    stop.cancel();
                }
            }
            outcome
        }
    };
    let warm_up = tokio::spawn(warm_up);

    let serving = async {
        while let Some(listener) = listeners.join_next().await {
            listener.map_err(io::Error::other)?;
        }
        Ok::<(), io::Error>(())
    };
    let outcome = shutdown::with_bounded_drain(serving, &stop, drain).await;
    let stopped_early = !stop.is_cancelled();
    stop.cancel();
    // The jobs that run are given back, so that another start does not count their attempts.
    if let Some(mut working) = working
        && time::timeout(JOBS_END, &mut working).await.is_err()
    {
        warn!("jobs could not be given back; their leases will run out");
        working.abort();
    }
    upkeep.abort();
    drained.abort();
    watching.shutdown().await;
    if warm_up.is_finished() {
        if let Ok(Err(error)) = warm_up.await {
            return Err(ServeError::WarmUp(error.to_string()));
        }
    } else {
        warm_up.abort();
    }
    app.close();
    info!(early = stopped_early, "stopped");
    outcome.unwrap_or(Ok(())).map_err(ServeError::Io)
}

/// The routes of HTTP and gRPC together, as one listener serves them.
pub fn router(app: &Arc<App>) -> Router {
    routes::finish(http_routes(app).merge(grpc_routes(app)), app)
}

fn http_router(app: &Arc<App>) -> Router {
    routes::finish(http_routes(app), app)
}

fn http_routes(app: &Arc<App>) -> Router<Arc<App>> {
    if app.editor {
        routes::routes().merge(editor::routes())
    } else {
        routes::routes()
    }
}

fn grpc_router(app: &Arc<App>) -> Router {
    routes::finish(grpc_routes(app), app)
}

fn grpc_routes(app: &Arc<App>) -> Router<Arc<App>> {
    use tower::ServiceExt as _;
    let service = grpc::service(app)
        .map_request(|request: axum::extract::Request| request.map(tonic::body::Body::new));
    let jobs = grpc_jobs::service(app)
        .map_request(|request: axum::extract::Request| request.map(tonic::body::Body::new));
    Router::new()
        .route_service("/darn.v1.Darn/{method}", service)
        .route_service("/darn.v1.Jobs/{method}", jobs)
}

async fn upkeep(app: Arc<App>) {
    let mut tick = time::interval(UPKEEP_INTERVAL);
    loop {
        tick.tick().await;
        app.metrics.upkeep();
        // Freeing a large session takes long, so it runs on a thread that may block; nothing waits for it.
        let sessions = Arc::clone(&app.sessions);
        drop(task::spawn_blocking(move || {
            sessions.end_idle(Instant::now())
        }));
    }
}
