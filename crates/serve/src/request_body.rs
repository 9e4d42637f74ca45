//! A request's body as its connection receives it: it ends in an error when its peer sends too slowly.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use axum::BoxError;
use bytes::Bytes;
use hyper::body::{Body, Frame, Incoming, SizeHint};
use tokio::time::{Instant, Sleep, sleep_until};

use super::{
    connection_table::RequestTurn,
    pace::{Pace, PaceLimits, TooSlow},
};

/// The body of a request.
#[derive(Debug)]
pub struct RequestBody {
    body: Incoming,
    limits: PaceLimits,
    /// Starts when the body is first waited for.
    clock: Option<(Pace, Pin<Box<Sleep>>)>,
    turn: Arc<RequestTurn>,
}

impl RequestBody {
    /// The same body, whose peer must keep within the limits.
    pub fn new(body: Incoming, limits: PaceLimits, turn: Arc<RequestTurn>) -> Self {
        let body = Self {
            body,
            limits,
            clock: None,
            turn,
        };
        body.note_end();
        body
    }

    fn note_end(&self) {
        if self.body.is_end_stream() {
            self.turn.received();
        }
    }

    /// Ready when the peer's time is over.
    fn poll_clock(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        let limits = self.limits;
        let (pace, sleep) = self.clock.get_or_insert_with(|| {
            let pace = Pace::new(limits, Instant::now());
            (pace, Box::pin(sleep_until(pace.deadline)))
        });
        while pace.deadline > Instant::now() {
            if sleep.deadline() != pace.deadline {
                sleep.as_mut().reset(pace.deadline);
            }
            ready!(sleep.as_mut().poll(cx));
        }
        Poll::Ready(())
    }
}

impl Body for RequestBody {
    type Data = Bytes;
    type Error = BoxError;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, BoxError>>> {
        match Pin::new(&mut self.body).poll_frame(cx) {
            Poll::Ready(Some(Ok(frame))) => {
                if let (Some((pace, _)), Some(data)) = (&mut self.clock, frame.data_ref()) {
                    pace.moved(data.len(), Instant::now());
                }
                self.note_end();
                Poll::Ready(Some(Ok(frame)))
            }
            Poll::Ready(Some(Err(error))) => Poll::Ready(Some(Err(error.into()))),
            Poll::Ready(None) => {
                self.turn.received();
                Poll::Ready(None)
            }
            Poll::Pending => {
                ready!(self.poll_clock(cx));
                Poll::Ready(Some(Err(TooSlow(self.limits).into())))
            }
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
