//! Laws of the sessions; time is counted, not waited for.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use proptest::prelude::*;

use super::*;
use crate::session::OVERHEAD;
use darn_contract::port::{Cancellation, Mended, PatchForm, Patches, Refusal};
use darn_contract::{Anchor, Constraints, Search, v1};

const IDLE: Duration = Duration::from_secs(60);

/// Takes a size, and counts how many of its kind are in memory.
struct Scan {
    bytes: Arc<AtomicUsize>,
    alive: Arc<AtomicUsize>,
}

impl Drop for Scan {
    fn drop(&mut self) {
        self.alive.fetch_sub(1, Relaxed);
    }
}

impl EditSession for Scan {
    fn described(&self) -> v1::Session {
        v1::Session::default()
    }

    fn bytes(&self) -> usize {
        self.bytes.load(Relaxed)
    }

    fn patches(
        &self,
        _: &Constraints,
        _: PatchForm,
        _: Cancellation<'_>,
    ) -> Result<Patches, Refusal> {
        let report = v1::Report::default();
        let bytes = Vec::new();
        Ok(Patches { bytes, report })
    }

    fn mended(&self, asked: &Constraints, _: Cancellation<'_>) -> Result<Mended, Refusal> {
        let bytes = vec![0; asked.anchors.len()];
        let report = v1::Report::default();
        Ok(Mended { bytes, report })
    }

    fn optimize_anchor(&self, _: &Search, _: Cancellation<'_>) -> Result<v1::AnchorFound, Refusal> {
        Ok(v1::AnchorFound::default())
    }
}

/// Sessions, and how many scans are in memory.
struct House {
    sessions: Arc<Sessions>,
    alive: Arc<AtomicUsize>,
    now: Instant,
}

impl House {
    fn of(memory: usize) -> Self {
        let limits = SessionLimits { idle: IDLE, memory };
        Self {
            sessions: Sessions::new(limits, SessionMetrics::unwatched()),
            alive: Arc::default(),
            now: Instant::now(),
        }
    }

    /// Opens a session of so many bytes; the handle changes them.
    fn open(&self, bytes: usize) -> Result<(Uuid, Arc<AtomicUsize>), SessionError> {
        self.alive.fetch_add(1, Relaxed);
        let size = Arc::new(AtomicUsize::new(bytes - OVERHEAD));
        let scan = Scan {
            bytes: Arc::clone(&size),
            alive: Arc::clone(&self.alive),
        };
        let id = Uuid::new_v4();
        let opened = self.sessions.open(id, Box::new(scan), self.now);
        opened.map(|()| (id, size))
    }

    fn end_of(&self, id: Uuid) -> Option<End> {
        match self.sessions.find(id, self.now) {
            Ok(()) => None,
            Err(SessionError::Ended(end)) => Some(end),
            Err(error) => panic!("{error}"),
        }
    }

    fn bytes(&self) -> usize {
        self.sessions.lock().bytes
    }

    fn alive(&self) -> usize {
        self.alive.load(Relaxed)
    }
}

#[test]
fn the_least_recently_used_goes_first() {
    let house = House::of(30_000);
    let [a, b, c] = [(); 3].map(|()| house.open(10_000).unwrap().0);
    drop(house.sessions.lease(a, house.now).unwrap());
    let d = house.open(10_000).unwrap().0;
    assert_eq!(house.end_of(b), Some(End::Evicted));
    assert_eq!([a, c, d].map(|id| house.end_of(id)), [None; 3]);
    let e = house.open(15_000).unwrap().0;
    assert_eq!([c, a].map(|id| house.end_of(id)), [Some(End::Evicted); 2]);
    assert_eq!([d, e].map(|id| house.end_of(id)), [None; 2]);
    assert_eq!((house.alive(), house.bytes()), (2, 25_000));
}

#[test]
fn what_is_in_use_is_not_ended_under_its_user() {
    let mut house = House::of(20_000);
    let (used, _) = house.open(15_000).unwrap();
    let lease = house.sessions.lease(used, house.now).unwrap();
    let limit = 20_000;
    assert_eq!(house.open(10_000).err(), Some(SessionError::Full { limit }));
    house.now += IDLE * 2;
    house.sessions.sweep(house.now);
    assert_eq!(house.end_of(used), None);

    house.sessions.delete(used, house.now).unwrap();
    assert_eq!(house.end_of(used), Some(End::Deleted));
    assert_eq!(house.alive(), 1, "the job still has it");
    drop(lease);
    assert_eq!((house.alive(), house.bytes()), (0, 0));
    assert!(house.open(10_000).is_ok());
}

#[test]
fn a_refusal_ends_nobody_else() {
    let house = House::of(20_000);
    let (idle, _) = house.open(5_000).unwrap();
    let (used, _) = house.open(15_000).unwrap();
    let _lease = house.sessions.lease(used, house.now).unwrap();
    assert!(matches!(
        house.open(10_000).err(),
        Some(SessionError::Full { .. })
    ));
    let (bytes, limit) = (20_001, 20_000);
    let refused = house.open(bytes).err();
    assert_eq!(refused, Some(SessionError::TooLarge { bytes, limit }));
    assert_eq!(house.end_of(idle), None);
    assert_eq!(house.alive(), 2);
}

#[test]
fn idleness_ends_a_session_and_use_keeps_it() {
    let mut house = House::of(100_000);
    let (left, _) = house.open(10_000).unwrap();
    house.now += IDLE / 2;
    let (later, _) = house.open(10_000).unwrap();
    house.now += IDLE / 2;
    // Before anybody has swept, and after.
    assert_eq!(house.end_of(left), Some(End::Idle));
    assert!(house.sessions.lease(left, house.now).is_err());
    assert_eq!(house.alive(), 2);
    house.sessions.sweep(house.now);
    assert_eq!(house.end_of(left), Some(End::Idle));
    assert_eq!(house.end_of(later), None);
    assert_eq!(house.alive(), 1);
    house.now += IDLE;
    house.sessions.sweep(house.now);
    assert_eq!((house.alive(), house.bytes()), (0, 0));
}

#[test]
fn an_id_never_given_is_told_from_one_that_is_gone() {
    let house = House::of(100_000);
    let unknown = house.sessions.find(Uuid::new_v4(), house.now);
    assert_eq!(unknown, Err(SessionError::Unknown));
    let (id, _) = house.open(10_000).unwrap();
    house.sessions.delete(id, house.now).unwrap();
    let twice = house.sessions.delete(id, house.now);
    assert_eq!(twice, Err(SessionError::Ended(End::Deleted)));
}

#[tokio::test]
async fn what_grows_in_use_makes_room_when_it_is_given_back() {
    let house = House::of(30_000);
    let (idle, _) = house.open(10_000).unwrap();
    let (grows, size) = house.open(10_000).unwrap();
    let turn = house.sessions.lease(grows, house.now).unwrap().turn().await;
    turn.work(|_| size.store(25_000 - OVERHEAD, Relaxed));
    assert_eq!(house.bytes(), 35_000);
    drop(turn);
    assert_eq!(house.end_of(idle), Some(End::Evicted));
    assert_eq!((house.alive(), house.bytes()), (1, 25_000));
}

#[tokio::test]
async fn turns_come_in_order_and_no_more_wait_than_may() {
    let house = House::of(100_000);
    let (id, _) = house.open(10_000).unwrap();
    let first = house.sessions.lease(id, house.now).unwrap().turn().await;
    let order = Arc::new(Mutex::new(Vec::new()));
    let mut waiting = Vec::new();
    for i in 1..MOST_USERS {
        let lease = house.sessions.lease(id, house.now).unwrap();
        let order = Arc::clone(&order);
        waiting.push(tokio::spawn(async move {
            let turn = lease.turn().await;
            turn.work(|_| order.lock().unwrap().push(i));
        }));
        tokio::task::yield_now().await;
    }
    let limit = MOST_USERS;
    let more = house.sessions.lease(id, house.now).err();
    assert_eq!(more, Some(SessionError::Busy { limit }));
    assert!(order.lock().unwrap().is_empty());
    // One that leaves gives up its turn.
    waiting.remove(0).abort();
    drop(first);
    for task in waiting {
        task.await.unwrap();
    }
    assert_eq!(*order.lock().unwrap(), [2, 3]);
    assert!(house.sessions.lease(id, house.now).is_ok());
}

#[test]
fn the_result_is_that_of_the_constraints_last_met() {
    let session = Session::new(Box::new(Scan {
        bytes: Arc::default(),
        alive: Arc::new(AtomicUsize::new(1)),
    }));
    let anchor = Anchor {
        hole: None,
        uv: None,
        position: [0.0; 3],
        hard: false,
    };
    let size = || session.result(Cancellation::NEVER).unwrap().bytes.len();
    assert_eq!(size(), 0);
    let asked = Constraints {
        anchors: vec![anchor; 3],
        ..Constraints::default()
    };
    // Of what nobody waited for, nobody knows.
    session
        .patches(&asked, PatchForm::Glb, Cancellation::new(&|| true))
        .unwrap();
    assert_eq!(size(), 0);
    session
        .patches(&asked, PatchForm::Glb, Cancellation::NEVER)
        .unwrap();
    assert_eq!(size(), 3);
    assert!(session.bytes() > 3 * size_of::<Anchor>());
}

#[derive(Debug, Clone)]
enum Step {
    Open(usize),
    Lease(usize),
    GiveBack(usize),
    Delete(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (2_000..20_000_usize).prop_map(Step::Open),
        3 => (0..64_usize).prop_map(Step::Lease),
        3 => (0..64_usize).prop_map(Step::GiveBack),
        1 => (0..64_usize).prop_map(Step::Delete),
        1 => (0..70_u64).prop_map(Step::Wait),
    ]
}

proptest! {
    /// Whatever happens: memory stays under its cap, the count of bytes is that of what is in memory, a leased session stays.
    #[test]
    fn the_books_are_right(steps in prop::collection::vec(step(), 0..120)) {
        let mut house = House::of(50_000);
        let (mut ids, mut leases) = (Vec::new(), Vec::new());
        for step in steps {
            match step {
                Step::Open(bytes) => ids.extend(house.open(bytes).ok().map(|(id, _)| id)),
                Step::Lease(i) if !ids.is_empty() => {
                    leases.extend(house.sessions.lease(ids[i % ids.len()], house.now).ok());
                }
                Step::GiveBack(i) if !leases.is_empty() => drop(leases.swap_remove(i % leases.len())),
                Step::Delete(i) if !ids.is_empty() => {
                    house.sessions.delete(ids[i % ids.len()], house.now).ok();
                }
                Step::Wait(seconds) => {
                    house.now += Duration::from_secs(seconds);
                    house.sessions.sweep(house.now);
                }
                _ => {}
            }
            let state = house.sessions.lock();
            prop_assert!(state.bytes <= 50_000);
            prop_assert_eq!(state.bytes, state.live.values().map(|entry| entry.bytes).sum::<usize>());
            prop_assert_eq!(state.live.len(), house.alive());
            prop_assert_eq!(state.line.len(), state.live.values().filter(|entry| entry.users == 0).count());
            for lease in &leases {
                prop_assert!(state.live.contains_key(&lease.id));
            }
        }
        drop(leases);
        house.now += IDLE + Duration::from_secs(1);
        // What was given back just now, was so by the clock.
        house.sessions.sweep(house.now.max(Instant::now() + IDLE));
        prop_assert_eq!((house.alive(), house.bytes()), (0, 0));
    }
}
