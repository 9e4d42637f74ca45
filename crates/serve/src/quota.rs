//! What keys have used of their limits. Counted in this process alone, but for jobs, which the database counts. Knows no clock: time is passed in.
//!
//! Requests and bytes are token buckets: a bucket holds a whole quota at first, and regains it evenly over the quota's time. So a client may spend a
//! day's bytes at once, and has some again an hour later.

use std::{
    fmt,
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use tokio::sync;

use super::key_file::KeyLimits;

/// Suggested seconds to wait until fewer jobs of a key wait.
const JOBS_WAIT: u64 = 10;
/// Suggested seconds to wait until a session of a key has ended.
const SESSIONS_WAIT: u64 = 60;

/// What sums of fractions may be off by, in units and in seconds.
const ROUNDING: f64 = 1e-6;

/// What a quota counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quota {
    /// Requests in a minute.
    Requests,
    /// Bytes of bodies in a day.
    Bytes,
    /// Jobs that wait.
    WaitingJobs,
    /// Sessions that are open.
    Sessions,
}

impl Quota {
    /// Its name in the headers of answers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Requests => "requests",
            Self::Bytes => "bytes",
            Self::WaitingJobs => "waiting-jobs",
            Self::Sessions => "sessions",
        }
    }

    /// The time over which it is regained; `None` where something else must end first.
    pub fn window(self) -> Option<Duration> {
        match self {
            Self::Requests => Some(Duration::from_secs(60)),
            Self::Bytes => Some(Duration::from_secs(24 * 60 * 60)),
            Self::WaitingJobs | Self::Sessions => None,
        }
    }
}

/// A quota that leaves no room for what was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub struct Exceeded {
    /// Which one.
    pub quota: Quota,
    /// The whole of it.
    pub limit: u64,
    /// Seconds after which there is room; `None` for what never fits.
    pub retry_after: Option<u64>,
}

impl Exceeded {
    /// So many jobs of a key wait already.
    pub fn waiting_jobs(limit: u64) -> Self {
        let retry_after = Some(JOBS_WAIT);
        let quota = Quota::WaitingJobs;
        Self {
            quota,
            limit,
            retry_after,
        }
    }

    /// So many sessions of a key are open already.
    pub fn sessions(limit: u64) -> Self {
        let retry_after = Some(SESSIONS_WAIT);
        let quota = Quota::Sessions;
        Self {
            quota,
            limit,
            retry_after,
        }
    }
}

impl fmt::Display for Exceeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limit = self.limit;
        match self.quota {
            Quota::Requests => write!(f, "this key may send {limit} requests a minute"),
            Quota::Bytes => write!(f, "this key may send {limit} bytes a day"),
            Quota::WaitingJobs => write!(f, "{limit} jobs of this key may wait, and so many do"),
            Quota::Sessions => write!(
                f,
                "{limit} sessions of this key may be open, and so many are"
            ),
        }?;
        match self.retry_after {
            Some(seconds) => write!(f, "; try again in {seconds} s"),
            None => write!(f, ", fewer than this takes"),
        }
    }
}

/// What is left of a quota.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Remainder {
    /// Which one.
    pub quota: Quota,
    /// The whole of it.
    pub limit: u64,
    /// What is left.
    pub left: u64,
    /// Seconds until something is left again; `None` while something is.
    pub wait: Option<u64>,
}

/// What a key has used.
#[derive(Debug, Default)]
pub struct Usage {
    requests: Mutex<Bucket>,
    bytes: Mutex<Bucket>,
    /// Held while a job of the key is handed over, so that its waiting jobs are counted before the next one.
    pub handing_over: sync::Mutex<()>,
}

impl Usage {
    /// Takes a request.
    ///
    /// # Errors
    /// None is left.
    pub fn take_request(&self, limits: &KeyLimits, now: Instant) -> Result<(), Exceeded> {
        let Some(limit) = limits.requests_per_minute else {
            return Ok(());
        };
        lock(&self.requests).take(Quota::Requests, limit, 1, now)
    }

    /// Takes the bytes of a body that declares its length; of one that does not, checks that any are left.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn take_bytes(
        &self,
        limits: &KeyLimits,
        declared: Option<u64>,
        now: Instant,
    ) -> Result<(), Exceeded> {
        let Some(limit) = limits.bytes_per_day else {
            return Ok(());
        };
        let mut bytes = lock(&self.bytes);
        match declared {
            Some(length) => bytes.take(Quota::Bytes, limit, length, now),
            None => bytes.check(Quota::Bytes, limit, 1, now),
        }
    }

    /// Takes bytes that have come without having been declared, also when fewer are left; what is too much has to be regained first.
    pub fn charge_bytes(&self, limits: &KeyLimits, count: u64, now: Instant) {
        if let Some(limit) = limits.bytes_per_day {
            lock(&self.bytes).charge(Quota::Bytes, limit, count as f64, now);
        }
    }

    /// Gives bytes back that were declared and have not come.
    pub fn give_back_bytes(&self, limits: &KeyLimits, count: u64, now: Instant) {
        if let Some(limit) = limits.bytes_per_day {
            lock(&self.bytes).charge(Quota::Bytes, limit, -(count as f64), now);
        }
    }

    /// What is left of the quotas that have a time.
    pub fn remainders(&self, limits: &KeyLimits, now: Instant) -> Vec<Remainder> {
        let of = |quota, limit: Option<u64>, bucket| {
            let limit = limit?;
            let mut bucket: MutexGuard<'_, Bucket> = lock(bucket);
            let left = bucket.level(quota, limit, now).max(0.0) as u64;
            let wait = (left == 0).then(|| bucket.wait(quota, limit, 1).unwrap_or(u64::MAX));
            Some(Remainder {
                quota,
                limit,
                left,
                wait: wait.filter(|wait| *wait != u64::MAX),
            })
        };
        let requests = of(Quota::Requests, limits.requests_per_minute, &self.requests);
        let bytes = of(Quota::Bytes, limits.bytes_per_day, &self.bytes);
        requests.into_iter().chain(bytes).collect()
    }
}

fn lock(bucket: &Mutex<Bucket>) -> MutexGuard<'_, Bucket> {
    bucket.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A token bucket. Its size is given at every call, since a file of keys may change it.
#[derive(Debug, Default)]
struct Bucket {
    /// What was taken and not yet regained; `None` while it is full.
    spent: Option<Spent>,
}

#[derive(Debug, Clone, Copy)]
struct Spent {
    amount: f64,
    at: Instant,
}

impl Bucket {
    /// What it holds now; below 0 when more was charged than it held.
    fn level(&mut self, quota: Quota, limit: u64, now: Instant) -> f64 {
        let limit = limit as f64;
        if let (Some(spent), Some(window)) = (&mut self.spent, quota.window()) {
            let passed = now.saturating_duration_since(spent.at);
            spent.amount -= limit * (passed.as_secs_f64() / window.as_secs_f64());
            spent.at = spent.at.max(now);
            if spent.amount <= 0.0 {
                self.spent = None;
            }
        }
        limit - self.spent.map_or(0.0, |spent| spent.amount)
    }

    /// Seconds until it holds so much, by its level of a moment ago; `None` when it never does.
    fn wait(&self, quota: Quota, limit: u64, count: u64) -> Option<u64> {
        let window = quota.window()?;
        if count > limit {
            return None;
        }
        let spent = self.spent.map_or(0.0, |spent| spent.amount);
        let missing = spent + count as f64 - limit as f64;
        let seconds = missing.max(0.0) / limit as f64 * window.as_secs_f64();
        // Not a second more for the rounding of sums.
        Some(((seconds - ROUNDING).ceil() as u64).max(1))
    }

    fn check(
        &mut self,
        quota: Quota,
        limit: u64,
        count: u64,
        now: Instant,
    ) -> Result<(), Exceeded> {
        if self.level(quota, limit, now) + ROUNDING >= count as f64 {
            return Ok(());
        }
        Err(Exceeded {
            quota,
            limit,
            retry_after: self.wait(quota, limit, count),
        })
    }

    fn take(&mut self, quota: Quota, limit: u64, count: u64, now: Instant) -> Result<(), Exceeded> {
        self.check(quota, limit, count, now)?;
        self.charge(quota, limit, count as f64, now);
        Ok(())
    }

    fn charge(&mut self, quota: Quota, limit: u64, amount: f64, now: Instant) {
        let level = self.level(quota, limit, now);
        let amount = limit as f64 - level + amount;
        self.spent = (amount > 0.0).then_some(Spent { amount, at: now });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    fn limits(requests: u64, bytes: u64) -> KeyLimits {
        KeyLimits {
            requests_per_minute: Some(requests),
            bytes_per_day: Some(bytes),
            ..KeyLimits::default()
        }
    }

    #[test]
    fn requests_come_back_evenly() {
        let (usage, limits, start) = (Usage::default(), limits(6, 1), Instant::now());
        for _ in 0..6 {
            usage.take_request(&limits, start).unwrap();
        }
        let refused = usage.take_request(&limits, start).unwrap_err();
        assert_eq!(refused.retry_after, Some(10));
        assert!(refused.to_string().contains("6 requests a minute"));
        let later = start + Duration::from_secs(10);
        usage.take_request(&limits, later).unwrap();
        assert!(usage.take_request(&limits, later).is_err());
        let [requests, _] = usage.remainders(&limits, later)[..] else {
            panic!("two quotas have a time");
        };
        assert_eq!((requests.left, requests.wait), (0, Some(10)));
        let rested = later + 2 * MINUTE;
        assert_eq!(usage.remainders(&limits, rested)[0].left, 6);
        assert_eq!(usage.remainders(&limits, rested)[0].wait, None);
    }

    #[test]
    fn bytes_are_taken_given_back_and_charged_beyond_what_is_left() {
        let (usage, limits, start) = (Usage::default(), limits(1, 86_400), Instant::now());
        usage.take_bytes(&limits, Some(86_000), start).unwrap();
        let refused = usage.take_bytes(&limits, Some(500), start).unwrap_err();
        assert_eq!(refused.retry_after, Some(100));
        usage.give_back_bytes(&limits, 80_000, start);
        usage.take_bytes(&limits, Some(500), start).unwrap();
        // One byte a second comes back.
        usage.charge_bytes(&limits, 80_000, start);
        let refused = usage.take_bytes(&limits, None, start).unwrap_err();
        assert_eq!(refused.retry_after, Some(101));
        let never = usage.take_bytes(&limits, Some(86_401), start).unwrap_err();
        assert_eq!(never.retry_after, None);
        assert!(never.to_string().ends_with("fewer than this takes"));
    }

    #[test]
    fn without_limits_nothing_is_counted() {
        let (usage, now) = (Usage::default(), Instant::now());
        let none = KeyLimits::default();
        usage.take_request(&none, now).unwrap();
        usage.take_bytes(&none, Some(u64::MAX), now).unwrap();
        assert_eq!(usage.remainders(&none, now), []);
    }

    proptest! {
        #[test]
        fn no_minute_lets_more_than_two_quotas_through(
            limit in 1..50_u64,
            pauses in prop::collection::vec(0..5_000_u64, 1..200),
        ) {
            let (usage, limits, start) = (Usage::default(), limits(limit, 1), Instant::now());
            let mut now = start;
            let mut taken: Vec<Instant> = Vec::new();
            for pause in pauses {
                now += Duration::from_millis(pause);
                if usage.take_request(&limits, now).is_ok() {
                    taken.push(now);
                }
            }
            for (k, first) in taken.iter().enumerate() {
                let within = taken[k..].iter().take_while(|at| **at < *first + MINUTE);
                prop_assert!(within.count() as u64 <= 2 * limit);
            }
        }

        #[test]
        fn after_the_wait_that_is_told_there_is_room(
            limit in 1..2_000_u64,
            sizes in prop::collection::vec(0..2_500_u64, 1..50),
        ) {
            let (usage, limits, mut now) = (Usage::default(), limits(1, limit), Instant::now());
            for size in sizes {
                match usage.take_bytes(&limits, Some(size), now) {
                    Ok(()) => {}
                    Err(Exceeded { retry_after: Some(seconds), .. }) => {
                        // A second for the rounding of sums of floats.
                        now += Duration::from_secs(seconds + 1);
                        prop_assert!(usage.take_bytes(&limits, Some(size), now).is_ok());
                    }
                    Err(_) => prop_assert!(size > limit),
                }
            }
        }
    }
}
