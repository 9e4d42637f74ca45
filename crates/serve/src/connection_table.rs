//! The open connections: how many there may be, and which gives way to a new one.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tokio_util::sync::CancellationToken;

use super::{client_address::ClientAddress, pace::PaceLimits};

/// Limits of the connections.
#[derive(Debug, Clone, Copy)]
pub struct ConnectionLimits {
    /// Most connections.
    pub in_all: usize,
    /// Most connections of one address; 0 for any number.
    pub per_address: usize,
    /// How slowly bodies may move.
    pub pace: PaceLimits,
}

/// The open connections of all listeners.
#[derive(Debug)]
pub struct ConnectionTable {
    /// Their limits.
    pub limits: ConnectionLimits,
    open: Mutex<Open>,
}

#[derive(Debug, Default)]
struct Open {
    next_id: u64,
    connections: HashMap<u64, Entry>,
    per_address: HashMap<IpAddr, usize>,
}

#[derive(Debug)]
struct Entry {
    client: ClientAddress,
    activity: Arc<Activity>,
    close: CancellationToken,
}

impl ConnectionTable {
    /// A table without connections.
    pub fn new(limits: ConnectionLimits) -> Arc<Self> {
        Arc::new(Self {
            limits,
            open: Mutex::default(),
        })
    }

    /// Takes in a new connection. When there are too many, of its address or in all, the one among them whose peer has been silent for
    /// longest is closed for it; `None` when all of them wait for the service, so that the new one must be closed. Who stalls thus gives
    /// way to who speaks, and newcomers get in.
    pub(crate) fn admit(self: &Arc<Self>, client: ClientAddress) -> Option<Admission> {
        let mut open = self.lock();
        let of_client = open.per_address.get(&client.0).copied().unwrap_or(0);
        if (1..=of_client).contains(&self.limits.per_address) {
            open.close_most_silent(Some(client))?;
        } else if open.connections.len() >= self.limits.in_all {
            open.close_most_silent(None)?;
        }
        let id = open.next_id;
        open.next_id += 1;
        let activity = Arc::<Activity>::default();
        let close = CancellationToken::new();
        let entry = Entry {
            client,
            activity: Arc::clone(&activity),
            close: close.clone(),
        };
        open.connections.insert(id, entry);
        *open.per_address.entry(client.0).or_default() += 1;
        drop(open);
        let table = Arc::clone(self);
        Some(Admission {
            id,
            activity,
            close,
            table,
        })
    }

    fn lock(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    /// Closes the connection whose peer has been silent for longest.
    fn close_most_silent(&mut self, of: Option<ClientAddress>) -> Option<()> {
        let now = Instant::now();
        let of_client = |entry: &Entry| of.is_none_or(|client| client == entry.client);
        let silences = (self.connections.iter())
            .filter(|(_, entry)| of_client(entry))
            .filter_map(|(id, entry)| Some((entry.activity.silence(now)?, *id)));
        let (_, id) = silences.max()?;
        self.remove(id);
        Some(())
    }

    /// Forgets a connection, and tells it to close.
    fn remove(&mut self, id: u64) {
        let Some(entry) = self.connections.remove(&id) else {
            return;
        };
        entry.close.cancel();
        if let Some(count) = self.per_address.get_mut(&entry.client.0) {
            *count -= 1;
            if *count == 0 {
                self.per_address.remove(&entry.client.0);
            }
        }
    }
}

/// A connection's place in the table; given back when dropped.
#[derive(Debug)]
pub struct Admission {
    id: u64,
    /// What its peer does.
    pub activity: Arc<Activity>,
    /// Cancelled when the connection must give way.
    pub close: CancellationToken,
    table: Arc<ConnectionTable>,
}

impl Drop for Admission {
    fn drop(&mut self) {
        self.table.lock().remove(self.id);
    }
}

/// When a connection's peer last sent or took a byte, and whether it waits for the service.
#[derive(Debug)]
pub struct Activity {
    opened: Instant,
    /// Milliseconds from `opened` to the last byte.
    last: AtomicU64,
    /// Requests that have come completely and are not answered yet.
    working: AtomicUsize,
}

impl Default for Activity {
    fn default() -> Self {
        Self {
            opened: Instant::now(),
            last: AtomicU64::new(0),
            working: AtomicUsize::new(0),
        }
    }
}

impl Activity {
    /// A byte came or went.
    pub fn touch(&self) {
        let since = self.opened.elapsed().as_millis();
        (self.last).store(u64::try_from(since).unwrap_or(u64::MAX), Relaxed);
    }

    /// How long the peer has been silent; `None` while it waits for the service.
    fn silence(&self, now: Instant) -> Option<Duration> {
        if self.working.load(Relaxed) > 0 {
            return None;
        }
        let last = self.opened + Duration::from_millis(self.last.load(Relaxed));
        Some(now.saturating_duration_since(last))
    }
}

/// Whose turn it is in one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    /// The peer sends its body.
    Peer,
    /// The service works on it.
    Service,
    /// It is answered or given up.
    Over,
}

/// A request on a connection, so that the connection does not count as silent while the service works.
#[derive(Debug)]
pub struct RequestTurn {
    activity: Arc<Activity>,
    turn: Mutex<Turn>,
}

impl RequestTurn {
    /// A request whose body has not come.
    pub fn new(activity: &Arc<Activity>) -> Arc<Self> {
        Arc::new(Self {
            activity: Arc::clone(activity),
            turn: Mutex::new(Turn::Peer),
        })
    }

    /// Its body has come.
    pub fn received(&self) {
        let mut turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        if *turn == Turn::Peer {
            *turn = Turn::Service;
            self.activity.working.fetch_add(1, Relaxed);
        }
    }

    /// It is answered, or given up.
    fn end(&self) {
        let mut turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        if *turn == Turn::Service {
            self.activity.touch();
            self.activity.working.fetch_sub(1, Relaxed);
        }
        *turn = Turn::Over;
    }

    /// Ends the turn when dropped.
    pub fn guard(self: &Arc<Self>) -> TurnGuard {
        TurnGuard(Arc::clone(self))
    }
}

/// Ends a request's turn when dropped.
#[derive(Debug)]
pub struct TurnGuard(Arc<RequestTurn>);

impl Drop for TurnGuard {
    fn drop(&mut self) {
        self.0.end();
    }
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;

    use super::*;

    /// More than the clock's grain.
    const SILENCE: Duration = Duration::from_millis(20);

    fn table(in_all: usize, per_address: usize) -> Arc<ConnectionTable> {
        ConnectionTable::new(ConnectionLimits {
            in_all,
            per_address,
            pace: PaceLimits {
                pause: Duration::from_secs(15),
                rate: 0,
            },
        })
    }

    fn client(last: u8) -> ClientAddress {
        ClientAddress::of([192, 0, 2, last].into())
    }

    #[test]
    fn the_most_silent_connection_of_the_address_gives_way() {
        let table = table(9, 2);
        let other = table.admit(client(2)).unwrap();
        let first = table.admit(client(1)).unwrap();
        let second = table.admit(client(1)).unwrap();
        sleep(SILENCE);
        first.activity.touch();
        let third = table.admit(client(1)).unwrap();
        assert!(second.close.is_cancelled());
        assert!(![&first, &third, &other].map(|it| it.close.is_cancelled())[..].contains(&true));
        // Its place was taken over, so this gives back none.
        drop(second);
        sleep(SILENCE);
        third.activity.touch();
        let _fourth = table.admit(client(1)).unwrap();
        assert!(first.close.is_cancelled());
        assert_eq!(table.lock().connections.len(), 3);
    }

    #[test]
    fn a_connection_that_waits_for_the_service_does_not_give_way() {
        let table = table(1, 0);
        let working = table.admit(client(1)).unwrap();
        let turn = RequestTurn::new(&working.activity);
        let guard = turn.guard();
        turn.received();
        sleep(SILENCE);
        assert!(table.admit(client(2)).is_none());
        drop(guard);
        turn.received();
        assert!(table.admit(client(2)).is_some());
        assert!(working.close.is_cancelled());
    }

    #[test]
    fn an_address_without_connections_is_forgotten() {
        let table = table(9, 2);
        drop(table.admit(client(1)));
        assert!(table.lock().per_address.is_empty());
        assert!(table.lock().connections.is_empty());
    }
}
