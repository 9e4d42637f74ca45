//! A service on a port of its own, and a mender whose scans say what it shall do.

use std::{
    net::SocketAddr,
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use clap::Parser;
use darn_contract::port::{
    Cancellation, Class, EditSession, Mended, Mender, PatchForm, Patches, Refusal,
};
use darn_contract::{Anchor, Constraints, FieldError, Search, v1};
use darn_serve::{App, ServeArgs, ServeError, Sockets, serve};
use reqwest::{Body, Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Settings as on the command line.
#[derive(Parser)]
pub struct Settings {
    #[command(flatten)]
    pub serve: ServeArgs,
}

/// Mends nothing; a scan's text says what happens to it.
#[derive(Default, Clone)]
pub struct Fake(Arc<Stage>);

#[derive(Default)]
struct Stage {
    state: Mutex<FakeState>,
    changed: Condvar,
    kept: AtomicUsize,
}

#[derive(Default)]
struct FakeState {
    seen: Vec<String>,
    released: bool,
}

impl Fake {
    /// Lets go of all scans that say `hold`, now and later.
    pub fn release(&self) {
        self.0.state.lock().unwrap().released = true;
        self.0.changed.notify_all();
    }

    /// Blocks until a scan has reached a worker.
    pub async fn wait_for(&self, scan: &'static str) {
        let fake = Arc::clone(&self.0);
        let wait = move || {
            let state = fake.state.lock().unwrap();
            let patience = Duration::from_secs(20);
            let waited = fake
                .changed
                .wait_timeout_while(state, patience, |s| !s.seen.iter().any(|seen| seen == scan));
            assert!(
                !waited.unwrap().1.timed_out(),
                "`{scan}` never reached a worker"
            );
        };
        tokio::task::spawn_blocking(wait).await.unwrap();
    }

    /// Every scan that reached a worker.
    pub fn seen(&self) -> Vec<String> {
        self.0.state.lock().unwrap().seen.clone()
    }

    /// Scans kept for editing and not dropped yet.
    pub fn kept(&self) -> usize {
        self.0.kept.load(Relaxed)
    }

    fn act(&self, scan: &[u8]) -> Result<(), Refusal> {
        let text = String::from_utf8_lossy(scan).into_owned();
        let mut state = self.0.state.lock().unwrap();
        state.seen.push(text.clone());
        self.0.changed.notify_all();
        if text.starts_with("hold") {
            drop(self.0.changed.wait_while(state, |s| !s.released).unwrap());
            return Ok(());
        }
        drop(state);
        let refusal = |class, code, detail: &str| Refusal {
            class,
            code,
            detail: detail.to_owned(),
            fields: Vec::new(),
        };
        match text.as_str() {
            "slow" => {
                std::thread::sleep(Duration::from_millis(3));
                Ok(())
            }
            "panic" => panic!("on purpose"),
            "truncated" => Err(refusal(
                Class::Malformed,
                "truncated",
                "chunk 1 ends at byte 90 of 80",
            )),
            "huge" => Err(refusal(
                Class::TooLarge,
                "too_many_faces",
                "5000001 triangles; the limit is 4000000",
            )),
            "cone" => Err(refusal(
                Class::Unprocessable,
                "not_a_disk",
                "region around loop 3 has 1 handle",
            )),
            "secret" => Err(refusal(
                Class::Internal,
                "weights",
                "/srv/secret/weights is gone",
            )),
            "unknown hole" => Err(Refusal {
                fields: vec![FieldError::new(
                    "/holes/0/id",
                    "there is no loop 9; loops are 0 to 3",
                )],
                ..refusal(
                    Class::Unprocessable,
                    "unknown_hole",
                    "the scan has no such hole",
                )
            }),
            _ => Ok(()),
        }
    }
}

/// What the fake says it did: each anchor is kept at the distance of its `x`.
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

/// A search's answer: as far away as the target's `x`; the map has a cell outside the hole.
fn found(search: &Search) -> v1::AnchorFound {
    v1::AnchorFound {
        hole: search.hole.unwrap_or(2),
        uv: vec![0.5, 0.5],
        distance: search.target[0],
        map: match search.map {
            true => vec![1.0, f64::NAN],
            false => Vec::new(),
        },
        ..Default::default()
    }
}

/// A scan kept for editing. Its text begins with its size in bytes; an anchor's hole says what happens: 6 takes its time,
/// 7 is held, 8 panics, 9 is not mended.
struct FakeKept {
    fake: Fake,
    scan: String,
}

impl FakeKept {
    fn new(fake: &Fake, scan: &[u8]) -> Self {
        fake.0.kept.fetch_add(1, Relaxed);
        Self {
            fake: fake.clone(),
            scan: String::from_utf8_lossy(scan).into_owned(),
        }
    }

    fn act(&self, constraints: &Constraints) -> Result<(), Refusal> {
        let anchor = constraints.anchors.first();
        let x = anchor.map_or(0.0, |anchor| anchor.position[0]);
        let text = match anchor.and_then(|anchor| anchor.hole) {
            Some(6) => "slow".to_owned(),
            Some(7) => format!("hold {x}"),
            Some(8) => "panic".to_owned(),
            Some(9) => "cone".to_owned(),
            _ => format!("move {x}"),
        };
        self.fake.act(text.as_bytes())
    }
}

impl Drop for FakeKept {
    fn drop(&mut self) {
        self.fake.0.kept.fetch_sub(1, Relaxed);
    }
}

impl EditSession for FakeKept {
    fn described(&self) -> v1::Session {
        v1::Session {
            holes: vec![v1::SessionHole {
                id: 2,
                rim_uvs: vec![0.25, 0.5],
                ..Default::default()
            }],
            bytes: self.bytes() as u64,
            ..Default::default()
        }
    }

    fn bytes(&self) -> usize {
        let size = self.scan.split(' ').next().and_then(|n| n.parse().ok());
        size.unwrap_or(10_000)
    }

    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        _: Cancellation<'_>,
    ) -> Result<Patches, Refusal> {
        self.act(constraints)?;
        let positions = constraints.anchors.iter().flat_map(|a| a.position);
        let bytes = match form {
            PatchForm::Glb => b"glTF patches".to_vec(),
            PatchForm::Positions => positions.flat_map(|x| (x as f32).to_le_bytes()).collect(),
        };
        Ok(Patches {
            bytes,
            report: report(constraints),
        })
    }

    fn mended(&self, constraints: &Constraints, _: Cancellation<'_>) -> Result<Mended, Refusal> {
        let xs: Vec<f64> = constraints.anchors.iter().map(|a| a.position[0]).collect();
        Ok(Mended {
            bytes: format!("glTF {} {xs:?}", self.scan).into_bytes(),
            report: report(constraints),
        })
    }

    fn optimize_anchor(
        &self,
        search: &Search,
        _: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        Ok(found(search))
    }
}

impl Mender for Fake {
    fn inpaint(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        _: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        self.act(scan)?;
        Ok(Mended {
            bytes: [b"glTF ", scan].concat(),
            report: report(constraints),
        })
    }

    fn optimize_anchor(
        &self,
        scan: &[u8],
        search: &Search,
        _: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        self.act(scan)?;
        Ok(found(search))
    }

    fn mend_to_target(
        &self,
        scan: &[u8],
        search: &Search,
        wanted: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        let anchor = Anchor {
            hole: search.hole,
            uv: None,
            position: search.target,
            hard: false,
        };
        let anchors = vec![anchor];
        let constraints = Constraints {
            anchors,
            ..Constraints::default()
        };
        self.inpaint(scan, &constraints, wanted)
    }

    fn open(
        &self,
        scan: &[u8],
        _: &Constraints,
        _: Cancellation<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        self.act(scan)?;
        Ok(Box::new(FakeKept::new(self, scan)))
    }

    fn find_holes(&self, scan: &[u8]) -> Result<v1::HolesReport, Refusal> {
        self.act(scan)?;
        let hole = v1::Loop {
            id: 2,
            kind: v1::LoopKind::Hole.into(),
            ..Default::default()
        };
        Ok(v1::HolesReport {
            loops: vec![hole],
            components: 1,
            ..Default::default()
        })
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.act(b"warm")
    }
}

/// A service under test.
pub struct Service {
    pub address: SocketAddr,
    pub grpc: Option<SocketAddr>,
    pub fake: Arc<Fake>,
    pub app: Arc<App>,
    pub stop: CancellationToken,
    pub ended: JoinHandle<Result<(), ServeError>>,
    client: reqwest::Client,
}

impl Service {
    /// Starts with settings as on the command line, and waits until it is ready.
    pub async fn start(settings: &[&str]) -> Self {
        let settings = [&["darn", "--listen", "127.0.0.1:0"], settings].concat();
        let settings = Settings::parse_from(settings).serve;
        let fake = Arc::new(Fake::default());
        let sockets = Sockets::bind(settings.listen, settings.grpc_listen)
            .await
            .unwrap();
        let address = sockets.http.local_addr().unwrap();
        let grpc = sockets
            .grpc
            .as_ref()
            .map(|socket| socket.local_addr().unwrap());
        let app = App::start(&settings, fake.clone()).unwrap();
        let stop = CancellationToken::new();
        let ended = tokio::spawn(serve(sockets, app.clone(), stop.clone(), settings.drain));
        let service = Self {
            address,
            grpc,
            fake,
            app,
            stop,
            ended,
            client: reqwest::Client::new(),
        };
        while service.get("/readyz").send().await.unwrap().status() != StatusCode::OK {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        service
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(self.url(path))
    }

    pub fn post(&self, path: &str) -> RequestBuilder {
        self.client
            .post(self.url(path))
            .header("x-request-id", "test")
    }

    /// `POST /inpaint` of a GLB that reads `scan`.
    pub fn scan(&self, scan: &'static str) -> RequestBuilder {
        self.post("/inpaint")
            .header("content-type", "model/gltf-binary")
            .body(scan)
    }

    /// `POST /sessions` of a GLB that reads `scan`.
    pub fn open(&self, scan: impl Into<Body>) -> RequestBuilder {
        self.post("/sessions")
            .header("content-type", "model/gltf-binary")
            .body(scan)
    }

    /// The path of a session just opened.
    pub async fn session(&self, scan: impl Into<Body>) -> String {
        let response = self.open(scan).send().await.unwrap();
        assert_eq!(response.status(), 201);
        response.headers()["location"].to_str().unwrap().to_owned()
    }

    /// `POST` of a JSON text.
    pub fn ask(&self, path: &str, json: impl Into<Body>) -> RequestBuilder {
        self.post(path)
            .header("content-type", "application/json")
            .body(json)
    }

    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, self.url(path))
    }

    pub fn delete(&self, path: &str) -> RequestBuilder {
        self.client
            .delete(self.url(path))
            .header("x-request-id", "test")
    }

    pub async fn metric(&self, line: &str) -> Option<f64> {
        let text = self
            .get("/metrics")
            .send()
            .await
            .unwrap()
            .text()
            .await
            .unwrap();
        let found = text
            .lines()
            .find_map(|l| l.strip_prefix(line)?.strip_prefix(' '))?;
        found.parse().ok()
    }
}

/// Waits until something holds.
pub async fn until<F: Future<Output = bool>>(holds: impl Fn() -> F) {
    let patience = Instant::now() + Duration::from_secs(20);
    while !holds().await {
        assert!(Instant::now() < patience, "it never came about");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// The problem document of an answer, its status checked against the answer's.
pub async fn problem(response: Response) -> Value {
    assert_eq!(
        response.headers()["content-type"],
        "application/problem+json"
    );
    let status = response.status().as_u16();
    let problem: Value = response.json().await.unwrap();
    assert_eq!(problem["status"], status);
    problem
}
