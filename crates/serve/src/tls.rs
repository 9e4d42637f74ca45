//! The certificate with which the service proves who it is, read again when its files change, and the TLS handshake of a connection.

use std::{
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
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
use sha2::{Digest as _, Sha256};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    task, time,
};
use tokio_rustls::{TlsAcceptor, server::TlsStream};
use tracing::{error, info};

/// How often the files are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Most bytes of each file; chains and keys have a few thousand.
const MAX_FILE_BYTES: u64 = 1 << 20;
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
    files: TlsFiles,
    /// Longest time of a handshake.
    handshake: Duration,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    config: Arc<ServerConfig>,
    /// The digest of the files as they were seen last, valid or not; `None` when one could not be read.
    seen: Option<[u8; 32]>,
}

/// What the two files say.
struct Texts {
    certificate: Vec<u8>,
    key: Vec<u8>,
}

impl ServedCertificate {
    /// Reads a certificate and its key. A handshake may take the time `handshake`.
    ///
    /// # Errors
    /// See [`TlsError`].
    pub async fn open(files: TlsFiles, handshake: Duration) -> Result<Arc<Self>, TlsError> {
        let texts = read(files.clone()).await?;
        let config = texts.config(&files)?;
        let seen = Some(texts.digest());
        Ok(Arc::new(Self {
            files,
            handshake,
            state: Mutex::new(State { config, seen }),
        }))
    }

    /// Reads the files again whenever one changes; never ends. Files that cannot be used, or that do not belong together because only
    /// one is new, leave the certificate as it is, and the log says why. Open connections stay.
    pub async fn watch(self: Arc<Self>) {
        let mut tick = time::interval(LOOK_EVERY);
        loop {
            tick.tick().await;
            self.look().await;
        }
    }

    async fn look(&self) {
        let texts = match read(self.files.clone()).await {
            Ok(texts) => texts,
            Err(fault) => {
                // Said once.
                if self.lock().seen.take().is_some() {
                    error!(%fault, "the certificate stays as it is");
                }
                return;
            }
        };
        let digest = texts.digest();
        if self.lock().seen == Some(digest) {
            return;
        }
        let config = texts.config(&self.files);
        let mut state = self.lock();
        state.seen = Some(digest);
        match config {
            Ok(config) => {
                info!("certificate read again");
                state.config = config;
            }
            Err(fault) => error!(%fault, "the certificate stays as it is"),
        }
    }

    /// The handshake of a connection.
    ///
    /// # Errors
    /// The peer does not speak TLS, refuses the certificate, or takes longer than a handshake may.
    pub async fn accept<S>(&self, stream: S) -> io::Result<TlsStream<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let config = Arc::clone(&self.lock().config);
        let handshake = TlsAcceptor::from(config).accept(stream);
        match time::timeout(self.handshake, handshake).await {
            Ok(outcome) => outcome,
            Err(_) => Err(io::Error::new(
                io::ErrorKind::TimedOut,
                "the handshake takes too long",
            )),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Texts {
    fn config(&self, files: &TlsFiles) -> Result<Arc<ServerConfig>, TlsError> {
        let chain = chain_of(&self.certificate, &files.certificate)?;
        let key = PrivateKeyDer::from_pem_slice(&self.key).map_err(|error| TlsError::NoKey {
            path: files.key.clone(),
            detail: error.to_string(),
        })?;
        let unusable = |source| TlsError::Unusable {
            certificate: files.certificate.clone(),
            key: files.key.clone(),
            source,
        };
        let mut config = ServerConfig::builder_with_provider(provider())
            .with_safe_default_protocol_versions()
            .map_err(unusable)?
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .map_err(unusable)?;
        config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
        Ok(Arc::new(config))
    }

    fn digest(&self) -> [u8; 32] {
        let mut digest = Sha256::new();
        digest.update(self.certificate.len().to_le_bytes());
        digest.update(&self.certificate);
        digest.update(&self.key);
        digest.finalize().into()
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
    chain_of(&read_file(path, "DARN_TLS_CERT")?, path)
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

async fn read(files: TlsFiles) -> Result<Texts, TlsError> {
    let path = files.certificate.clone();
    let reading = task::spawn_blocking(move || {
        Ok(Texts {
            certificate: read_file(&files.certificate, "DARN_TLS_CERT")?,
            key: read_file(&files.key, "DARN_TLS_KEY")?,
        })
    });
    reading.await.unwrap_or_else(|error| {
        Err(TlsError::Unreadable {
            path,
            setting: "DARN_TLS_CERT",
            source: io::Error::other(error),
        })
    })
}

fn read_file(path: &Path, setting: &'static str) -> Result<Vec<u8>, TlsError> {
    let read = || {
        let mut text = Vec::new();
        let mut file = fs::File::open(path)?.take(MAX_FILE_BYTES + 1);
        match file.read_to_end(&mut text)? as u64 {
            0..=MAX_FILE_BYTES => Ok(text),
            _ => Err(io::Error::other(format!(
                "it has more than {MAX_FILE_BYTES} bytes"
            ))),
        }
    };
    read().map_err(|source| TlsError::Unreadable {
        path: path.to_owned(),
        setting,
        source,
    })
}
