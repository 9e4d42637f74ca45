//! The HTTP routes of jobs: a scan is handed over, its result is fetched later.

use std::{sync::Arc, time::Duration};

use axum::{
    Router,
    extract::{FromRequestParts, Path, Request, State},
    http::{HeaderMap, StatusCode, Uri, header, request::Parts},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use darn_jobs::{Job, Jobs, ListQuery, State as JobState};
use tokio::{
    select,
    time::{Instant, sleep_until},
};
use uuid::Uuid;

use super::{
    app::App,
    body,
    client::Caller,
    error::RequestError,
    job_answer,
    job_events::{self, Listener},
    job_input::Inlet,
    job_message::{message, messages, problem_document},
    job_quota,
    job_request::{JobLabels, JobRequest},
    job_upload::{self, JobUpload},
    key_file::Scope,
    media_types::{JSON, PROBLEM_JSON},
    prefer::{PREFERENCE_APPLIED, Preferences},
    response,
    telemetry::RequestId,
};
use darn_contract::{excerpt, v1};

/// Jobs of a page, where the query does not say.
pub const DEFAULT_LIMIT: u32 = 50;
/// Most jobs of a page.
pub const MAX_LIMIT: u32 = 200;

/// The routes below `/jobs`.
pub fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/jobs", post(submit).get(list))
        .route("/jobs/{id}", get(describe).delete(delete))
        .route("/jobs/{id}/result", get(result))
        .route("/jobs/{id}/report", get(report))
        .route("/jobs/{id}/events", get(events))
        .route("/jobs/{id}/cancel", post(cancel))
        .route("/jobs/{id}/retry", post(retry))
}

/// The jobs of a service that keeps some.
struct KeptJobs(Arc<Jobs>);

impl FromRequestParts<Arc<App>> for KeptJobs {
    type Rejection = RequestError;

    async fn from_request_parts(_: &mut Parts, app: &Arc<App>) -> Result<Self, RequestError> {
        app.jobs.clone().map(Self).ok_or(RequestError::JobsNotKept)
    }
}

/// A job that the caller may see: for all others it does not exist.
pub struct KnownJob {
    /// All jobs.
    pub jobs: Arc<Jobs>,
    /// This one.
    pub job: Job,
}

impl FromRequestParts<Arc<App>> for KnownJob {
    type Rejection = RequestError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, RequestError> {
        // A text that cannot be read is no id, either.
        let text = Path::<String>::from_request_parts(parts, app).await;
        let text = text.map(|Path(text)| text).unwrap_or_default();
        Self::find(app, &Caller::of(&parts.extensions), &text).await
    }
}

impl KnownJob {
    /// The job of an id.
    ///
    /// # Errors
    /// `JobsNotKept` or `NoSuchJob`.
    pub async fn find(app: &App, caller: &Caller, id: &str) -> Result<Self, RequestError> {
        let jobs = app.jobs.clone().ok_or(RequestError::JobsNotKept)?;
        // A text that is not an id is an unknown job.
        let id = Uuid::try_parse(id).map_err(|_| RequestError::NoSuchJob)?;
        let job = jobs.get(id).await?;
        if caller.sees(&job) {
            Ok(Self { jobs, job })
        } else {
            Err(RequestError::NoSuchJob)
        }
    }

    /// Cancels it.
    ///
    /// # Errors
    /// `JobWrongState`.
    pub async fn cancel(&self) -> Result<v1::Job, RequestError> {
        let cancelled = self.jobs.cancel(self.job.id).await?;
        Ok(message(&self.jobs, &cancelled).await?)
    }

    /// Lets it wait again.
    ///
    /// # Errors
    /// `JobWrongState`, `JobExpired` or `Quota`.
    pub async fn retry(&self, caller: &Caller) -> Result<v1::Job, RequestError> {
        let turn = job_quota::turn(caller).await;
        if turn.is_some() {
            job_quota::check(&self.jobs, caller).await?;
        }
        let retried = self.jobs.retry(self.job.id).await?;
        drop(turn);
        Ok(message(&self.jobs, &retried).await?)
    }
}

async fn submit(State(app): State<Arc<App>>, request: Request) -> Result<Response, RequestError> {
    let labels = JobLabels::of(request.headers(), request.uri().query())
        .and_then(|labels| labels.checked(&app, &Caller::of(request.extensions())));
    let jobs = match Caller::of(request.extensions()).may_hand_over() {
        true => app.jobs.as_ref().ok_or(RequestError::JobsNotKept),
        false => Err(RequestError::InsufficientScope { scope: Scope::Jobs }),
    };
    match (jobs, labels) {
        (Ok(jobs), Ok(labels)) => {
            let job = hand_over(&app, jobs, request, labels).await?;
            accepted(jobs, &job).await
        }
        (Err(error), _) | (_, Err(error)) => {
            body::discard(request, &app.limits);
            Err(error)
        }
    }
}

/// `POST /inpaint` of a client that prefers a job: waits as long as it allows, then answers with the job.
///
/// # Errors
/// Those of receiving the request, and of the jobs.
pub async fn inpaint_later(
    app: &App,
    jobs: &Jobs,
    request: Request,
    preferences: Preferences,
) -> Result<Response, RequestError> {
    let wait = preferences.wait.unwrap_or_default();
    let mut answer = inpaint_within(app, jobs, request, wait.min(app.limits.deadline)).await?;
    let applied = preferences.applied();
    answer.headers_mut().insert(PREFERENCE_APPLIED, applied);
    Ok(answer)
}

/// `POST /inpaint` to a process without workers: another one mends the scan as a job, whose result is waited for until the deadline.
///
/// # Errors
/// Those of receiving the request, and of the jobs.
pub async fn inpaint_elsewhere(
    app: &App,
    jobs: &Jobs,
    request: Request,
) -> Result<Response, RequestError> {
    inpaint_within(app, jobs, request, app.limits.deadline).await
}

/// Hands a scan over as a job; the answer is its result, or the job itself where that takes longer than `wait`.
async fn inpaint_within(
    app: &App,
    jobs: &Jobs,
    request: Request,
    wait: Duration,
) -> Result<Response, RequestError> {
    let headers = request.headers().clone();
    let id = request.extensions().get::<RequestId>().cloned();
    let labels = match JobLabels::of_headers(&headers) {
        Ok(labels) => labels,
        Err(error) => {
            body::discard(request, &app.limits);
            return Err(error);
        }
    };
    let job = hand_over(app, jobs, request, labels).await?;
    let job = finished_within(app, jobs, job, wait).await?;
    Ok(match job.state {
        JobState::Done => {
            let mut answer = job_answer::result(app, jobs, job.id, &headers).await?;
            let path = format!("/jobs/{}/result", job.id).try_into();
            (answer.headers_mut()).extend(path.map(|path| (header::CONTENT_LOCATION, path)));
            answer
        }
        JobState::Error => failed(&job, id),
        JobState::Waiting | JobState::Running | JobState::Cancelled => accepted(jobs, &job).await?,
    })
}

/// Receives a scan and makes its job, or finds that of an earlier request with the same key.
async fn hand_over(
    app: &App,
    jobs: &Jobs,
    request: Request,
    labels: JobLabels,
) -> Result<Job, RequestError> {
    let headers = request.headers().clone();
    let caller = Caller::of(request.extensions());
    let inlet = match Inlet::open(app, jobs, &caller, &labels).await {
        Ok(inlet) => inlet,
        Err(error) => {
            body::discard(request, &app.limits);
            return Err(error);
        }
    };
    let JobUpload {
        input,
        files,
        constraints,
        permit,
    } = job_upload::receive(app, inlet, request).await?;
    let asked = JobRequest::new(constraints, files.answer(&headers).form);
    let submission = labels.submission(app.job_owner(&caller), &asked);
    let job = input.submit(jobs, &caller, submission).await?;
    drop(permit);
    Ok(job)
}

/// The job once it is finished, or as it is after this time or when the service shuts down.
///
/// # Errors
/// `NoSuchJob` once it is deleted; `JobsUnavailable`.
pub async fn finished_within(
    app: &App,
    jobs: &Jobs,
    mut job: Job,
    wait: Duration,
) -> Result<Job, RequestError> {
    let end = Instant::now() + wait;
    while !job.state.is_finished() {
        select! {
            changed = jobs.changed_since(job.id, job.version) => job = changed?,
            () = sleep_until(end) => break,
            () = app.stopping.cancelled() => break,
        }
    }
    Ok(job)
}

/// The answer of a job that was handed over.
async fn accepted(jobs: &Jobs, job: &Job) -> Result<Response, RequestError> {
    let headers = [
        (header::CONTENT_TYPE, JSON.to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::LOCATION, format!("/jobs/{}", job.id)),
    ];
    let message = response::json(&message(jobs, job).await?);
    Ok((StatusCode::ACCEPTED, headers, message).into_response())
}

/// The problem document of a job that has failed, as the answer of this request.
fn failed(job: &Job, request: Option<RequestId>) -> Response {
    let Some((status, mut document)) = problem_document(job) else {
        return RequestError::Internal.into_response();
    };
    if let Some(request) = request {
        document["request_id"] = request.0.into();
    }
    let headers = [
        (header::CONTENT_TYPE, PROBLEM_JSON),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (status, headers, response::json(&document)).into_response()
}

async fn list(
    KeptJobs(jobs): KeptJobs,
    caller: Caller,
    uri: Uri,
) -> Result<Response, RequestError> {
    let page = match list_query(uri.query())? {
        Some(query) => page(&jobs, &caller, query).await?,
        None => v1::JobList::default(),
    };
    Ok(response::json_response(response::json(&page)))
}

/// A page of the jobs that a caller may see.
///
/// # Errors
/// `Internal` where the database fails.
pub async fn page(
    jobs: &Jobs,
    caller: &Caller,
    query: ListQuery,
) -> Result<v1::JobList, RequestError> {
    let query = ListQuery {
        client: caller.only_jobs_of().map(ToString::to_string),
        ..query
    };
    let page = jobs.list(&query).await?;
    Ok(v1::JobList {
        jobs: messages(jobs, &page.jobs).await?,
        next: page.next.map(|number| number.to_string()),
    })
}

/// The page that a URL's query asks for; `None` for one that no job is on.
fn list_query(query: Option<&str>) -> Result<Option<ListQuery>, RequestError> {
    let mut may_have_jobs = true;
    let mut wanted = ListQuery {
        client: None,
        state: None,
        before: None,
        limit: DEFAULT_LIMIT,
    };
    let wrong = |detail: String| Err(RequestError::Malformed(detail));
    for (name, value) in form_urlencoded::parse(query.unwrap_or_default().as_bytes()) {
        match name.as_ref() {
            // What pipelines call a job whose scan has not come: here a job is made with its scan, and waits at once.
            "state" if value.eq_ignore_ascii_case("created") => may_have_jobs = false,
            "state" => match value.to_ascii_lowercase().parse() {
                Ok(state) => wanted.state = Some(state),
                Err(_) => {
                    return wrong(format!(
                        "`{}` is no state of a job; the states are waiting, running, done, error and cancelled, and no job is ever `created`",
                        excerpt(&value)
                    ));
                }
            },
            "from" => match value.parse() {
                Ok(number) => wanted.before = Some(number),
                Err(_) => return wrong("`from` must be the `next` of another page".to_owned()),
            },
            "limit" => match value.parse() {
                Ok(limit @ 1..=MAX_LIMIT) => wanted.limit = limit,
                _ => {
                    return wrong(format!(
                        "`limit` must be a whole number from 1 to {MAX_LIMIT}"
                    ));
                }
            },
            other => {
                return wrong(format!(
                    "`{}` is not known; the URL's query has `state`, `from` and `limit`",
                    excerpt(other)
                ));
            }
        }
    }
    Ok(may_have_jobs.then_some(wanted))
}

async fn describe(KnownJob { jobs, job }: KnownJob) -> Result<Response, RequestError> {
    Ok(described(&message(&jobs, &job).await?))
}

async fn result(
    State(app): State<Arc<App>>,
    KnownJob { jobs, job }: KnownJob,
    headers: HeaderMap,
) -> Result<Response, RequestError> {
    job_answer::result(&app, &jobs, job.id, &headers).await
}

async fn report(KnownJob { jobs, job }: KnownJob) -> Result<Response, RequestError> {
    job_answer::report(&jobs, job.id).await
}

async fn events(
    State(app): State<Arc<App>>,
    KnownJob { jobs, job }: KnownJob,
    caller: Caller,
    headers: HeaderMap,
) -> Response {
    job_events::answer(Listener { app, jobs, caller }, job, &headers)
}

async fn cancel(known: KnownJob) -> Result<Response, RequestError> {
    Ok(described(&known.cancel().await?))
}

async fn retry(known: KnownJob, caller: Caller) -> Result<Response, RequestError> {
    Ok(described(&known.retry(&caller).await?))
}

async fn delete(KnownJob { jobs, job }: KnownJob) -> Result<StatusCode, RequestError> {
    jobs.delete(job.id).await?;
    Ok(StatusCode::NO_CONTENT)
}

fn described(job: &v1::Job) -> Response {
    response::json_response(response::json(job))
}
