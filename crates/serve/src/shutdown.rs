//! Shutdown: signals, and a drain of bounded length.

use std::{io, time::Duration};

use tokio::{
    select,
    signal::unix::{SignalKind, signal},
    time::timeout,
};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

/// Cancels `stop` at the first SIGTERM or SIGINT, and `abort`, which ends the drain, at the second.
///
/// # Errors
/// The signal handlers cannot be installed.
pub fn on_signal(stop: CancellationToken, abort: CancellationToken) -> io::Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::spawn(async move {
        let mut next = async || {
            select! {
                _ = terminate.recv() => "SIGTERM",
                _ = interrupt.recv() => "SIGINT",
            }
        };
        let signal = next().await;
        info!(signal, "shutting down");
        stop.cancel();
        let signal = next().await;
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
