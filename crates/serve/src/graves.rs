//! How sessions ended, remembered for a bounded number of them, so that "never was" and "is gone" can be told apart.

use std::{
    collections::{HashMap, VecDeque},
    fmt,
};

use uuid::Uuid;

/// Ended sessions remembered; about 4 MB.
const MOST: usize = 1 << 16;

/// Why a session is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// No request came for too long.
    Idle,
    /// Its memory was needed.
    Evicted,
    /// Its owner ended it.
    Deleted,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Idle => "no request came to this session for too long (DARN_SESSION_IDLE)",
            Self::Evicted => "this session's memory was needed for others (DARN_SESSION_MEMORY)",
            Self::Deleted => "this session was deleted",
        })
    }
}

/// The ended sessions, the latest ones only.
#[derive(Debug, Default)]
pub struct Graves {
    ends: HashMap<Uuid, End>,
    order: VecDeque<Uuid>,
}

impl Graves {
    /// Remembers an end; forgets the oldest when there are too many.
    pub fn dig(&mut self, id: Uuid, end: End) {
        if self.ends.insert(id, end).is_some() {
            return;
        }
        self.order.push_back(id);
        if self.order.len() > MOST
            && let Some(oldest) = self.order.pop_front()
        {
            self.ends.remove(&oldest);
        }
    }

    /// How a session ended, if it is remembered.
    pub fn end_of(&self, id: &Uuid) -> Option<End> {
        self.ends.get(id).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_forgotten_first() {
        let mut graves = Graves::default();
        let ids: Vec<Uuid> = (0..MOST as u128 + 2).map(Uuid::from_u128).collect();
        for id in &ids {
            graves.dig(*id, End::Idle);
        }
        assert_eq!(graves.end_of(&ids[0]), None);
        assert_eq!(graves.end_of(&ids[1]), None);
        assert_eq!(graves.end_of(&ids[2]), Some(End::Idle));
        assert_eq!(graves.order.len(), MOST);
        assert_eq!(graves.ends.len(), MOST);
    }
}
