//! The certificate with which the service proves who it is, read again when its files change, and the TLS handshake of a connection.

use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use rustls::{
    ServerConfig,
    crypto::{CryptoProvider, ring},
    pki_types::{
        CertificateDer, PrivateKeyDer,
        pem::{self, PemObject},
    },
};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    time,
};
use tokio_rustls::{TlsAcceptor, server::TlsStream};

use super::watched_files::{Watched, WatchedSource, read_file};

/// The protocols offered, the preferred one first (RFC 7301).
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// Why a certificate cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file cannot be read.
    #[error("{} cannot be read: {source} ({setting})", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The setting that names it.
        setting: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// A file has no certificate, or one that is broken.
    #[error("{} has no certificate chain in PEM: {detail} (DARN_TLS_CERT)", .path.display())]
    NoCertificate {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        detail: String,
    },
    /// A file has no private key that can be read.
    #[error(
        "{} has no private key in PEM (PKCS #8, SEC 1 or PKCS #1, not encrypted): {detail} (DARN_TLS_KEY)",
        .path.display()
    )]
    NoKey {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        detail: String,
    },
    /// The cryptography has no protocol version.
    #[error("TLS cannot be spoken: {source}")]
    Unsupported {
        /// Why not.
        source: rustls::Error,
    },
    /// Certificate and key do not serve together.
    #[error("the certificate in {} cannot be served with the key in {}: {source}", .certificate.display(), .key.display())]
    Unusable {
        /// The file of the certificate.
        certificate: PathBuf,
        /// The file of the key.
        key: PathBuf,
        /// Why not.
        source: rustls::Error,
    },
}

/// The two files of a certificate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// The certificate and those that lead from it to its authority, in PEM.
    pub certificate: PathBuf,
    /// Its private key, in PEM.
    pub key: PathBuf,
}

/// The certificate of the service.
#[derive(Debug)]
pub struct ServedCertificate {
    config: Watched<TlsFiles>,
    /// Longest time of a handshake.
    handshake: Duration,
}

impl WatchedSource for TlsFiles {
    type Value = ServerConfig;
    type Error = TlsError;
    const READ_AGAIN: &'static str = "certificate read again";
    const STAYS: &'static str = "the certificate stays as it is";

    fn texts(&self) -> Result<Vec<Vec<u8>>, TlsError> {
        Ok(vec![
            read(&self.certificate, "DARN_TLS_CERT")?,
            read(&self.key, "DARN_TLS_KEY")?,
        ])
    }

    fn value(&self, texts: &[Vec<u8>], _: Option<&ServerConfig>) -> Result<ServerConfig, TlsError> {
        let text = |k: usize| texts.get(k).map_or(&[][..], Vec::as_slice);
        let chain = chain_of(text(0), &self.certificate)?;
        let key = PrivateKeyDer::from_pem_slice(text(1)).map_err(|error| TlsError::NoKey {
            path: self.key.clone(),
            detail: error.to_string(),
        })?;
        let unusable = |source| TlsError::Unusable {
            certificate: self.certificate.clone(),
            key: self.key.clone(),
            source,
        };
        let mut config = ServerConfig::builder_with_provider(provider())
            .with_safe_default_protocol_versions()
            .map_err(unusable)?
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .map_err(unusable)?;
        config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
        Ok(config)
    }
}

impl ServedCertificate {
    /// Reads a certificate and its key; blocks. A handshake may take the time `handshake`.
    ///
    /// # Errors
    /// See [`TlsError`].
    pub fn open(files: TlsFiles, handshake: Duration) -> Result<Arc<Self>, TlsError> {
        let config = Watched::open(files)?;
        Ok(Arc::new(Self { config, handshake }))
    }

    /// Reads the files again whenever one changes; never ends. Files that cannot be used, or that do not belong together because only
    /// one is new, leave the certificate as it is, and the log says why. Open connections stay.
    pub async fn watch(self: Arc<Self>) {
        self.config.watch().await;
    }

    /// The handshake of a connection.
    ///
    /// # Errors
    /// The peer does not speak TLS, refuses the certificate, or takes longer than a handshake may.
    pub async fn accept<S>(&self, stream: S) -> io::Result<TlsStream<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let handshake = TlsAcceptor::from(self.config.value()).accept(stream);
        match time::timeout(self.handshake, handshake).await {
            Ok(outcome) => outcome,
            Err(_) => Err(io::Error::new(
                io::ErrorKind::TimedOut,
                "the handshake takes too long",
            )),
        }
    }
}

/// The cryptography of every connection.
pub fn provider() -> Arc<CryptoProvider> {
    Arc::new(ring::default_provider())
}

/// The certificates of a file, the service's own first.
///
/// # Errors
/// `Unreadable` or `NoCertificate`.
pub fn certificate_chain(path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    chain_of(&read(path, "DARN_TLS_CERT")?, path)
}

fn chain_of(text: &[u8], path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let broken = |detail: String| TlsError::NoCertificate {
        path: path.to_owned(),
        detail,
    };
    let chain: Result<Vec<_>, pem::Error> = CertificateDer::pem_slice_iter(text).collect();
    match chain {
        Ok(chain) if chain.is_empty() => Err(broken("no CERTIFICATE section".to_owned())),
        Ok(chain) => Ok(chain),
        Err(error) => Err(broken(error.to_string())),
    }
}

fn read(path: &Path, setting: &'static str) -> Result<Vec<u8>, TlsError> {
    read_file(path).map_err(|source| TlsError::Unreadable {
        path: path.to_owned(),
        setting,
        source,
    })
}
