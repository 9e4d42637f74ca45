//! How sessions ended, remembered for a bounded number of them, so that an ended session is told from an unknown id.

use std::{
    collections::{HashMap, VecDeque},
    fmt,
};

use uuid::Uuid;

/// Most ended sessions remembered; about 4 MB.
const MAX_REMEMBERED: usize = 1 << 16;

/// Why a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// It received no request for too long.
    Idle,
    /// Its memory was needed for others.
    Evicted,
    /// Its owner deleted it.
    Deleted,
}

impl fmt::Display for EndReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Idle => "no request came to this session for too long (DARN_SESSION_IDLE)",
            Self::Evicted => "this session's memory was needed for others (DARN_SESSION_MEMORY)",
            Self::Deleted => "this session was deleted",
        })
    }
}

/// The sessions that ended last.
#[derive(Debug, Default)]
pub struct EndedSessions {
    reasons: HashMap<Uuid, EndReason>,
    /// Oldest first.
    order: VecDeque<Uuid>,
}

impl EndedSessions {
    /// Remembers an end, and forgets the oldest one when there are too many.
    pub fn record(&mut self, id: Uuid, reason: EndReason) {
        if self.reasons.insert(id, reason).is_some() {
            return;
        }
        self.order.push_back(id);
        if self.order.len() > MAX_REMEMBERED
            && let Some(oldest) = self.order.pop_front()
        {
            self.reasons.remove(&oldest);
        }
    }

    /// Why a session ended, if that is remembered.
    pub fn reason(&self, id: &Uuid) -> Option<EndReason> {
        self.reasons.get(id).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_forgotten_first() {
        let mut ended = EndedSessions::default();
        let ids: Vec<Uuid> = (0..MAX_REMEMBERED as u128 + 2)
            .map(Uuid::from_u128)
            .collect();
        for id in &ids {
            ended.record(*id, EndReason::Idle);
        }
        assert_eq!(ended.reason(&ids[0]), None);
        assert_eq!(ended.reason(&ids[1]), None);
        assert_eq!(ended.reason(&ids[2]), Some(EndReason::Idle));
        assert_eq!(ended.order.len(), MAX_REMEMBERED);
        assert_eq!(ended.reasons.len(), MAX_REMEMBERED);
    }
}
