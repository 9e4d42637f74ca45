//! Sends one request to the receiver of a webhook: over a connection of its own to an address that was checked, without redirects and proxies.

use std::{
    io,
    net::{IpAddr, SocketAddr},
    sync::Arc,
    time::{Duration, SystemTime},
};

use axum::{
    body::{Body, to_bytes},
    http::{HeaderMap, Method, Request, StatusCode, header},
};
use bytes::Bytes;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use rustls::{ClientConfig, RootCertStore, pki_types::ServerName};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpStream, lookup_host},
    time::timeout,
};
use tokio_rustls::TlsConnector;
use tokio_util::task::AbortOnDropHandle;

use super::{
    super::tls,
    address,
    destination::{Target, UrlRules, WebhookUrl},
    settings::WebhookSettingsError,
};
use darn_contract::error_chain;

/// Addresses of a host that are tried in turn.
const ADDRESSES: usize = 3;
/// Most bytes of the head of an answer.
const MAX_HEAD_BYTES: usize = 16 << 10;
/// Most bytes of the body of an answer that are taken, so that the receiver can finish; nobody reads them.
const MAX_BODY_BYTES: usize = 64 << 10;
const USER_AGENT: &str = concat!("darn/", env!("CARGO_PKG_VERSION"));

/// A message with its signature.
#[derive(Debug, Clone)]
pub struct Message {
    /// The header `webhook-id`.
    pub id: String,
    /// The header `webhook-timestamp`: seconds since 1970.
    pub timestamp: u64,
    /// The header `webhook-signature`.
    pub signature: String,
    /// The body, JSON.
    pub body: Bytes,
}

/// Why there was no answer. The texts are told to clients: they say nothing of the network inside.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The name does not exist, or no resolver answers.
    #[error("the host cannot be resolved")]
    Unresolved(#[source] io::Error),
    /// The name has no address that webhooks may go to.
    #[error("the host has no public address: it resolves to {kind} (DARN_WEBHOOK_ALLOW)")]
    NotPublic {
        /// The first address, for the log.
        address: IpAddr,
        /// What kind of address it is.
        kind: &'static str,
    },
    /// No connection.
    #[error("no connection: {0}")]
    Connect(#[source] io::Error),
    /// The handshake failed.
    #[error("no TLS connection: {0}")]
    Tls(#[source] io::Error),
    /// What came is no answer.
    #[error("no answer: {}", error_chain(.0))]
    Answer(#[source] hyper::Error),
    /// It took too long.
    #[error("no answer within {} s (DARN_WEBHOOK_TIMEOUT)", .0.as_secs_f64())]
    Timeout(Duration),
    /// The URL cannot be made a request.
    #[error("the URL cannot be asked for: {0}")]
    Request(#[from] axum::http::Error),
}

/// What a receiver answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PostAnswer {
    /// Its status.
    pub status: StatusCode,
    /// How long it asks not to be asked again.
    pub again_after: Option<Duration>,
}

/// What sends.
#[derive(Debug)]
pub struct Poster {
    tls: Arc<ClientConfig>,
    rules: UrlRules,
    time: Duration,
}

impl Poster {
    /// Sends to servers whose certificates are signed by these authorities, each try within a time.
    ///
    /// # Errors
    /// None in practice: they would concern the versions of TLS that the library has.
    pub fn new(
        roots: RootCertStore,
        rules: UrlRules,
        time: Duration,
    ) -> Result<Self, WebhookSettingsError> {
        let tls = ClientConfig::builder_with_provider(tls::provider())
            .with_safe_default_protocol_versions()?
            .with_root_certificates(roots)
            .with_no_client_auth();
        Ok(Self {
            tls: Arc::new(tls),
            rules,
            time,
        })
    }

    /// Longest time of a try.
    pub fn time(&self) -> Duration {
        self.time
    }

    /// Sends a message.
    ///
    /// # Errors
    /// See [`PostError`].
    pub async fn post(&self, url: &WebhookUrl, message: &Message) -> Result<PostAnswer, PostError> {
        let sent = timeout(self.time, self.send(url, message)).await;
        sent.unwrap_or(Err(PostError::Timeout(self.time)))
    }

    async fn send(&self, url: &WebhookUrl, message: &Message) -> Result<PostAnswer, PostError> {
        let request = Request::builder()
            .method(Method::POST)
            .uri(url.path())
            .header(header::HOST, url.authority())
            .header(header::CONTENT_TYPE, "application/json")
            .header(header::USER_AGENT, USER_AGENT)
            .header("webhook-id", &message.id)
            .header("webhook-timestamp", message.timestamp)
            .header("webhook-signature", &message.signature)
            .body(Body::from(message.body.clone()))?;
        let stream = self.connect(url).await?;
        if !url.is_https() {
            return ask(stream, request).await;
        }
        let wrong = |error| PostError::Tls(io::Error::other(error));
        let name = match url.target() {
            Some(Target::Address(address)) => ServerName::from(address),
            _ => ServerName::try_from(url.host().to_owned()).map_err(wrong)?,
        };
        let tls = TlsConnector::from(Arc::clone(&self.tls));
        let stream = tls.connect(name, stream).await.map_err(PostError::Tls)?;
        ask(stream, request).await
    }

    /// Connects to an address of the host that was checked; nobody resolves the host again.
    async fn connect(&self, url: &WebhookUrl) -> Result<TcpStream, PostError> {
        let addresses = self.addresses(url).await?;
        let each = self.time / u32::try_from(addresses.len().max(1)).unwrap_or(1);
        let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
        for address in addresses {
            match timeout(each, TcpStream::connect(address)).await {
                Ok(Ok(stream)) => return Ok(stream),
                Ok(Err(error)) => last = error,
                Err(late) => last = late.into(),
            }
        }
        Err(PostError::Connect(last))
    }

    /// The addresses of the host that webhooks may go to.
    async fn addresses(&self, url: &WebhookUrl) -> Result<Vec<SocketAddr>, PostError> {
        let found: Vec<SocketAddr> = match url.target() {
            Some(Target::Address(address)) => vec![(address, url.port()).into()],
            _ => {
                let found = lookup_host((url.host(), url.port())).await;
                found.map_err(PostError::Unresolved)?.collect()
            }
        };
        let mut refused = None;
        let mut allowed = Vec::new();
        for address in found {
            match address::check(address.ip(), &self.rules.allowed) {
                Ok(()) => allowed.push(address),
                Err(kind) => refused = refused.or(Some((address.ip(), kind))),
            }
        }
        allowed.truncate(ADDRESSES);
        match refused {
            Some((address, kind)) if allowed.is_empty() => {
                Err(PostError::NotPublic { address, kind })
            }
            _ => Ok(allowed),
        }
    }
}

/// Sends a request over a connection, and closes it.
async fn ask(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Body>,
) -> Result<PostAnswer, PostError> {
    let (mut sender, connection) = http1::Builder::new()
        .max_buf_size(MAX_HEAD_BYTES)
        .handshake(TokioIo::new(stream))
        .await
        .map_err(PostError::Answer)?;
    let _connection = AbortOnDropHandle::new(tokio::spawn(connection));
    let answer = sender
        .send_request(request)
        .await
        .map_err(PostError::Answer)?;
    let said = PostAnswer {
        status: answer.status(),
        again_after: again_after(answer.headers(), SystemTime::now()),
    };
    // What it says more, and whether that ends, changes nothing.
    to_bytes(Body::new(answer.into_body()), MAX_BODY_BYTES)
        .await
        .ok();
    Ok(said)
}

/// How long the receiver asks not to be asked again (RFC 9110, 10.2.3): seconds, or a date.
fn again_after(headers: &HeaderMap, now: SystemTime) -> Option<Duration> {
    let said = headers.get(header::RETRY_AFTER)?.to_str().ok()?.trim();
    match said.parse::<u64>() {
        Ok(seconds) => Some(Duration::from_secs(seconds)),
        Err(_) => httpdate::parse_http_date(said)
            .ok()?
            .duration_since(now)
            .ok(),
    }
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[test]
    fn a_receiver_asks_for_seconds_or_a_date() {
        let now = httpdate::parse_http_date("Sun, 29 Nov 2026 12:00:00 GMT").unwrap();
        let asked = |said: &'static str| {
            let header = (header::RETRY_AFTER, HeaderValue::from_static(said));
            again_after(&HeaderMap::from_iter([header]), now)
        };
        assert_eq!(asked("120"), Some(Duration::from_secs(120)));
        let hour = "Sun, 29 Nov 2026 13:00:00 GMT";
        assert_eq!(asked(hour), Some(Duration::from_secs(3600)));
        for nothing in ["Sun, 29 Nov 2026 11:00:00 GMT", "-1", "soon", ""] {
            assert_eq!(asked(nothing), None, "{nothing}");
        }
        assert_eq!(again_after(&HeaderMap::new(), now), None);
    }
}
