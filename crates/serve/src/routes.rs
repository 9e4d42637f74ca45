//! The HTTP routes of a scan sent with each request, the probes, and the layers around all routes.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use axum::{
    Router,
    extract::{MatchedPath, Request, State},
    http::{HeaderValue, Method, Version, header, uri::Authority},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use opentelemetry::trace::FutureExt as _;
use tokio::task;
use tower_http::{
    catch_panic::CatchPanicLayer,
    cors::{AllowOrigin, CorsLayer},
};
use tracing::{Instrument as _, field::Empty, info, info_span, warn};

use super::{
    accept::preferred,
    app::App,
    authorization::authorize,
    body::{self, ScanRequest},
    client::Caller,
    counted::counted_answer,
    digest::{CONTENT_DIGEST, REPR_DIGEST},
    door::refuse_work,
    error::RequestError,
    job_events::LAST_EVENT_ID,
    job_request::IDEMPOTENCY_KEY,
    job_routes,
    media_types::{GLB, GLTF, JSON, MULTIPART_MIXED, OBJ, PLY, PROMETHEUS, ZIP},
    openapi, parameters,
    prefer::{PREFER, PREFERENCE_APPLIED, Preferences},
    quota_check::{RATELIMIT, RATELIMIT_POLICY},
    response::{self, ANCHOR_DISTANCE, HOLES_FILLED, LOOPS_SKIPPED, MendResponse, RESULT, STRIP},
    result_cache::{CACHE_STATUS, CacheStatus, RequestKey},
    scan_files::AnswerForm,
    service_info, session_routes,
    telemetry::{REQUEST_ID, RequestId, SERVER_TIMING},
    traces,
};
use darn_contract::{Constraints, Search, excerpt};
use darn_jobs::State as JobState;

/// All HTTP routes; [`finish`] makes them a service.
pub fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/inpaint", post(inpaint))
        .route("/holes", post(holes))
        .route("/optimize-anchor", post(optimize_anchor))
        .route("/strip", post(strip))
        .merge(session_routes::routes())
        .merge(job_routes::routes())
        .route("/livez", get(|| async { "alive\n" }))
        .route("/readyz", get(readyz))
        .route("/metrics", get(metrics))
        .route("/info", get(service_info::answer))
        .route("/openapi.json", get(openapi_document))
        .fallback(|| async { RequestError::NotFound })
        .method_not_allowed_fallback(|| async { RequestError::MethodNotAllowed })
}

/// Adds the layers around all routes of a listener: panics, the lack of workers, keys, CORS, the check of the host, and outermost what every answer gets: request
/// ids, problem documents, metrics, the log.
pub fn finish(routes: Router<Arc<App>>, app: &Arc<App>) -> Router {
    routes
        .layer(CatchPanicLayer::custom(|_| {
            RequestError::Internal.into_response()
        }))
        .layer(middleware::from_fn_with_state(Arc::clone(app), refuse_work))
        .layer(middleware::from_fn_with_state(Arc::clone(app), authorize))
        .layer(cors(&app.allow_origin))
        .layer(middleware::from_fn_with_state(Arc::clone(app), check_host))
        .layer(middleware::from_fn_with_state(Arc::clone(app), observe))
        .with_state(Arc::clone(app))
}

/// How long a browser may go by the answer to a preflight: as long as Chromium does at most, which is less than others.
const PREFLIGHT_AGE: Duration = Duration::from_secs(2 * 60 * 60);

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
        .max_age(PREFLIGHT_AGE)
        .allow_headers([
            header::ACCEPT,
            header::AUTHORIZATION,
            header::CONTENT_ENCODING,
            header::CONTENT_TYPE,
            CONTENT_DIGEST,
            REPR_DIGEST,
            REQUEST_ID,
            PREFER,
            IDEMPOTENCY_KEY,
            LAST_EVENT_ID,
        ])
        .expose_headers([
            HOLES_FILLED,
            LOOPS_SKIPPED,
            CACHE_STATUS,
            header::ETAG,
            RESULT,
            STRIP,
            REPR_DIGEST,
            ANCHOR_DISTANCE,
            REQUEST_ID,
            PREFERENCE_APPLIED,
            header::LOCATION,
            header::CONTENT_LOCATION,
            header::RETRY_AFTER,
            header::WWW_AUTHENTICATE,
            RATELIMIT,
            RATELIMIT_POLICY,
            SERVER_TIMING,
        ])
}

/// Refuses a request whose target is in doubt (RFC 9112, section 3.2): with more than one header `host`, an invalid one, or, in HTTP/1.1,
/// none. A proxy in front of the service might have read another one.
async fn check_host(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let mut hosts = request.headers().get_all(header::HOST).iter();
    let problem = match (hosts.next(), hosts.next()) {
        (None, _) if request.version() == Version::HTTP_11 => "HTTP/1.1 needs the header `host`",
        (Some(_), Some(_)) => "the header `host` comes twice",
        (Some(host), None) if !is_host(host.as_bytes()) => "the header `host` names no host",
        _ => return next.run(request).await,
    };
    body::discard(request, &app.limits);
    RequestError::Malformed(problem.to_owned()).into_response()
}

/// Whether it is `host` or `host:port`; it is empty when the target has no host.
fn is_host(value: &[u8]) -> bool {
    value.is_empty() || (!value.contains(&b'@') && Authority::try_from(value).is_ok())
}

/// Gives a request its id and log span, renders its error, and records its metrics.
async fn observe(State(app): State<Arc<App>>, mut request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = RequestId::of(request.headers());
    let route = request
        .extensions()
        .get::<MatchedPath>()
        .map_or("(none)", MatchedPath::as_str)
        .to_owned();
    let method = excerpt(request.method().as_str());
    let span = info_span!("request", id = id.0, %method, route, key = Empty, trace = Empty);
    let trace = traces::request_span(request.headers(), &method, &route);
    if let Some(id) = traces::trace_id(&trace) {
        span.record("trace", id);
    }
    request.extensions_mut().insert(id.clone());

    let answered = next.run(request).instrument(span.clone());
    let mut response = answered.with_context(trace.clone()).await;
    let error = response.extensions_mut().remove::<RequestError>();
    if let Some(error) = &error {
        response = error.render(&id.0, std::mem::take(response.headers_mut()));
    }
    if let Ok(value) = HeaderValue::from_str(&id.0) {
        response.headers_mut().insert(REQUEST_ID, value);
    }

    let took = started.elapsed();
    let timing = format!("total;dur={:.2}", took.as_secs_f64() * 1000.0);
    if let Ok(value) = HeaderValue::try_from(timing) {
        response.headers_mut().insert(SERVER_TIMING, value);
    }

    let response = response.map(|body| counted_answer(body, &app.limits.memory));
    let status = response.status().as_u16();
    app.metrics.answered(&route, status, took);
    let code = error.as_ref().map(|error| error.code().word);
    traces::end_request(&trace, status, code);
    span.in_scope(|| info!(status, code, ms = took.as_secs_f64() * 1000.0, "answered"));
    response
}

async fn inpaint(State(app): State<Arc<App>>, request: Request) -> Result<Response, RequestError> {
    let preferences = Preferences::of(request.headers());
    // A preference that the caller's key does not allow is passed over, as any that cannot be followed.
    let may_hand_over = Caller::of(request.extensions()).may_hand_over();
    let jobs = app.jobs.as_ref().filter(|_| may_hand_over);
    match jobs {
        Some(jobs) if preferences.respond_async => {
            return job_routes::inpaint_later(&app, jobs, request, preferences).await;
        }
        Some(jobs) if !app.has_workers() => {
            return job_routes::inpaint_elsewhere(&app, jobs, request).await;
        }
        None if !app.has_workers() => {
            body::discard(request, &app.limits);
            return Err(RequestError::NoWorkers);
        }
        _ => {}
    }
    let headers = request.headers().clone();
    let ScanRequest {
        scan,
        files,
        parameters,
        upload,
    } = body::receive_scan::<Constraints>(&app, request).await?;
    let constraints = parameters.unwrap_or_default();
    let AnswerForm { media_type, form } = files.answer(&headers);
    let service = Arc::clone(&app);
    app.submit(upload, scan.len(), move |mender, budget| {
        let known = (service.results.as_ref())
            .map(|results| (results, RequestKey::of(&scan, &constraints, form)));
        if let Some(mend) = known.as_ref().and_then(|(results, key)| results.get(key)) {
            return Ok(with_status(mend.render(media_type), CacheStatus::Hit));
        }
        let mended = mender.inpaint(scan, &constraints, budget)?;
        let mended = mender.repacked(mended, form, budget)?;
        let response = MendResponse::from(mended);
        let Some((results, key)) = known else {
            return Ok(response.render(media_type, &service.metrics));
        };
        let mend = Arc::new(response.keep(&service.metrics));
        let status = results.keep(key, &mend);
        Ok(with_status(mend.render(media_type), status))
    })
    .await
}

fn with_status(mut answer: Response, status: CacheStatus) -> Response {
    answer.headers_mut().insert(CACHE_STATUS, status.value());
    answer
}

async fn holes(State(app): State<Arc<App>>, request: Request) -> Result<Response, RequestError> {
    let wanted = match parameters::holes_query(request.uri().query()) {
        Ok(wanted) => wanted,
        Err(error) => {
            body::discard(request, &app.limits);
            return Err(error);
        }
    };
    let received = body::receive_scan(&app, request).await?;
    let ScanRequest { scan, upload, .. } = received.without_constraints()?;
    let text = app
        .submit(upload, scan.len(), move |mender, budget| {
            Ok(response::json(&mender.find_holes(scan, wanted, budget)?))
        })
        .await?;
    Ok(response::json_response(text))
}

async fn strip(State(app): State<Arc<App>>, request: Request) -> Result<Response, RequestError> {
    let headers = request.headers().clone();
    let received = body::receive_scan(&app, request).await?;
    let ScanRequest {
        scan,
        files,
        upload,
        ..
    } = received.without_constraints()?;
    let AnswerForm { media_type, form } = files.answer(&headers);
    app.submit(upload, scan.len(), move |mender, budget| {
        let stripped = mender.strip(scan, form, budget)?;
        Ok(response::stripped(stripped, media_type))
    })
    .await
}

async fn optimize_anchor(
    State(app): State<Arc<App>>,
    request: Request,
) -> Result<Response, RequestError> {
    let headers = request.headers().clone();
    let ScanRequest {
        scan,
        files,
        parameters,
        upload,
    } = body::receive_scan::<Search>(&app, request).await?;
    let place = "the part `query` of multipart/form-data, beside the part `scan`";
    let search = parameters.ok_or(RequestError::NoQuery { place })?;
    if preferred(&headers, &[JSON, GLB, GLTF, OBJ, PLY, ZIP, MULTIPART_MIXED]) == JSON {
        let text = app
            .submit(upload, scan.len(), move |mender, budget| {
                let found = mender.optimize_anchor(scan, &search, budget)?;
                Ok(response::json(&found))
            })
            .await?;
        return Ok(response::json_response(text));
    }
    let AnswerForm { media_type, form } = files.answer(&headers);
    let service = Arc::clone(&app);
    app.submit(upload, scan.len(), move |mender, budget| {
        let mended = mender.mend_to_target(scan, &search, budget)?;
        let mended = mender.repacked(mended, form, budget)?;
        Ok(MendResponse::from(mended).render(media_type, &service.metrics))
    })
    .await
}

async fn openapi_document() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, JSON)], openapi::text())
}

async fn readyz(State(app): State<Arc<App>>) -> Result<&'static str, RequestError> {
    app.ready().map(|()| "ready\n")
}

async fn metrics(State(app): State<Arc<App>>) -> impl IntoResponse {
    // The gauges must not count sessions that were idle for too long.
    let sessions = Arc::clone(&app.sessions);
    (task::spawn_blocking(move || sessions.end_idle(Instant::now())).await).ok();
    if let Some(jobs) = &app.jobs {
        match jobs.counts().await {
            Ok(counts) => {
                let of = |state| counts.get(&state).copied().unwrap_or_default();
                (app.metrics).durable_jobs(of(JobState::Waiting), of(JobState::Running));
            }
            Err(error) => warn!(?error, "the jobs cannot be counted"),
        }
        match jobs.store().waiting_deliveries().await {
            Ok(waiting) => app.metrics.webhooks_waiting(waiting),
            Err(error) => warn!(?error, "the webhooks cannot be counted"),
        }
    }
    ([(header::CONTENT_TYPE, PROMETHEUS)], app.metrics.render())
}
