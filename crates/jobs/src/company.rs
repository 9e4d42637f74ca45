//! Which jobs run beside each other in this process ([`Company`]).

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::job::{Company, Job};

/// The jobs that run in this process.
#[derive(Debug, Default)]
pub(crate) struct RunningJobs {
    counts: Mutex<Counts>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Counts {
    running: usize,
    /// Those that run alone because an earlier attempt of theirs crashed: at most one.
    alone: usize,
}

impl RunningJobs {
    /// In what company a job would start; nothing where none may, because one that runs must be alone.
    pub(crate) fn company(&self) -> Option<Company> {
        match *self.counts() {
            Counts { alone: 1.., .. } => None,
            Counts { running: 0, .. } => Some(Company::Alone),
            Counts { .. } => Some(Company::Shared),
        }
    }

    /// A job starts; it runs until what is returned is dropped.
    pub(crate) fn start(self: &Arc<Self>, job: &Job) -> RunningJob {
        let running = RunningJob {
            jobs: Arc::clone(self),
            is_alone: job.attempt > 1,
        };
        let mut counts = self.counts();
        counts.running += 1;
        counts.alone += usize::from(running.is_alone);
        running
    }

    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A job that runs.
#[derive(Debug)]
pub(crate) struct RunningJob {
    jobs: Arc<RunningJobs>,
    is_alone: bool,
}

impl Drop for RunningJob {
    fn drop(&mut self) {
        let mut counts = self.jobs.counts();
        counts.running -= 1;
        counts.alone -= usize::from(self.is_alone);
    }
}
