//! An attempt as the thread that works sees it, and the task that keeps its lease.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU8, Ordering},
    },
    time::Duration,
};

use tokio::time::{Instant, MissedTickBehavior, interval};
use tracing::{info, warn};

use super::{
    error::JobError,
    job::{Lease, Progress, Signal},
    jobs::{Changes, Jobs},
};

/// How often progress is written at most. More often would only cost syncs of the disk.
const PROGRESS_EVERY: Duration = Duration::from_millis(500);

/// Why an attempt is to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The client wants the job cancelled.
    Cancelled,
    /// The job was given to another worker, or was deleted.
    LeaseLost,
}

/// An attempt as the thread that works sees it. Nothing here waits.
#[derive(Debug, Default)]
pub struct Attempt {
    /// Progress that is not written yet.
    progress: Mutex<Option<Progress>>,
    stop: AtomicU8,
}

const STOP_CANCELLED: u8 = 1;
const STOP_LEASE_LOST: u8 = 2;

impl Attempt {
    /// Tells how far the work is. It is written soon, at most twice a second; of several, the last one.
    pub fn report(&self, progress: Progress) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
    }

    /// Whether and why the work is to stop.
    pub fn stop_reason(&self) -> Option<StopReason> {
        match self.stop.load(Ordering::Relaxed) {
            STOP_CANCELLED => Some(StopReason::Cancelled),
            STOP_LEASE_LOST => Some(StopReason::LeaseLost),
            _ => None,
        }
    }

    fn take_progress(&self) -> Option<Progress> {
        self.progress
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }

    /// Keeps progress that could not be written, unless there is newer one.
    fn put_back(&self, progress: Progress) {
        self.progress
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get_or_insert(progress);
    }
}

/// Renews the lease, writes progress and hears of cancellation, until the lease is lost or this is dropped.
///
/// A cancellation by this process is heard of at once, one by another machine at the next renewal. While the database cannot be reached, the
/// work goes on: if nobody takes the lease meanwhile, nothing is lost.
///
/// `stops` has been listening since before the job was claimed, so that no cancellation is missed.
pub(crate) async fn keep(jobs: Arc<Jobs>, lease: Lease, attempt: Arc<Attempt>, mut stops: Changes) {
    let mut ticks = interval(PROGRESS_EVERY.min(jobs.settings().renewal));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut renewed_at = Instant::now();
    loop {
        let is_told = tokio::select! {
            _ = ticks.tick() => false,
            () = stops.of(lease.job) => true,
        };
        let is_due = renewed_at.elapsed() >= jobs.settings().renewal;
        let signal = match attempt.take_progress() {
            Some(progress) => {
                let signal = jobs.store().progress(lease, &progress).await;
                match signal {
                    Ok(_) => jobs.announce(lease.job),
                    Err(_) => attempt.put_back(progress),
                }
                signal
            }
            None if is_due || is_told => jobs.store().renew(lease).await,
            None => continue,
        };
        match signal {
            Ok(signal) => {
                renewed_at = Instant::now();
                if signal == Signal::Cancel {
                    attempt.stop.store(STOP_CANCELLED, Ordering::Relaxed);
                }
            }
            Err(JobError::LeaseLost(job)) => {
                info!(%job, "the lease is lost");
                attempt.stop.store(STOP_LEASE_LOST, Ordering::Relaxed);
                return;
            }
            Err(error) => warn!(job = %lease.job, ?error, "the lease cannot be renewed"),
        }
    }
}
