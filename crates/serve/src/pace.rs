//! How slowly a body may move, in either direction, before its peer counts as gone.

use std::time::Duration;

use tokio::time::Instant;

/// The time for a whole body, as a multiple of the longest pause.
const PAUSES_PER_BODY: u32 = 8;

/// How slowly a body may move.
#[derive(Debug, Clone, Copy)]
pub struct PaceLimits {
    /// Longest time in which no byte moves.
    pub pause: Duration,
    /// Fewest bytes per second over any time longer than the pause; 0 for no such limit.
    pub rate: usize,
}

impl PaceLimits {
    /// The longest time for a whole body.
    pub fn whole(self) -> Duration {
        self.pause * PAUSES_PER_BODY
    }

    /// The time that so many moved bytes buy.
    fn earned(self, bytes: usize) -> Duration {
        if self.rate == 0 {
            return self.pause;
        }
        let earned = Duration::try_from_secs_f64(bytes as f64 / self.rate as f64);
        earned.unwrap_or(self.pause).min(self.pause)
    }
}

/// The clock of one body: it starts with one pause of time, and each byte that moves buys more, up to one pause.
///
/// Who moves fewer bytes than the rate runs out of time, however the bytes are spread; who moves more never does.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    limits: PaceLimits,
    /// When the time is over if nothing moves.
    pub deadline: Instant,
}

impl Pace {
    /// A clock that starts at `now`.
    pub fn new(limits: PaceLimits, now: Instant) -> Self {
        let deadline = now + limits.pause;
        Self { limits, deadline }
    }

    /// Counts bytes that moved at `now`.
    pub fn moved(&mut self, bytes: usize, now: Instant) {
        let most = now + self.limits.pause;
        self.deadline = most.min(self.deadline + self.limits.earned(bytes));
    }
}

/// A request's body moved too slowly.
#[derive(Debug, thiserror::Error)]
#[error(
    "the body came too slowly: less than {} bytes a second (DARN_BODY_RATE), or nothing for {} s (DARN_BODY_TIMEOUT)",
    .0.rate,
    .0.pause.as_secs_f64()
)]
pub struct TooSlow(pub PaceLimits);

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: PaceLimits = PaceLimits {
        pause: Duration::from_secs(10),
        rate: 100,
    };

    /// Seconds until a clock is over when so many bytes move each second; `None` when it runs for an hour.
    fn ends_after(limits: PaceLimits, bytes_a_second: usize) -> Option<u64> {
        let start = Instant::now();
        let mut pace = Pace::new(limits, start);
        (0..3600).find(|second| {
            let now = start + Duration::from_secs(*second);
            let is_over = pace.deadline <= now;
            pace.moved(bytes_a_second, now);
            is_over
        })
    }

    #[test]
    fn a_body_below_the_rate_ends_and_one_at_the_rate_does_not() {
        assert_eq!(ends_after(LIMITS, 0), Some(10));
        assert_eq!(ends_after(LIMITS, 50), Some(19));
        assert_eq!(ends_after(LIMITS, 100), None);
        assert_eq!(ends_after(LIMITS, 1_000_000), None);
    }

    #[test]
    fn without_a_rate_any_byte_is_enough() {
        let limits = PaceLimits { rate: 0, ..LIMITS };
        assert_eq!(ends_after(limits, 0), None);
    }

    #[test]
    fn much_at_once_buys_one_pause_and_no_more() {
        let now = Instant::now();
        let mut pace = Pace::new(LIMITS, now);
        pace.moved(usize::MAX, now);
        assert_eq!(pace.deadline, now + LIMITS.pause);
    }
}
