//! The HTTP door: paths, what they take and what they answer.

use std::{sync::Arc, time::Instant};

use axum::{
    Json, Router,
    body::Body,
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use tower_http::{
    catch_panic::CatchPanicLayer,
    cors::{AllowOrigin, CorsLayer},
};
use tracing::{Instrument as _, info, info_span};
use uuid::Uuid;

use super::{
    app::App,
    errors::Mended,
    intake::{self, Asked},
    openapi,
    problem::Fault,
    telemetry::{REQUEST_ID, RequestId},
};

/// How many holes were filled, as a header beside the scan.
pub const HOLES_FILLED: HeaderName = HeaderName::from_static("darn-holes-filled");
/// How many loops were left as they were.
pub const LOOPS_SKIPPED: HeaderName = HeaderName::from_static("darn-loops-skipped");

/// The HTTP routes; `finish` turns them into a service.
pub fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/inpaint", post(inpaint))
        .route("/holes", post(holes))
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
        .allow_methods([axum::http::Method::GET, axum::http::Method::POST])
        .allow_headers([
            header::ACCEPT,
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            REQUEST_ID,
        ])
        .expose_headers([HOLES_FILLED, LOOPS_SKIPPED, REQUEST_ID, header::RETRY_AFTER])
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
    let in_parts = accepts_parts(request.headers());
    let Asked {
        scan,
        constraints,
        upload,
    } = admitted(&app, request).await?;
    let constraints = constraints.unwrap_or_default();
    let mended = app
        .submit(upload, move |menders| menders.inpaint(&scan, &constraints))
        .await?;
    app.metrics.mended(&mended.report);
    Ok(if in_parts {
        parts_response(mended)
    } else {
        scan_response(mended)
    })
}

async fn holes(State(app): State<Arc<App>>, request: Request) -> Result<Response, Fault> {
    let Asked { scan, upload, .. } = admitted(&app, request).await?.unconstrained()?;
    let report = app
        .submit(upload, move |menders| menders.find_holes(&scan))
        .await?;
    Ok(Json(report).into_response())
}

async fn admitted(app: &App, request: Request) -> Result<Asked, Fault> {
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
    (
        [(header::CONTENT_TYPE, "text/plain; version=0.0.4")],
        app.metrics.render(),
    )
}

/// Whether the caller wants scan and report as two parts.
fn accepts_parts(headers: &HeaderMap) -> bool {
    (headers.get_all(header::ACCEPT).iter())
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .any(|media| {
            media
                .split(';')
                .next()
                .is_some_and(|media| media.trim().eq_ignore_ascii_case("multipart/mixed"))
        })
}

fn media_type(scan: &[u8]) -> &'static str {
    if scan.starts_with(b"glTF") {
        "model/gltf-binary"
    } else {
        "model/gltf+json"
    }
}

fn counts(mended: &Mended) -> [(HeaderName, String); 2] {
    [
        (HOLES_FILLED, mended.report.holes.len().to_string()),
        (LOOPS_SKIPPED, mended.report.skipped.len().to_string()),
    ]
}

fn scan_response(mended: Mended) -> Response {
    let media = [(header::CONTENT_TYPE, media_type(&mended.bytes))];
    (
        StatusCode::OK,
        media,
        counts(&mended),
        Body::from(mended.bytes),
    )
        .into_response()
}

fn parts_response(mended: Mended) -> Response {
    let boundary = format!("darn-{}", Uuid::new_v4().simple());
    let counts = counts(&mended);
    let media = media_type(&mended.bytes);
    let report = serde_json::to_vec(&mended.report).unwrap_or_default();
    let mut body = Vec::with_capacity(mended.bytes.len() + report.len() + 512);
    for (name, media, bytes) in [
        ("report", "application/json", &report),
        ("scan", media, &mended.bytes),
    ] {
        let head = format!(
            "--{boundary}\r\ncontent-disposition: attachment; name=\"{name}\"\r\ncontent-type: {media}\r\ncontent-length: {}\r\n\r\n",
            bytes.len()
        );
        body.extend_from_slice(head.as_bytes());
        body.extend_from_slice(bytes);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
    let media = [(
        header::CONTENT_TYPE,
        format!("multipart/mixed; boundary={boundary}"),
    )];
    (StatusCode::OK, media, counts, Body::from(body)).into_response()
}
