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
use uuid::Uuid;

use super::{
    answer::LiveAnswer, app::App, client::Caller, job_message::message, media_types::EVENT_STREAM,
    response,
};
use darn_contract::v1;

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
    // Versions start at 1: whoever has seen none is told the present one.
    let received = listen(listener, job.id, seen.unwrap_or(0), |job| {
        Some(job.map_or(Bytes::from_static(b":\n\n"), event))
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

/// The changes of a job after the version that was seen, as `answer` tells them: each in the words of `render`, which is asked with nothing
/// after a while without one.
pub fn listen<E: Send + 'static>(
    listener: Listener,
    job: Uuid,
    seen: i64,
    render: fn(Option<&v1::Job>) -> Option<E>,
) -> mpsc::Receiver<E> {
    let (events, received) = mpsc::channel(EVENTS_AHEAD);
    tokio::spawn(async move {
        let told = Told {
            events: &events,
            render,
        };
        select! {
            () = tell(&listener, job, seen, &told) => {}
            () = events.closed() => {}
            () = listener.app.stopping.cancelled() => {}
        }
    });
    received
}

/// How somebody is told.
struct Told<'a, E> {
    events: &'a mpsc::Sender<E>,
    render: fn(Option<&v1::Job>) -> Option<E>,
}

async fn tell<E>(listener: &Listener, id: Uuid, mut seen: i64, told: &Told<'_, E>) {
    loop {
        let changed = select! {
            () = sleep(COMMENT_EVERY) => None,
            job = listener.jobs.changed_since(id, seen) => Some(job),
        };
        if !listener.app.still_takes(&listener.caller) {
            return;
        }
        let (event, is_last) = match changed {
            None => ((told.render)(None), false),
            Some(job) => {
                // Deleted, or the database failed: the client asks again and is told.
                let Ok(job) = job else {
                    return;
                };
                seen = job.version;
                let Ok(message) = message(&listener.jobs, &job).await else {
                    return;
                };
                ((told.render)(Some(&message)), job.state.is_finished())
            }
        };
        if let Some(event) = event
            && told.events.send(event).await.is_err()
        {
            return;
        }
        if is_last {
            return;
        }
    }
}

fn event(job: &v1::Job) -> Bytes {
    // JSON has no line breaks of its own.
    let mut text = format!("id: {}\nevent: job\ndata: ", job.version).into_bytes();
    text.extend_from_slice(&response::json(job));
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
