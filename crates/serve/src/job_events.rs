//! The changes of a job as server-sent events (<https://html.spec.whatwg.org/multipage/server-sent-events.html>).

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use axum::{
    body::Body,
    http::{HeaderMap, HeaderName, StatusCode, header},
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use darn_jobs::{Job, Jobs};
use hyper::body::Frame;
use tokio::{select, sync::mpsc, time::sleep};

use super::{
    answer::LiveAnswer, app::App, client::Caller, job_message::message, media_types::EVENT_STREAM,
    response,
};

/// The version that a client has seen last; browsers send it when they connect again.
pub const LAST_EVENT_ID: HeaderName = HeaderName::from_static("last-event-id");

/// Keeps a proxy from collecting events before it hands them on.
pub(super) const NO_BUFFERING: (HeaderName, &str) =
    (HeaderName::from_static("x-accel-buffering"), "no");
/// How often a comment is sent while nothing changes, so that nobody between takes the connection for dead.
const COMMENT_EVERY: Duration = Duration::from_secs(15);
/// Events that wait for a client that reads slowly; then the changes wait.
const EVENTS_AHEAD: usize = 4;

/// Who listens to the events of a job.
pub struct Listener {
    /// The service.
    pub app: Arc<App>,
    /// Its jobs.
    pub jobs: Arc<Jobs>,
    /// Whoever asked for them.
    pub caller: Caller,
}

/// The events of a job from its present state on, until it is finished or deleted, the service stops, or the caller's key is no longer taken.
/// Nothing (204, after which a browser does not connect again) for a client that has seen the job finished.
pub fn answer(listener: Listener, job: Job, headers: &HeaderMap) -> Response {
    let seen = headers.get(LAST_EVENT_ID);
    let seen = seen.and_then(|id| id.to_str().ok()?.trim().parse::<i64>().ok());
    if job.state.is_finished() && seen == Some(job.version) {
        return StatusCode::NO_CONTENT.into_response();
    }
    let (events, received) = mpsc::channel(EVENTS_AHEAD);
    tokio::spawn(async move {
        // Versions start at 1: whoever has seen none is told the present one.
        let told = tell(&listener, job, seen.unwrap_or(0), &events);
        select! {
            () = told => {}
            () = events.closed() => {}
            () = listener.app.stopping.cancelled() => {}
        }
    });
    let headers = [
        (header::CONTENT_TYPE, EVENT_STREAM),
        (header::CACHE_CONTROL, "no-store"),
        NO_BUFFERING,
    ];
    let mut answer = (headers, Body::new(EventBody { received })).into_response();
    answer.extensions_mut().insert(LiveAnswer);
    answer
}

async fn tell(listener: &Listener, job: Job, mut seen: i64, events: &mpsc::Sender<Bytes>) {
    let id = job.id;
    loop {
        let changed = select! {
            () = sleep(COMMENT_EVERY) => None,
            job = listener.jobs.changed_since(id, seen) => Some(job),
        };
        if !listener.app.still_takes(&listener.caller) {
            return;
        }
        let text = match changed {
            None => Bytes::from_static(b":\n\n"),
            Some(job) => {
                // Deleted, or the database failed: the client asks again and is told.
                let Ok(job) = job else {
                    return;
                };
                seen = job.version;
                let event = event(&job);
                if job.state.is_finished() {
                    events.send(event).await.ok();
                    return;
                }
                event
            }
        };
        if events.send(text).await.is_err() {
            return;
        }
    }
}

fn event(job: &Job) -> Bytes {
    // JSON has no line breaks of its own.
    let mut text = format!("id: {}\nevent: job\ndata: ", job.version).into_bytes();
    text.extend_from_slice(&response::json(&message(job)));
    text.extend_from_slice(b"\n\n");
    text.into()
}

/// A body of texts that are sent as they are written.
pub(super) struct EventBody {
    /// The texts.
    pub(super) received: mpsc::Receiver<Bytes>,
}

impl hyper::body::Body for EventBody {
    type Data = Bytes;
    type Error = std::convert::Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        let event = self.received.poll_recv(cx);
        event.map(|event| event.map(|text| Ok(Frame::data(text))))
    }
}
