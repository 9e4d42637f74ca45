//! What calls leave for later calls, such as buffers and threads.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Values that are dear to make and that no call uses now. They are freed when none has used them for a while, so that a busy hour does not decide
/// what an idle service holds.
#[derive(Debug)]
pub struct Spares<T>(Mutex<Vec<Spare<T>>>);

#[derive(Debug)]
struct Spare<T> {
    value: T,
    since: Instant,
}

impl<T> Default for Spares<T> {
    fn default() -> Spares<T> {
        Spares(Mutex::default())
    }
}

impl<T> Spares<T> {
    /// The value that was used last, if there is one.
    pub fn take(&self) -> Option<T> {
        self.lock().pop().map(|spare| spare.value)
    }

    /// The value that was used last of those that fit.
    pub fn take_where(&self, fits: impl Fn(&T) -> bool) -> Option<T> {
        let mut spares = self.lock();
        let at = spares.iter().rposition(|spare| fits(&spare.value))?;
        Some(spares.remove(at).value)
    }

    /// Keeps a value for later calls.
    pub fn keep(&self, value: T) {
        let since = Instant::now();
        self.lock().push(Spare { value, since });
    }

    /// Frees the values that no call has used for so long.
    pub fn release(&self, unused: Duration) {
        let mut spares = self.lock();
        // The least recently used stand first.
        let recent = spares.partition_point(|spare| spare.since.elapsed() >= unused);
        let freed: Vec<Spare<T>> = spares.drain(..recent).collect();
        drop(spares);
        drop(freed);
    }

    /// The number of values kept.
    pub fn count(&self) -> usize {
        self.lock().len()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Spare<T>>> {
        // No change under the lock can panic half-way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_used_last_is_taken_first_and_others_are_freed() {
        let spares = Spares::default();
        spares.keep(1);
        spares.keep(2);
        assert_eq!(spares.take_where(|value| *value < 2), Some(1));
        assert_eq!(spares.take_where(|value| *value < 2), None);
        spares.keep(1);
        assert_eq!(spares.take_where(|value| *value > 1), Some(2));
        spares.keep(3);
        spares.release(Duration::from_secs(3600));
        assert_eq!(spares.count(), 2);
        std::thread::sleep(Duration::from_millis(30));
        spares.keep(4);
        spares.release(Duration::from_millis(20));
        assert_eq!(spares.count(), 1);
        assert_eq!(spares.take(), Some(4));
        assert_eq!(spares.take(), None);
    }
}
