//! Work in nanoseconds, and a counter for small steps.

use crate::{Budget, Exhausted};

/// Nanoseconds in a second.
pub const NANOSECONDS_PER_SECOND: f64 = 1e9;

/// Work after which a counter asks its budget: small against the half second in which a worker must be free, large against the cost
/// of asking.
const ASK_AFTER: u64 = 100_000;

/// Counts the small steps of a loop, and asks the budget after each tenth of a millisecond of them.
///
/// ```
/// use darn_budget::{Budget, Steps};
///
/// let mut steps = Steps::of(Budget::unlimited());
/// for _ in 0..1000 {
///     steps.take(20)?; // about 20 ns each
/// }
/// # Ok::<(), darn_budget::Exhausted>(())
/// ```
#[derive(Debug)]
pub struct Steps<'a> {
    budget: &'a Budget<'a>,
    unasked: u64,
}

impl<'a> Steps<'a> {
    /// A counter at zero.
    pub fn of(budget: &'a Budget<'a>) -> Steps<'a> {
        Steps { budget, unasked: 0 }
    }

    /// Takes work in nanoseconds of one core. What is left when the counter is dropped is not counted, so a
    /// counter must live as long as the loop that the input decides.
    ///
    /// # Errors
    /// As [`Budget::spend`].
    #[inline]
    pub fn take(&mut self, nanoseconds: u64) -> Result<(), Exhausted> {
        self.unasked = self.unasked.saturating_add(nanoseconds);
        if self.unasked < ASK_AFTER {
            return Ok(());
        }
        self.budget.spend(std::mem::take(&mut self.unasked))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;

    #[test]
    fn small_steps_add_up_to_the_limit() {
        let limits = Limits {
            work: 10_000_000,
            ..Limits::default()
        };
        let budget = Budget::new(limits, &|| false);
        let mut steps = Steps::of(&budget);
        let taken = (0..).take_while(|_| steps.take(1000).is_ok()).count() as u64;
        assert!(
            (10_000..10_000 + ASK_AFTER / 1000).contains(&taken),
            "{taken}"
        );
    }
}
