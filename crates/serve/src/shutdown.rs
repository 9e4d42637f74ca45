//! The end of the service: a signal, a drain, a bound.

use std::{io, time::Duration};

use tokio::{
    select,
    signal::unix::{SignalKind, signal},
    time::timeout,
};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

/// Cancels `stop` at the first SIGTERM or SIGINT, and `now` at the second: whoever asks twice does not want to wait.
///
/// # Errors
/// When the signals cannot be listened to.
pub fn on_signal(stop: CancellationToken, now: CancellationToken) -> io::Result<()> {
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
        now.cancel();
    });
    Ok(())
}

/// Waits for `serving`, but once `stop` is cancelled no longer than `drain`; `None` when the drain was cut short.
pub async fn bounded<T>(
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
    async fn a_drain_ends_when_the_work_does_or_when_time_is_up() {
        let stop = CancellationToken::new();
        stop.cancel();
        let short = Duration::from_millis(20);
        assert_eq!(bounded(async { 1 }, &stop, short).await, Some(1));
        assert_eq!(
            bounded(std::future::pending::<()>(), &stop, short).await,
            None
        );
        assert_eq!(
            bounded(async { 2 }, &CancellationToken::new(), short).await,
            Some(2)
        );
    }
}
