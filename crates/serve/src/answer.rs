//! Answers are sent only as long as their peer takes them.
//!
//! hyper hands an answer's body to HTTP/2 and then waits for flow control without a limit: a peer that grants none, yet answers pings,
//! would keep its answers forever. So the body goes out in pieces that know when the socket has taken them, and a task of its own reader
//! (an HTTP/1 connection, an HTTP/2 stream) ends when its peer takes them too slowly. That closes the connection, or resets the stream.

use std::{
    pin::Pin,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    task::{Context, Poll, Waker, ready},
};

use axum::{body::Body, http::HeaderMap, response::Response};
use bytes::{Buf, Bytes};
use hyper::{
    body::{Frame, SizeHint},
    rt::Executor,
};
use tokio::{
    select,
    sync::Notify,
    task_local,
    time::{Duration, Instant, sleep_until},
};
use tracing::debug;

use super::pace::{Pace, PaceLimits};

/// Most bytes of a piece.
const PIECE_BYTES: usize = 64 << 10;
/// Most pieces of an answer on their way.
const MAX_PIECES: usize = 4;
/// Longest time that a live answer may take.
const LIVE_ANSWER: Duration = Duration::from_secs(24 * 60 * 60);

/// Marks, as an extension, an answer that is written as things happen. As a whole it may take a day; each of its pieces must be taken as others.
#[derive(Debug, Clone, Copy)]
pub struct LiveAnswer;

/// Most bytes of an answer that HTTP/2 buffers.
pub const MAX_BUFFERED_BYTES: usize = MAX_PIECES * PIECE_BYTES;

task_local! {
    /// The reader of the answers that a task sends.
    static READER: Arc<Reader>;
}

/// Runs a task that sends answers; `None` when it was ended because its peer takes them too slowly.
pub async fn while_read<T>(limits: PaceLimits, task: impl Future<Output = T>) -> Option<T> {
    let reader = Arc::new(Reader::new(limits));
    let watched = async {
        select! {
            outcome = task => Some(outcome),
            () = reader.stalled() => None,
        }
    };
    READER.scope(Arc::clone(&reader), watched).await
}

/// Spawns each HTTP/2 stream as a task that ends when its answer is taken too slowly.
#[derive(Debug, Clone)]
pub struct StreamExecutor(pub PaceLimits);

impl<F> Executor<F> for StreamExecutor
where
    F: Future<Output: Send> + Send + 'static,
{
    fn execute(&self, stream: F) {
        let limits = self.0;
        tokio::spawn(async move {
            if while_read(limits, stream).await.is_none() {
                debug!("an answer was not taken; its stream is reset");
            }
        });
    }
}

/// How a peer takes the answers of one task.
#[derive(Debug)]
struct Reader {
    limits: PaceLimits,
    state: Mutex<Reading>,
    /// The first piece is on its way.
    begun: Notify,
}

#[derive(Debug)]
struct Reading {
    /// Pieces on their way.
    pieces: usize,
    /// Counts while there are any.
    pace: Pace,
    /// When the whole answer must have been taken.
    end: Instant,
    /// Waits until there are fewer pieces.
    waker: Option<Waker>,
}

impl Reader {
    fn new(limits: PaceLimits) -> Self {
        let now = Instant::now();
        Self {
            limits,
            state: Mutex::new(Reading {
                pieces: 0,
                pace: Pace::new(limits, now),
                end: now + limits.whole(),
                waker: None,
            }),
            begun: Notify::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, Reading> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the peer has taken too little for too long.
    async fn stalled(&self) {
        loop {
            let deadline = {
                let state = self.state();
                (state.pieces > 0).then(|| state.pace.deadline.min(state.end))
            };
            match deadline {
                None => self.begun.notified().await,
                Some(deadline) if deadline <= Instant::now() => return,
                Some(deadline) => sleep_until(deadline).await,
            }
        }
    }

    /// A new answer begins, which must have been taken after this time.
    fn begin(&self, whole: Duration) {
        self.state().end = Instant::now() + whole;
    }

    fn sent(&self) {
        let mut state = self.state();
        state.pieces += 1;
        if state.pieces == 1 {
            state.pace = Pace::new(self.limits, Instant::now());
            self.begun.notify_one();
        }
    }

    fn took(&self, bytes: usize) {
        self.state().pace.moved(bytes, Instant::now());
    }

    fn done(&self) {
        let mut state = self.state();
        state.pieces = state.pieces.saturating_sub(1);
        if let Some(waker) = state.waker.take() {
            waker.wake();
        }
    }

    /// Waits until at most so many pieces are on their way.
    fn poll_room(&self, most: usize, cx: &Context<'_>) -> Poll<()> {
        let mut state = self.state();
        if state.pieces <= most {
            return Poll::Ready(());
        }
        state.waker = Some(cx.waker().clone());
        Poll::Pending
    }
}

/// A piece of an answer, on its way to the socket.
#[derive(Debug)]
pub struct Piece {
    bytes: Bytes,
    reader: Arc<Reader>,
}

impl Piece {
    fn new(bytes: Bytes, reader: &Arc<Reader>) -> Self {
        reader.sent();
        let reader = Arc::clone(reader);
        Self { bytes, reader }
    }
}

impl Drop for Piece {
    fn drop(&mut self) {
        self.reader.done();
    }
}

impl Buf for Piece {
    fn remaining(&self) -> usize {
        self.bytes.remaining()
    }

    fn chunk(&self) -> &[u8] {
        self.bytes.chunk()
    }

    fn advance(&mut self, bytes: usize) {
        self.bytes.advance(bytes);
        self.reader.took(bytes);
    }
}

/// An answer's body in pieces. It ends only when its peer has taken all of it, so that its task lives as long and can be ended.
#[derive(Debug)]
pub struct AnswerBody {
    body: Body,
    /// What is left of the last frame of `body`.
    rest: Bytes,
    /// `body` has ended, with these trailers if any.
    end: Option<Option<HeaderMap>>,
    reader: Arc<Reader>,
}

impl AnswerBody {
    /// The body of an answer that the current task sends. Outside of [`while_read`] nobody looks how it is taken.
    pub fn new(answer: Response, limits: PaceLimits) -> Response<Self> {
        let whole = match answer.extensions().get::<LiveAnswer>() {
            Some(LiveAnswer) => LIVE_ANSWER,
            None => limits.whole(),
        };
        answer.map(|body| Self::of(body, limits, whole))
    }

    fn of(body: Body, limits: PaceLimits, whole: Duration) -> Self {
        let reader = READER.try_with(Arc::clone);
        let reader = reader.unwrap_or_else(|_| Arc::new(Reader::new(limits)));
        reader.begin(whole);
        Self {
            body,
            rest: Bytes::new(),
            end: None,
            reader,
        }
    }
}

impl hyper::body::Body for AnswerBody {
    type Data = Piece;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Piece>, axum::Error>>> {
        ready!(self.reader.poll_room(MAX_PIECES - 1, cx));
        while self.rest.is_empty() {
            if self.end.is_some() {
                ready!(self.reader.poll_room(0, cx));
                let trailers = self.end.as_mut().and_then(Option::take);
                return Poll::Ready(trailers.map(|it| Ok(Frame::trailers(it))));
            }
            match ready!(Pin::new(&mut self.body).poll_frame(cx)).transpose() {
                Ok(Some(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(frame) => self.end = Some(frame.into_trailers().ok()),
                },
                Ok(None) => self.end = Some(None),
                Err(error) => return Poll::Ready(Some(Err(error))),
            }
        }
        let length = self.rest.len().min(PIECE_BYTES);
        let bytes = self.rest.split_to(length);
        let piece = Piece::new(bytes, &self.reader);
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        let is_sent = match &self.end {
            Some(trailers) => trailers.is_none(),
            None => self.body.is_end_stream(),
        };
        is_sent && self.rest.is_empty() && self.reader.state().pieces == 0
    }

    fn size_hint(&self) -> SizeHint {
        let rest = self.rest.len() as u64;
        let body = self.body.size_hint();
        let mut hint = SizeHint::new();
        hint.set_lower(body.lower().saturating_add(rest));
        if let Some(upper) = body.upper() {
            hint.set_upper(upper.saturating_add(rest));
        }
        hint
    }
}
