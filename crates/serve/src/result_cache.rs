//! Mends of requests that may come again (`--result-cache`): the same scan with the same constraints has the same answer, which is kept in memory,
//! the least recently used one ends first. Off by default.

use std::{
    fmt,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use axum::http::{HeaderName, HeaderValue};
use lru::LruCache;
use sha2::{Digest as _, Sha256};

use super::response::KeptMend;
use darn_contract::{Constraints, port::ScanForm};

/// How the cache took part in an answer (RFC 9211).
pub const CACHE_STATUS: HeaderName = HeaderName::from_static("cache-status");

/// How the cache took part in an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CacheStatus {
    /// It had the answer.
    Hit,
    /// It did not, and has it now.
    Stored,
    /// It did not, and the answer is larger than the cache.
    Passed,
}

impl CacheStatus {
    /// The value of the header.
    pub fn value(self) -> HeaderValue {
        HeaderValue::from_static(match self {
            Self::Hit => "darn; hit",
            Self::Stored => "darn; fwd=miss; stored",
            Self::Passed => "darn; fwd=miss",
        })
    }
}

/// What a mend depends on, in a running service: its weights and version do not change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RequestKey([u8; 32]);

impl RequestKey {
    /// The key of a request. Reads the whole scan; to be called on a worker.
    pub fn of(scan: &[u8], constraints: &Constraints, form: ScanForm) -> Self {
        let mut digest = Sha256::new();
        // Every field with its name and all digits: two that differ in anything have different texts.
        let asked = format!("{constraints:?} {form:?}");
        digest.update(asked.len().to_le_bytes());
        digest.update(asked);
        digest.update(scan);
        Self(digest.finalize().into())
    }
}

/// The mends that are kept.
pub struct ResultCache {
    /// Most bytes of all answers together.
    limit: usize,
    state: Mutex<State>,
}

struct State {
    kept: LruCache<RequestKey, Arc<KeptMend>>,
    bytes: usize,
}

impl fmt::Debug for ResultCache {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ResultCache")
            .field("limit", &self.limit)
            .finish_non_exhaustive()
    }
}

impl ResultCache {
    /// A cache of at most so many bytes.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            state: Mutex::new(State {
                kept: LruCache::unbounded(),
                bytes: 0,
            }),
        }
    }

    /// A kept mend; counts as its use.
    pub fn get(&self, key: &RequestKey) -> Option<Arc<KeptMend>> {
        self.lock().kept.get(key).cloned()
    }

    /// Keeps a mend, unless it alone is larger than the cache.
    pub fn keep(&self, key: RequestKey, mend: &Arc<KeptMend>) -> CacheStatus {
        let bytes = size(mend);
        if bytes > self.limit {
            return CacheStatus::Passed;
        }
        let mut freed = Vec::new();
        let mut state = self.lock();
        if let Some(before) = state.kept.put(key, Arc::clone(mend)) {
            state.bytes -= size(&before);
            freed.push(before);
        }
        state.bytes += bytes;
        while state.bytes > self.limit
            && let Some((_, oldest)) = state.kept.pop_lru()
        {
            state.bytes -= size(&oldest);
            freed.push(oldest);
        }
        // Freed after the lock: that takes long.
        drop(state);
        CacheStatus::Stored
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing under the lock panics halfway through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// About the bytes of memory of a mend.
fn size(mend: &KeptMend) -> usize {
    mend.bytes.len() + mend.report.len() + 1024
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mend(bytes: usize) -> Arc<KeptMend> {
        Arc::new(KeptMend {
            answer: Default::default(),
            bytes: vec![7; bytes],
            report: Vec::new(),
        })
    }

    #[test]
    fn the_least_recently_used_mends_end_first_and_the_limit_holds() {
        let cache = ResultCache::new(10_000);
        let key = |scan: u8| RequestKey::of(&[scan], &Constraints::default(), ScanForm::AsReceived);
        for scan in 0..3 {
            assert_eq!(cache.keep(key(scan), &mend(2000)), CacheStatus::Stored);
        }
        assert!(cache.get(&key(0)).is_some());
        assert_eq!(cache.keep(key(3), &mend(2000)), CacheStatus::Stored);
        let kept = [0, 1, 2, 3].map(|scan| cache.get(&key(scan)).is_some());
        assert_eq!(kept, [true, false, true, true]);
        // The same one again is not counted twice.
        assert_eq!(cache.keep(key(3), &mend(2000)), CacheStatus::Stored);
        assert!(cache.get(&key(0)).is_some());
        assert_eq!(cache.keep(key(9), &mend(10_000)), CacheStatus::Passed);
        assert!(cache.get(&key(9)).is_none() && cache.get(&key(3)).is_some());
    }

    #[test]
    fn any_difference_of_a_request_makes_another_key() {
        let constraints = Constraints::default();
        let doubtful = Constraints {
            accept_doubtful: true,
            ..Constraints::default()
        };
        let first = RequestKey::of(b"scan", &constraints, ScanForm::AsReceived);
        assert_eq!(
            first,
            RequestKey::of(b"scan", &constraints, ScanForm::AsReceived)
        );
        for other in [
            RequestKey::of(b"scam", &constraints, ScanForm::AsReceived),
            RequestKey::of(b"scan", &doubtful, ScanForm::AsReceived),
            RequestKey::of(b"scan", &constraints, ScanForm::Glb),
        ] {
            assert_ne!(first, other);
        }
    }
}
