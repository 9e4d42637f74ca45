//! Milliseconds for the report.

use std::time::{Duration, Instant};

use darn_contract::v1;

/// Adds the time of reading the scan, which [`mend`](crate::mend) does not see, to a report's timings.
pub fn add_read_time(timings: &mut Option<v1::ScanTimings>, read: Duration) {
    if let Some(timings) = timings {
        timings.read = read.as_secs_f64() * 1e3;
        timings.total += timings.read;
    }
}

/// Milliseconds since `started`.
pub(crate) fn milliseconds(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}
