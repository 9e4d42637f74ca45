//! Files in a folder.
//!
//! A file is written under a temporary name, synced, renamed, and its folder is synced.
//!
//! ```text
//! FOLDER/incoming/NAME      being written
//! FOLDER/blobs/3f/NAME      whole; the folder is the first two digits of the job's id
//! ```

use std::{
    io,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use tokio::{
    fs::{self, File},
    io::{AsyncRead, AsyncWriteExt},
    task::spawn_blocking,
};
use tracing::warn;
use uuid::Uuid;

use super::{BlobFile, BlobName, CHUNK, Source, Written};
use crate::error::JobError;

/// A folder of files.
#[derive(Debug, Clone)]
pub(super) struct Folder {
    whole: PathBuf,
    incoming: PathBuf,
}

impl Folder {
    /// Opens the files of a folder, which is made where it is missing.
    pub(super) async fn open(folder: &Path) -> Result<Self, JobError> {
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

    pub(super) async fn put(
        &self,
        name: &BlobName,
        content: impl AsyncRead,
    ) -> Result<Written, JobError> {
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

    pub(super) async fn open_blob(&self, name: &BlobName) -> Result<BlobFile, JobError> {
        let opened = async { BlobFile::of_disk(File::open(self.path(name)).await?).await };
        opened.await.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => JobError::BlobMissing(name.clone()),
            _ => JobError::file(|| format!("cannot open {name}"), error),
        })
    }

    pub(super) async fn delete(&self, name: &BlobName) -> Result<(), JobError> {
        match fs::remove_file(self.path(name)).await {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(JobError::file(|| format!("cannot delete {name}"), error))
            }
            _ => Ok(()),
        }
    }

    /// [`Self::delete`] that blocks for a moment.
    pub(super) fn delete_now(&self, name: &BlobName) {
        if let Err(error) = remove_if_there(&self.path(name)) {
            warn!(%name, ?error, "a file cannot be deleted");
        }
    }

    pub(super) async fn unnamed(&self, age: Duration) -> Result<Vec<BlobName>, JobError> {
        let folder = self.clone();
        in_background(move || {
            let limit = folder.storage_time()?.checked_sub(age);
            let is_old = |entry: &std::fs::DirEntry| -> io::Result<bool> {
                match entry.metadata().and_then(|metadata| metadata.modified()) {
                    Ok(modified) => Ok(limit.is_some_and(|limit| modified <= limit)),
                    // Deleted or renamed since the folder was listed.
                    Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
                    Err(error) => Err(error),
                }
            };
            for entry in std::fs::read_dir(&folder.incoming)? {
                let entry = entry?;
                if is_old(&entry)? {
                    remove_if_there(&entry.path())?;
                }
            }
            let mut old = Vec::new();
            for part in std::fs::read_dir(&folder.whole)? {
                for entry in std::fs::read_dir(part?.path())? {
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
    let content = std::pin::pin!(content);
    let mut source = Source::new(content);
    let mut file = File::create_new(path).await.map_err(failed)?;
    let mut chunk = Vec::with_capacity(CHUNK);
    while source.read(&mut chunk).await? > 0 {
        file.write_all(&chunk).await.map_err(failed)?;
        chunk.clear();
    }
    file.flush().await.map_err(failed)?;
    file.sync_all().await.map_err(failed)?;
    Ok(source.written())
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
