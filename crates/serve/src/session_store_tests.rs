//! Tests of the sessions. Time is passed in, so nothing waits.

use crate::media_types::GLB;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use proptest::prelude::*;

use super::*;
use crate::client::ClientId;
use crate::client_address::ClientAddress;
use crate::kept_session::OVERHEAD;
use crate::telemetry::Metrics;
use darn_budget::{Budget, Limits};
use darn_contract::port::{MapSpan, Mended, PatchForm, Patches, Refusal};
use darn_contract::{Anchor, Constraints, Outcome, Search, v1};

const IDLE: Duration = Duration::from_secs(60);

/// A session of a given size; counts how many of them are in memory.
struct SizedSession {
    bytes: Arc<AtomicUsize>,
    alive: Arc<AtomicUsize>,
}

impl Drop for SizedSession {
    fn drop(&mut self) {
        self.alive.fetch_sub(1, Relaxed);
    }
}

impl EditSession for SizedSession {
    fn described(&self) -> v1::Session {
        v1::Session::default()
    }

    fn outcome(&self) -> Outcome {
        Outcome::default()
    }

    fn bytes(&self) -> usize {
        self.bytes.load(Relaxed)
    }

    fn patches(&self, _: &Constraints, _: PatchForm, _: &Budget<'_>) -> Result<Patches, Refusal> {
        let report = v1::Report::default();
        let bytes = Vec::new();
        Ok(Patches { bytes, report })
    }

    fn draft(&self, _: &Constraints, _: &Budget<'_>) -> Result<Vec<u8>, Refusal> {
        unreachable!("the store asks for no drafts")
    }

    fn mended(&self, constraints: &Constraints, _: &Budget<'_>) -> Result<Mended, Refusal> {
        let bytes = vec![0; constraints.anchors.len()];
        let report = v1::Report::default();
        Ok(Mended {
            bytes,
            media_type: GLB,
            report,
            file: None,
        })
    }

    fn optimize_anchor(&self, _: &Search, _: &Budget<'_>) -> Result<v1::AnchorFound, Refusal> {
        Ok(v1::AnchorFound::default())
    }

    fn map_piece(&self, _: &Search, _: MapSpan, _: &Budget<'_>) -> Result<v1::MapPiece, Refusal> {
        Ok(v1::MapPiece::default())
    }
}

/// A store, how many of its sessions are in memory, and the time.
struct TestStore {
    sessions: Arc<SessionStore>,
    alive: Arc<AtomicUsize>,
    /// Who opens the next sessions.
    client: Client,
    /// How many each of them may have open.
    most: Option<u64>,
    now: Instant,
}

impl TestStore {
    fn of(memory: usize) -> Self {
        let limits = SessionLimits { idle: IDLE, memory };
        Self {
            sessions: SessionStore::new(limits, Metrics::new().unwrap().sessions()),
            alive: Arc::default(),
            client: None,
            most: None,
            now: Instant::now(),
        }
    }

    /// Opens a session of so many bytes; the counter changes them later.
    fn open(&self, bytes: usize) -> Result<(Uuid, Arc<AtomicUsize>), SessionError> {
        self.alive.fetch_add(1, Relaxed);
        let size = Arc::new(AtomicUsize::new(bytes - OVERHEAD));
        let session = SizedSession {
            bytes: Arc::clone(&size),
            alive: Arc::clone(&self.alive),
        };
        let id = Uuid::new_v4();
        let opener = Opener {
            client: self.client.clone(),
            most: self.most,
        };
        let opened = self
            .sessions
            .insert(id, opener, Box::new(session), self.now);
        opened.map(|()| (id, size))
    }

    fn end_of(&self, id: Uuid) -> Option<EndReason> {
        match self.sessions.check(id, &self.client, self.now) {
            Ok(()) => None,
            Err(SessionError::Ended(reason)) => Some(reason),
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
fn the_least_recently_used_session_is_evicted_first() {
    let store = TestStore::of(30_000);
    let [a, b, c] = [(); 3].map(|()| store.open(10_000).unwrap().0);
    drop(store.sessions.lease(a, &None, store.now).unwrap());
    let d = store.open(10_000).unwrap().0;
    assert_eq!(store.end_of(b), Some(EndReason::Evicted));
    assert_eq!([a, c, d].map(|id| store.end_of(id)), [None; 3]);
    let e = store.open(15_000).unwrap().0;
    assert_eq!(
        [c, a].map(|id| store.end_of(id)),
        [Some(EndReason::Evicted); 2]
    );
    assert_eq!([d, e].map(|id| store.end_of(id)), [None; 2]);
    assert_eq!((store.alive(), store.bytes()), (2, 25_000));
}

#[test]
fn a_leased_session_is_not_freed() {
    let mut store = TestStore::of(20_000);
    let (used, _) = store.open(15_000).unwrap();
    let lease = store.sessions.lease(used, &None, store.now).unwrap();
    let limit = 20_000;
    assert_eq!(store.open(10_000).err(), Some(SessionError::Full { limit }));
    store.now += IDLE * 2;
    store.sessions.end_idle(store.now);
    assert_eq!(store.end_of(used), None);

    store.sessions.delete(used, &None, store.now).unwrap();
    assert_eq!(store.end_of(used), Some(EndReason::Deleted));
    assert_eq!(store.alive(), 1, "the lease still has it");
    drop(lease);
    assert_eq!((store.alive(), store.bytes()), (0, 0));
    assert!(store.open(10_000).is_ok());
}

#[test]
fn a_refused_session_ends_no_other() {
    let store = TestStore::of(20_000);
    let (idle, _) = store.open(5_000).unwrap();
    let (used, _) = store.open(15_000).unwrap();
    let _lease = store.sessions.lease(used, &None, store.now).unwrap();
    assert!(matches!(
        store.open(10_000).err(),
        Some(SessionError::Full { .. })
    ));
    let (bytes, limit) = (20_001, 20_000);
    let refused = store.open(bytes).err();
    assert_eq!(refused, Some(SessionError::TooLarge { bytes, limit }));
    assert_eq!(store.end_of(idle), None);
    assert_eq!(store.alive(), 2);
}

#[test]
fn an_idle_session_ends_and_a_used_one_stays() {
    let mut store = TestStore::of(100_000);
    let (left, _) = store.open(10_000).unwrap();
    store.now += IDLE / 2;
    let (later, _) = store.open(10_000).unwrap();
    store.now += IDLE / 2;
    // Before and after idle sessions are ended.
    assert_eq!(store.end_of(left), Some(EndReason::Idle));
    assert!(store.sessions.lease(left, &None, store.now).is_err());
    assert_eq!(store.alive(), 2);
    store.sessions.end_idle(store.now);
    assert_eq!(store.end_of(left), Some(EndReason::Idle));
    assert_eq!(store.end_of(later), None);
    assert_eq!(store.alive(), 1);
    store.now += IDLE;
    store.sessions.end_idle(store.now);
    assert_eq!((store.alive(), store.bytes()), (0, 0));
}

#[test]
fn an_unknown_id_is_told_from_that_of_an_ended_session() {
    let store = TestStore::of(100_000);
    let unknown = store.sessions.check(Uuid::new_v4(), &None, store.now);
    assert_eq!(unknown, Err(SessionError::Unknown));
    let (id, _) = store.open(10_000).unwrap();
    store.sessions.delete(id, &None, store.now).unwrap();
    let twice = store.sessions.delete(id, &None, store.now);
    assert_eq!(twice, Err(SessionError::Ended(EndReason::Deleted)));
}

#[tokio::test]
async fn a_session_that_grew_evicts_others_when_released() {
    let store = TestStore::of(30_000);
    let (idle, _) = store.open(10_000).unwrap();
    let (grows, size) = store.open(10_000).unwrap();
    let guard = store
        .sessions
        .lease(grows, &None, store.now)
        .unwrap()
        .exclusive()
        .await;
    guard.run(|_| size.store(25_000 - OVERHEAD, Relaxed));
    assert_eq!(store.bytes(), 35_000);
    drop(guard);
    assert_eq!(store.end_of(idle), Some(EndReason::Evicted));
    assert_eq!((store.alive(), store.bytes()), (1, 25_000));
}

#[tokio::test]
async fn exclusive_use_comes_in_order_and_waiting_requests_are_bounded() {
    let store = TestStore::of(100_000);
    let (id, _) = store.open(10_000).unwrap();
    let first = store
        .sessions
        .lease(id, &None, store.now)
        .unwrap()
        .exclusive()
        .await;
    let order = Arc::new(Mutex::new(Vec::new()));
    let mut waiting = Vec::new();
    for i in 1..MAX_LEASES {
        let lease = store.sessions.lease(id, &None, store.now).unwrap();
        let order = Arc::clone(&order);
        waiting.push(tokio::spawn(async move {
            let guard = lease.exclusive().await;
            guard.run(|_| order.lock().unwrap().push(i));
        }));
        tokio::task::yield_now().await;
    }
    let limit = MAX_LEASES;
    let more = store.sessions.lease(id, &None, store.now).err();
    assert_eq!(more, Some(SessionError::Busy { limit }));
    assert!(order.lock().unwrap().is_empty());
    // A request that is dropped no longer waits.
    waiting.remove(0).abort();
    drop(first);
    for task in waiting {
        task.await.unwrap();
    }
    assert_eq!(*order.lock().unwrap(), [2, 3]);
    assert!(store.sessions.lease(id, &None, store.now).is_ok());
}

#[test]
fn the_result_has_the_constraints_of_the_last_successful_edit() {
    let session = KeptSession::new(Box::new(SizedSession {
        bytes: Arc::default(),
        alive: Arc::new(AtomicUsize::new(1)),
    }));
    let anchor = Anchor {
        hole: None,
        uv: None,
        position: [0.0; 3],
        hard: false,
    };
    let size = || session.result(Budget::unlimited()).unwrap().bytes.len();
    assert_eq!(size(), 0);
    let constraints = Constraints {
        anchors: vec![anchor; 3],
        ..Constraints::default()
    };
    // The answer of a cancelled call reaches nobody, so its constraints are not remembered.
    session
        .patches(
            &constraints,
            PatchForm::Glb,
            &Budget::new(Limits::default(), &|| true),
        )
        .unwrap();
    assert_eq!(size(), 0);
    session
        .patches(&constraints, PatchForm::Glb, Budget::unlimited())
        .unwrap();
    assert_eq!(size(), 3);
    assert!(session.bytes() > 3 * size_of::<Anchor>());
}

#[derive(Debug, Clone)]
enum Step {
    Open(usize),
    Lease(usize),
    Release(usize),
    Delete(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (2_000..20_000_usize).prop_map(Step::Open),
        3 => (0..64_usize).prop_map(Step::Lease),
        3 => (0..64_usize).prop_map(Step::Release),
        1 => (0..64_usize).prop_map(Step::Delete),
        1 => (0..70_u64).prop_map(Step::Wait),
    ]
}

proptest! {
    /// After any sequence of steps: memory stays below its limit, the byte count is that of the live sessions, leased ones live.
    #[test]
    fn counts_match_the_live_sessions_after_any_steps(steps in prop::collection::vec(step(), 0..120)) {
        let mut store = TestStore::of(50_000);
        let (mut ids, mut leases) = (Vec::new(), Vec::new());
        for step in steps {
            match step {
                Step::Open(bytes) => ids.extend(store.open(bytes).ok().map(|(id, _)| id)),
                Step::Lease(i) if !ids.is_empty() => {
                    leases.extend(store.sessions.lease(ids[i % ids.len()], &None, store.now).ok());
                }
                Step::Release(i) if !leases.is_empty() => drop(leases.swap_remove(i % leases.len())),
                Step::Delete(i) if !ids.is_empty() => {
                    store.sessions.delete(ids[i % ids.len()], &None, store.now).ok();
                }
                Step::Wait(seconds) => {
                    store.now += Duration::from_secs(seconds);
                    store.sessions.end_idle(store.now);
                }
                _ => {}
            }
            let state = store.sessions.lock();
            prop_assert!(state.bytes <= 50_000);
            prop_assert_eq!(state.bytes, state.live.values().map(|entry| entry.bytes).sum::<usize>());
            prop_assert_eq!(state.live.len(), store.alive());
            prop_assert_eq!(state.unleased.len(), state.live.values().filter(|entry| entry.leases == 0).count());
            for lease in &leases {
                prop_assert!(state.live.contains_key(&lease.id));
            }
        }
        drop(leases);
        store.now += IDLE + Duration::from_secs(1);
        // Leases set the time of last use from the real clock.
        store.sessions.end_idle(store.now.max(Instant::now() + IDLE));
        prop_assert_eq!((store.alive(), store.bytes()), (0, 0));
    }
}

#[test]
fn a_client_with_many_sessions_ends_its_own_first() {
    let mut store = TestStore::of(100_000);
    let client = |n: u8| {
        let address = std::net::Ipv4Addr::new(192, 0, 2, n).into();
        Some(ClientId::Address(ClientAddress::of(address)))
    };
    store.client = client(1);
    let (quiet, _) = store.open(10_000).unwrap();
    store.client = client(2);
    let many: Vec<Uuid> = (0..700).map(|_| store.open(2000).unwrap().0).collect();
    assert_eq!(store.end_of(quiet), None);
    assert_eq!(store.end_of(many[0]), Some(EndReason::Evicted));
    assert_eq!(store.end_of(many[699]), None);
    assert!(store.bytes() <= 100_000);
}

#[test]
fn a_session_of_a_key_is_there_for_that_key_alone() {
    let key = |id: &str| Some(ClientId::Key(id.parse().unwrap()));
    let mut store = TestStore::of(10_000);
    store.client = key("a");
    let ids = [(); 3].map(|()| store.open(2000).unwrap().0);
    store.sessions.delete(ids[1], &key("a"), store.now).unwrap();
    let lease = store.sessions.lease(ids[2], &key("a"), store.now).unwrap();
    store.sessions.delete(ids[2], &key("a"), store.now).unwrap();
    for other in [key("b"), None] {
        // One that is open, one that has ended, and one that ends after its last lease.
        for id in ids {
            let unknown = Err(SessionError::Unknown);
            assert_eq!(store.sessions.check(id, &other, store.now), unknown);
            assert!(store.sessions.lease(id, &other, store.now).is_err());
            assert_eq!(store.sessions.delete(id, &other, store.now), unknown);
        }
    }
    let ended = Some(EndReason::Deleted);
    assert_eq!(ids.map(|id| store.end_of(id)), [None, ended, ended]);
    drop(lease);
}

#[test]
fn a_client_has_as_many_sessions_open_as_it_may() {
    let key = |id: &str| Some(ClientId::Key(id.parse().unwrap()));
    let mut store = TestStore::of(100_000);
    store.most = Some(2);
    for client in [key("a"), key("b")] {
        store.client = client.clone();
        let (first, _) = store.open(2000).unwrap();
        store.open(2000).unwrap();
        let refused = store.open(2000).map(drop);
        assert_eq!(refused, Err(SessionError::Quota(Exceeded::sessions(2))));
        store.sessions.delete(first, &client, store.now).unwrap();
        store.open(2000).unwrap();
    }
    // Those that are idle for too long count no more.
    store.now += 2 * IDLE;
    store.open(2000).unwrap();
    assert_eq!(store.alive(), 1);
}
