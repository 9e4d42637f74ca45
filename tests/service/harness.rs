//! A service on a port of its own around a fake mender, and the requests that tests send it.

use std::{
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use clap::Parser;
use darn_serve::{App, ServeArgs, ServeError, Sockets, serve};
use reqwest::{Body, Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use tokio::{
    net::{TcpSocket, TcpStream},
    task::JoinHandle,
};
use tokio_util::sync::CancellationToken;

use crate::fake::{FakeMender, FakeScan};

/// Settings as on the command line.
#[derive(Parser)]
pub struct Settings {
    #[command(flatten)]
    pub serve: ServeArgs,
}

/// A client of HTTP. Its TLS wants a provider of cryptography also where a test does not speak it.
pub fn client() -> reqwest::Client {
    rustls::crypto::ring::default_provider()
        .install_default()
        .ok();
    reqwest::Client::new()
}

/// A service under test.
pub struct Service {
    pub address: SocketAddr,
    pub grpc: Option<SocketAddr>,
    pub fake: Arc<FakeMender>,
    pub app: Arc<App>,
    pub stop: CancellationToken,
    pub ended: JoinHandle<Result<(), ServeError>>,
    client: reqwest::Client,
    scheme: &'static str,
}

impl Service {
    /// Starts with settings as on the command line, and waits until it is ready.
    pub async fn start(settings: &[&str]) -> Self {
        Self::start_for(client(), "http", settings).await
    }

    /// Starts with settings, for a client that speaks this scheme, and waits until it is ready.
    pub async fn start_for(
        client: reqwest::Client,
        scheme: &'static str,
        settings: &[&str],
    ) -> Self {
        let settings = [&["darn", "--listen", "127.0.0.1:0"], settings].concat();
        let settings = Settings::parse_from(settings).serve;
        let fake = Arc::new(FakeMender::default());
        let sockets = Sockets::bind(settings.listen, settings.grpc_listen)
            .await
            .unwrap();
        let address = sockets.http.local_addr().unwrap();
        let grpc = sockets
            .grpc
            .as_ref()
            .map(|socket| socket.local_addr().unwrap());
        let app = App::start(&settings, fake.clone()).await.unwrap();
        let stop = CancellationToken::new();
        let ended = tokio::spawn(serve(sockets, app.clone(), stop.clone(), settings.drain));
        let service = Self {
            address,
            grpc,
            fake,
            app,
            stop,
            ended,
            client,
            scheme,
        };
        while service.get("/readyz").send().await.unwrap().status() != StatusCode::OK {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        service
    }

    pub fn url(&self, path: &str) -> String {
        format!("{}://{}{path}", self.scheme, self.address)
    }

    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(self.url(path))
    }

    pub fn post(&self, path: &str) -> RequestBuilder {
        self.client
            .post(self.url(path))
            .header("x-request-id", "test")
    }

    /// `POST /inpaint` of a scan.
    pub fn scan(&self, scan: impl Into<FakeScan>) -> RequestBuilder {
        self.post("/inpaint")
            .header("content-type", "model/gltf-binary")
            .body(scan.into().bytes())
    }

    /// `POST /sessions` of a scan.
    pub fn open(&self, scan: impl Into<FakeScan>) -> RequestBuilder {
        self.post("/sessions")
            .header("content-type", "model/gltf-binary")
            .body(scan.into().bytes())
    }

    /// Opens a session; its path.
    pub async fn session(&self, scan: impl Into<FakeScan>) -> String {
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

/// A connection to the service from another address of this machine, such as 127.0.0.2.
pub async fn connect_from(service: &Service, address: &str) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket
        .bind(format!("{address}:0").parse().unwrap())
        .unwrap();
    socket.connect(service.address).await.unwrap()
}

/// Waits until a condition holds.
pub async fn until<F: Future<Output = bool>>(holds: impl Fn() -> F) {
    let end = Instant::now() + Duration::from_secs(20);
    while !holds().await {
        assert!(Instant::now() < end, "the condition never held");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// The problem document of an answer; checks its media type and its status.
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

/// A job, by its path.
pub async fn job(service: &Service, path: &str) -> Value {
    let answer = service.get(path).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    answer.json().await.unwrap()
}

/// A job once it is in a state.
pub async fn until_state(service: &Service, path: &str, state: &str) -> Value {
    until(|| async { job(service, path).await["state"] == state }).await;
    job(service, path).await
}
