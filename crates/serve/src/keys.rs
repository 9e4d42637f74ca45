//! The keys of a service, which are read again when their file changes.

use std::{
    collections::HashMap,
    fmt, fs, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, SystemTime},
};

use tokio::{task, time};
use tracing::{error, info};

use super::{
    key_file::{Expiry, KeyEntry, KeyFile, KeyId, KeyLimits, Scope},
    key_secret::{Secret, SecretDigest},
    quota::Usage,
    webhook::WebhookSecrets,
};
use darn_jobs::RunningLimits;

/// How often the file is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Most bytes of the file: some 5,000 keys, which are all compared with the secret of each request.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Why a file of keys cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KeyFileError {
    /// It cannot be read.
    #[error("the keys in {} cannot be read: {source} (DARN_KEYS)", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// It says something else than keys.
    #[error("the keys in {} are not valid (DARN_KEYS): {detail}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column.
        detail: String,
    },
}

/// Why a secret is not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyRefusal {
    /// No key has it.
    Unknown,
    /// Its key has expired.
    Expired,
}

/// A key. It stays as it was for the requests that came with it, also when the file changes meanwhile.
pub struct Key {
    /// Its name.
    pub id: KeyId,
    /// What it may take.
    pub limits: KeyLimits,
    /// From when on it is refused.
    pub expires: Option<Expiry>,
    /// What signs the webhooks of its jobs; empty: the secret of the service.
    pub webhook_secrets: WebhookSecrets,
    /// What it has used of its limits.
    pub usage: Arc<Usage>,
    digest: SecretDigest,
    scopes: Vec<Scope>,
}

impl Key {
    fn of(entry: KeyEntry, defaults: KeyLimits, usage: Arc<Usage>) -> Self {
        Self {
            usage,
            limits: entry.limits.unwrap_or_default().or(defaults),
            digest: entry.sha256.0,
            scopes: entry.scopes,
            expires: entry.expires,
            webhook_secrets: entry.webhook_secrets,
            id: entry.id,
        }
    }

    /// Whether it may do something.
    pub fn has(&self, scope: Scope) -> bool {
        self.scopes.contains(&scope)
    }

    /// What it may do.
    pub fn scopes(&self) -> &[Scope] {
        &self.scopes
    }

    fn has_expired(&self, now: SystemTime) -> bool {
        self.expires.is_some_and(|expires| expires.time() <= now)
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Key")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}

/// All keys of a service.
#[derive(Debug)]
pub struct KeyRing {
    path: PathBuf,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    keys: Arc<[Arc<Key>]>,
    /// Most jobs that may run of each key that has such a limit.
    running_limits: Arc<RunningLimits>,
    /// The file as it was seen last, valid or not; `None` when it could not be read.
    seen: Option<Vec<u8>>,
}

impl KeyRing {
    /// Reads the keys of a file.
    ///
    /// # Errors
    /// See [`KeyFileError`].
    pub async fn open(path: &Path) -> Result<Arc<Self>, KeyFileError> {
        let text = read(path.to_owned()).await?;
        let keys = keys_of(path, &text, &[])?;
        let running_limits = Arc::new(running_limits(&keys));
        Ok(Arc::new(Self {
            path: path.to_owned(),
            state: Mutex::new(State {
                keys,
                running_limits,
                seen: Some(text),
            }),
        }))
    }

    /// Reads the file again whenever it changes; never ends. A file that cannot be used leaves the keys as they are, and the log says why.
    pub async fn watch(self: Arc<Self>) {
        let mut tick = time::interval(LOOK_EVERY);
        loop {
            tick.tick().await;
            self.look().await;
        }
    }

    async fn look(&self) {
        let text = match read(self.path.clone()).await {
            Ok(text) => text,
            Err(fault) => {
                // Said once.
                if self.lock().seen.take().is_some() {
                    error!(%fault, "the keys stay as they are");
                }
                return;
            }
        };
        if self.lock().seen.as_ref() == Some(&text) {
            return;
        }
        let keys = keys_of(&self.path, &text, &self.keys());
        let mut state = self.lock();
        state.seen = Some(text);
        match keys {
            Ok(keys) => {
                info!(keys = keys.len(), "keys read again");
                state.running_limits = Arc::new(running_limits(&keys));
                state.keys = keys;
            }
            Err(fault) => error!(%fault, "the keys stay as they are"),
        }
    }

    /// The key of a secret. Every key is compared, so that the time tells nothing about them.
    ///
    /// # Errors
    /// The secret is unknown, or its key has expired.
    pub fn identify(&self, secret: &Secret, now: SystemTime) -> Result<Arc<Key>, KeyRefusal> {
        let digest = secret.digest();
        let mut found = None;
        for key in self.keys().iter() {
            if key.digest.is(&digest) {
                found = Some(Arc::clone(key));
            }
        }
        match found {
            None => Err(KeyRefusal::Unknown),
            Some(key) if key.has_expired(now) => Err(KeyRefusal::Expired),
            Some(key) => Ok(key),
        }
    }

    /// The key of an id, unless it has expired.
    pub fn find(&self, id: &KeyId, now: SystemTime) -> Option<Arc<Key>> {
        let keys = self.keys();
        let found = keys.iter().find(|key| key.id == *id)?;
        (!found.has_expired(now)).then(|| Arc::clone(found))
    }

    /// Whether a key that was taken before is still there, with the same secret, and has not expired.
    pub fn is_current(&self, key: &Key, now: SystemTime) -> bool {
        let keys = self.keys();
        let same = |other: &Arc<Key>| other.id == key.id && other.digest.is(&key.digest);
        (keys.iter().find(|other| same(other))).is_some_and(|other| !other.has_expired(now))
    }

    /// Most jobs that may run of each key that has such a limit, by its id.
    pub fn running_limits(&self) -> Arc<RunningLimits> {
        Arc::clone(&self.lock().running_limits)
    }

    fn keys(&self) -> Arc<[Arc<Key>]> {
        Arc::clone(&self.lock().keys)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn read(path: PathBuf) -> Result<Vec<u8>, KeyFileError> {
    let unreadable = |path: &Path, source| KeyFileError::Unreadable {
        path: path.to_owned(),
        source,
    };
    let reading = task::spawn_blocking({
        let path = path.clone();
        move || match fs::metadata(&path)?.len() {
            0..=MAX_FILE_BYTES => fs::read(&path),
            bytes => Err(io::Error::other(format!(
                "it has {bytes} bytes; the limit is {MAX_FILE_BYTES}"
            ))),
        }
    });
    let text = reading
        .await
        .unwrap_or_else(|error| Err(io::Error::other(error)));
    text.map_err(|source| unreadable(&path, source))
}

/// The keys of a text. Those that were among `before` go on with what they have used.
fn keys_of(path: &Path, text: &[u8], before: &[Arc<Key>]) -> Result<Arc<[Arc<Key>]>, KeyFileError> {
    let file = KeyFile::parse(text).map_err(|detail| KeyFileError::Invalid {
        path: path.to_owned(),
        detail,
    })?;
    let KeyFile { defaults, keys } = file;
    let before: HashMap<&KeyId, &Arc<Usage>> =
        before.iter().map(|key| (&key.id, &key.usage)).collect();
    let keys = keys.0.into_iter().map(|entry| {
        let usage = before.get(&entry.id).copied().cloned().unwrap_or_default();
        Arc::new(Key::of(entry, defaults, usage))
    });
    Ok(keys.collect())
}

fn running_limits(keys: &[Arc<Key>]) -> RunningLimits {
    let limits = keys.iter().filter_map(|key| {
        let most = i64::try_from(key.limits.running_jobs?).unwrap_or(i64::MAX);
        Some((key.id.to_string(), most))
    });
    limits.collect()
}
