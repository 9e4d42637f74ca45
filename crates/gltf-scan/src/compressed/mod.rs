//! Geometry that a file stores compressed: whole primitives (Draco), and buffer views (meshopt).
//!
//! The streams are hostile until proven otherwise. What a stream declares is checked against the limits before it is
//! decoded, what it decodes to is checked afterwards, and both are counted in the request's budget.

pub(super) mod draco;
#[cfg(test)]
pub(super) mod encoded;
pub(super) mod meshopt;

use std::cell::Cell;

use darn_budget::Budget;

use super::error::ScanError;
use super::limits::{Limit, ScanLimits};

/// What decoding may cost: the limits of the scan, and the request's budget.
pub(super) struct DecodeAllowance<'d> {
    pub limits: &'d ScanLimits,
    pub budget: &'d Budget<'d>,
    /// Bytes decoded so far and still held.
    held: Cell<usize>,
}

impl<'d> DecodeAllowance<'d> {
    /// Nothing decoded yet.
    pub fn new(limits: &'d ScanLimits, budget: &'d Budget<'d>) -> Self {
        Self {
            limits,
            budget,
            held: Cell::new(0),
        }
    }

    /// Bytes that may still be decoded.
    fn left(&self) -> usize {
        self.limits
            .max_decoded_bytes
            .saturating_sub(self.held.get())
    }

    /// Takes `bytes` of decoded data, before they are allocated; `pointer` is the JSON pointer of the stream.
    pub fn take(&self, bytes: usize, pointer: &str) -> Result<(), ScanError> {
        let held = self.held.get().saturating_add(bytes);
        let limit = Limit {
            name: "max_decoded_bytes",
            allowed: self.limits.max_decoded_bytes,
        };
        limit.check(held, pointer)?;
        self.budget.hold(bytes)?;
        self.held.set(held);
        Ok(())
    }

    /// Gives back what is held: the decoded streams are dropped, the scan keeps its own arrays.
    pub fn release(&self) {
        self.budget.release(self.held.replace(0));
    }
}
