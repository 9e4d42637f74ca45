//! The files of the jobs: inputs, results, reports.
//!
//! A file appears whole or not at all, and is on disk before a row names it: it is written under a temporary name, synced, renamed, and its
//! folder is synced. It is deleted after no row names it. A crash between two of these steps leaves a file without a row, never a row without
//! its file; [`Blobs::unnamed`] finds such files. For many machines the folder is on storage that all of them mount.
//!
//! ```text
//! FOLDER/incoming/NAME      being written
//! FOLDER/blobs/3f/NAME      whole; the folder is the first two digits of the job's id
//! ```

mod name;

use std::{
    io,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use sha2::{Digest, Sha256};
use tokio::{
    fs::{self, File},
    io::{AsyncRead, AsyncReadExt, AsyncWriteExt},
    task::spawn_blocking,
};
use uuid::Uuid;

use super::error::JobError;
pub use name::BlobName;

/// Bytes that are read and written at once.
const CHUNK: usize = 256 << 10;

/// A folder of files.
#[derive(Debug, Clone)]
pub struct Blobs {
    whole: PathBuf,
    incoming: PathBuf,
}

/// What is known of a file that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Its bytes.
    pub bytes: u64,
    /// Its SHA-256.
    pub sha256: [u8; 32],
}

impl Blobs {
    /// Opens the files of a folder, which is made where it is missing.
    pub async fn open(folder: &Path) -> Result<Self, JobError> {
        let whole = folder.join("blobs");
        let incoming = folder.join("incoming");
        let made = {
            let (whole, incoming) = (whole.clone(), incoming.clone());
            in_background(move || {
                std::fs::create_dir_all(&incoming)?;
                for first in 0..=u8::MAX {
                    std::fs::create_dir_all(whole.join(format!("{first:02x}")))?;
                }
                sync_folder(&whole)?;
                sync_folder(whole.parent().unwrap_or(&whole))
            })
        };
        made.await.map_err(|error| {
            JobError::file(|| format!("cannot make {}", folder.display()), error)
        })?;
        Ok(Self { whole, incoming })
    }

    /// Writes a file from a stream. When this returns, the file is on disk under its name; where it fails or is dropped, nothing is left but,
    /// after a crash, what [`Self::unnamed`] finds.
    ///
    /// # Errors
    /// [`JobError::StorageFull`] where the disk is full, [`JobError::Stream`] where the stream fails.
    pub async fn put(&self, name: &BlobName, content: impl AsyncRead) -> Result<Written, JobError> {
        // Two writers of one name do not meet.
        let temporary = Temporary {
            path: self.incoming.join(format!("{name}-{}", Uuid::new_v4())),
        };
        let written = copy_to_disk(&temporary.path, content).await?;
        let whole = self.path(name);
        in_background(move || {
            std::fs::rename(&temporary.path, &whole)?;
            sync_folder(whole.parent().unwrap_or(&whole))
        })
        .await
        .map_err(|error| JobError::file(|| format!("cannot rename {name}"), error))?;
        Ok(written)
    }

    /// Opens a file for reading.
    ///
    /// # Errors
    /// [`JobError::BlobMissing`] where it is not there.
    pub async fn open_blob(&self, name: &BlobName) -> Result<File, JobError> {
        File::open(self.path(name))
            .await
            .map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => JobError::BlobMissing(name.clone()),
                _ => JobError::file(|| format!("cannot open {name}"), error),
            })
    }

    /// Deletes a file; one that is not there is deleted already.
    pub async fn delete(&self, name: &BlobName) -> Result<(), JobError> {
        match fs::remove_file(self.path(name)).await {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(JobError::file(|| format!("cannot delete {name}"), error))
            }
            _ => Ok(()),
        }
    }

    /// Like [`Self::delete`], for where nothing can be awaited.
    pub(crate) fn delete_now(&self, name: &BlobName) -> io::Result<()> {
        remove_if_there(&self.path(name))
    }

    /// The whole files that are at least this old, for the caller to compare with the rows. Deletes what is left of writing that broke off
    /// at least as long ago.
    ///
    /// The age keeps files whose row another process is just writing. It is counted by the clock of the storage, which need not be this machine's.
    pub async fn unnamed(&self, age: Duration) -> Result<Vec<BlobName>, JobError> {
        let blobs = self.clone();
        in_background(move || {
            let limit = blobs.storage_time()?.checked_sub(age);
            let is_old = |entry: &std::fs::DirEntry| -> io::Result<bool> {
                match entry.metadata().and_then(|metadata| metadata.modified()) {
                    Ok(modified) => Ok(limit.is_some_and(|limit| modified <= limit)),
                    // Deleted or renamed since the folder was listed.
                    Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
                    Err(error) => Err(error),
                }
            };
            for entry in std::fs::read_dir(&blobs.incoming)? {
                let entry = entry?;
                if is_old(&entry)? {
                    remove_if_there(&entry.path())?;
                }
            }
            let mut old = Vec::new();
            for folder in std::fs::read_dir(&blobs.whole)? {
                for entry in std::fs::read_dir(folder?.path())? {
                    let entry = entry?;
                    // Other files are not ours to delete.
                    let name = entry.file_name().into_string().ok();
                    if let Some(name) = name.and_then(|name| BlobName::parse(&name).ok())
                        && is_old(&entry)?
                    {
                        old.push(name);
                    }
                }
            }
            Ok(old)
        })
        .await
        .map_err(|error| JobError::file(|| "cannot list the files of the jobs".to_owned(), error))
    }

    /// The time by the clock of the storage: that of a file just made.
    fn storage_time(&self) -> io::Result<SystemTime> {
        let path = self.incoming.join(format!("clock-{}", Uuid::new_v4()));
        let time = std::fs::File::create_new(&path)
            .and_then(|file| file.metadata())
            .and_then(|metadata| metadata.modified());
        remove_if_there(&path)?;
        time
    }

    fn path(&self, name: &BlobName) -> PathBuf {
        let name = name.as_str();
        self.whole.join(&name[..2]).join(name)
    }
}

/// A file that is deleted when it is dropped.
struct Temporary {
    path: PathBuf,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // What cannot be deleted is swept later.
        let _ = std::fs::remove_file(&self.path);
    }
}

async fn copy_to_disk(path: &Path, content: impl AsyncRead) -> Result<Written, JobError> {
    let failed = |error| JobError::file(|| format!("cannot write {}", path.display()), error);
    let mut content = std::pin::pin!(content);
    let mut file = File::create_new(path).await.map_err(failed)?;
    let mut sha256 = Sha256::new();
    let mut bytes = 0;
    let mut chunk = Vec::with_capacity(CHUNK);
    loop {
        chunk.clear();
        let mut part = (&mut content).take(CHUNK as u64);
        while chunk.len() < CHUNK {
            if part.read_buf(&mut chunk).await.map_err(JobError::Stream)? == 0 {
                break;
            }
        }
        if chunk.is_empty() {
            break;
        }
        sha256.update(&chunk);
        bytes += chunk.len() as u64;
        file.write_all(&chunk).await.map_err(failed)?;
    }
    file.flush().await.map_err(failed)?;
    file.sync_all().await.map_err(failed)?;
    Ok(Written {
        bytes,
        sha256: sha256.finalize().into(),
    })
}

/// Makes names that were added to a folder or taken from it last. Where the system has no such call, its file system does it by itself.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) {
        std::fs::File::open(folder)?.sync_all()?;
    }
    Ok(())
}

fn remove_if_there(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

async fn in_background<T: Send + 'static>(
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> io::Result<T> {
    spawn_blocking(work).await.map_err(io::Error::other)?
}
