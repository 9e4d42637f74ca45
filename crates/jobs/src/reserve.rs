//! Space held back on the disk of an SQLite database, so that jobs can be ended, cancelled and deleted when the disk is full: even a deletion
//! writes to the database's log before it frees anything.

use std::path::{Path, PathBuf};

use tokio::{fs, io::AsyncWriteExt};
use tracing::warn;

/// Bytes held back: room for about a hundred changes, more than the log needs until it starts over.
const BYTES: usize = 8 << 20;

/// The file that holds the space.
#[derive(Debug)]
pub(crate) struct Reserve {
    path: PathBuf,
}

impl Reserve {
    pub(crate) fn new(folder: &Path) -> Self {
        Self {
            path: folder.join("reserve"),
        }
    }

    /// Gives the space back to the disk.
    pub(crate) async fn release(&self) {
        match fs::remove_file(&self.path).await {
            Ok(()) => warn!("the disk is full; the reserve for deletions is used"),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => warn!(%error, "the reserve for deletions cannot be used"),
        }
    }

    /// Takes the space where it is not held. Without room for it nothing is taken.
    pub(crate) async fn restore(&self) {
        let held = fs::metadata(&self.path).await;
        if held.is_ok_and(|held| held.len() == BYTES as u64) {
            return;
        }
        if let Err(error) = self.take().await {
            warn!(%error, "no space for the reserve for deletions");
            self.release_quietly().await;
        }
    }

    async fn take(&self) -> std::io::Result<()> {
        let mut file = fs::File::create(&self.path).await?;
        // Written, not only sized: a hole in a file takes no space.
        let block = vec![0x55; 1 << 20];
        for _ in 0..BYTES / block.len() {
            file.write_all(&block).await?;
        }
        file.sync_all().await
    }

    async fn release_quietly(&self) {
        // It is as small as the disk allowed; the next try begins anew.
        let _ = fs::remove_file(&self.path).await;
    }
}
