//! A fake mender whose behaviour tests set: in the scan itself, or per edit of a session.

mod session;

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
    time::Duration,
};

use axum::body::Bytes;
use darn_budget::Budget;
use darn_contract::port::{
    EditSession, HolesQuery, MapSpan, Mended, Mender, PatchForm, Patches, Refusal, ScanForm,
    Stripped,
};
use darn_contract::{Anchor, Code, Constraints, FieldError, Outcome, Search, codes, v1};
use serde_json::{Value, json};

use session::FakeSession;

/// What the mender does with a scan or an edit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Behaviour {
    /// Succeeds at once.
    Mend,
    /// Succeeds after some milliseconds.
    TakeTime,
    /// Succeeds once [`FakeMender::release`] is called.
    Hold,
    /// Goes on until its budget says that it is cancelled.
    UntilCancelled,
    Panic,
    RefuseTruncated,
    RefuseHuge,
    RefuseNotADisk,
    RefuseUnknownHole,
    /// An internal refusal whose details no caller may see.
    FailInternally,
}

impl Behaviour {
    const ALL: [Behaviour; 10] = [
        Behaviour::Mend,
        Behaviour::TakeTime,
        Behaviour::Hold,
        Behaviour::UntilCancelled,
        Behaviour::Panic,
        Behaviour::RefuseTruncated,
        Behaviour::RefuseHuge,
        Behaviour::RefuseNotADisk,
        Behaviour::RefuseUnknownHole,
        Behaviour::FailInternally,
    ];

    fn word(self) -> String {
        format!("{self:?}")
    }

    /// The refusals of a mender with codes of its own.
    fn refusal(self) -> Option<Refusal> {
        let code = |word, like: Code| Code { word, ..like };
        let refusal = match self {
            Self::Mend | Self::TakeTime | Self::Hold | Self::UntilCancelled | Self::Panic => {
                return None;
            }
            Self::RefuseTruncated => Refusal::new(
                code("truncated", codes::NOT_A_GLTF),
                "chunk 1 ends at byte 90 of 80",
            ),
            Self::RefuseHuge => Refusal::new(
                code("too_many_faces", codes::SCAN_TOO_LARGE),
                "5000001 triangles; the limit is 4000000",
            ),
            Self::RefuseNotADisk => Refusal {
                outcome: Some(Outcome {
                    skipped: 1,
                    ..Outcome::default()
                }),
                ..Refusal::new(codes::NOT_A_DISK, "region around loop 3 has 1 handle")
            },
            Self::RefuseUnknownHole => Refusal {
                code: code("unknown_hole", codes::CONSTRAINTS_DO_NOT_FIT),
                detail: "the scan has no such hole".to_owned(),
                fields: vec![FieldError::new(
                    "/holes/0/id",
                    "there is no loop 9; loops are 0 to 3",
                )],
                outcome: None,
            },
            Self::FailInternally => Refusal::new(codes::INTERNAL, "/srv/secret/weights is gone"),
        };
        Some(refusal)
    }
}

/// A scan: its bytes are JSON that says how the mender behaves.
#[derive(Debug, Clone)]
pub struct FakeScan {
    name: String,
    behaviour: Behaviour,
    /// Bytes that a session of it takes.
    kept_bytes: usize,
}

impl FakeScan {
    /// A scan that is mended at once.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            behaviour: Behaviour::Mend,
            kept_bytes: 10_000,
        }
    }

    /// A scan that is held until [`FakeMender::release`].
    pub fn holding(name: &str) -> Self {
        Self {
            behaviour: Behaviour::Hold,
            ..Self::named(name)
        }
    }

    /// The same scan, whose session takes so many bytes.
    pub fn keeping(self, kept_bytes: usize) -> Self {
        Self { kept_bytes, ..self }
    }

    /// The scan as it is sent.
    pub fn bytes(&self) -> Vec<u8> {
        let behaviour = self.behaviour.word();
        let scan =
            json!({ "name": self.name, "behaviour": behaviour, "keptBytes": self.kept_bytes });
        scan.to_string().into_bytes()
    }

    /// The scan as it is answered.
    pub fn mended(&self) -> Vec<u8> {
        mended(&self.bytes())
    }

    /// Reads a scan; bytes that are none are mended at once.
    fn read(bytes: &[u8]) -> Self {
        let scan: Value = serde_json::from_slice(bytes).unwrap_or_default();
        let behaviour = Behaviour::ALL
            .into_iter()
            .find(|behaviour| scan["behaviour"] == behaviour.word());
        let plain = Self::named(scan["name"].as_str().unwrap_or_default());
        Self {
            behaviour: behaviour.unwrap_or(plain.behaviour),
            kept_bytes: (scan["keptBytes"].as_u64()).map_or(plain.kept_bytes, |n| n as usize),
            ..plain
        }
    }
}

impl From<&str> for FakeScan {
    fn from(name: &str) -> Self {
        Self::named(name)
    }
}

impl From<Behaviour> for FakeScan {
    fn from(behaviour: Behaviour) -> Self {
        Self {
            behaviour,
            ..Self::named("scan")
        }
    }
}

/// What a mend puts in front of a scan.
const MENDED: &[u8] = b"glTF ";

fn mended(scan: &[u8]) -> Vec<u8> {
    [MENDED, scan].concat()
}

/// Mends nothing; behaves as scans and tests say.
#[derive(Default, Clone)]
pub struct FakeMender(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<FakeState>,
    changed: Condvar,
    kept: AtomicUsize,
}

#[derive(Default)]
struct FakeState {
    scans: Vec<String>,
    edits: Vec<f64>,
    /// Behaviours of the next edits, then of every later one.
    next_edits: VecDeque<Behaviour>,
    every_edit: Option<Behaviour>,
    /// Pieces of maps that reached a worker.
    map_pieces: usize,
    /// Behaviours of the next pieces.
    next_pieces: VecDeque<Behaviour>,
    released: bool,
}

impl FakeMender {
    /// Lets held scans and edits go on, now and later.
    pub fn release(&self) {
        self.lock().released = true;
        self.0.changed.notify_all();
    }

    /// Sets the behaviour of the next edit of a session that reaches a worker.
    pub fn next_edit(&self, behaviour: Behaviour) {
        self.lock().next_edits.push_back(behaviour);
    }

    /// Sets the behaviour of every edit that has none of its own.
    pub fn every_edit(&self, behaviour: Behaviour) {
        self.lock().every_edit = Some(behaviour);
    }

    /// Sets the behaviour of the next piece of a map that has none yet.
    pub fn next_piece(&self, behaviour: Behaviour) {
        self.lock().next_pieces.push_back(behaviour);
    }

    /// Pieces of maps that reached a worker.
    pub fn map_pieces(&self) -> usize {
        self.lock().map_pieces
    }

    /// Blocks until the scan of this name has reached a worker.
    pub async fn wait_for_scan(&self, name: &'static str) {
        self.wait_until(move |state| state.scans.iter().any(|seen| seen == name))
            .await;
    }

    /// Blocks until the edit with its anchor at `x` has reached a worker.
    pub async fn wait_for_edit(&self, x: f64) {
        self.wait_until(move |state| state.edits.contains(&x)).await;
    }

    async fn wait_until(&self, holds: impl Fn(&FakeState) -> bool + Send + 'static) {
        let fake = self.clone();
        let wait = move || {
            let timeout = Duration::from_secs(20);
            let changed = &fake.0.changed;
            let waited = changed.wait_timeout_while(fake.lock(), timeout, |state| !holds(state));
            assert!(!waited.unwrap().1.timed_out(), "it never reached a worker");
        };
        tokio::task::spawn_blocking(wait).await.unwrap();
    }

    /// Whether a scan of this name reached a worker.
    pub fn saw(&self, name: &str) -> bool {
        self.lock().scans.iter().any(|seen| seen == name)
    }

    /// The anchors' `x` of the edits that reached a worker, in order.
    pub fn edits(&self) -> Vec<f64> {
        self.lock().edits.clone()
    }

    /// Sessions in memory.
    pub fn kept(&self) -> usize {
        self.0.kept.load(Relaxed)
    }

    fn lock(&self) -> MutexGuard<'_, FakeState> {
        self.0.state.lock().unwrap()
    }

    fn act_on_scan(&self, scan: &[u8]) -> Result<FakeScan, Refusal> {
        let scan = FakeScan::read(scan);
        self.lock().scans.push(scan.name.clone());
        self.act(scan.behaviour)?;
        Ok(scan)
    }

    fn act_on_edit(&self, constraints: &Constraints) -> Result<(), Refusal> {
        let mut state = self.lock();
        let anchor = constraints.anchors.first();
        state
            .edits
            .push(anchor.map_or(0.0, |anchor| anchor.position[0]));
        let next = state.next_edits.pop_front();
        let behaviour = next.or(state.every_edit).unwrap_or(Behaviour::Mend);
        drop(state);
        self.act(behaviour)
    }

    fn act_on_piece(&self) -> Result<(), Refusal> {
        let mut state = self.lock();
        state.map_pieces += 1;
        let next = state.next_pieces.pop_front();
        drop(state);
        self.act(next.unwrap_or(Behaviour::TakeTime))
    }

    fn act(&self, behaviour: Behaviour) -> Result<(), Refusal> {
        self.0.changed.notify_all();
        match behaviour {
            Behaviour::TakeTime => std::thread::sleep(Duration::from_millis(3)),
            Behaviour::Panic => panic!("on purpose"),
            Behaviour::Hold => {
                let released = self.0.changed.wait_while(self.lock(), |s| !s.released);
                drop(released.unwrap());
            }
            _ => {}
        }
        behaviour.refusal().map_or(Ok(()), Err)
    }
}

/// A report in which each anchor is missed by the `x` of its position.
fn report(constraints: &Constraints) -> v1::Report {
    let anchors = constraints.anchors.iter().map(|anchor| v1::AnchorReport {
        distance: anchor.position[0],
        ..Default::default()
    });
    let hole = v1::HoleReport {
        id: 2,
        anchors: anchors.collect(),
        timings: Some(v1::HoleTimings::default()),
        ..Default::default()
    };
    v1::Report {
        version: "test".to_owned(),
        holes: vec![hole],
        notes: vec![format!("{} anchors", constraints.anchors.len())],
        ..Default::default()
    }
}

/// The answer of a search, at the distance of the target's `x`; its map has one cell outside the hole.
fn found(search: &Search) -> v1::AnchorFound {
    let map = if search.map {
        vec![1.0, f64::NAN]
    } else {
        Vec::new()
    };
    v1::AnchorFound {
        hole: search.hole.unwrap_or(2),
        uv: vec![0.5, 0.5],
        distance: search.target[0],
        map,
        ..Default::default()
    }
}

/// Cells of a map.
pub const MAP_CELLS: usize = 1000;

impl Mender for FakeMender {
    fn weights(&self) -> Vec<v1::Weights> {
        vec![v1::Weights {
            name: "fake".into(),
            sha256: "0".repeat(64),
        }]
    }

    fn inpaint(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        let scan_read = self.act_on_scan(&scan)?;
        let stage = budget.begin("flattening", 3);
        stage.one_done();
        if scan_read.behaviour == Behaviour::UntilCancelled {
            while budget.check().is_ok() {
                std::thread::sleep(Duration::from_millis(2));
            }
            return Err(Refusal::new(codes::DEADLINE_EXCEEDED, "cancelled"));
        }
        Ok(Mended {
            bytes: mended(&scan),
            media_type: "model/gltf-binary",
            report: report(constraints),
            file: None,
        })
    }

    /// Takes away what [`mended`] put in front; other scans have nothing to strip.
    fn strip(&self, scan: Bytes, _: ScanForm, _: &Budget<'_>) -> Result<Stripped, Refusal> {
        self.act_on_scan(&scan)?;
        let Some(bytes) = scan.strip_prefix(MENDED) else {
            return Err(Refusal::new(codes::NOTHING_TO_STRIP, "nothing of darn's"));
        };
        Ok(Stripped {
            bytes: bytes.to_vec(),
            media_type: "model/gltf-binary",
            report: v1::StripReport {
                exact: !bytes.ends_with(b"!"),
                patches: 1,
                ..Default::default()
            },
        })
    }

    fn optimize_anchor(
        &self,
        scan: Bytes,
        search: &Search,
        _: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        self.act_on_scan(&scan)?;
        Ok(found(search))
    }

    fn mend_to_target(
        &self,
        scan: Bytes,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        let anchor = Anchor {
            hole: search.hole,
            uv: None,
            position: search.target,
            hard: false,
        };
        let constraints = Constraints {
            anchors: vec![anchor],
            ..Constraints::default()
        };
        self.inpaint(scan, &constraints, budget)
    }

    fn open(
        &self,
        scan: Bytes,
        _: &Constraints,
        _: &Budget<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        let scan = self.act_on_scan(&scan)?;
        Ok(Box::new(FakeSession::new(self, scan)))
    }

    fn find_holes(
        &self,
        scan: Bytes,
        wanted: HolesQuery,
        _: &Budget<'_>,
    ) -> Result<v1::HolesReport, Refusal> {
        self.act_on_scan(&scan)?;
        let suspect = v1::Suspect {
            reason: "stretched".to_owned(),
            ..Default::default()
        };
        let hole = v1::Loop {
            id: 2,
            kind: v1::LoopKind::Hole.into(),
            ..Default::default()
        };
        Ok(v1::HolesReport {
            loops: vec![hole],
            suspects: wanted.suspects.then_some(suspect).into_iter().collect(),
            components: 1,
            ..Default::default()
        })
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        Ok(())
    }
}
