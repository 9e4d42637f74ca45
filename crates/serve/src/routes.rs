//! The HTTP door: paths, what they take and what they answer.

use std::{sync::Arc, time::Instant};

use axum::{
    Json, Router,
    extract::{MatchedPath, Request, State},
    http::{HeaderValue, Method, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use tokio::task;
use tower_http::{
    catch_panic::CatchPanicLayer,
    cors::{AllowOrigin, CorsLayer},
};
use tracing::{Instrument as _, info, info_span};

use super::{
    answer::{self, ANCHOR_DISTANCE, Cloth, GLB, GLTF, HOLES_FILLED, JSON, LOOPS_SKIPPED, PARTS},
    app::App,
    editing,
    intake::{self, Asked},
    openapi,
    problem::Fault,
    question::Question,
    telemetry::{REQUEST_ID, RequestId},
};
use darn_contract::{Constraints, Search};

/// The HTTP routes; `finish` turns them into a service.
pub fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/inpaint", post(inpaint))
        .route("/holes", post(holes))
        .route("/optimize-anchor", post(optimize_anchor))
        .merge(editing::routes())
        .route("/livez", get(|| async { "alive\n" }))
        .route("/readyz", get(readyz))
        .route("/metrics", get(metrics))
        .route("/openapi.json", get(|| async { Json(openapi::document()) }))
        .fallback(|| async { Fault::NotFound })
        .method_not_allowed_fallback(|| async { Fault::MethodNotAllowed })
}

/// Puts the layers around all routes of a listener: panics, request ids, problem documents, counts, web origins.
pub fn finish(routes: Router<Arc<App>>, app: &Arc<App>) -> Router {
    routes
        .layer(CatchPanicLayer::custom(|_| Fault::Internal.into_response()))
        .layer(middleware::from_fn_with_state(Arc::clone(app), around))
        .layer(cors(&app.allow_origin))
        .with_state(Arc::clone(app))
}

fn cors(origins: &[String]) -> CorsLayer {
    let origins = if origins.iter().any(|origin| origin == "*") {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(
            origins
                .iter()
                .filter_map(|origin| HeaderValue::from_str(origin).ok()),
        )
    };
    CorsLayer::new()
        .allow_origin(origins)
        .allow_methods([Method::GET, Method::POST, Method::DELETE])
        .allow_headers([
            header::ACCEPT,
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            REQUEST_ID,
        ])
        .expose_headers([
            HOLES_FILLED,
            LOOPS_SKIPPED,
            ANCHOR_DISTANCE,
            REQUEST_ID,
            header::LOCATION,
            header::RETRY_AFTER,
        ])
}

async fn around(State(app): State<Arc<App>>, mut request: Request, next: Next) -> Response {
    let begun = Instant::now();
    let id = RequestId::of(request.headers());
    let route = request
        .extensions()
        .get::<MatchedPath>()
        .map_or("(none)", MatchedPath::as_str)
        .to_owned();
    let span = info_span!("request", id = id.0, method = %request.method(), route);
    request.extensions_mut().insert(id.clone());

    let mut response = next.run(request).instrument(span.clone()).await;
    let fault = response.extensions_mut().remove::<Fault>();
    if let Some(fault) = &fault {
        response = fault.render(&id.0, std::mem::take(response.headers_mut()));
    }
    if let Ok(value) = HeaderValue::from_str(&id.0) {
        response.headers_mut().insert(REQUEST_ID, value);
    }

    let status = response.status().as_u16();
    app.metrics.answered(&route, status, begun.elapsed());
    let code = fault.as_ref().map(Fault::code);
    span.in_scope(|| {
        info!(
            status,
            code,
            ms = begun.elapsed().as_secs_f64() * 1000.0,
            "answered"
        )
    });
    response
}

async fn inpaint(State(app): State<Arc<App>>, request: Request) -> Result<Response, Fault> {
    let wanted = answer::preferred(request.headers(), &[GLB, GLTF, PARTS]);
    let Asked {
        scan,
        question,
        upload,
    } = admitted::<Constraints>(&app, request).await?;
    let asked = question.unwrap_or_default();
    let mended = app
        .submit(upload, move |mender, cancellation| {
            mender.inpaint(&scan, &asked, cancellation)
        })
        .await?;
    app.metrics.mended(&mended.report);
    Ok(Cloth::from(mended).response(wanted))
}

async fn holes(State(app): State<Arc<App>>, request: Request) -> Result<Response, Fault> {
    let Asked { scan, upload, .. } = admitted(&app, request).await?.unconstrained()?;
    let report = app
        .submit(upload, move |mender, _| mender.find_holes(&scan))
        .await?;
    Ok(Json(report).into_response())
}

async fn optimize_anchor(State(app): State<Arc<App>>, request: Request) -> Result<Response, Fault> {
    let wanted = answer::preferred(request.headers(), &[JSON, GLB, GLTF, PARTS]);
    let Asked {
        scan,
        question,
        upload,
    } = admitted::<Search>(&app, request).await?;
    let place = "the part `query` of multipart/form-data, beside the part `scan`";
    let search = question.ok_or(Fault::NoQuery { place })?;
    if wanted == JSON {
        let text = app
            .submit(upload, move |mender, cancellation| {
                let found = mender.optimize_anchor(&scan, &search, cancellation)?;
                Ok(answer::json(&found))
            })
            .await?;
        return Ok(answer::json_response(text));
    }
    let mended = app
        .submit(upload, move |mender, cancellation| {
            mender.mend_to_target(&scan, &search, cancellation)
        })
        .await?;
    app.metrics.mended(&mended.report);
    Ok(Cloth::from(mended).response(wanted))
}

/// A scan and what is asked of it; its body is read only when there is room for the job.
pub(super) async fn admitted<Q: Question>(app: &App, request: Request) -> Result<Asked<Q>, Fault> {
    match app.upload() {
        Ok(upload) => intake::asked(request, upload, &app.limits).await,
        Err(fault) => {
            let (parts, body) = request.into_parts();
            intake::refuse(&parts.headers, body, &app.limits);
            Err(fault)
        }
    }
}

async fn readyz(State(app): State<Arc<App>>) -> Result<&'static str, Fault> {
    app.ready().map(|()| "ready\n")
}

async fn metrics(State(app): State<Arc<App>>) -> impl IntoResponse {
    // So that no session is counted whose time is over.
    let sessions = Arc::clone(&app.sessions);
    (task::spawn_blocking(move || sessions.sweep(Instant::now())).await).ok();
    (
        [(header::CONTENT_TYPE, "text/plain; version=0.0.4")],
        app.metrics.render(),
    )
}
