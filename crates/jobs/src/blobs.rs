//! The files of the jobs: inputs, results, reports.
//!
//! A file appears whole or not at all, and is on disk before a row names it. It is deleted after no row names it. A crash between two of these
//! steps leaves a file without a row, never a row without its file; [`Blobs::unnamed`] finds such files. For many machines the files are in a
//! folder that all of them mount, or in storage that speaks S3. Callers do not know which.

mod bucket;
mod file;
mod folder;
mod name;
#[cfg(feature = "s3")]
mod objects;

use std::{
    fmt,
    path::PathBuf,
    pin::{Pin, pin},
    time::Duration,
};

use sha2::{Digest, Sha256};
use tokio::io::{AsyncRead, AsyncReadExt};

use super::error::JobError;
pub use bucket::{Bucket, InvalidBucket};
pub use file::BlobFile;
use folder::Folder;
pub use name::BlobName;
#[cfg(feature = "s3")]
use objects::Objects;

/// Bytes that are read and written at once.
const CHUNK: usize = 256 << 10;

/// Where files are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Files {
    /// In a folder, as this machine sees it.
    Folder(PathBuf),
    /// In storage that speaks S3; takes the crate's feature `s3`.
    Bucket(Bucket),
}

impl fmt::Display for Files {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(folder) => folder.display().fmt(f),
            Self::Bucket(bucket) => bucket.fmt(f),
        }
    }
}

/// The files of the jobs.
#[derive(Debug, Clone)]
pub struct Blobs {
    storage: Storage,
}

#[derive(Debug, Clone)]
enum Storage {
    Folder(Folder),
    #[cfg(feature = "s3")]
    Objects(Objects),
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
    /// Opens the files of a place: a folder is made where it is missing; a bucket must be there, and is tried.
    ///
    /// # Errors
    /// [`JobError::File`], which names the place, where it cannot be written to and read from.
    pub async fn open(files: &Files) -> Result<Self, JobError> {
        let storage = match files {
            Files::Folder(folder) => Storage::Folder(Folder::open(folder).await?),
            #[cfg(feature = "s3")]
            Files::Bucket(bucket) => Storage::Objects(Objects::open(bucket).await?),
            #[cfg(not(feature = "s3"))]
            Files::Bucket(bucket) => {
                let missing = "this program was built without the feature `s3`";
                let error = std::io::Error::new(std::io::ErrorKind::Unsupported, missing);
                return Err(JobError::file(|| format!("cannot use {bucket}"), error));
            }
        };
        Ok(Self { storage })
    }

    /// Writes a file from a stream. When this returns, the file is stored for good under its name; where it fails or is dropped, nothing is left
    /// but what [`Self::unnamed`] finds: after a crash, and where storage did what it was asked and could not say so.
    ///
    /// # Errors
    /// [`JobError::StorageFull`] where the disk is full, [`JobError::Stream`] where the stream fails.
    pub async fn put(&self, name: &BlobName, content: impl AsyncRead) -> Result<Written, JobError> {
        match &self.storage {
            Storage::Folder(folder) => folder.put(name, content).await,
            #[cfg(feature = "s3")]
            Storage::Objects(objects) => objects.put(name, content).await,
        }
    }

    /// Opens a file for reading.
    ///
    /// # Errors
    /// [`JobError::BlobMissing`] where it is not there.
    pub async fn open_blob(&self, name: &BlobName) -> Result<BlobFile, JobError> {
        match &self.storage {
            Storage::Folder(folder) => folder.open_blob(name).await,
            #[cfg(feature = "s3")]
            Storage::Objects(objects) => objects.open_blob(name).await,
        }
    }

    /// Deletes a file; one that is not there is deleted already.
    pub async fn delete(&self, name: &BlobName) -> Result<(), JobError> {
        match &self.storage {
            Storage::Folder(folder) => folder.delete(name).await,
            #[cfg(feature = "s3")]
            Storage::Objects(objects) => objects.delete(name).await,
        }
    }

    /// Like [`Self::delete`], for where nothing can be awaited: at once in a folder, by a task where the storage is elsewhere. What cannot be
    /// deleted is logged, and swept later.
    pub(crate) fn delete_soon(&self, name: &BlobName) {
        match &self.storage {
            Storage::Folder(folder) => folder.delete_now(name),
            #[cfg(feature = "s3")]
            Storage::Objects(objects) => objects.delete_soon(name),
        }
    }

    /// The whole files that are at least this old, for the caller to compare with the rows. Deletes what is left of writing that broke off
    /// at least as long ago, where the storage can list that.
    ///
    /// The age keeps files whose row another process is just writing. It is counted by the clock of the storage, which need not be this machine's.
    pub async fn unnamed(&self, age: Duration) -> Result<Vec<BlobName>, JobError> {
        match &self.storage {
            Storage::Folder(folder) => folder.unnamed(age).await,
            #[cfg(feature = "s3")]
            Storage::Objects(objects) => objects.unnamed(age).await,
        }
    }
}

/// What a file with this content would be, without writing it.
pub(crate) async fn measure(content: impl AsyncRead) -> Result<Written, JobError> {
    let content = pin!(content);
    let mut source = Source::new(content);
    let mut buffer = Vec::with_capacity(CHUNK);
    while source.read(&mut buffer).await? > 0 {
        buffer.clear();
    }
    Ok(source.written())
}

/// The stream of a file that is written, which counts and digests what it gives.
struct Source<R> {
    content: Pin<R>,
    sha256: Sha256,
    bytes: u64,
}

impl<R: std::ops::DerefMut<Target: AsyncRead>> Source<R> {
    fn new(content: Pin<R>) -> Self {
        Self {
            content,
            sha256: Sha256::new(),
            bytes: 0,
        }
    }

    /// Adds up to [`CHUNK`] bytes to the buffer, and fewer only at the end of the stream. Answers with their number.
    async fn read(&mut self, buffer: &mut Vec<u8>) -> Result<usize, JobError> {
        let before = buffer.len();
        let mut part = self.content.as_mut().take(CHUNK as u64);
        while buffer.len() - before < CHUNK {
            if part.read_buf(buffer).await.map_err(JobError::Stream)? == 0 {
                break;
            }
        }
        let read = buffer.len() - before;
        self.sha256.update(&buffer[before..]);
        self.bytes += read as u64;
        Ok(read)
    }

    fn written(self) -> Written {
        Written {
            bytes: self.bytes,
            sha256: self.sha256.finalize().into(),
        }
    }
}
