//! Files of settings: read whole, up to a limit, and read again when they change.

use std::{
    fmt, fs,
    io::{self, Read as _},
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use sha2::{Digest as _, Sha256};
use tokio::{task, time};
use tracing::{error, info};

/// How often files are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Most bytes of a file: some 5,000 keys, which are all compared with the secret of each request.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Files that say something.
pub trait WatchedSource: Send + Sync + 'static {
    /// What they say.
    type Value: Send + Sync + 'static;
    /// Why they cannot be used.
    type Error: fmt::Display + Send + 'static;
    /// What the log says when something else was read.
    const READ_AGAIN: &'static str;
    /// What the log says when files that have changed cannot be used.
    const STAYS: &'static str;

    /// Reads the files; blocks.
    ///
    /// # Errors
    /// One cannot be read.
    fn texts(&self) -> Result<Vec<Vec<u8>>, Self::Error>;

    /// What the texts say; `before` is what is replaced.
    ///
    /// # Errors
    /// They say something else.
    fn value(
        &self,
        texts: &[Vec<u8>],
        before: Option<&Self::Value>,
    ) -> Result<Self::Value, Self::Error>;
}

/// What some files say, as it was read last.
#[derive(Debug)]
pub struct Watched<S: WatchedSource> {
    source: Arc<S>,
    state: Mutex<WatchedState<S::Value>>,
}

#[derive(Debug)]
struct WatchedState<T> {
    value: Arc<T>,
    /// Digest of the texts as they were seen last, valid or not; `None` when one could not be read.
    seen: Option<[u8; 32]>,
}

impl<S: WatchedSource> Watched<S> {
    /// Reads the files; blocks.
    ///
    /// # Errors
    /// They cannot be read, or say something else.
    pub fn open(source: S) -> Result<Self, S::Error> {
        let texts = source.texts()?;
        let value = Arc::new(source.value(&texts, None)?);
        let seen = Some(digest(&texts));
        Ok(Self {
            source: Arc::new(source),
            state: Mutex::new(WatchedState { value, seen }),
        })
    }

    /// What they say.
    pub fn value(&self) -> Arc<S::Value> {
        Arc::clone(&self.lock().value)
    }

    /// Reads the files again whenever one changes; never ends. Files that cannot be used leave the value as it is, and the log says why, once.
    pub async fn watch(&self) {
        let mut tick = time::interval(LOOK_EVERY);
        loop {
            tick.tick().await;
            self.look().await;
        }
    }

    async fn look(&self) {
        let source = Arc::clone(&self.source);
        let texts = match task::spawn_blocking(move || source.texts()).await {
            Ok(Ok(texts)) => texts,
            Ok(Err(fault)) => {
                if self.lock().seen.take().is_some() {
                    error!(%fault, "{}", S::STAYS);
                }
                return;
            }
            // The runtime shuts down.
            Err(_) => return,
        };
        let digest = digest(&texts);
        if self.lock().seen == Some(digest) {
            return;
        }
        let value = self.source.value(&texts, Some(&self.value()));
        let mut state = self.lock();
        state.seen = Some(digest);
        match value {
            Ok(value) => {
                info!("{}", S::READ_AGAIN);
                state.value = Arc::new(value);
            }
            Err(fault) => error!(%fault, "{}", S::STAYS),
        }
    }

    fn lock(&self) -> MutexGuard<'_, WatchedState<S::Value>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Reads a file of settings; blocks.
///
/// # Errors
/// It cannot be read, or has more bytes than such a file may have.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut file = fs::File::open(path)?.take(MAX_FILE_BYTES + 1);
    match file.read_to_end(&mut text)? as u64 {
        0..=MAX_FILE_BYTES => Ok(text),
        _ => Err(io::Error::other(format!(
            "it has more than {MAX_FILE_BYTES} bytes"
        ))),
    }
}

fn digest(texts: &[Vec<u8>]) -> [u8; 32] {
    let mut digest = Sha256::new();
    for text in texts {
        digest.update(text.len().to_le_bytes());
        digest.update(text);
    }
    digest.finalize().into()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    /// A file with a number.
    struct NumberFile(PathBuf);

    impl WatchedSource for NumberFile {
        type Value = (u32, u32);
        type Error = String;
        const READ_AGAIN: &'static str = "number read again";
        const STAYS: &'static str = "the number stays as it is";

        fn texts(&self) -> Result<Vec<Vec<u8>>, String> {
            let text = read_file(&self.0).map_err(|error| error.to_string())?;
            Ok(vec![text])
        }

        /// The number, and the one before it.
        fn value(
            &self,
            texts: &[Vec<u8>],
            before: Option<&(u32, u32)>,
        ) -> Result<(u32, u32), String> {
            let number = String::from_utf8_lossy(&texts[0]).parse::<u32>();
            let number = number.map_err(|error| error.to_string())?;
            Ok((number, before.map_or(0, |(last, _)| *last)))
        }
    }

    #[tokio::test]
    async fn what_is_read_last_and_valid_counts() {
        let path = std::env::temp_dir().join(format!("darn-watched-{}", uuid::Uuid::new_v4()));
        assert!(Watched::open(NumberFile(path.clone())).is_err());
        fs::write(&path, "x").unwrap();
        assert!(Watched::open(NumberFile(path.clone())).is_err());
        fs::write(&path, "1").unwrap();
        let watched = Watched::open(NumberFile(path.clone())).unwrap();
        assert_eq!(*watched.value(), (1, 0));
        for (text, expected) in [("2", (2, 1)), ("x", (2, 1)), ("2", (2, 2)), ("3", (3, 2))] {
            fs::write(&path, text).unwrap();
            watched.look().await;
            assert_eq!(*watched.value(), expected, "{text}");
        }
        fs::write(&path, vec![b'1'; 2 << 20]).unwrap();
        watched.look().await;
        fs::remove_file(&path).unwrap();
        watched.look().await;
        assert_eq!(*watched.value(), (3, 2));
        fs::write(&path, "4").unwrap();
        watched.look().await;
        assert_eq!(*watched.value(), (4, 3));
        fs::remove_file(&path).unwrap();
    }
}
