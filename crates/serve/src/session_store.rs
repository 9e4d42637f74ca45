//! All kept sessions by id. A session ends when it is deleted, is idle for too long, or its memory is needed.
//! Knows no HTTP; the time is passed in.
//!
//! A request that uses a session holds a [`SessionLease`]. A leased session is not freed: deleting it takes effect after its last
//! lease. Sessions without a lease are ordered by last use; the least recently used one ends first.
//!
//! A session that was opened with a key is there for that key alone; others are told that there is none.

use std::{
    collections::{BTreeMap, HashMap},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use tokio::sync::OwnedSemaphorePermit;
use uuid::Uuid;

use super::{
    client::{Client, may_use},
    ended_sessions::{End, EndReason, EndedSessions},
    instance::InstanceName,
    kept_session::KeptSession,
    quota::Exceeded,
    telemetry::SessionMetrics,
};
use darn_contract::port::EditSession;

/// Most requests for one session at once: one uses it, the others wait. Together with the places of the pool this keeps the number
/// of waiting requests below that of requests received at once.
const MAX_LEASES: usize = 4;

/// About the bytes that a session holds for each byte of its scan.
const HELD_PER_BYTE: usize = 16;

/// Why a session cannot be used or kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// No session had this id, or its end is forgotten.
    #[error("there is no session of this id; POST /sessions opens one")]
    Unknown,
    /// It has ended.
    #[error("{0}; POST /sessions opens it anew")]
    Ended(EndReason),
    /// The process that kept it has ended.
    #[error("the process that kept this session has ended; POST /sessions opens it anew")]
    Lost,
    /// Another process keeps it.
    #[error("this session is kept by the instance {0}; send the request there")]
    Elsewhere(InstanceName),
    /// Too many requests use it or wait for it.
    #[error(
        "{limit} requests for this session are under way, which is all it takes; wait for their answers"
    )]
    Busy {
        /// Most requests at once.
        limit: usize,
    },
    /// As many sessions of its key are open as may be.
    #[error(transparent)]
    Quota(Exceeded),
    /// It needs more memory than all sessions together may take.
    #[error(
        "kept for editing this scan takes {bytes} bytes; all sessions together may take {limit} (DARN_SESSION_MEMORY)"
    )]
    TooLarge {
        /// Bytes it needs.
        bytes: usize,
        /// Most bytes of all sessions.
        limit: usize,
    },
    /// The leased sessions leave no room for it.
    #[error(
        "the sessions in use leave no room for another within {limit} bytes (DARN_SESSION_MEMORY); try again"
    )]
    Full {
        /// Most bytes of all sessions.
        limit: usize,
    },
}

/// Limits of all sessions.
#[derive(Debug, Clone, Copy)]
pub struct SessionLimits {
    /// Time without a request after which a session ends.
    pub idle: Duration,
    /// Most bytes of all sessions together.
    pub memory: usize,
}

/// Who opens a session.
#[derive(Debug, Clone, Default)]
pub struct Opener {
    /// The client.
    pub client: Client,
    /// Most sessions that it may have open.
    pub most: Option<u64>,
}

/// All sessions.
pub struct SessionStore {
    state: Mutex<StoreState>,
    limits: SessionLimits,
    metrics: SessionMetrics,
}

#[derive(Default)]
struct StoreState {
    live: HashMap<Uuid, SessionEntry>,
    /// Sessions without a lease by the number of their last use: least recently used first.
    unleased: BTreeMap<u64, Uuid>,
    /// Number of uses so far.
    uses: u64,
    /// Bytes of all live sessions.
    bytes: usize,
    ended: EndedSessions,
}

struct SessionEntry {
    session: Arc<KeptSession>,
    /// Who opened it.
    client: Client,
    bytes: usize,
    leases: usize,
    last_used: Instant,
    /// Its key in `unleased`; meaningless while it is leased.
    use_number: u64,
    /// Deleted while leased; freed after the last lease.
    is_deleted: bool,
}

impl std::fmt::Debug for SessionStore {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SessionStore")
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

impl SessionStore {
    /// A store without sessions.
    pub fn new(limits: SessionLimits, metrics: SessionMetrics) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::default(),
            limits,
            metrics,
        })
    }

    /// The limits it was made with.
    pub fn limits(&self) -> SessionLimits {
        self.limits
    }

    /// Checks that a client may open one more session.
    ///
    /// # Errors
    /// `Quota`.
    pub fn check_quota(&self, opener: &Opener) -> Result<(), SessionError> {
        self.lock().check_quota(opener)
    }

    /// Keeps a client's session under a new id; ends sessions whose memory it needs, first those of the client whose sessions take most. Blocks
    /// while their memory is freed.
    ///
    /// # Errors
    /// `Quota`, `TooLarge` or `Full`; then no session was ended to make room.
    pub fn insert(
        &self,
        id: Uuid,
        opener: Opener,
        session: Box<dyn EditSession>,
        now: Instant,
    ) -> Result<(), SessionError> {
        let session = Arc::new(KeptSession::new(session));
        let bytes = session.bytes();
        let limit = self.limits.memory;
        if bytes > limit {
            return Err(SessionError::TooLarge { bytes, limit });
        }
        let mut state = self.lock();
        let mut ended = state.expire(now, self.limits.idle, &self.metrics);
        let room = match state.check_quota(&opener) {
            Ok(()) if state.leased_bytes() + bytes > limit => Err(SessionError::Full { limit }),
            checked => checked,
        };
        if room.is_err() {
            self.publish(&state);
            // Release the lock before `ended` is freed, which may take long.
            drop(state);
            return room;
        }
        ended.extend(state.evict(limit - bytes, &self.metrics));
        let use_number = state.enqueue(id);
        state.bytes += bytes;
        let entry = SessionEntry {
            session,
            client: opener.client,
            bytes,
            leases: 0,
            last_used: now,
            use_number,
            is_deleted: false,
        };
        state.live.insert(id, entry);
        self.metrics.opened.increment(1);
        self.publish(&state);
        drop(state);
        drop(ended);
        Ok(())
    }

    /// Checks that a session exists; does not count as a use.
    ///
    /// # Errors
    /// `Unknown` or `Ended`.
    pub fn check(&self, id: Uuid, client: &Client, now: Instant) -> Result<(), SessionError> {
        let mut state = self.lock();
        state.find(id, client, now, self.limits.idle).map(drop)
    }

    /// Leases a session: it is kept until the lease is dropped.
    ///
    /// # Errors
    /// `Unknown`, `Ended` or `Busy`.
    pub fn lease(
        self: &Arc<Self>,
        id: Uuid,
        client: &Client,
        now: Instant,
    ) -> Result<SessionLease, SessionError> {
        let mut state = self.lock();
        let entry = state.find(id, client, now, self.limits.idle)?;
        if entry.leases == MAX_LEASES {
            return Err(SessionError::Busy { limit: MAX_LEASES });
        }
        entry.leases += 1;
        let (use_number, session) = (entry.use_number, Arc::clone(&entry.session));
        state.unleased.remove(&use_number);
        self.metrics.requests.increment(1);
        Ok(SessionLease {
            id,
            session,
            store: Arc::clone(self),
        })
    }

    /// Deletes a session; requests that hold a lease may finish. Blocks while its memory is freed.
    ///
    /// # Errors
    /// `Unknown` or `Ended`.
    pub fn delete(&self, id: Uuid, client: &Client, now: Instant) -> Result<(), SessionError> {
        let mut state = self.lock();
        let entry = state.find(id, client, now, self.limits.idle)?;
        let client = entry.client.clone();
        let removed = if entry.leases > 0 {
            entry.is_deleted = true;
            None
        } else {
            state.remove(id)
        };
        let reason = EndReason::Deleted;
        state.ended.record(id, End { reason, client });
        self.metrics.deleted.increment(1);
        self.publish(&state);
        drop(state);
        drop(removed);
        Ok(())
    }

    /// Ends the sessions that were idle for too long. Blocks while their memory is freed.
    pub fn end_idle(&self, now: Instant) {
        let mut state = self.lock();
        let ended = state.expire(now, self.limits.idle, &self.metrics);
        self.publish(&state);
        drop(state);
        drop(ended);
    }

    /// Ends one lease of a session.
    fn release(&self, id: Uuid, now: Instant) {
        let mut state = self.lock();
        let Some(entry) = state.live.get_mut(&id) else {
            return;
        };
        entry.leases -= 1;
        entry.last_used = now;
        self.metrics.requests.decrement(1);
        let mut ended = Vec::new();
        if entry.leases == 0 {
            if entry.is_deleted {
                ended.extend(state.remove(id).map(|entry| entry.session));
            } else {
                let use_number = state.enqueue(id);
                if let Some(entry) = state.live.get_mut(&id) {
                    entry.use_number = use_number;
                }
            }
        }
        // The session may have grown during its use.
        ended.extend(state.evict(self.limits.memory, &self.metrics));
        self.publish(&state);
        drop(state);
        drop(ended);
    }

    /// Updates the memory a session takes.
    fn set_bytes(&self, id: Uuid, bytes: usize) {
        let mut state = self.lock();
        if let Some(entry) = state.live.get_mut(&id) {
            let before = std::mem::replace(&mut entry.bytes, bytes);
            state.bytes = state.bytes - before + bytes;
        }
    }

    /// Sets the gauges.
    fn publish(&self, state: &StoreState) {
        self.metrics.open.set(state.live.len() as f64);
        self.metrics.bytes.set(state.bytes as f64);
    }

    fn lock(&self) -> MutexGuard<'_, StoreState> {
        // Nothing under the lock panics halfway through a change, so a poisoned state is still consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StoreState {
    fn find(
        &mut self,
        id: Uuid,
        client: &Client,
        now: Instant,
        idle: Duration,
    ) -> Result<&mut SessionEntry, SessionError> {
        if let Some(end) = self.ended.end(&id) {
            return Err(match may_use(&end.client, client) {
                true => SessionError::Ended(end.reason),
                false => SessionError::Unknown,
            });
        }
        match self.live.get_mut(&id) {
            None => Err(SessionError::Unknown),
            Some(entry) if !may_use(&entry.client, client) => Err(SessionError::Unknown),
            Some(entry) if entry.is_deleted => Err(SessionError::Ended(EndReason::Deleted)),
            // Idle for too long, and not ended yet by `end_idle`.
            Some(entry) if entry.leases == 0 && is_over(entry.last_used, now, idle) => {
                Err(SessionError::Ended(EndReason::Idle))
            }
            Some(entry) => Ok(entry),
        }
    }

    fn check_quota(&self, opener: &Opener) -> Result<(), SessionError> {
        let Some(most) = opener.most else {
            return Ok(());
        };
        let open = |entry: &&SessionEntry| entry.client == opener.client && !entry.is_deleted;
        if (self.live.values().filter(open).count() as u64) < most {
            Ok(())
        } else {
            Err(SessionError::Quota(Exceeded::sessions(most)))
        }
    }

    /// Makes a session the most recently used of those without a lease; returns its new use number.
    fn enqueue(&mut self, id: Uuid) -> u64 {
        self.uses += 1;
        self.unleased.insert(self.uses, id);
        self.uses
    }

    /// Bytes of the leased sessions.
    fn leased_bytes(&self) -> usize {
        let leased = self.live.values().filter(|entry| entry.leases > 0);
        leased.map(|entry| entry.bytes).sum()
    }

    fn remove(&mut self, id: Uuid) -> Option<SessionEntry> {
        let entry = self.live.remove(&id)?;
        self.unleased.remove(&entry.use_number);
        self.bytes -= entry.bytes;
        Some(entry)
    }

    /// Ends a session, for a reason that is remembered.
    fn end(&mut self, id: Uuid, reason: EndReason) -> Option<Arc<KeptSession>> {
        let SessionEntry {
            session, client, ..
        } = self.remove(id)?;
        self.ended.record(id, End { reason, client });
        Some(session)
    }

    /// Ends sessions until all take at most `limit` bytes, or only leased ones are left: of the client whose unleased sessions take most the
    /// least recently used one. So a client with many sessions ends its own, and not those of others.
    fn evict(&mut self, limit: usize, metrics: &SessionMetrics) -> Vec<Arc<KeptSession>> {
        let mut ended = Vec::new();
        while self.bytes > limit {
            let Some(id) = self.first_to_end() else {
                break;
            };
            ended.extend(self.end(id, EndReason::Evicted));
            metrics.evicted.increment(1);
        }
        ended
    }

    /// The least recently used session of the client whose unleased sessions take most memory.
    fn first_to_end(&self) -> Option<Uuid> {
        let mut bytes: HashMap<&Client, usize> = HashMap::new();
        // In order of use, so that of clients with equally much the least recently used one is met first.
        let unleased = || {
            self.unleased
                .values()
                .filter_map(|id| Some((id, self.live.get(id)?)))
        };
        for (_, entry) in unleased() {
            *bytes.entry(&entry.client).or_default() += entry.bytes;
        }
        let most = bytes.values().copied().max()?;
        unleased()
            .find(|(_, entry)| bytes.get(&entry.client) == Some(&most))
            .map(|(id, _)| *id)
    }

    /// Ends the sessions that were idle for too long; `unleased` is in order of last use.
    fn expire(
        &mut self,
        now: Instant,
        idle: Duration,
        metrics: &SessionMetrics,
    ) -> Vec<Arc<KeptSession>> {
        let mut ended = Vec::new();
        while let Some((_, &id)) = self.unleased.first_key_value() {
            if (self.live.get(&id)).is_some_and(|entry| !is_over(entry.last_used, now, idle)) {
                break;
            }
            ended.extend(self.end(id, EndReason::Idle));
            metrics.expired.increment(1);
        }
        ended
    }
}

fn is_over(last_used: Instant, now: Instant, idle: Duration) -> bool {
    now.saturating_duration_since(last_used) >= idle
}

/// Keeps a session from being freed until it is dropped.
pub struct SessionLease {
    id: Uuid,
    session: Arc<KeptSession>,
    store: Arc<SessionStore>,
}

impl SessionLease {
    /// Waits for exclusive use of the session, in order of arrival. Blocks no thread.
    pub async fn exclusive(self) -> SessionGuard {
        let permit = self.session.exclusive().await;
        SessionGuard {
            _permit: permit,
            lease: self,
        }
    }
}

impl Drop for SessionLease {
    fn drop(&mut self) {
        self.store.release(self.id, Instant::now());
    }
}

/// Exclusive use of a leased session, until it is dropped.
pub struct SessionGuard {
    _permit: Option<OwnedSemaphorePermit>,
    lease: SessionLease,
}

impl SessionGuard {
    /// About the bytes of the session's scan.
    pub fn scan_bytes(&self) -> usize {
        self.lease.session.bytes() / HELD_PER_BYTE
    }

    /// Runs `job` on the session, then updates the memory it takes.
    pub fn run<T>(&self, job: impl FnOnce(&KeptSession) -> T) -> T {
        let session = &self.lease.session;
        let outcome = job(session);
        let bytes = session.bytes();
        self.lease.store.set_bytes(self.lease.id, bytes);
        outcome
    }
}

#[cfg(test)]
#[path = "session_store_tests.rs"]
mod tests;
