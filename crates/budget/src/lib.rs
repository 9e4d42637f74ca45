//! What one request may still cost: time, work, memory and the size of its answer.
//!
//! Every loop whose length the input decides asks the request's [`Budget`]. Time and cancellation depend on the clock and the caller.
//! Work, memory and output are counted from the input alone, so that the same request is always refused or always answered.

mod memory;
pub mod priority;
mod progress;
mod spares;
mod work;

pub use memory::{Memory, MemoryPool};
pub use progress::{Listener, Progress, Stage};
pub use spares::Spares;
pub use work::{NANOSECONDS_PER_SECOND, Steps};

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Why a request ends before its answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Exhausted {
    /// The caller has left, or the deadline has passed or would pass before the next step ends.
    #[error("the deadline has passed, or nobody waits for the answer any more")]
    Cancelled,
    /// The request needs more work than its size allows.
    #[error(
        "the request needs more than the {seconds:.1} s of work that are allowed for its size; \
         send fewer constraints or holes at once, or a scan with fewer triangles around its holes"
    )]
    Work {
        /// Work allowed, in seconds of one core.
        seconds: f64,
    },
    /// One part of the request, such as a hole, needs more work than its share of the request's.
    #[error(
        "it alone needs more than {seconds:.1} s of work, its share of what is allowed for the request's size; name it to \
         let it have all, or send a scan with fewer triangles around it"
    )]
    Share {
        /// Work allowed for the part, in seconds of one core.
        seconds: f64,
    },
    /// The request needs more memory than its size allows.
    #[error(
        "the request needs more than the {} MiB of memory that are allowed for its size; choose fewer holes at once by `holes`",
        .limit >> 20
    )]
    Memory {
        /// Bytes allowed.
        limit: usize,
    },
    /// All requests together need more memory than the service may take.
    #[error("the service's memory of {} MiB is taken by other requests", .limit >> 20)]
    MemoryFull {
        /// Bytes that all requests together may take.
        limit: usize,
    },
    /// The answer would be larger than its limit.
    #[error("the answer would be larger than {} MiB", .limit >> 20)]
    Output {
        /// Bytes allowed.
        limit: usize,
    },
}

/// The limits of a request; each is without bound unless set.
#[derive(Debug, Clone)]
pub struct Limits {
    /// When the answer comes too late.
    pub deadline: Option<Instant>,
    /// Work in nanoseconds of one core, as the code estimates it.
    pub work: u64,
    /// Bytes of memory that the request may hold at once, as the code estimates them.
    pub memory: usize,
    /// Bytes of the answer.
    pub output: usize,
    /// The memory that all requests share.
    pub pool: Option<Arc<MemoryPool>>,
    /// Who is told how far the work is. It bounds nothing.
    pub listener: Option<Listener>,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            deadline: None,
            work: u64::MAX,
            memory: usize::MAX,
            output: usize::MAX,
            pool: None,
            listener: None,
        }
    }
}

/// What one request may still cost. Shared by reference between the threads that work for it.
pub struct Budget<'a> {
    limits: Limits,
    cancelled: &'a (dyn Fn() -> bool + Sync),
    spent: AtomicU64,
    held: AtomicUsize,
    /// The budget of which this one is a share.
    whole: Option<&'a Budget<'a>>,
}

/// A request without limits that is never cancelled.
static UNLIMITED: Budget<'static> = Budget {
    limits: Limits {
        deadline: None,
        work: u64::MAX,
        memory: usize::MAX,
        output: usize::MAX,
        pool: None,
        listener: None,
    },
    cancelled: &|| false,
    spent: AtomicU64::new(0),
    held: AtomicUsize::new(0),
    whole: None,
};

impl<'a> Budget<'a> {
    /// A budget within limits, for a caller who waits until `cancelled` returns true. `cancelled` is cheap and may be called from any
    /// thread.
    pub fn new(limits: Limits, cancelled: &'a (dyn Fn() -> bool + Sync)) -> Budget<'a> {
        Budget {
            limits,
            cancelled,
            spent: AtomicU64::new(0),
            held: AtomicUsize::new(0),
            whole: None,
        }
    }

    /// A budget for one part of the request, which may take at most so much work of it, in nanoseconds of one core. All that it takes and holds
    /// counts for the request, too.
    pub fn share(&self, work: u64) -> Budget<'_> {
        Budget {
            limits: Limits {
                work,
                deadline: self.limits.deadline,
                ..Limits::default()
            },
            cancelled: self.cancelled,
            spent: AtomicU64::new(0),
            held: AtomicUsize::new(0),
            whole: Some(self),
        }
    }

    /// The budget of a command that a person runs: no limits, never cancelled.
    pub fn unlimited() -> &'static Budget<'static> {
        &UNLIMITED
    }

    /// The limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Begins a stage of the work that has so many pieces; 0 where it is one piece.
    pub fn begin(&self, stage: &'static str, pieces: usize) -> Stage<'_> {
        match self.whole {
            Some(whole) => whole.begin(stage, pieces),
            None => Stage::begin(self.limits.listener.as_ref(), stage, pieces),
        }
    }

    /// Checks that the answer is still waited for.
    ///
    /// # Errors
    /// `Cancelled`.
    pub fn check(&self) -> Result<(), Exhausted> {
        if let Some(whole) = self.whole {
            return whole.check();
        }
        let late = self.limits.deadline.is_some_and(|at| Instant::now() >= at);
        if late || (self.cancelled)() {
            return Err(Exhausted::Cancelled);
        }
        Ok(())
    }

    /// Takes work, in nanoseconds of one core, and checks that the answer is still waited for. Call it before a step whose cost is
    /// known, or after each few thousand small ones ([`Steps`] counts those).
    ///
    /// # Errors
    /// `Work`, or `Share` where this is the budget of a part; `Cancelled`.
    pub fn spend(&self, nanoseconds: u64) -> Result<(), Exhausted> {
        // Without a limit nothing is counted: the shared budget of commands would overflow in the end.
        let before = match self.limits.work {
            u64::MAX => 0,
            _ => self.spent.fetch_add(nanoseconds, Relaxed),
        };
        let left = self.limits.work.saturating_sub(before);
        // What was exhausted stays so, even for work that is none.
        let is_exhausted = before.saturating_add(nanoseconds) > self.limits.work;
        let Some(whole) = self.whole else {
            return match is_exhausted {
                true => Err(Exhausted::Work {
                    seconds: self.limits.work as f64 / NANOSECONDS_PER_SECOND,
                }),
                false => self.check(),
            };
        };
        // An exhausted part costs the request all of its share, whatever its threads were about to take.
        whole.spend(nanoseconds.min(left))?;
        match is_exhausted {
            true => Err(Exhausted::Share {
                seconds: self.limits.work as f64 / NANOSECONDS_PER_SECOND,
            }),
            false => Ok(()),
        }
    }

    /// [`Budget::spend`] before a step that cannot be interrupted: ends the request at once when the step would end after the deadline.
    ///
    /// # Errors
    /// As [`Budget::spend`].
    pub fn spend_at_once(&self, nanoseconds: u64) -> Result<(), Exhausted> {
        self.spend(nanoseconds)?;
        let end = self
            .limits
            .deadline
            .zip(Instant::now().checked_add(Duration::from_nanos(nanoseconds)));
        match end {
            Some((deadline, end)) if end > deadline => Err(Exhausted::Cancelled),
            _ => Ok(()),
        }
    }

    /// Work that may still be taken, in nanoseconds of one core; `None` without a limit.
    pub fn work_left(&self) -> Option<u64> {
        let limit = Some(self.limits.work).filter(|work| *work != u64::MAX);
        limit.map(|work| work.saturating_sub(self.spent()))
    }

    /// Work taken so far, in nanoseconds of one core; 0 without a limit.
    pub fn spent(&self) -> u64 {
        self.spent.load(Relaxed)
    }

    /// Counts memory that the request holds until it ends.
    ///
    /// # Errors
    /// `Memory`, `MemoryFull`.
    pub fn hold(&self, bytes: usize) -> Result<(), Exhausted> {
        if let Some(whole) = self.whole {
            return whole.hold(bytes);
        }
        if self.limits.memory == usize::MAX && self.limits.pool.is_none() {
            return Ok(());
        }
        let before = self.held.fetch_add(bytes, Relaxed);
        let limit = self.limits.memory;
        let taken = match &self.limits.pool {
            _ if before.saturating_add(bytes) > limit => Err(Exhausted::Memory { limit }),
            Some(pool) if !pool.grow(bytes) => Err(Exhausted::MemoryFull {
                limit: pool.limit(),
            }),
            _ => return Ok(()),
        };
        self.held.fetch_sub(bytes, Relaxed);
        taken
    }

    /// Bytes of memory that the whole request holds now; 0 without limits.
    pub fn held(&self) -> usize {
        match self.whole {
            Some(whole) => whole.held(),
            None => self.held.load(Relaxed),
        }
    }

    /// Bytes that this request may still hold, whatever other requests hold.
    pub fn memory_left(&self) -> usize {
        match self.whole {
            Some(whole) => whole.memory_left(),
            None => self.limits.memory.saturating_sub(self.held()),
        }
    }

    /// Gives back memory counted by [`Budget::hold`].
    pub fn release(&self, bytes: usize) {
        if let Some(whole) = self.whole {
            return whole.release(bytes);
        }
        if self.limits.memory == usize::MAX && self.limits.pool.is_none() {
            return;
        }
        let before = self.held.fetch_sub(bytes, Relaxed);
        debug_assert!(before >= bytes, "more is released than was held");
        if let Some(pool) = &self.limits.pool {
            pool.shrink(bytes);
        }
    }

    /// Checks the size of an answer, in bytes.
    ///
    /// # Errors
    /// `Output`.
    pub fn check_output(&self, bytes: usize) -> Result<(), Exhausted> {
        if let Some(whole) = self.whole {
            return whole.check_output(bytes);
        }
        let limit = self.limits.output;
        if bytes > limit {
            return Err(Exhausted::Output { limit });
        }
        Ok(())
    }
}

impl Drop for Budget<'_> {
    fn drop(&mut self) {
        if let Some(pool) = &self.limits.pool {
            pool.shrink(self.held.load(Relaxed));
        }
    }
}

impl fmt::Debug for Budget<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Budget")
            .field("limits", &self.limits)
            .field("spent", &self.spent)
            .field("held", &self.held)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn budget(limits: Limits) -> Budget<'static> {
        Budget::new(limits, &|| false)
    }

    #[test]
    fn a_caller_who_left_ends_every_step() {
        let left = Budget::new(Limits::default(), &|| true);
        assert_eq!(left.check(), Err(Exhausted::Cancelled));
        assert_eq!(left.spend(1), Err(Exhausted::Cancelled));
    }

    #[test]
    fn a_step_that_would_end_after_the_deadline_is_not_begun() {
        let soon = Instant::now() + Duration::from_secs(60);
        let limits = Limits {
            deadline: Some(soon),
            ..Limits::default()
        };
        let budget = budget(limits);
        assert_eq!(budget.spend_at_once(1_000_000_000), Ok(()));
        assert_eq!(
            budget.spend_at_once(120_000_000_000),
            Err(Exhausted::Cancelled)
        );
        assert_eq!(budget.spend(120_000_000_000), Ok(()));
    }

    #[test]
    fn whoever_listens_hears_of_every_piece() {
        let (tell, heard) = std::sync::mpsc::channel();
        let limits = Limits {
            listener: Some(Listener::new(move |progress| tell.send(progress).unwrap())),
            ..Limits::default()
        };
        let budget = budget(limits);
        let stage = budget.begin("flatten", 2);
        stage.one_done();
        stage.one_done();
        budget.begin("write", 0);
        let heard: Vec<_> = heard
            .try_iter()
            .map(|it| (it.stage, it.done, it.all))
            .collect();
        let all = [
            ("flatten", 0, 2),
            ("flatten", 1, 2),
            ("flatten", 2, 2),
            ("write", 0, 0),
        ];
        assert_eq!(heard, all);
        Budget::unlimited().begin("flatten", 1).one_done();
    }

    #[test]
    fn memory_of_a_pool_comes_back_when_the_request_ends() {
        let pool = MemoryPool::new(100);
        let limits = Limits {
            pool: Some(Arc::clone(&pool)),
            memory: 80,
            ..Limits::default()
        };
        let first = budget(limits.clone());
        let second = budget(limits);
        assert_eq!(first.hold(70), Ok(()));
        assert_eq!(first.hold(20), Err(Exhausted::Memory { limit: 80 }));
        assert_eq!(second.hold(40), Err(Exhausted::MemoryFull { limit: 100 }));
        assert_eq!(pool.used(), 70);
        first.release(30);
        assert_eq!(second.hold(40), Ok(()));
        drop(first);
        assert_eq!(pool.used(), 40);
        drop(second);
        assert_eq!(pool.used(), 0);
    }

    #[test]
    fn what_a_share_takes_counts_for_the_request_and_no_more_than_the_share() {
        let limits = Limits {
            work: 100,
            memory: 50,
            ..Limits::default()
        };
        let whole = budget(limits);
        let part = whole.share(30);
        assert_eq!(part.spend(20), Ok(()));
        let seconds = 30.0 / NANOSECONDS_PER_SECOND;
        assert_eq!(part.spend(20), Err(Exhausted::Share { seconds }));
        assert_eq!(part.spend(1), Err(Exhausted::Share { seconds }));
        assert_eq!(whole.spent(), 30, "the share and no more");
        assert_eq!(whole.share(30).spend(30), Ok(()));
        let seconds = 100.0 / NANOSECONDS_PER_SECOND;
        let last = whole.share(60);
        assert_eq!(last.spend(50), Err(Exhausted::Work { seconds }));
        assert_eq!(part.hold(40), Ok(()));
        assert_eq!((whole.held(), last.memory_left()), (40, 10));
        assert_eq!(last.hold(20), Err(Exhausted::Memory { limit: 50 }));
        drop(part);
        assert_eq!(whole.held(), 40, "what a part made stays");
        last.release(40);
        assert_eq!(whole.held(), 0);
    }

    #[test]
    fn a_share_ends_with_the_request() {
        let left = Budget::new(Limits::default(), &|| true);
        assert_eq!(left.share(10).check(), Err(Exhausted::Cancelled));
        let past = budget(Limits {
            deadline: Some(Instant::now()),
            ..Limits::default()
        });
        assert_eq!(past.share(10).spend(1), Err(Exhausted::Cancelled));
    }

    #[test]
    fn without_limits_nothing_is_counted() {
        let unlimited = Budget::unlimited();
        assert_eq!(unlimited.spend(u64::MAX), Ok(()));
        assert_eq!(unlimited.hold(usize::MAX), Ok(()));
        assert_eq!(unlimited.check_output(usize::MAX), Ok(()));
        assert_eq!(unlimited.spent(), 0);
    }

    proptest! {
        #[test]
        fn work_is_refused_exactly_when_its_sum_exceeds_the_limit(
            limit in 0..1000u64, steps in prop::collection::vec(0..100u64, 0..40)
        ) {
            let budget = budget(Limits { work: limit, ..Limits::default() });
            let mut sum = 0;
            for step in steps {
                sum += step;
                prop_assert_eq!(budget.spend(step).is_err(), sum > limit);
            }
        }

        #[test]
        fn memory_within_the_limit_is_granted_and_refusals_take_nothing(
            limit in 0..1000usize, steps in prop::collection::vec(0..400usize, 0..40)
        ) {
            let budget = budget(Limits { memory: limit, ..Limits::default() });
            let mut sum = 0;
            for step in steps {
                let fits = sum + step <= limit;
                prop_assert_eq!(budget.hold(step).is_ok(), fits);
                if fits {
                    sum += step;
                }
            }
        }
    }
}
