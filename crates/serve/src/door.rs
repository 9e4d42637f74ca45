//! A process without workers (`--workers 0`): it takes jobs, which other processes run, and refuses what only a worker of its own could answer.

use std::sync::Arc;

use axum::{
    extract::{MatchedPath, Request, State},
    middleware::Next,
    response::{IntoResponse, Response},
};

use super::{app::App, body, error::RequestError, telemetry::RequestId};

/// Routes that are answered on a worker of this process. `POST /inpaint` is not among them: without workers it is handed over as a job.
const WORKER_ROUTES: [&str; 9] = [
    "/holes",
    "/strip",
    "/optimize-anchor",
    "/sessions",
    "/sessions/{id}",
    "/sessions/{id}/inpaint",
    "/sessions/{id}/optimize-anchor",
    "/sessions/{id}/result",
    GRPC,
];
/// The methods of gRPC.
const GRPC: &str = "/darn.v1.Darn/{method}";
/// That one of them which is `POST /inpaint`.
const GRPC_INPAINT: &str = "/darn.v1.Darn/Inpaint";

/// Refuses a request that this process cannot answer because it has no workers.
pub async fn refuse_work(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let matched = request.extensions().get::<MatchedPath>();
    let route = matched.map_or("", MatchedPath::as_str);
    let is_handed_over = request.uri().path() == GRPC_INPAINT;
    if app.has_workers() || !WORKER_ROUTES.contains(&route) || is_handed_over {
        return next.run(request).await;
    }
    if route == GRPC {
        let id = request.extensions().get::<RequestId>().cloned();
        let id = id.map(|id| id.0).unwrap_or_default();
        return RequestError::NoWorkers.grpc(&id).into_http();
    }
    body::discard(request, &app.limits);
    RequestError::NoWorkers.into_response()
}
