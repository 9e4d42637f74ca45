//! Scans kept for editing: by id, used by one request at a time, ended when idle for too long or when memory is short.
//! Knows no HTTP, and no time but what it is given.
//!
//! Whoever works on a session holds a [`Lease`]; what is leased is never ended under its user, only marked. What nobody
//! leases stands in line, least recently used first, and is ended from the front.

use std::{
    collections::{BTreeMap, HashMap},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use tokio::sync::OwnedSemaphorePermit;
use uuid::Uuid;

use super::{
    graves::{End, Graves},
    session::Session,
    telemetry::SessionMetrics,
};
use darn_contract::port::EditSession;

/// Requests one session takes at once: one works, the others wait for their turn. Together with the places of the pool this
/// bounds who waits, below the number of requests received at once.
const MOST_USERS: usize = 4;

/// Why a session is not there, or not to be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// The id was never given, or so long ago that its end is forgotten.
    #[error("there is no session of this id; POST /sessions opens one")]
    Unknown,
    /// It was there.
    #[error("{0}; POST /sessions opens it anew")]
    Ended(End),
    /// Too many requests for the same one.
    #[error(
        "{limit} requests for this session are under way, which is all it takes; wait for their answers"
    )]
    Busy {
        /// Requests at once.
        limit: usize,
    },
    /// It alone is larger than all sessions may be.
    #[error(
        "kept for editing this scan takes {bytes} bytes; all sessions together may take {limit} (DARN_SESSION_MEMORY)"
    )]
    TooLarge {
        /// What it takes.
        bytes: usize,
        /// What all may take.
        limit: usize,
    },
    /// What is in use leaves no room for it.
    #[error(
        "the sessions in use leave no room for another within {limit} bytes (DARN_SESSION_MEMORY); try again"
    )]
    Full {
        /// What all may take.
        limit: usize,
    },
}

/// What sessions may cost.
#[derive(Debug, Clone, Copy)]
pub struct SessionLimits {
    /// Time without a request after which one ends.
    pub idle: Duration,
    /// Bytes of all together.
    pub memory: usize,
}

/// All sessions.
pub struct Sessions {
    state: Mutex<State>,
    limits: SessionLimits,
    metrics: SessionMetrics,
}

#[derive(Default)]
struct State {
    live: HashMap<Uuid, Entry>,
    /// Those nobody leases, least recently used first.
    line: BTreeMap<u64, Uuid>,
    /// Places in line given so far.
    places: u64,
    bytes: usize,
    graves: Graves,
}

struct Entry {
    session: Arc<Session>,
    bytes: usize,
    users: usize,
    used: Instant,
    /// In the line; of no meaning while somebody leases it.
    place: u64,
    /// Deleted, and gone when its last user is.
    doomed: bool,
}

impl std::fmt::Debug for Sessions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sessions")
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

impl Sessions {
    /// None yet.
    pub fn new(limits: SessionLimits, metrics: SessionMetrics) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::default(),
            limits,
            metrics,
        })
    }

    /// What they may cost.
    pub fn limits(&self) -> SessionLimits {
        self.limits
    }

    /// Keeps a scan under an id of its own; ends the least recently used ones that it needs the room of. Frees their memory:
    /// call it where that may take its time.
    ///
    /// # Errors
    /// `TooLarge` or `Full`; then nothing was ended for it.
    pub fn open(
        &self,
        id: Uuid,
        kept: Box<dyn EditSession>,
        now: Instant,
    ) -> Result<(), SessionError> {
        let session = Arc::new(Session::new(kept));
        let bytes = session.bytes();
        let limit = self.limits.memory;
        if bytes > limit {
            return Err(SessionError::TooLarge { bytes, limit });
        }
        let mut state = self.lock();
        let mut ended = state.expire(now, self.limits.idle, &self.metrics);
        if state.leased() + bytes > limit {
            self.count(&state);
            // First the lock, then what has expired: its memory may take its time.
            drop(state);
            return Err(SessionError::Full { limit });
        }
        ended.extend(state.evict(limit - bytes, &self.metrics));
        let place = state.stand(id);
        state.bytes += bytes;
        let entry = Entry {
            session,
            bytes,
            users: 0,
            used: now,
            place,
            doomed: false,
        };
        state.live.insert(id, entry);
        self.metrics.opened.increment(1);
        self.count(&state);
        drop(state);
        drop(ended);
        Ok(())
    }

    /// Whether a session is there; does not count as using it.
    ///
    /// # Errors
    /// `Unknown` or `Ended`.
    pub fn find(&self, id: Uuid, now: Instant) -> Result<(), SessionError> {
        self.lock().find(id, now, self.limits.idle).map(drop)
    }

    /// Takes a session into use.
    ///
    /// # Errors
    /// `Unknown`, `Ended` or `Busy`.
    pub fn lease(self: &Arc<Self>, id: Uuid, now: Instant) -> Result<Lease, SessionError> {
        let mut state = self.lock();
        let entry = state.find(id, now, self.limits.idle)?;
        if entry.users == MOST_USERS {
            return Err(SessionError::Busy { limit: MOST_USERS });
        }
        entry.users += 1;
        let (place, session) = (entry.place, Arc::clone(&entry.session));
        state.line.remove(&place);
        self.metrics.requests.increment(1);
        Ok(Lease {
            id,
            session,
            of: Arc::clone(self),
        })
    }

    /// Ends a session at its owner's wish; requests that work on it may finish. Frees its memory.
    ///
    /// # Errors
    /// `Unknown` or `Ended`.
    pub fn delete(&self, id: Uuid, now: Instant) -> Result<(), SessionError> {
        let mut state = self.lock();
        let entry = state.find(id, now, self.limits.idle)?;
        let ended = if entry.users > 0 {
            entry.doomed = true;
            None
        } else {
            state.remove(id)
        };
        state.graves.dig(id, End::Deleted);
        self.metrics.deleted.increment(1);
        self.count(&state);
        drop(state);
        drop(ended);
        Ok(())
    }

    /// Ends those that were idle for too long. Frees their memory.
    pub fn sweep(&self, now: Instant) {
        let mut state = self.lock();
        let ended = state.expire(now, self.limits.idle, &self.metrics);
        self.count(&state);
        drop(state);
        drop(ended);
    }

    fn give_back(&self, id: Uuid, now: Instant) {
        let mut state = self.lock();
        let Some(entry) = state.live.get_mut(&id) else {
            return;
        };
        entry.users -= 1;
        entry.used = now;
        self.metrics.requests.decrement(1);
        let mut ended = Vec::new();
        if entry.users == 0 {
            if entry.doomed {
                ended.extend(state.remove(id));
            } else {
                let place = state.stand(id);
                if let Some(entry) = state.live.get_mut(&id) {
                    entry.place = place;
                }
            }
        }
        // It may have grown while it was in use.
        ended.extend(state.evict(self.limits.memory, &self.metrics));
        self.count(&state);
        drop(state);
        drop(ended);
    }

    fn weigh(&self, id: Uuid, bytes: usize) {
        let mut state = self.lock();
        if let Some(entry) = state.live.get_mut(&id) {
            let before = std::mem::replace(&mut entry.bytes, bytes);
            state.bytes = state.bytes - before + bytes;
        }
    }

    fn count(&self, state: &State) {
        self.metrics.open.set(state.live.len() as f64);
        self.metrics.bytes.set(state.bytes as f64);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No foreign code runs under the lock, so a poisoned one is still whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn find(&mut self, id: Uuid, now: Instant, idle: Duration) -> Result<&mut Entry, SessionError> {
        if let Some(end) = self.graves.end_of(&id) {
            return Err(SessionError::Ended(end));
        }
        match self.live.get_mut(&id) {
            None => Err(SessionError::Unknown),
            Some(entry) if entry.doomed => Err(SessionError::Ended(End::Deleted)),
            // Its time is over, only nobody has swept yet.
            Some(entry) if entry.users == 0 && is_over(entry.used, now, idle) => {
                Err(SessionError::Ended(End::Idle))
            }
            Some(entry) => Ok(entry),
        }
    }

    fn stand(&mut self, id: Uuid) -> u64 {
        self.places += 1;
        self.line.insert(self.places, id);
        self.places
    }

    fn leased(&self) -> usize {
        let leased = self.live.values().filter(|entry| entry.users > 0);
        leased.map(|entry| entry.bytes).sum()
    }

    fn remove(&mut self, id: Uuid) -> Option<Arc<Session>> {
        let entry = self.live.remove(&id)?;
        self.line.remove(&entry.place);
        self.bytes -= entry.bytes;
        Some(entry.session)
    }

    /// Ends from the front of the line until no more than `most` bytes are left, or nobody in line.
    fn evict(&mut self, most: usize, metrics: &SessionMetrics) -> Vec<Arc<Session>> {
        let mut ended = Vec::new();
        while self.bytes > most {
            let Some((_, &id)) = self.line.first_key_value() else {
                break;
            };
            ended.extend(self.remove(id));
            self.graves.dig(id, End::Evicted);
            metrics.evicted.increment(1);
        }
        ended
    }

    /// Ends from the front of the line those whose time is over; places in line are in order of last use.
    fn expire(
        &mut self,
        now: Instant,
        idle: Duration,
        metrics: &SessionMetrics,
    ) -> Vec<Arc<Session>> {
        let mut ended = Vec::new();
        while let Some((_, &id)) = self.line.first_key_value() {
            if (self.live.get(&id)).is_some_and(|entry| !is_over(entry.used, now, idle)) {
                break;
            }
            ended.extend(self.remove(id));
            self.graves.dig(id, End::Idle);
            metrics.expired.increment(1);
        }
        ended
    }
}

fn is_over(used: Instant, now: Instant, idle: Duration) -> bool {
    now.saturating_duration_since(used) >= idle
}

/// The right to use a session; until it is dropped the session is kept.
pub struct Lease {
    id: Uuid,
    session: Arc<Session>,
    of: Arc<Sessions>,
}

impl Lease {
    /// Waits until it is this lease's turn, first come, first served. No thread waits with it.
    pub async fn turn(self) -> Turn {
        let permit = self.session.turn().await;
        Turn {
            _permit: permit,
            lease: self,
        }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.of.give_back(self.id, Instant::now());
    }
}

/// The turn of a lease; the next one's begins when it is dropped.
pub struct Turn {
    _permit: Option<OwnedSemaphorePermit>,
    lease: Lease,
}

impl Turn {
    /// Works on the session, and weighs it afterwards.
    pub fn work<T>(&self, job: impl FnOnce(&Session) -> T) -> T {
        let session = &self.lease.session;
        let outcome = job(session);
        self.lease.of.weigh(self.lease.id, session.bytes());
        outcome
    }
}

#[cfg(test)]
#[path = "sessions_tests.rs"]
mod tests;
