//! The service: settings, HTTP and gRPC doors, worker pool, problem documents, metrics, logs, shutdown.
//! May use: contract, axum, tonic, tokio, and whatever mends through the port, `darn_contract::port`.
//! May not live here: geometry, glTF, networks; nothing here blocks an async thread.

mod answer;
mod app;
mod config;
mod door;
mod editing;
mod graves;
mod grpc;
mod healthcheck;
mod intake;
mod job;
pub mod openapi;
mod pool;
mod problem;
mod question;
mod routes;
mod schema;
mod session;
mod sessions;
mod shutdown;
mod telemetry;

use std::{
    io,
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use axum::Router;
use tokio::{net::TcpListener, runtime, task, time};
use tokio_util::sync::CancellationToken;
use tracing::{error, info};

pub use self::{
    app::App,
    config::ServeArgs,
    healthcheck::{HealthError, healthcheck},
    telemetry::{LogFormat, start_logging},
};
pub use darn_contract::port::{
    Cancellation, Class, EditSession, Mended, Mender, PatchForm, Patches, Refusal,
};

/// How often recorded samples are folded into their histograms.
const UPKEEP: Duration = Duration::from_secs(5);

/// Why the service could not start, or ended.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// An address that cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address, as set.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// Threads, signals or sockets failed.
    #[error("the service failed: {0}")]
    Io(#[from] io::Error),
    /// The warm-up mend failed: no request could succeed.
    #[error("the warm-up mend failed: {0}")]
    WarmUp(String),
}

/// Serves until a signal comes or something breaks; blocks.
///
/// # Errors
/// See [`ServeError`].
pub fn run(settings: &ServeArgs, mender: Arc<dyn Mender>) -> Result<(), ServeError> {
    let runtime = runtime::Builder::new_multi_thread().enable_all().build()?;
    let outcome = runtime.block_on(async {
        let sockets = Sockets::bind(settings.listen, settings.grpc_listen).await?;
        let app = App::start(settings, mender)?;
        let (stop, now) = (CancellationToken::new(), CancellationToken::new());
        shutdown::on_signal(stop.clone(), now.clone())?;
        tokio::select! {
            outcome = serve(sockets, app, stop, settings.drain) => outcome,
            () = now.cancelled() => Ok(()),
        }
    });
    // A mend that nobody waits for may still run; the process does not wait for it either.
    runtime.shutdown_background();
    outcome
}

/// Bound sockets: one for both doors, or one each.
#[derive(Debug)]
pub struct Sockets {
    /// HTTP, and gRPC when it has none of its own.
    pub http: TcpListener,
    /// gRPC alone.
    pub grpc: Option<TcpListener>,
}

impl Sockets {
    /// Binds them.
    ///
    /// # Errors
    /// `Bind`, naming the address.
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

/// Serves on bound sockets until `stop` is cancelled, then drains no longer than `drain`.
///
/// # Errors
/// When a socket breaks or the warm-up fails.
pub async fn serve(
    sockets: Sockets,
    app: Arc<App>,
    stop: CancellationToken,
    drain: Duration,
) -> Result<(), ServeError> {
    info!(address = %sockets.http.local_addr()?, "listening");
    let mut doors = tokio::task::JoinSet::new();
    let pause = app.limits.body_pause;
    if let Some(socket) = sockets.grpc {
        info!(address = %socket.local_addr()?, "listening for grpc alone");
        doors.spawn(door::open(socket, grpc_router(&app), stop.clone(), pause));
        doors.spawn(door::open(
            sockets.http,
            http_router(&app),
            stop.clone(),
            pause,
        ));
    } else {
        doors.spawn(door::open(sockets.http, router(&app), stop.clone(), pause));
    }
    let upkeep = tokio::spawn(upkeep(Arc::clone(&app)));
    let drained = tokio::spawn({
        let (app, stop) = (Arc::clone(&app), stop.clone());
        async move {
            stop.cancelled().await;
            app.drain().await;
        }
    });

    let warm_up = {
        let (app, stop) = (Arc::clone(&app), stop.clone());
        async move {
            let outcome = app.warm_up().await;
            match &outcome {
                Ok(()) => info!("ready"),
                Err(problem::Fault::Draining) => return Ok(()),
                Err(fault) => {
                    error!(%fault, "the warm-up mend failed");
                    stop.cancel();
                }
            }
            outcome
        }
    };
    let warm_up = tokio::spawn(warm_up);

    let serving = async {
        while let Some(door) = doors.join_next().await {
            door.map_err(io::Error::other)?;
        }
        Ok::<(), io::Error>(())
    };
    let outcome = shutdown::bounded(serving, &stop, drain).await;
    let stopped_early = !stop.is_cancelled();
    stop.cancel();
    upkeep.abort();
    drained.abort();
    if warm_up.is_finished() {
        if let Ok(Err(fault)) = warm_up.await {
            return Err(ServeError::WarmUp(fault.to_string()));
        }
    } else {
        warm_up.abort();
    }
    app.close();
    info!(early = stopped_early, "stopped");
    outcome.unwrap_or(Ok(())).map_err(ServeError::Io)
}

/// Both doors.
pub fn router(app: &Arc<App>) -> Router {
    routes::finish(routes::routes().merge(grpc_routes(app)), app)
}

fn http_router(app: &Arc<App>) -> Router {
    routes::finish(routes::routes(), app)
}

fn grpc_router(app: &Arc<App>) -> Router {
    routes::finish(grpc_routes(app), app)
}

fn grpc_routes(app: &Arc<App>) -> Router<Arc<App>> {
    use tower::ServiceExt as _;
    let service = grpc::service(app)
        .map_request(|request: axum::extract::Request| request.map(tonic::body::Body::new));
    Router::new().route_service("/darn.v1.Darn/{method}", service)
}

async fn upkeep(app: Arc<App>) {
    let mut tick = time::interval(UPKEEP);
    loop {
        tick.tick().await;
        app.metrics.upkeep();
        // Freeing a large session takes its time, so not on this thread; nothing depends on when it is done.
        let sessions = Arc::clone(&app.sessions);
        drop(task::spawn_blocking(move || sessions.sweep(Instant::now())));
    }
}
