//! Threads for the parallel work of calls, apart for each call that runs.
//!
//! With one pool for all calls, the small steps of a small mend would wait behind the large ones of others: a thread of rayon takes no new
//! work before its own list is empty. With a pool for each, the operating system shares the processors between calls, by the priorities of the
//! threads that make them.

use std::time::Duration;

use darn_budget::{Budget, Spares, priority};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Most threads of a call. Mends gain little beyond it, and a machine with many processors runs many calls.
const MAX_THREADS: usize = 8;
/// Calls that hold this many bytes are large.
const LARGE: usize = 32 << 20;

/// Thread pools of calls; one that is not in use is kept for the next call for a while.
#[derive(Debug)]
pub struct CallPools {
    threads: usize,
    spare: Spares<CallPool>,
}

/// The threads of one call.
#[derive(Debug)]
struct CallPool {
    threads: ThreadPool,
    /// Theirs, which they have from the thread that made them.
    priority: i32,
}

impl Default for CallPools {
    /// Pools with as many threads as rayon's global one, but no more than eight.
    fn default() -> CallPools {
        CallPools {
            threads: rayon::current_num_threads().min(MAX_THREADS),
            spare: Spares::default(),
        }
    }
}

impl CallPools {
    /// Runs a call whose parallel work has its own threads; on the global pool where the system gives no more threads. The result does not
    /// depend on where it runs.
    pub fn run<T: Send>(&self, budget: &Budget, call: impl FnOnce() -> T + Send) -> T {
        let priority = priority::of_this_thread();
        let is_alike = |pool: &CallPool| pool.priority == priority;
        let pool = self.spare.take_where(is_alike).or_else(|| {
            let threads = ThreadPoolBuilder::new().num_threads(self.threads);
            let named = threads.thread_name(|k| format!("call-{k}"));
            let threads = named.build().ok()?;
            Some(CallPool { threads, priority })
        });
        let Some(pool) = pool else {
            return call();
        };
        let outcome = pool.threads.install(call);
        // The allocator keeps freed memory for each thread: after a large call the threads end, and their memory is free for all.
        if budget.held() < LARGE {
            self.spare.keep(pool);
        }
        outcome
    }

    /// Ends the threads that no call has used for so long.
    pub(crate) fn release_idle(&self, unused: Duration) {
        self.spare.release(unused);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, mpsc};
    use std::thread;

    use rayon::prelude::*;

    use super::*;

    #[test]
    fn a_call_does_not_wait_for_the_parallel_work_of_another() {
        let pools = CallPools::default();
        let (release, released) = mpsc::channel::<()>();
        let (begun, has_begun) = mpsc::channel();
        let released = Mutex::new(released);
        thread::scope(|scope| {
            let pools = &pools;
            let released = &released;
            scope.spawn(move || {
                pools.run(Budget::unlimited(), || {
                    // Holds every thread of its pool.
                    (0..2 * MAX_THREADS).into_par_iter().for_each(|_| {
                        begun.send(()).ok();
                        released.lock().unwrap().recv().ok();
                    });
                });
            });
            has_begun.recv().unwrap();
            let sum: usize =
                pools.run(Budget::unlimited(), || (0..1000usize).into_par_iter().sum());
            assert_eq!(sum, 499_500);
            drop(release);
        });
        assert_eq!(pools.spare.count(), 2);
    }

    #[test]
    fn the_work_of_a_call_has_the_priority_of_its_caller() {
        let pools = CallPools::default();
        let of_call = || pools.run(Budget::unlimited(), priority::of_this_thread);
        let own = of_call();
        assert_eq!(own, priority::of_this_thread());
        let (lowered, of_lowered) = thread::scope(|scope| {
            let lowered = scope.spawn(|| {
                priority::lower_this_thread();
                (priority::of_this_thread(), of_call())
            });
            lowered.join().unwrap()
        });
        assert_eq!(of_lowered, lowered);
        assert_eq!(of_call(), own);
    }
}
