//! Asks a running service whether it is ready, for a container's health check.

use std::{
    io::{self, Read, Write},
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use rustls::{
    CertificateError, ClientConfig, ClientConnection, DigitallySignedStruct, SignatureScheme,
    StreamOwned,
    client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier},
    crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature},
    pki_types::{CertificateDer, ServerName, UnixTime},
};

use super::tls::{self, TlsError};

/// Why a service does not count as ready.
#[derive(Debug, thiserror::Error)]
pub enum HealthError {
    /// There was no answer.
    #[error("{address} does not answer: {source}")]
    NoAnswer {
        /// The address asked.
        address: SocketAddr,
        /// The I/O error.
        source: io::Error,
    },
    /// The certificate that the service should have cannot be read.
    #[error(transparent)]
    Certificate(#[from] TlsError),
    /// The answer was not 200.
    #[error("{address} is not ready: {answer}")]
    NotReady {
        /// The address asked.
        address: SocketAddr,
        /// Its status line.
        answer: String,
    },
}

/// Where a service listens, and how.
#[derive(Debug, Clone)]
pub struct Listening {
    /// Its address; an unspecified one (`0.0.0.0`, `::`) is asked on the loopback address.
    pub address: SocketAddr,
    /// The file of its certificate, when it speaks TLS.
    pub certificate: Option<PathBuf>,
}

impl Listening {
    /// Without TLS.
    pub fn plain(address: SocketAddr) -> Self {
        Self {
            address,
            certificate: None,
        }
    }
}

/// Requests `/readyz` of a service. Over TLS only the very certificate of its file is taken, whatever name and authority it has.
///
/// # Errors
/// The service does not answer within `timeout`, or answers anything but 200, or the file of its certificate cannot be read.
pub fn healthcheck(listening: &Listening, timeout: Duration) -> Result<(), HealthError> {
    let ip = match listening.address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    let address = SocketAddr::new(ip, listening.address.port());
    let tls = (listening.certificate.as_deref())
        .map(own_certificate_only)
        .transpose()?;
    let answer =
        ask(address, tls, timeout).map_err(|source| HealthError::NoAnswer { address, source })?;
    let line = answer.lines().next().unwrap_or_default();
    if line.split(' ').nth(1) == Some("200") {
        Ok(())
    } else {
        Err(HealthError::NotReady {
            address,
            answer: line.to_owned(),
        })
    }
}

fn ask(
    address: SocketAddr,
    tls: Option<Arc<ClientConfig>>,
    timeout: Duration,
) -> io::Result<String> {
    let stream = TcpStream::connect_timeout(&address, timeout)?;
    stream.set_read_timeout(Some(timeout))?;
    stream.set_write_timeout(Some(timeout))?;
    match tls {
        None => ask_over(stream, address),
        Some(config) => {
            let name = ServerName::IpAddress(address.ip().into());
            let session = ClientConnection::new(config, name).map_err(io::Error::other)?;
            ask_over(StreamOwned::new(session, stream), address)
        }
    }
}

fn ask_over(mut stream: impl Read + Write, address: SocketAddr) -> io::Result<String> {
    stream.write_all(
        format!("GET /readyz HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n").as_bytes(),
    )?;
    let mut answer = Vec::new();
    stream.take(4096).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

fn own_certificate_only(path: &Path) -> Result<Arc<ClientConfig>, TlsError> {
    let chain = tls::certificate_chain(path)?;
    let provider = tls::provider();
    let unusable = |source| TlsError::Unsupported { source };
    let mut config = ClientConfig::builder_with_provider(Arc::clone(&provider))
        .with_safe_default_protocol_versions()
        .map_err(unusable)?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(OnlyThis {
            certificate: chain.into_iter().next(),
            provider,
        }))
        .with_no_client_auth();
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(Arc::new(config))
}

/// Takes one certificate and no other: stricter than names and authorities, which a service that asks itself has no use for.
#[derive(Debug)]
struct OnlyThis {
    certificate: Option<CertificateDer<'static>>,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for OnlyThis {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        if self.certificate.as_ref() == Some(end_entity) {
            Ok(ServerCertVerified::assertion())
        } else {
            Err(CertificateError::UnknownIssuer.into())
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, cert, dss, algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, cert, dss, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        (self.provider.signature_verification_algorithms).supported_schemes()
    }
}
