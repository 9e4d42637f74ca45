//! The HTTP routes of sessions: a scan is sent once, later requests carry constraints alone.

use std::{sync::Arc, time::Instant};

use axum::{
    Router,
    extract::{FromRequestParts, Path, Request, State},
    http::{HeaderMap, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use tokio::task;
use uuid::Uuid;

use super::{
    accept::preferred,
    anchor_lines,
    app::{App, UploadPermit},
    body::{self, ScanRequest},
    client::Caller,
    error::RequestError,
    media_types::{GLB, GLTF, JSON, MULTIPART_MIXED, NDJSON, OBJ, OCTET_STREAM, PLY},
    parameters::{self, Parameters},
    response::{self, MendResponse, result_header},
    session_store::SessionError,
};
use darn_contract::port::PatchForm;
use darn_contract::{Constraints, Search, v1};

/// The routes below `/sessions`.
pub fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/sessions", post(open))
        .route("/sessions/{id}", get(describe).delete(delete))
        .route("/sessions/{id}/inpaint", post(inpaint))
        .route("/sessions/{id}/optimize-anchor", post(optimize_anchor))
        .route("/sessions/{id}/result", get(result))
}

/// The session id in a path, if this process would keep its session.
struct SessionId(Uuid);

impl FromRequestParts<Arc<App>> for SessionId {
    type Rejection = RequestError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, RequestError> {
        // A text that is not an id is an unknown session.
        let unknown = SessionError::Unknown;
        let Ok(Path(text)) = Path::<String>::from_request_parts(parts, app).await else {
            return Err(unknown.into());
        };
        let id = Uuid::try_parse(&text).map_err(|_| unknown)?;
        app.check_session_place(id).await?;
        Ok(Self(id))
    }
}

async fn open(State(app): State<Arc<App>>, request: Request) -> Result<Response, RequestError> {
    let opener = app.opener(&Caller::of(request.extensions()));
    if let Err(error) = app.sessions.check_quota(&opener) {
        body::discard(request, &app.limits);
        return Err(error.into());
    }
    let ScanRequest {
        scan,
        parameters,
        upload,
        ..
    } = body::receive_scan::<Constraints>(&app, request).await?;
    let constraints = parameters::only_selection(parameters.unwrap_or_default())?;
    let (id, sessions) = (app.instance.session_id(), Arc::clone(&app.sessions));
    let idle_seconds = sessions.limits().idle.as_secs_f64();
    let job = app.submit(upload, scan.len(), move |mender, budget| {
        let session = mender.open(scan, &constraints, budget)?;
        let described = v1::Session {
            constraints: Some(v1::Constraints::default()),
            ..session.described()
        };
        let text = session_json(described, id, idle_seconds);
        let result = result_header(&session.outcome());
        Ok((session, text, result))
    });
    // Inserted only while the caller still waits: an abandoned session must not evict another.
    let (session, text, result) = job.await?;
    run_blocking(move || sessions.insert(id, opener, session, Instant::now())).await?;
    let headers = [
        (header::CONTENT_TYPE, JSON.to_owned()),
        (header::LOCATION, format!("/sessions/{id}")),
    ];
    let result: HeaderMap = result.into_iter().collect();
    Ok((StatusCode::CREATED, headers, result, text).into_response())
}

async fn describe(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, RequestError> {
    let upload = session_permit(&app, id, &request)?;
    let idle_seconds = app.sessions.limits().idle.as_secs_f64();
    let text = app
        .submit_to_session(id, upload, move |session, _| {
            Ok(session_json(session.described(), id, idle_seconds))
        })
        .await?;
    Ok(response::json_response(text))
}

async fn inpaint(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, RequestError> {
    let is_draft = match parameters::is_draft(request.uri().query()) {
        Ok(is_draft) => is_draft,
        Err(error) => {
            body::discard(request, &app.limits);
            return Err(error);
        }
    };
    let media_type = preferred(request.headers(), &[GLB, OCTET_STREAM, MULTIPART_MIXED]);
    // Also the form of the patches inside multipart/mixed.
    let form = match preferred(request.headers(), &[GLB, OCTET_STREAM]) {
        OCTET_STREAM => PatchForm::Positions,
        _ => PatchForm::Glb,
    };
    let SessionRequest { parameters, upload } = receive::<Constraints>(&app, id, request).await?;
    let constraints = parameters::only_edits(parameters.unwrap_or_default())?;
    if is_draft {
        let draft = app.submit_to_session(id, upload, move |session, budget| {
            session.draft(&constraints, budget)
        });
        return Ok(response::draft(draft.await?));
    }
    let service = Arc::clone(&app);
    app.submit_to_session(id, upload, move |session, budget| {
        let patches = session.patches(&constraints, form, budget)?;
        Ok(MendResponse::of_patches(patches, form).render(media_type, &service.metrics))
    })
    .await
}

async fn optimize_anchor(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, RequestError> {
    let media_type = preferred(request.headers(), &[JSON, NDJSON]);
    let SessionRequest { parameters, upload } = receive::<Search>(&app, id, request).await?;
    let place = "the body, application/json";
    let search = parameters.ok_or(RequestError::NoQuery { place })?;
    if media_type == NDJSON {
        let client = upload.client().clone();
        let searched = anchor_lines::Searched {
            app,
            client,
            id,
            search,
        };
        return anchor_lines::answer(searched, upload).await;
    }
    let text = app
        .submit_to_session(id, upload, move |session, budget| {
            session
                .optimize_anchor(&search, budget)
                .map(|found| response::json(&found))
        })
        .await?;
    Ok(response::json_response(text))
}

async fn result(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, RequestError> {
    let media_type = preferred(request.headers(), &[GLB, GLTF, OBJ, PLY, MULTIPART_MIXED]);
    let upload = session_permit(&app, id, &request)?;
    let service = Arc::clone(&app);
    app.submit_to_session(id, upload, move |session, budget| {
        let mended = session.result(budget)?;
        Ok(MendResponse::from(mended).render(media_type, &service.metrics))
    })
    .await
}

async fn delete(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    caller: Caller,
) -> Result<StatusCode, RequestError> {
    app.check_serving()?;
    let (sessions, client) = (Arc::clone(&app.sessions), app.client(&caller));
    run_blocking(move || sessions.delete(id, &client, Instant::now())).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// A request to an open session.
struct SessionRequest<P> {
    /// Checked constraints or query; `None` when the request carries none.
    parameters: Option<P>,
    upload: UploadPermit,
}

/// Takes an upload permit for a request to a session that exists.
fn session_permit(app: &App, id: Uuid, request: &Request) -> Result<UploadPermit, RequestError> {
    app.check_serving()?;
    let client = app.client(&Caller::of(request.extensions()));
    app.sessions.check(id, &client, Instant::now())?;
    app.upload_permit_of(request, parameters::MAX_BYTES)
}

/// Receives a request to a session that exists.
async fn receive<P: Parameters>(
    app: &App,
    id: Uuid,
    request: Request,
) -> Result<SessionRequest<P>, RequestError> {
    match session_permit(app, id, &request) {
        Ok(upload) => Ok(SessionRequest {
            parameters: body::read_parameters(request, &app.limits).await?,
            upload,
        }),
        Err(error) => {
            body::discard(request, &app.limits);
            Err(error)
        }
    }
}

/// Runs `work` on a thread that may block: freeing a large session takes long.
async fn run_blocking(
    work: impl FnOnce() -> Result<(), SessionError> + Send + 'static,
) -> Result<(), RequestError> {
    let done = task::spawn_blocking(work).await;
    Ok(done.map_err(|_| RequestError::Internal)??)
}

fn session_json(mut session: v1::Session, id: Uuid, idle_seconds: f64) -> Vec<u8> {
    session.id = id.to_string();
    session.idle_seconds = idle_seconds;
    response::json(&session)
}
