//! The keys of a service, which are read again when their file changes.

use std::{
    collections::HashMap,
    fmt, io,
    path::{Path, PathBuf},
    sync::Arc,
    time::SystemTime,
};

use super::{
    key_file::{Expiry, KeyEntry, KeyFile, KeyId, KeyLimits, Scope},
    key_secret::{Secret, SecretDigest},
    quota::Usage,
    watched_files::{Watched, WatchedSource, read_file},
    webhook::WebhookSecrets,
};
use darn_jobs::RunningLimits;

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
pub struct KeyRing(Watched<KeysFile>);

/// The file of the keys.
#[derive(Debug)]
struct KeysFile(PathBuf);

/// What the file says.
#[derive(Debug)]
struct Keys {
    all: Arc<[Arc<Key>]>,
    /// Most jobs that may run of each key that has such a limit.
    running_limits: Arc<RunningLimits>,
}

impl WatchedSource for KeysFile {
    type Value = Keys;
    type Error = KeyFileError;
    const READ_AGAIN: &'static str = "keys read again";
    const STAYS: &'static str = "the keys stay as they are";

    fn texts(&self) -> Result<Vec<Vec<u8>>, KeyFileError> {
        let text = read_file(&self.0).map_err(|source| KeyFileError::Unreadable {
            path: self.0.clone(),
            source,
        })?;
        Ok(vec![text])
    }

    /// Those that were among the keys before go on with what they have used.
    fn value(&self, texts: &[Vec<u8>], before: Option<&Keys>) -> Result<Keys, KeyFileError> {
        let file = KeyFile::parse(&texts.concat()).map_err(|detail| KeyFileError::Invalid {
            path: self.0.clone(),
            detail,
        })?;
        let KeyFile { defaults, keys } = file;
        let before = before.map_or(&[][..], |before| &before.all);
        let before: HashMap<&KeyId, &Arc<Usage>> =
            before.iter().map(|key| (&key.id, &key.usage)).collect();
        let keys = keys.0.into_iter().map(|entry| {
            let usage = before.get(&entry.id).copied().cloned().unwrap_or_default();
            Arc::new(Key::of(entry, defaults, usage))
        });
        let all: Arc<[Arc<Key>]> = keys.collect();
        Ok(Keys {
            running_limits: Arc::new(running_limits(&all)),
            all,
        })
    }
}

impl KeyRing {
    /// Reads the keys of a file; blocks.
    ///
    /// # Errors
    /// See [`KeyFileError`].
    pub fn open(path: &Path) -> Result<Arc<Self>, KeyFileError> {
        let watched = Watched::open(KeysFile(path.to_owned()))?;
        Ok(Arc::new(Self(watched)))
    }

    /// Reads the file again whenever it changes; never ends. A file that cannot be used leaves the keys as they are, and the log says why.
    pub async fn watch(self: Arc<Self>) {
        self.0.watch().await;
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
        Arc::clone(&self.0.value().running_limits)
    }

    fn keys(&self) -> Arc<[Arc<Key>]> {
        Arc::clone(&self.0.value().all)
    }
}

fn running_limits(keys: &[Arc<Key>]) -> RunningLimits {
    let limits = keys.iter().filter_map(|key| {
        let most = i64::try_from(key.limits.running_jobs?).unwrap_or(i64::MAX);
        Some((key.id.to_string(), most))
    });
    limits.collect()
}
