//! Shutdown: signals, and a drain of bounded length.

use std::{io, time::Duration};

use tokio::{select, time::timeout};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

/// What asks a process to end: SIGTERM and SIGINT.
#[cfg(unix)]
struct EndSignals {
    terminate: tokio::signal::unix::Signal,
    interrupt: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl EndSignals {
    fn new() -> io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(EndSignals {
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
        })
    }

    /// Waits for the next; its name.
    async fn next(&mut self) -> &'static str {
        select! {
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.interrupt.recv() => "SIGINT",
        }
    }
}

/// What asks a process to end: Ctrl-C, a console that is closed, a system that shuts down.
#[cfg(windows)]
struct EndSignals {
    interrupt: tokio::signal::windows::CtrlC,
    close: tokio::signal::windows::CtrlClose,
    shutdown: tokio::signal::windows::CtrlShutdown,
}

#[cfg(windows)]
impl EndSignals {
    fn new() -> io::Result<Self> {
        use tokio::signal::windows::{ctrl_c, ctrl_close, ctrl_shutdown};
        Ok(EndSignals {
            interrupt: ctrl_c()?,
            close: ctrl_close()?,
            shutdown: ctrl_shutdown()?,
        })
    }

    /// Waits for the next; its name.
    async fn next(&mut self) -> &'static str {
        select! {
            _ = self.interrupt.recv() => "Ctrl-C",
            _ = self.close.recv() => "the console is closed",
            _ = self.shutdown.recv() => "the system shuts down",
        }
    }
}

/// Cancels `stop` at the first signal that asks the process to end, and `abort`, which ends the drain, at the second.
///
/// # Errors
/// The signal handlers cannot be installed.
pub fn on_signal(stop: CancellationToken, abort: CancellationToken) -> io::Result<()> {
    let mut signals = EndSignals::new()?;
    tokio::spawn(async move {
        let signal = signals.next().await;
        info!(signal, "shutting down");
        stop.cancel();
        let signal = signals.next().await;
        warn!(signal, "ending at once");
        abort.cancel();
    });
    Ok(())
}

/// Waits for `serving`, at most `drain` once `stop` is cancelled; `None` when that time was over.
pub async fn with_bounded_drain<T>(
    serving: impl Future<Output = T>,
    stop: &CancellationToken,
    drain: Duration,
) -> Option<T> {
    let mut serving = std::pin::pin!(serving);
    select! {
        outcome = &mut serving => return Some(outcome),
        () = stop.cancelled() => {}
    }
    let outcome = timeout(drain, serving).await.ok();
    if outcome.is_none() {
        warn!(
            seconds = drain.as_secs_f64(),
            "requests under way were cut off"
        );
    }
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_drain_ends_with_the_work_or_after_its_time() {
        let stop = CancellationToken::new();
        stop.cancel();
        let short = Duration::from_millis(20);
        assert_eq!(with_bounded_drain(async { 1 }, &stop, short).await, Some(1));
        assert_eq!(
            with_bounded_drain(std::future::pending::<()>(), &stop, short).await,
            None
        );
        assert_eq!(
            with_bounded_drain(async { 2 }, &CancellationToken::new(), short).await,
            Some(2)
        );
    }
}
