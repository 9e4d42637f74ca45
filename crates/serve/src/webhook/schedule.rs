//! When a webhook is tried again: the schedule that the Standard Webhooks specification suggests. Ten tries take some three days.

use std::time::Duration;

const fn minutes(minutes: u64) -> Duration {
    Duration::from_secs(60 * minutes)
}

/// The pauses after each try that failed; none after the last one.
const PAUSES: [Duration; 9] = [
    Duration::from_secs(5),
    minutes(5),
    minutes(30),
    minutes(2 * 60),
    minutes(5 * 60),
    minutes(10 * 60),
    minutes(14 * 60),
    minutes(20 * 60),
    minutes(24 * 60),
];
/// By how much of itself a pause may be longer or shorter, so that what failed together does not come back together.
const JITTER: f64 = 0.1;

/// How long to wait after this try, the first of which is 1; nothing after the last one. `random` is from 0 to 1.
pub fn pause_after(tries: i64, random: f64) -> Option<Duration> {
    let index = usize::try_from(tries.saturating_sub(1)).unwrap_or(0);
    let pause = PAUSES.get(index)?;
    Some(pause.mul_f64(1.0 + JITTER * (2.0 * random.clamp(0.0, 1.0) - 1.0)))
}

/// A pause, or a longer one that the receiver asks for; the longest of the schedule at most.
pub fn pause_as_asked(pause: Duration, asked: Option<Duration>) -> Duration {
    let most = PAUSES.iter().copied().max().unwrap_or(pause);
    pause.max(asked.unwrap_or_default().min(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_and_end() {
        assert_eq!(pause_after(1, 0.5), Some(Duration::from_secs(5)));
        assert_eq!(pause_after(1, 0.0), Some(Duration::from_millis(4_500)));
        assert_eq!(pause_after(2, 1.0), Some(Duration::from_secs(330)));
        let pauses: Vec<_> = (1..).map_while(|tries| pause_after(tries, 0.5)).collect();
        assert_eq!(pauses.len(), 9);
        assert!(pauses.is_sorted());
        let all: Duration = pauses.iter().sum();
        assert_eq!(all, minutes(75 * 60 + 35) + Duration::from_secs(5));
        assert_eq!(pause_after(10, 0.5), None);
        assert_eq!(pause_after(i64::MAX, 0.5), None);
    }

    #[test]
    fn a_receiver_may_ask_for_a_longer_pause_up_to_a_day() {
        let asked = |seconds| pause_as_asked(minutes(5), Some(Duration::from_secs(seconds)));
        assert_eq!(pause_as_asked(minutes(5), None), minutes(5));
        assert_eq!(asked(10), minutes(5));
        assert_eq!(asked(7200), minutes(120));
        assert_eq!(asked(u64::MAX), minutes(24 * 60));
    }
}
