//! One listening socket: accepts connections, has hyper serve them, and closes those whose peer is silent or does not read.
//!
//! axum's own `serve` gives hyper no timer: a peer that sends half a request, never reads its answer or has vanished would keep its
//! file descriptor and its answer forever.

use std::{
    future::Future as _,
    io,
    pin::Pin,
    task::{Context, Poll, ready},
    time::Duration,
};

use axum::{Router, http::Request};
use hyper::body::Incoming;
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::{conn::auto, graceful::GracefulShutdown},
    service::TowerToHyperService,
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    time::{self, Instant, Sleep},
};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;
use tracing::{debug, error};

use super::client_address::ClientAddress;

/// Bytes after which hyper knows the HTTP version and its own timers apply.
const PREFACE_BYTES: usize = 24;

/// Accepts and serves until `stop` is cancelled, then until the last request under way is answered.
///
/// `pause` is the longest time a peer may take to send the head of a request, to read a piece of an answer, and (HTTP/2) to answer a ping.
pub async fn serve(socket: TcpListener, router: Router, stop: CancellationToken, pause: Duration) {
    let mut http = auto::Builder::new(TokioExecutor::new());
    http.http1()
        .timer(TokioTimer::new())
        .header_read_timeout(pause);
    http.http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(pause)
        .keep_alive_timeout(pause);
    let connections = GracefulShutdown::new();
    while let Some((stream, client)) = stop.run_until_cancelled(accept(&socket)).await {
        let io = TokioIo::new(TimeoutStream::new(stream, pause));
        let router = router.clone();
        let service =
            TowerToHyperService::new(router.map_request(move |mut request: Request<Incoming>| {
                request.extensions_mut().insert(client);
                request
            }));
        let connection = http.serve_connection(io, service).into_owned();
        let connection = connections.watch(connection);
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                debug!(%error, "a connection broke");
            }
        });
    }
    drop(socket);
    connections.shutdown().await;
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
    /// Until when the peer must have sent its preface; `None` once it has.
    preface_timeout: Option<Pin<Box<Sleep>>>,
    /// Bytes read so far.
    read: usize,
    /// Until when the peer must have read something; `None` while no write waits.
    write_timeout: Option<Pin<Box<Sleep>>>,
}

impl<S> TimeoutStream<S> {
    fn new(stream: S, pause: Duration) -> Self {
        Self {
            stream,
            pause,
            preface_timeout: Some(Box::pin(time::sleep(pause))),
            read: 0,
            write_timeout: None,
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
        self.read = self
            .read
            .saturating_add(buffer.filled().len().saturating_sub(before));
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
        self.with_timeout(cx, outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(cx, pieces);
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
        let mut near = TimeoutStream::new(near, PAUSE);
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
        let mut near = TimeoutStream::new(near, PAUSE);
        far.write_all(b"PRI * HTTP").await.unwrap();
        near.read_exact(&mut [0; 10]).await.unwrap();
        let error = near.read_u8().await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);

        let (near, mut far) = duplex(64);
        let mut near = TimeoutStream::new(near, PAUSE);
        far.write_all(&[7; PREFACE_BYTES]).await.unwrap();
        near.read_exact(&mut [0; PREFACE_BYTES]).await.unwrap();
        // From here on hyper's timers apply.
        let reading = tokio::spawn(async move { near.read_u8().await });
        time::sleep(PAUSE * 2).await;
        far.write_all(&[9]).await.unwrap();
        assert_eq!(reading.await.unwrap().unwrap(), 9);
    }
}
