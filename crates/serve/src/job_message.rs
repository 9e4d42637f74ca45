//! A job as clients see it.

use axum::http::StatusCode;
use darn_jobs::{CRASHED, Delivery, DeliveryOutcome, Job, JobError, Jobs, Progress, State};
use serde_json::Value;
use uuid::Uuid;

use super::{
    error::RequestError,
    job_worker::{READING, WAITING},
    response::KeptAnswer,
    webhook,
};
use darn_contract::{FieldError, codes, port::Refusal, v1};

/// The messages of jobs, in their order.
///
/// # Errors
/// The database fails.
pub async fn messages(jobs: &Jobs, shown: &[Job]) -> Result<Vec<v1::Job>, JobError> {
    // Only those have something in the outbox.
    let told = shown.iter().filter(|job| job.webhook.is_some());
    let told: Vec<Uuid> = told.map(|job| job.id).collect();
    let deliveries = jobs.store().deliveries(&told).await?;
    let message = |job| message_of(job, deliveries.get(&job.id));
    Ok(shown.iter().map(message).collect())
}

/// The message of a job.
///
/// # Errors
/// The database fails.
pub async fn message(jobs: &Jobs, job: &Job) -> Result<v1::Job, JobError> {
    let delivery = match &job.webhook {
        Some(_) => jobs.store().deliveries(&[job.id]).await?.remove(&job.id),
        None => None,
    };
    Ok(message_of(job, delivery.as_ref()))
}

fn message_of(job: &Job, delivery: Option<&Delivery>) -> v1::Job {
    let path = |file| path(job.id, file);
    v1::Job {
        id: job.id.to_string(),
        name: job.name.clone(),
        priority: i32::try_from(job.priority).unwrap_or_default(),
        state: state(job.state).into(),
        stage: stage(job).to_owned(),
        version: u32::try_from(job.version).unwrap_or(u32::MAX),
        attempt: u32::try_from(job.attempt).unwrap_or_default(),
        cancelling: job.cancel_wanted && !job.state.is_finished(),
        created_at: Some(timestamp(job.created_at)),
        changed_at: Some(timestamp(job.changed_at)),
        started_at: job.started_at.map(timestamp),
        finished_at: job.finished_at.map(timestamp),
        expired_at: job.expired_at.map(timestamp),
        result: job.result.as_ref().map(|_| path("result")),
        report: job.report.as_ref().map(|_| path("report")),
        outcome: kept_answer(job).and_then(|answer| answer.result().map(str::to_owned)),
        problem: problem(job),
        holes: holes(job, |progress| progress.holes),
        holes_done: holes(job, |progress| progress.hole),
        webhook: webhook(job, delivery),
    }
}

/// The path of a file of a job.
pub fn path(job: Uuid, file: &str) -> String {
    format!("/jobs/{job}/{file}")
}

/// A state as messages have it.
pub fn state(state: State) -> v1::JobState {
    match state {
        State::Waiting => v1::JobState::Waiting,
        State::Running => v1::JobState::Running,
        State::Done => v1::JobState::Done,
        State::Error => v1::JobState::Error,
        State::Cancelled => v1::JobState::Cancelled,
    }
}

fn webhook(job: &Job, delivery: Option<&Delivery>) -> Option<v1::JobWebhook> {
    let url = webhook::shown(job.webhook.as_ref()?);
    let Some(delivery) = delivery else {
        return Some(v1::JobWebhook {
            url,
            state: v1::WebhookState::Pending.into(),
            ..v1::JobWebhook::default()
        });
    };
    let state = match delivery.outcome {
        DeliveryOutcome::Waiting => v1::WebhookState::Pending,
        DeliveryOutcome::Delivered => v1::WebhookState::Delivered,
        DeliveryOutcome::GivenUp => v1::WebhookState::GivenUp,
        DeliveryOutcome::Disabled => v1::WebhookState::Disabled,
    };
    Some(v1::JobWebhook {
        url,
        state: state.into(),
        tries: u32::try_from(delivery.tries).unwrap_or_default(),
        last_status: delivery.last_status.and_then(|it| u32::try_from(it).ok()),
        last_error: delivery.last_error.clone(),
        last_try_at: delivery.last_try_at.map(timestamp),
        next_try_at: delivery.next_try_at.map(timestamp),
    })
}

/// What goes with the result of a job; `None` unless it is done.
pub fn kept_answer(job: &Job) -> Option<KeptAnswer> {
    let answer = job.answer.as_ref().filter(|_| job.state == State::Done)?;
    serde_json::from_str(answer).ok()
}

/// The status of a job's failure and its problem document, which has the job's id for a request id; `None` unless it has failed.
pub fn problem_document(job: &Job) -> Option<(StatusCode, Value)> {
    let failure = job.failure.as_ref().filter(|_| job.state == State::Error)?;
    let kept = job.answer.as_ref();
    let document = kept.and_then(|text| serde_json::from_str::<Value>(text).ok());
    let document = document.unwrap_or_else(|| {
        // The store itself gave it up.
        let code = codes::JOB_CRASHED_WORKER;
        let status = if failure.code == CRASHED {
            code.status
        } else {
            codes::INTERNAL.status
        };
        serde_json::json!({
            "type": "about:blank",
            "title": "Internal Server Error",
            "status": status,
            "code": failure.code,
            "detail": failure.message,
            "request_id": job.id.to_string(),
        })
    });
    let status = document["status"].as_u64();
    let status = status.and_then(|status| StatusCode::from_u16(u16::try_from(status).ok()?).ok());
    Some((
        status.unwrap_or(StatusCode::INTERNAL_SERVER_ERROR),
        document,
    ))
}

fn problem(job: &Job) -> Option<v1::JobProblem> {
    let (status, document) = problem_document(job)?;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let errors = document["errors"].as_array().into_iter().flatten();
    Some(v1::JobProblem {
        status: status.as_u16().into(),
        code: text(&document["code"]),
        detail: text(&document["detail"]),
        errors: errors
            .map(|error| v1::JobFault {
                pointer: text(&error["pointer"]),
                detail: text(&error["detail"]),
            })
            .collect(),
    })
}

/// The failure of a job as the error that a request would have been answered with; `Internal` unless it has failed.
pub fn failure(job: &Job) -> RequestError {
    let Some(problem) = problem(job) else {
        return RequestError::Internal;
    };
    let code = codes::ALL.iter().find(|code| code.word == problem.code);
    let Some(code) = code.filter(|code| **code != codes::INTERNAL) else {
        return RequestError::Internal;
    };
    let field = |fault: v1::JobFault| FieldError {
        pointer: fault.pointer,
        detail: fault.detail,
    };
    RequestError::Refused(Refusal {
        code: *code,
        detail: problem.detail,
        fields: problem.errors.into_iter().map(field).collect(),
        outcome: None,
    })
}

/// What is done now.
fn stage(job: &Job) -> &str {
    match (job.state, &job.progress) {
        (State::Waiting, _) => WAITING,
        (State::Running, None) => READING,
        (State::Running, Some(progress)) => &progress.stage,
        (State::Done | State::Error | State::Cancelled, _) => "",
    }
}

/// A count of the holes of a stage; 0 where nothing is done hole by hole.
fn holes(job: &Job, count: impl Fn(&Progress) -> i64) -> u32 {
    let progress = job
        .progress
        .as_ref()
        .filter(|_| job.state == State::Running);
    progress.map_or(0, |progress| {
        u32::try_from(count(progress)).unwrap_or_default()
    })
}

/// A time in milliseconds since 1970.
pub fn timestamp(milliseconds: i64) -> pbjson_types::Timestamp {
    pbjson_types::Timestamp {
        seconds: milliseconds.div_euclid(1000),
        nanos: i32::try_from(milliseconds.rem_euclid(1000) * 1_000_000).unwrap_or_default(),
    }
}
