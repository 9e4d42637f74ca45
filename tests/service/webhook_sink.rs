//! A receiver of webhooks that answers as a test says, and keeps what it received.

use std::{
    collections::VecDeque,
    net::SocketAddr,
    sync::{Arc, Mutex},
    time::Duration,
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::State,
    http::{HeaderMap, StatusCode, Uri, header},
    response::{IntoResponse, Response},
};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use rustls::pki_types::PrivateKeyDer;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::{TlsAcceptor, server::TlsStream};

use crate::harness::until;

/// The answer to a request.
#[derive(Debug, Clone, Copy)]
pub enum Reply {
    Status(u16),
    /// 503, and not to be asked again for so many seconds.
    Busy(u64),
    /// To another path of the same receiver.
    Redirect,
    /// None.
    Silence,
}

/// A request that came.
#[derive(Debug, Clone)]
pub struct Received {
    pub path: String,
    pub headers: HeaderMap,
    pub body: Bytes,
}

impl Received {
    pub fn header(&self, name: &str) -> &str {
        self.headers[name].to_str().unwrap()
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    /// Whether it is signed with this secret, of at most 64 bytes. HMAC-SHA256 as RFC 2104 has it.
    pub fn is_signed_with(&self, secret: &[u8]) -> bool {
        use base64::{Engine as _, engine::general_purpose::STANDARD};
        let mut key = [0; 64];
        key[..secret.len()].copy_from_slice(secret);
        let pad = |byte: u8| key.map(|it| it ^ byte);
        let (id, timestamp) = (self.header("webhook-id"), self.header("webhook-timestamp"));
        let inner = Sha256::new()
            .chain_update(pad(0x36))
            .chain_update(format!("{id}.{timestamp}."))
            .chain_update(&self.body);
        let outer = Sha256::new()
            .chain_update(pad(0x5c))
            .chain_update(inner.finalize());
        let signature = format!("v1,{}", STANDARD.encode(outer.finalize()));
        let mut signatures = self.header("webhook-signature").split(' ');
        signatures.any(|it| it == signature)
    }
}

/// The replies that are still to be given, the last of which is given again and again, and what came.
#[derive(Debug)]
struct Script {
    replies: VecDeque<Reply>,
    received: Vec<Received>,
}

/// A receiver.
pub struct Sink {
    pub address: SocketAddr,
    script: Arc<Mutex<Script>>,
}

impl Sink {
    /// Listens without TLS.
    pub async fn start(replies: &[Reply]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let (sink, router) = Self::new(listener.local_addr().unwrap(), replies);
        tokio::spawn(async move { axum::serve(listener, router).await });
        sink
    }

    /// Listens with TLS as `localhost`; also answers with the certificate (PEM) of the authority that signed its own.
    pub async fn start_tls(replies: &[Reply]) -> (Self, String) {
        let key = KeyPair::generate().unwrap();
        let mut authority = CertificateParams::default();
        authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let authority = CertifiedIssuer::self_signed(authority, key).unwrap();
        let key = KeyPair::generate().unwrap();
        let certificate = CertificateParams::new(["localhost".to_owned()]).unwrap();
        let certificate = certificate.signed_by(&key, &authority).unwrap();
        let key = PrivateKeyDer::try_from(key.serialize_der()).unwrap();
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = rustls::ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(vec![certificate.der().clone()], key)
            .unwrap();
        let acceptor = TlsAcceptor::from(Arc::new(config));

        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let (sink, router) = Self::new(listener.local_addr().unwrap(), replies);
        let listener = TlsListener { listener, acceptor };
        tokio::spawn(async move { axum::serve(listener, router).await });
        (sink, authority.pem())
    }

    fn new(address: SocketAddr, replies: &[Reply]) -> (Self, Router) {
        let script = Arc::new(Mutex::new(Script {
            replies: replies.iter().copied().collect(),
            received: Vec::new(),
        }));
        let router = Router::new()
            .fallback(answer)
            .with_state(Arc::clone(&script));
        (Self { address, script }, router)
    }

    /// The URL of a path.
    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// What came so far.
    pub fn received(&self) -> Vec<Received> {
        self.script.lock().unwrap().received.clone()
    }

    /// Waits until so many requests have come.
    pub async fn wait_for(&self, count: usize) -> Vec<Received> {
        until(|| async { self.received().len() >= count }).await;
        self.received()
    }
}

/// Accepts connections that are encrypted.
struct TlsListener {
    listener: TcpListener,
    acceptor: TlsAcceptor,
}

impl axum::serve::Listener for TlsListener {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, SocketAddr) {
        loop {
            let (stream, address) = self.listener.accept().await.unwrap();
            // A client that does not trust the certificate breaks off.
            if let Ok(stream) = self.acceptor.accept(stream).await {
                return (stream, address);
            }
        }
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

async fn answer(
    State(script): State<Arc<Mutex<Script>>>,
    uri: Uri,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let reply = {
        let mut script = script.lock().unwrap();
        script.received.push(Received {
            path: uri.to_string(),
            headers,
            body,
        });
        match script.replies.len() {
            0 | 1 => script.replies.front().copied(),
            _ => script.replies.pop_front(),
        }
    };
    match reply.unwrap_or(Reply::Status(204)) {
        Reply::Status(status) => StatusCode::from_u16(status).unwrap().into_response(),
        Reply::Busy(seconds) => {
            let later = [(header::RETRY_AFTER, seconds.to_string())];
            (StatusCode::SERVICE_UNAVAILABLE, later).into_response()
        }
        Reply::Redirect => (StatusCode::FOUND, [(header::LOCATION, "/elsewhere")]).into_response(),
        Reply::Silence => {
            tokio::time::sleep(Duration::from_secs(3600)).await;
            Body::empty().into_response()
        }
    }
}
