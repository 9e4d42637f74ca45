//! Space held back on the disk of an SQLite database, so that jobs can be ended, cancelled and deleted when the disk is full: even a deletion
//! writes to the database's log before it frees anything.
//!
//! Where a change has needed the space, nothing new is taken in until it is held again. Otherwise the next upload would fill it.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    time::Duration,
};

use tokio::{
    fs,
    io::AsyncWriteExt,
    sync::{Mutex, MutexGuard},
    time::Instant,
};
use tracing::{info, warn};

/// Bytes held back: room for hundreds of changes, and more than the log grows to before it starts over.
const BYTES: usize = 8 << 20;

/// How often it is tried to hold the space again.
const TRY_EVERY: Duration = Duration::from_secs(1);

/// The file that holds the space.
#[derive(Debug)]
pub(crate) struct Reserve {
    path: PathBuf,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    is_held: bool,
    tried_at: Option<Instant>,
}

impl Reserve {
    /// The reserve in a folder; it is held where there is space for it.
    pub(crate) async fn open(folder: &Path) -> Self {
        let reserve = Self {
            path: folder.join("reserve"),
            state: Mutex::default(),
        };
        reserve.restore(reserve.state.lock().await).await;
        reserve
    }

    /// Gives the space back to the disk, for a change that must be made.
    pub(crate) async fn release(&self) {
        let mut state = self.state.lock().await;
        if state.is_held {
            warn!("the disk is full; the space held back for deletions is used");
        }
        state.is_held = false;
        // Right after this the disk is as full as before.
        state.tried_at = Some(Instant::now());
        self.remove().await;
    }

    /// Whether the space is held. Where it is not, it is tried to hold it again, but not at once after the last try.
    pub(crate) async fn is_held(&self) -> bool {
        let state = self.state.lock().await;
        if state.is_held {
            return true;
        }
        let is_due = state
            .tried_at
            .is_none_or(|tried| tried.elapsed() >= TRY_EVERY);
        is_due && self.restore(state).await
    }

    async fn restore(&self, mut state: MutexGuard<'_, State>) -> bool {
        state.tried_at = Some(Instant::now());
        match self.take().await {
            Ok(()) => {
                info!("space is held back for deletions on a full disk");
                state.is_held = true;
            }
            Err(error) => {
                warn!(%error, "there is no space to hold back for deletions; nothing new is taken in");
                self.remove().await;
            }
        }
        state.is_held
    }

    async fn take(&self) -> std::io::Result<()> {
        if fs::metadata(&self.path)
            .await
            .is_ok_and(|held| held.len() == BYTES as u64)
        {
            return Ok(());
        }
        let mut file = fs::File::create(&self.path).await?;
        // Written, not only sized: a hole in a file takes no space.
        let block = vec![0x55; 1 << 20];
        for _ in 0..BYTES / block.len() {
            file.write_all(&block).await?;
        }
        file.flush().await?;
        file.sync_all().await
    }

    async fn remove(&self) {
        match fs::remove_file(&self.path).await {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                warn!(%error, "the space held back for deletions cannot be given up");
            }
            _ => {}
        }
    }
}
