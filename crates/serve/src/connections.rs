//! One listening socket: accepts connections, has hyper serve them, over TLS where there is a certificate, and closes those whose peer is silent or does not read, and those
//! that are too many.
//!
//! axum's own `serve` gives hyper no timer: a peer that sends half a request, never reads its answer or has vanished would keep its
//! file descriptor and its answer forever.

use std::{
    future::Future as _,
    io,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Duration,
};

use axum::{Router, http::Request};
use hyper::{body::Incoming, service::service_fn};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::{
        conn::auto,
        graceful::{GracefulShutdown, Watcher},
    },
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    time::{self, Instant, Sleep},
};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;
use tracing::{debug, error};

use super::{
    answer::{self, AnswerBody, StreamExecutor, while_read},
    client_address::ClientAddress,
    connection_table::{Activity, Admission, ConnectionTable, RequestTurn},
    pace::PaceLimits,
    request_body::RequestBody,
    tls::ServedCertificate,
};

/// Bytes after which hyper knows the HTTP version and its own timers apply.
const PREFACE_BYTES: usize = 24;

/// Most requests of one HTTP/2 connection at once.
const MAX_STREAMS: u32 = 32;
/// Most streams that a peer may reset before they are served.
const MAX_RESET_STREAMS: usize = 20;
/// Most bytes of a request's headers over HTTP/2.
const MAX_HEADER_BYTES: u32 = 16 << 10;
/// Bytes that an HTTP/2 connection, and each of its streams, may send ahead.
const RECEIVE_WINDOW: u32 = 1 << 20;

/// What a listening socket serves.
#[derive(Clone)]
pub struct Listener {
    /// What answers requests.
    pub router: Router,
    /// The open connections.
    pub table: Arc<ConnectionTable>,
    /// The certificate of TLS; `None` for plain connections.
    pub certificate: Option<Arc<ServedCertificate>>,
}

/// Accepts and serves until `stop` is cancelled, then until the last request under way is answered.
///
/// A peer may take one pause to send the head of a request, to take a piece of an answer, and (HTTP/2) to answer a ping.
pub async fn serve(socket: TcpListener, listener: Listener, stop: CancellationToken) {
    let connections = GracefulShutdown::new();
    while let Some((stream, client)) = stop.run_until_cancelled(accept(&socket)).await {
        let Some(admission) = listener.table.admit(client) else {
            debug!(address = %client.0, "too many connections; a new one is closed");
            continue;
        };
        let connection = Connection {
            client,
            activity: Arc::clone(&admission.activity),
            watcher: connections.watcher(),
            router: listener.router.clone(),
            pace: listener.table.limits.pace,
        };
        let certificate = listener.certificate.clone();
        let stop = stop.clone();
        tokio::spawn(run_admitted(admission, async move {
            let Some(certificate) = certificate else {
                return connection.serve(stream).await;
            };
            // Nothing is under way yet, so a shutdown does not wait for a handshake.
            match stop.run_until_cancelled(certificate.accept(stream)).await {
                Some(Ok(stream)) => connection.serve(stream).await,
                Some(Err(error)) => debug!(%error, "a handshake failed"),
                None => {}
            }
        }));
    }
    drop(socket);
    connections.shutdown().await;
}

/// Runs a connection until it ends, or until it has to give way to a new one. The admission is given back then.
async fn run_admitted(admission: Admission, connection: impl Future<Output = ()>) {
    let close = admission.close.clone();
    if close.run_until_cancelled(connection).await.is_none() {
        debug!("a silent connection gives way to a new one");
    }
}

/// A connection that was admitted.
struct Connection {
    client: ClientAddress,
    activity: Arc<Activity>,
    watcher: Watcher,
    router: Router,
    pace: PaceLimits,
}

impl Connection {
    /// Serves the requests that come over a stream, until the connection ends.
    async fn serve<S>(self, stream: S)
    where
        S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let Self {
            client,
            activity,
            watcher,
            router,
            pace,
        } = self;
        let io = TimeoutStream::new(stream, pace.pause, Arc::clone(&activity));
        let service = service_fn(move |request: Request<Incoming>| {
            let turn = RequestTurn::new(&activity);
            let guard = turn.guard();
            let mut request = request.map(|body| RequestBody::new(body, pace, turn));
            request.extensions_mut().insert(client);
            let answer = router.clone().oneshot(request);
            async move {
                let answer = answer.await;
                drop(guard);
                answer.map(|answer| AnswerBody::new(answer, pace))
            }
        });
        let http = http_settings(pace);
        let connection = http.serve_connection(TokioIo::new(io), service);
        match while_read(pace, watcher.watch(connection.into_owned())).await {
            Some(Ok(())) => {}
            Some(Err(error)) => debug!(error, "a connection broke"),
            None => debug!("an answer was not taken; its connection is closed"),
        }
    }
}

fn http_settings(pace: PaceLimits) -> auto::Builder<StreamExecutor> {
    let mut http = auto::Builder::new(StreamExecutor(pace));
    http.http1()
        .timer(TokioTimer::new())
        .header_read_timeout(pace.pause);
    http.http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(pace.pause)
        .keep_alive_timeout(pace.pause)
        .max_concurrent_streams(MAX_STREAMS)
        .max_pending_accept_reset_streams(MAX_RESET_STREAMS)
        .max_header_list_size(MAX_HEADER_BYTES)
        .max_send_buf_size(answer::MAX_BUFFERED_BYTES)
        .initial_connection_window_size(RECEIVE_WINDOW)
        .initial_stream_window_size(RECEIVE_WINDOW);
    http
}

/// Waits for the next connection; retries after errors.
async fn accept(socket: &TcpListener) -> (TcpStream, ClientAddress) {
    loop {
        let error = match socket.accept().await {
            Ok((stream, peer)) => {
                // A failure costs latency only.
                stream.set_nodelay(true).ok();
                return (stream, ClientAddress::of(peer.ip()));
            }
            Err(error) => error,
        };
        // A peer may leave before it is accepted. Any other error, such as no free file descriptor, may pass with time.
        let peer_left = matches!(
            error.kind(),
            io::ErrorKind::ConnectionRefused
                | io::ErrorKind::ConnectionAborted
                | io::ErrorKind::ConnectionReset
        );
        if !peer_left {
            error!(%error, "no connection can be accepted");
            time::sleep(Duration::from_secs(1)).await;
        }
    }
}

/// A stream that fails when, for the time `pause`, its peer reads nothing of what is written, or does not send the first
/// [`PREFACE_BYTES`].
#[derive(Debug)]
struct TimeoutStream<S> {
    stream: S,
    pause: Duration,
    activity: Arc<Activity>,
    /// Until when the peer must have sent its preface; `None` once it has.
    preface_timeout: Option<Pin<Box<Sleep>>>,
    /// Bytes read so far.
    read: usize,
    /// Until when the peer must have read something; `None` while no write waits.
    write_timeout: Option<Pin<Box<Sleep>>>,
}

impl<S> TimeoutStream<S> {
    fn new(stream: S, pause: Duration, activity: Arc<Activity>) -> Self {
        Self {
            stream,
            pause,
            activity,
            preface_timeout: Some(Box::pin(time::sleep(pause))),
            read: 0,
            write_timeout: None,
        }
    }

    fn note_written(&self, outcome: &Poll<io::Result<usize>>) {
        if matches!(outcome, Poll::Ready(Ok(1..))) {
            self.activity.touch();
        }
    }

    /// The outcome of a write, or an error when it has waited for too long.
    fn with_timeout<T>(
        &mut self,
        cx: &mut Context<'_>,
        outcome: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if outcome.is_ready() {
            self.write_timeout = None;
            return outcome;
        }
        let until = Instant::now() + self.pause;
        let write_timeout =
            (self.write_timeout).get_or_insert_with(|| Box::pin(time::sleep_until(until)));
        ready!(write_timeout.as_mut().poll(cx));
        Poll::Ready(Err(timed_out("the peer reads nothing")))
    }
}

fn timed_out(detail: &str) -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, detail)
}

impl<S: AsyncRead + Unpin> AsyncRead for TimeoutStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let outcome = Pin::new(&mut self.stream).poll_read(cx, buffer);
        if let Some(preface_timeout) = &mut self.preface_timeout
            && outcome.is_pending()
        {
            ready!(preface_timeout.as_mut().poll(cx));
            return Poll::Ready(Err(timed_out("the peer sends nothing")));
        }
        let read = buffer.filled().len().saturating_sub(before);
        if read > 0 {
            self.activity.touch();
        }
        self.read = self.read.saturating_add(read);
        if self.read >= PREFACE_BYTES {
            self.preface_timeout = None;
        }
        outcome
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for TimeoutStream<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.note_written(&outcome);
        self.with_timeout(cx, outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(cx, pieces);
        self.note_written(&outcome);
        self.with_timeout(cx, outcome)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let outcome = Pin::new(&mut self.stream).poll_flush(cx);
        self.with_timeout(cx, outcome)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let outcome = Pin::new(&mut self.stream).poll_shutdown(cx);
        self.with_timeout(cx, outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, duplex};

    const PAUSE: Duration = Duration::from_millis(600);

    #[tokio::test]
    async fn a_peer_that_reads_nothing_times_out() {
        let (near, mut far) = duplex(64);
        let mut near = TimeoutStream::new(near, PAUSE, Arc::default());
        let writing = tokio::spawn(async move { near.write_all(&[7; 320]).await });
        // Reading one piece per pause suffices, however long the whole takes.
        for _ in 0..3 {
            time::sleep(PAUSE / 2).await;
            far.read_exact(&mut [0; 64]).await.unwrap();
        }
        assert!(!writing.is_finished());
        let error = writing.await.unwrap().unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn a_peer_times_out_until_it_has_sent_its_preface() {
        let (near, mut far) = duplex(64);
        let mut near = TimeoutStream::new(near, PAUSE, Arc::default());
        far.write_all(b"PRI * HTTP").await.unwrap();
        near.read_exact(&mut [0; 10]).await.unwrap();
        let error = near.read_u8().await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);

        let (near, mut far) = duplex(64);
        let mut near = TimeoutStream::new(near, PAUSE, Arc::default());
        far.write_all(&[7; PREFACE_BYTES]).await.unwrap();
        near.read_exact(&mut [0; PREFACE_BYTES]).await.unwrap();
        // From here on hyper's timers apply.
        let reading = tokio::spawn(async move { near.read_u8().await });
        time::sleep(PAUSE * 2).await;
        far.write_all(&[9]).await.unwrap();
        assert_eq!(reading.await.unwrap().unwrap(), 9);
    }
}
