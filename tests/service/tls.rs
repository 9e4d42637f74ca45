//! Connections over TLS: both versions of HTTP, gRPC, certificates that change, handshakes that do not end.

use std::{net::SocketAddr, path::PathBuf, sync::Arc, time::Duration};

use clap::Parser;
use darn_serve::{App, Listening, ServeError, generated::darn_client::DarnClient, healthcheck};
use hyper_util::rt::TokioIo;
use rcgen::{CertifiedKey, KeyPair};
use reqwest::Version;
use rustls::{
    ClientConfig, RootCertStore,
    crypto::ring,
    pki_types::{CertificateDer, ServerName},
};
use tempfile::TempDir;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::Instant,
};
use tokio_rustls::{TlsConnector, client::TlsStream};
use tonic::transport::{Endpoint, Uri};

use crate::{
    fake::{FakeMender, FakeScan},
    harness::{Service, Settings, until},
    protocols::chunks,
};

const NAME: &str = "darn.example";

/// A certificate for [`NAME`] and this machine, made for the test, in the files that the settings name.
struct Identity {
    folder: TempDir,
}

impl Identity {
    fn new() -> Self {
        let identity = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        identity.renew();
        identity
    }

    /// Puts a new certificate with a new key into the files.
    fn renew(&self) {
        let made = certificate();
        std::fs::write(self.key(), made.signing_key.serialize_pem()).unwrap();
        std::fs::write(self.chain(), made.cert.pem()).unwrap();
    }

    fn chain(&self) -> PathBuf {
        self.folder.path().join("chain.pem")
    }

    fn key(&self) -> PathBuf {
        self.folder.path().join("key.pem")
    }

    fn settings(&self) -> Vec<String> {
        let text = |path: PathBuf| path.to_str().unwrap().to_owned();
        let settings = [
            "--tls-cert",
            &text(self.chain()),
            "--tls-key",
            &text(self.key()),
        ];
        settings.map(str::to_owned).to_vec()
    }

    /// A client that trusts the certificate of now, and no other.
    fn client(&self, protocols: &[&str]) -> ClientConfig {
        use rustls::pki_types::pem::PemObject as _;
        let mut roots = RootCertStore::empty();
        (roots.add(CertificateDer::from_pem_file(self.chain()).unwrap())).unwrap();
        let mut config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_root_certificates(roots)
            .with_no_client_auth();
        config.alpn_protocols = protocols.iter().map(|it| it.as_bytes().to_vec()).collect();
        config
    }

    fn http_client(&self) -> reqwest::Client {
        let config = self.client(&["h2", "http/1.1"]);
        let client = reqwest::Client::builder().tls_backend_preconfigured(config);
        client.build().unwrap()
    }

    async fn service(&self, more: &[&str]) -> Service {
        let settings = self.settings();
        let settings: Vec<&str> = settings
            .iter()
            .map(String::as_str)
            .chain(more.iter().copied())
            .collect();
        Service::start_for(self.http_client(), "https", &settings).await
    }
}

fn certificate() -> CertifiedKey<KeyPair> {
    let names = [NAME, "localhost", "127.0.0.1"].map(str::to_owned);
    rcgen::generate_simple_self_signed(names).unwrap()
}

async fn connect(
    address: SocketAddr,
    config: ClientConfig,
) -> std::io::Result<TlsStream<TcpStream>> {
    let stream = TcpStream::connect(address).await?;
    let name = ServerName::try_from(NAME).unwrap();
    TlsConnector::from(Arc::new(config))
        .connect(name, stream)
        .await
}

#[tokio::test]
async fn http_of_both_versions_and_grpc_come_over_tls() {
    let identity = Identity::new();
    let service = identity.service(&[]).await;
    let answer = service.scan("cloth").send().await.unwrap();
    assert_eq!(
        (answer.status().as_u16(), answer.version()),
        (200, Version::HTTP_2)
    );
    assert_eq!(
        answer.bytes().await.unwrap(),
        FakeScan::named("cloth").mended()
    );

    let old = reqwest::Client::builder()
        .tls_backend_preconfigured(identity.client(&["http/1.1"]))
        .build()
        .unwrap();
    let answer = old.get(service.url("/livez")).send().await.unwrap();
    assert_eq!(
        (answer.status().as_u16(), answer.version()),
        (200, Version::HTTP_11)
    );

    let config = identity.client(&["h2"]);
    let address = service.address;
    let connector = tower::service_fn(move |_: Uri| {
        let config = config.clone();
        async move { connect(address, config).await.map(TokioIo::new) }
    });
    let channel = Endpoint::from_shared(format!("http://{NAME}"))
        .unwrap()
        .connect_with_connector(connector)
        .await
        .unwrap();
    let mut grpc = DarnClient::new(channel);
    let holes = grpc.find_holes(chunks("cloth", None)).await.unwrap();
    assert_eq!(holes.into_inner().loops[0].id, 2);
}

#[tokio::test]
async fn a_plain_request_gets_no_answer_and_harms_nobody() {
    let identity = Identity::new();
    let service = identity.service(&[]).await;
    let mut plain = TcpStream::connect(service.address).await.unwrap();
    plain
        .write_all(b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\n")
        .await
        .unwrap();
    let mut answer = Vec::new();
    // Closed or reset, after an alert at most.
    let _ = plain.read_to_end(&mut answer).await;
    assert!(!answer.windows(4).any(|four| four == b"HTTP"));
    assert_eq!(service.get("/livez").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_certificate_that_changes_is_served_to_new_connections() {
    let identity = Identity::new();
    let service = identity.service(&[]).await;
    let before = identity.client(&["http/1.1"]);
    assert!(connect(service.address, before.clone()).await.is_ok());

    // Only one file is new: they do not belong together, so the old certificate stays.
    let other = certificate();
    std::fs::write(identity.chain(), other.cert.pem()).unwrap();
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(connect(service.address, before.clone()).await.is_ok());

    identity.renew();
    let after = identity.client(&["http/1.1"]);
    until(async || connect(service.address, after.clone()).await.is_ok()).await;
    assert!(connect(service.address, before).await.is_err());

    std::fs::write(identity.key(), "no key").unwrap();
    std::fs::remove_file(identity.chain()).unwrap();
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(connect(service.address, after).await.is_ok());
}

#[tokio::test]
async fn a_handshake_that_does_not_end_is_cut_and_holds_nobody_up() {
    let identity = Identity::new();
    let service = identity.service(&["--tls-handshake", "700ms"]).await;
    let mut silent = Vec::new();
    for begin in [&b""[..], b"\x16\x03\x01\x02\x00\x01\x00"].repeat(20) {
        let mut stream = TcpStream::connect(service.address).await.unwrap();
        stream.write_all(begin).await.unwrap();
        silent.push(stream);
    }
    let begun = Instant::now();
    assert!(
        connect(service.address, identity.client(&["http/1.1"]))
            .await
            .is_ok()
    );
    for mut stream in silent {
        let end = tokio::time::timeout(Duration::from_secs(20), stream.read(&mut [0; 64])).await;
        assert!(matches!(end.unwrap(), Ok(0) | Err(_)));
    }
    assert!(begun.elapsed() > Duration::from_millis(500));

    // A shutdown does not wait for one.
    let identity = Identity::new();
    let service = identity.service(&["--tls-handshake", "10m"]).await;
    let _silent = TcpStream::connect(service.address).await.unwrap();
    service.stop.cancel();
    let ended = tokio::time::timeout(Duration::from_secs(15), service.ended).await;
    ended.unwrap().unwrap().unwrap();
}

#[tokio::test]
async fn the_health_check_takes_the_certificate_of_its_file_only() {
    let identity = Identity::new();
    let service = identity.service(&[]).await;
    let check = async |certificate: Option<PathBuf>| {
        let listening = Listening {
            address: service.address,
            certificate,
        };
        let check = move || healthcheck(&listening, Duration::from_secs(5));
        tokio::task::spawn_blocking(check).await.unwrap()
    };
    check(Some(identity.chain())).await.unwrap();
    let other = Identity::new();
    assert!(check(Some(other.chain())).await.is_err());
    assert!(check(Some(other.key())).await.is_err());
    assert!(check(None).await.is_err());
}

#[tokio::test]
async fn files_that_cannot_be_served_are_named() {
    let identity = Identity::new();
    let refusal = async || {
        let settings = [vec!["darn".to_owned()], identity.settings()].concat();
        let settings = Settings::parse_from(settings).serve;
        match App::start(&settings, Arc::new(FakeMender::default())).await {
            Err(error @ ServeError::Tls(_)) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    std::fs::write(identity.chain(), certificate().cert.pem()).unwrap();
    let text = refusal().await;
    assert!(
        text.contains("chain.pem") && text.contains("key.pem"),
        "{text}"
    );

    let encrypted =
        "-----BEGIN ENCRYPTED PRIVATE KEY-----\nAAAA\n-----END ENCRYPTED PRIVATE KEY-----\n";
    std::fs::write(identity.key(), encrypted).unwrap();
    let text = refusal().await;
    assert!(
        text.contains("not encrypted") && text.contains("DARN_TLS_KEY"),
        "{text}"
    );

    for broken in [
        "",
        "-----BEGIN CERTIFICATE-----\n*\n-----END CERTIFICATE-----\n",
    ] {
        std::fs::write(identity.chain(), broken).unwrap();
        let text = refusal().await;
        assert!(
            text.contains("DARN_TLS_CERT") && text.contains("PEM"),
            "{text}"
        );
    }
    std::fs::write(identity.chain(), vec![b'-'; 2 << 20]).unwrap();
    let text = refusal().await;
    assert!(text.contains("1048576 bytes"), "{text}");
    std::fs::remove_file(identity.chain()).unwrap();
    let text = refusal().await;
    assert!(
        text.contains("cannot be read") && text.contains("DARN_TLS_CERT"),
        "{text}"
    );
}
