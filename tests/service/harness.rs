//! A service on a port of its own, and a mender whose scans say what it shall do.

use std::{
    net::SocketAddr,
    sync::{Arc, Condvar, Mutex},
    time::Duration,
};

use clap::Parser;
use darn::{
    contract::{Constraints, FieldError, v1},
    serve::{App, Class, Mended, Menders, Refusal, ServeArgs, ServeError, Sockets, serve},
};
use reqwest::{RequestBuilder, Response, StatusCode};
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
#[derive(Default)]
pub struct Fake {
    state: Mutex<FakeState>,
    changed: Condvar,
}

#[derive(Default)]
struct FakeState {
    seen: Vec<String>,
    released: bool,
}

impl Fake {
    /// Lets go of all scans that say `hold`, now and later.
    pub fn release(&self) {
        self.state.lock().unwrap().released = true;
        self.changed.notify_all();
    }

    /// Blocks until a scan has reached a worker.
    pub async fn wait_for(self: &Arc<Self>, scan: &'static str) {
        let fake = Arc::clone(self);
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
        self.state.lock().unwrap().seen.clone()
    }

    fn act(&self, scan: &[u8]) -> Result<(), Refusal> {
        let text = String::from_utf8_lossy(scan).into_owned();
        let mut state = self.state.lock().unwrap();
        state.seen.push(text.clone());
        self.changed.notify_all();
        if text.starts_with("hold") {
            drop(self.changed.wait_while(state, |s| !s.released).unwrap());
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

impl Menders for Fake {
    fn inpaint(&self, scan: &[u8], constraints: &Constraints) -> Result<Mended, Refusal> {
        self.act(scan)?;
        let report = v1::Report {
            version: "test".to_owned(),
            holes: vec![v1::HoleReport {
                id: 2,
                timings: Some(v1::HoleTimings::default()),
                ..Default::default()
            }],
            notes: vec![format!("{} anchors", constraints.anchors.len())],
            ..Default::default()
        };
        Ok(Mended {
            bytes: [b"glTF ", scan].concat(),
            report,
        })
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
        let ended = tokio::spawn(serve(sockets, app, stop.clone(), settings.drain));
        let service = Self {
            address,
            grpc,
            fake,
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

    pub async fn metric(&self, line: &str) -> Option<f64> {
        let text = self
            .get("/metrics")
            .send()
            .await
            .unwrap()
            .text()
            .await
            .unwrap();
        let found = text.lines().find_map(|l| l.strip_prefix(line))?;
        found.trim().parse().ok()
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
