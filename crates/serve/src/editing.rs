//! The HTTP door to sessions: a scan is sent once, and constraints alone from then on.

use std::{sync::Arc, time::Instant};

use axum::{
    Router,
    extract::{FromRequestParts, Path, Request, State},
    http::{StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use tokio::task;
use uuid::Uuid;

use super::{
    answer::{self, Cloth, GLB, GLTF, JSON, OCTETS, PARTS},
    app::{App, Upload},
    intake::{self, Asked},
    problem::Fault,
    question::{self, Question},
    routes::admitted,
    sessions::SessionError,
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

/// The session that a path names.
struct SessionId(Uuid);

impl<S: Send + Sync> FromRequestParts<S> for SessionId {
    type Rejection = Fault;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Fault> {
        // What is no id was never given as one.
        let unknown = Fault::Session(SessionError::Unknown);
        let Ok(Path(text)) = Path::<String>::from_request_parts(parts, state).await else {
            return Err(unknown);
        };
        Uuid::try_parse(&text).map(Self).map_err(|_| unknown)
    }
}

async fn open(State(app): State<Arc<App>>, request: Request) -> Result<Response, Fault> {
    let Asked {
        scan,
        question,
        upload,
    } = admitted::<Constraints>(&app, request).await?;
    let asked = question::choosing(question.unwrap_or_default())?;
    let (id, sessions) = (Uuid::new_v4(), Arc::clone(&app.sessions));
    let idle_seconds = sessions.limits().idle.as_secs_f64();
    let job = app.submit(upload, move |mender, cancellation| {
        let kept = mender.open(&scan, &asked, cancellation)?;
        let text = session_json(kept.described(), id, idle_seconds);
        Ok((kept, text))
    });
    // Kept only once the answer is here: what nobody waits for any more costs nobody else their session.
    let (kept, text) = job.await?;
    apart(move || sessions.open(id, kept, Instant::now())).await?;
    let headers = [
        (header::CONTENT_TYPE, JSON.to_owned()),
        (header::LOCATION, format!("/sessions/{id}")),
    ];
    Ok((StatusCode::CREATED, headers, text).into_response())
}

async fn describe(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
) -> Result<Response, Fault> {
    let upload = enter(&app, id)?;
    let idle_seconds = app.sessions.limits().idle.as_secs_f64();
    let text = app
        .submit_to(id, upload, move |session, _| {
            Ok(session_json(session.described(), id, idle_seconds))
        })
        .await?;
    Ok(answer::json_response(text))
}

async fn inpaint(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, Fault> {
    let wanted = answer::preferred(request.headers(), &[GLB, OCTETS, PARTS]);
    let form = match answer::preferred(request.headers(), &[GLB, OCTETS]) {
        OCTETS => PatchForm::Positions,
        _ => PatchForm::Glb,
    };
    let (asked, upload) = asked_of::<Constraints>(&app, id, request).await?;
    let asked = question::moving(asked.unwrap_or_default())?;
    let patches = app
        .submit_to(id, upload, move |session, cancellation| {
            session.patches(&asked, form, cancellation)
        })
        .await?;
    app.metrics.mended(&patches.report);
    Ok(Cloth::of_patches(patches, form).response(wanted))
}

async fn optimize_anchor(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, Fault> {
    let (search, upload) = asked_of::<Search>(&app, id, request).await?;
    let place = "the body, application/json";
    let search = search.ok_or(Fault::NoQuery { place })?;
    let text = app
        .submit_to(id, upload, move |session, cancellation| {
            session
                .optimize_anchor(&search, cancellation)
                .map(|found| answer::json(&found))
        })
        .await?;
    Ok(answer::json_response(text))
}

async fn result(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
    request: Request,
) -> Result<Response, Fault> {
    let wanted = answer::preferred(request.headers(), &[GLB, GLTF, PARTS]);
    let upload = enter(&app, id)?;
    let mended = app
        .submit_to(id, upload, |session, cancellation| {
            session.result(cancellation)
        })
        .await?;
    app.metrics.mended(&mended.report);
    Ok(Cloth::from(mended).response(wanted))
}

async fn delete(
    State(app): State<Arc<App>>,
    SessionId(id): SessionId,
) -> Result<StatusCode, Fault> {
    app.serving()?;
    let sessions = Arc::clone(&app.sessions);
    apart(move || sessions.delete(id, Instant::now())).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The right to be put into the queue with a job for a session that is there.
fn enter(app: &App, id: Uuid) -> Result<Upload, Fault> {
    app.serving()?;
    app.sessions.find(id, Instant::now())?;
    app.upload()
}

/// What is asked of a session that is there.
async fn asked_of<Q: Question>(
    app: &App,
    id: Uuid,
    request: Request,
) -> Result<(Option<Q>, Upload), Fault> {
    match enter(app, id) {
        Ok(upload) => Ok((intake::question(request, &app.limits).await?, upload)),
        Err(fault) => {
            let (parts, body) = request.into_parts();
            intake::refuse(&parts.headers, body, &app.limits);
            Err(fault)
        }
    }
}

/// Does what frees sessions away from the async threads.
async fn apart(
    work: impl FnOnce() -> Result<(), SessionError> + Send + 'static,
) -> Result<(), Fault> {
    let done = task::spawn_blocking(work).await;
    Ok(done.map_err(|_| Fault::Internal)??)
}

fn session_json(mut session: v1::Session, id: Uuid, idle_seconds: f64) -> Vec<u8> {
    session.id = id.to_string();
    session.idle_seconds = idle_seconds;
    answer::json(&session)
}
