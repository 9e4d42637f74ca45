//! One listening socket: accepts connections, has hyper serve them, lets go of those whose peer says or takes nothing.
//!
//! axum's own `serve` gives hyper no timer: a peer that sends half a request, never takes its answer or has vanished would be kept,
//! with its file descriptor and its answer, for good.

use std::{
    future::Future as _,
    io,
    pin::Pin,
    task::{Context, Poll, ready},
    time::Duration,
};

use axum::Router;
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
use tracing::{debug, error};

/// Bytes after which hyper knows which HTTP is spoken, and its own timers watch.
const PREFACE: usize = 24;

/// Accepts and serves until `stop` is cancelled, then until the last request under way is answered.
///
/// `pause` is the longest a peer may take to send the head of a request, to take a piece of an answer, and (HTTP/2) to answer a ping.
pub async fn open(socket: TcpListener, router: Router, stop: CancellationToken, pause: Duration) {
    let mut http = auto::Builder::new(TokioExecutor::new());
    http.http1()
        .timer(TokioTimer::new())
        .header_read_timeout(pause);
    http.http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(pause)
        .keep_alive_timeout(pause);
    let open = GracefulShutdown::new();
    while let Some(stream) = stop.run_until_cancelled(accepted(&socket)).await {
        let io = TokioIo::new(Impatient::new(stream, pause));
        let service = TowerToHyperService::new(router.clone());
        let connection = http.serve_connection(io, service).into_owned();
        let connection = open.watch(connection);
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                debug!(%error, "a connection broke");
            }
        });
    }
    drop(socket);
    open.shutdown().await;
}

/// The next connection.
async fn accepted(socket: &TcpListener) -> TcpStream {
    loop {
        let error = match socket.accept().await {
            Ok((stream, _)) => {
                // Only costs latency when it fails.
                stream.set_nodelay(true).ok();
                return stream;
            }
            Err(error) => error,
        };
        // A peer that left before it was accepted is no fault; out of descriptors, one waits until some are free.
        let theirs = matches!(
            error.kind(),
            io::ErrorKind::ConnectionRefused
                | io::ErrorKind::ConnectionAborted
                | io::ErrorKind::ConnectionReset
        );
        if !theirs {
            error!(%error, "no connection can be accepted");
            time::sleep(Duration::from_secs(1)).await;
        }
    }
}

/// A stream that fails when its peer takes no byte of what is written for so long, or does not say so soon which HTTP it speaks.
#[derive(Debug)]
struct Impatient<S> {
    stream: S,
    pause: Duration,
    /// When the peer must have said which HTTP it speaks; none when it has.
    greeting: Option<Pin<Box<Sleep>>>,
    read: usize,
    /// When the peer must have taken something; none when nothing waits.
    taking: Option<Pin<Box<Sleep>>>,
}

impl<S> Impatient<S> {
    fn new(stream: S, pause: Duration) -> Self {
        Self {
            stream,
            pause,
            greeting: Some(Box::pin(time::sleep(pause))),
            read: 0,
            taking: None,
        }
    }

    /// What came of a write, or that it has been waited for too long.
    fn watched<T>(
        &mut self,
        cx: &mut Context<'_>,
        outcome: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if outcome.is_ready() {
            self.taking = None;
            return outcome;
        }
        let until = Instant::now() + self.pause;
        let taking = (self.taking).get_or_insert_with(|| Box::pin(time::sleep_until(until)));
        ready!(taking.as_mut().poll(cx));
        Poll::Ready(Err(late("its peer takes nothing")))
    }
}

fn late(detail: &str) -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, detail)
}

impl<S: AsyncRead + Unpin> AsyncRead for Impatient<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let outcome = Pin::new(&mut self.stream).poll_read(cx, buffer);
        if let Some(greeting) = &mut self.greeting
            && outcome.is_pending()
        {
            ready!(greeting.as_mut().poll(cx));
            return Poll::Ready(Err(late("its peer says nothing")));
        }
        self.read = self
            .read
            .saturating_add(buffer.filled().len().saturating_sub(before));
        if self.read >= PREFACE {
            self.greeting = None;
        }
        outcome
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Impatient<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.watched(cx, outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(cx, pieces);
        self.watched(cx, outcome)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let outcome = Pin::new(&mut self.stream).poll_flush(cx);
        self.watched(cx, outcome)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let outcome = Pin::new(&mut self.stream).poll_shutdown(cx);
        self.watched(cx, outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, duplex};

    const PAUSE: Duration = Duration::from_millis(600);

    #[tokio::test]
    async fn who_takes_nothing_is_let_go() {
        let (ours, mut theirs) = duplex(64);
        let mut ours = Impatient::new(ours, PAUSE);
        let writing = tokio::spawn(async move { ours.write_all(&[7; 320]).await });
        // A piece before each pause is over is enough, however long the whole takes.
        for _ in 0..3 {
            time::sleep(PAUSE / 2).await;
            theirs.read_exact(&mut [0; 64]).await.unwrap();
        }
        assert!(!writing.is_finished());
        let error = writing.await.unwrap().unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn who_says_nothing_is_let_go_until_it_has_said_enough() {
        let (ours, mut theirs) = duplex(64);
        let mut ours = Impatient::new(ours, PAUSE);
        theirs.write_all(b"PRI * HTTP").await.unwrap();
        ours.read_exact(&mut [0; 10]).await.unwrap();
        let error = ours.read_u8().await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);

        let (ours, mut theirs) = duplex(64);
        let mut ours = Impatient::new(ours, PAUSE);
        theirs.write_all(&[7; PREFACE]).await.unwrap();
        ours.read_exact(&mut [0; PREFACE]).await.unwrap();
        // From here on hyper watches.
        let reading = tokio::spawn(async move { ours.read_u8().await });
        time::sleep(PAUSE * 2).await;
        theirs.write_all(&[9]).await.unwrap();
        assert_eq!(reading.await.unwrap().unwrap(), 9);
    }
}
