//! How sessions ended, remembered for a bounded number of them, so that an ended session is told from an unknown id.

use std::{
    collections::{HashMap, VecDeque},
    fmt,
};

use uuid::Uuid;

use super::client::Client;

/// Most ended sessions remembered; about 4 MB.
const MAX_REMEMBERED: usize = 1 << 16;

/// Why a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// It received no request for too long.
    Idle,
    /// Its memory was needed for others.
    Evicted,
    /// Its client deleted it.
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

/// The end of a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct End {
    /// Why it ended.
    pub reason: EndReason,
    /// Who had opened it.
    pub client: Client,
}

/// The sessions that ended last.
#[derive(Debug, Default)]
pub struct EndedSessions {
    ends: HashMap<Uuid, End>,
    /// Oldest first.
    order: VecDeque<Uuid>,
}

impl EndedSessions {
    /// Remembers an end, and forgets the oldest one when there are too many.
    pub fn record(&mut self, id: Uuid, end: End) {
        if self.ends.insert(id, end).is_some() {
            return;
        }
        self.order.push_back(id);
        if self.order.len() > MAX_REMEMBERED
            && let Some(oldest) = self.order.pop_front()
        {
            self.ends.remove(&oldest);
        }
    }

    /// How a session ended, if that is remembered.
    pub fn end(&self, id: &Uuid) -> Option<&End> {
        self.ends.get(id)
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
        let end = End {
            reason: EndReason::Idle,
            client: None,
        };
        for id in &ids {
            ended.record(*id, end.clone());
        }
        assert_eq!(ended.end(&ids[0]), None);
        assert_eq!(ended.end(&ids[1]), None);
        assert_eq!(ended.end(&ids[2]), Some(&end));
        assert_eq!(ended.order.len(), MAX_REMEMBERED);
        assert_eq!(ended.ends.len(), MAX_REMEMBERED);
    }
}
