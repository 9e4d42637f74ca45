//! The memory that all requests of a service share.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A number of bytes that requests take from and give back to.
#[derive(Debug)]
pub struct MemoryPool {
    limit: usize,
    used: AtomicUsize,
}

impl MemoryPool {
    /// A pool of `limit` bytes, all free.
    pub fn new(limit: usize) -> Arc<MemoryPool> {
        let used = AtomicUsize::new(0);
        Arc::new(MemoryPool { limit, used })
    }

    /// Bytes in all.
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Bytes taken.
    pub fn used(&self) -> usize {
        self.used.load(Relaxed)
    }

    /// Takes bytes that are given back when the result is dropped; `None` when fewer are free.
    pub fn take(self: &Arc<Self>, bytes: usize) -> Option<Memory> {
        // Lazily: a `Memory` that is made and dropped would give back what was never taken.
        self.grow(bytes).then(|| Memory {
            pool: Arc::clone(self),
            bytes,
        })
    }

    /// Takes bytes even when fewer are free: for memory that is in use already.
    pub fn take_anyway(self: &Arc<Self>, bytes: usize) -> Memory {
        self.used.fetch_add(bytes, Relaxed);
        Memory {
            pool: Arc::clone(self),
            bytes,
        }
    }

    /// Whether `bytes` more were free; they are taken then.
    pub(crate) fn grow(&self, bytes: usize) -> bool {
        let fits = |used: usize| used.checked_add(bytes).filter(|sum| *sum <= self.limit);
        self.used.fetch_update(Relaxed, Relaxed, fits).is_ok()
    }

    pub(crate) fn shrink(&self, bytes: usize) {
        self.used.fetch_sub(bytes, Relaxed);
    }
}

/// Bytes taken from a pool; given back when dropped.
#[derive(Debug)]
pub struct Memory {
    pool: Arc<MemoryPool>,
    bytes: usize,
}

impl Memory {
    /// Where they were taken from.
    pub fn pool(&self) -> &MemoryPool {
        &self.pool
    }

    /// Bytes taken.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Takes or gives back bytes until `bytes` are taken; false, and no change, when they are not free.
    pub fn resize(&mut self, bytes: usize) -> bool {
        let more = bytes.saturating_sub(self.bytes);
        if !self.pool.grow(more) {
            return false;
        }
        self.pool.shrink((self.bytes + more) - bytes);
        self.bytes = bytes;
        true
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.pool.shrink(self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_taken_is_within_the_limit_and_comes_back(
            limit in 0..1000usize, sizes in prop::collection::vec((0..600usize, 0..600usize), 0..20)
        ) {
            let pool = MemoryPool::new(limit);
            let mut taken: Vec<Memory> = sizes.iter().filter_map(|(size, _)| pool.take(*size)).collect();
            let sum = |taken: &[Memory]| taken.iter().map(Memory::bytes).sum::<usize>();
            prop_assert_eq!(pool.used(), sum(&taken));
            for (memory, (_, size)) in taken.iter_mut().zip(&sizes) {
                let (before, used) = (memory.bytes(), pool.used());
                let fits = used - before + size <= limit;
                prop_assert_eq!(memory.resize(*size), fits);
                prop_assert_eq!(memory.bytes(), if fits { *size } else { before });
            }
            prop_assert!(pool.used() <= limit);
            prop_assert_eq!(pool.used(), sum(&taken));
            drop(taken);
            prop_assert_eq!(pool.used(), 0);
        }
    }
}
