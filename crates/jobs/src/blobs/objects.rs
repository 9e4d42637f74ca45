//! Files in storage that speaks S3.
//!
//! An object is there as a whole once its upload has ended, and is stored for good by then; before, nothing of it is there. The names are those
//! of a folder:
//!
//! ```text
//! s3://BUCKET/PREFIX/incoming/trial-…, clock-…   small, and deleted at once
//! s3://BUCKET/PREFIX/blobs/3f/NAME               as in a folder
//! ```
//!
//! What is left of a multipart upload whose process died has no name, and cannot be listed here: the bucket's lifecycle deletes it
//! (docs/scale.md).

mod cause;
mod upload;

use std::{
    fmt, io,
    sync::Arc,
    time::{Duration, SystemTime},
};

use futures_util::TryStreamExt as _;
use object_store::{
    BackoffConfig, ClientOptions, ObjectMeta, ObjectStore, ObjectStoreExt as _, PutPayload,
    RetryConfig,
    aws::{AmazonS3, AmazonS3Builder},
    path::Path,
};
use tokio::{io::AsyncRead, runtime::Handle, time::timeout};
use tokio_util::io::StreamReader;
use tracing::warn;
use uuid::Uuid;

use super::{BlobFile, BlobName, Bucket, Written};
use crate::error::JobError;
use cause::cause;

/// How long the storage may take for what moves few bytes, with all tries.
const PATIENCE: Duration = Duration::from_secs(20);

/// How long no byte may come, and a request may take to be sent. A body that is read may take longer in all: whoever reads it may be slow.
const SILENCE: Duration = Duration::from_secs(30);

/// How long it may take to connect.
const CONNECT: Duration = Duration::from_secs(5);

/// Tries after the first, and the time after which none begins.
const RETRIES: usize = 4;
const RETRY_FOR: Duration = Duration::from_secs(10);

/// A bucket that was tried.
#[derive(Clone)]
pub(super) struct Objects {
    store: Arc<AmazonS3>,
    prefix: Path,
    /// Runs what is left to do where nothing can be awaited.
    runtime: Handle,
}

impl Objects {
    /// Connects to a bucket, and writes, reads and deletes a small object.
    pub(super) async fn open(bucket: &Bucket) -> Result<Self, JobError> {
        let failed = |error| JobError::file(|| format!("cannot use {bucket}"), error);
        let prefix = Path::parse(bucket.prefix());
        let objects = Self {
            store: Arc::new(connect(bucket).map_err(|error| failed(cause(&error)))?),
            prefix: prefix.map_err(|error| failed(cause(&error.into())))?,
            runtime: Handle::current(),
        };
        objects.try_out().await.map_err(failed)?;
        Ok(objects)
    }

    /// # Errors
    /// As a whole upload does ([`upload`]).
    pub(super) async fn put(
        &self,
        name: &BlobName,
        content: impl AsyncRead,
    ) -> Result<Written, JobError> {
        let path = self.path(name);
        let upload = upload::put(self, &path, content);
        upload.await.map_err(|error| match error {
            upload::Failed::Stream(error) => error,
            upload::Failed::Storage(error) => {
                JobError::file(|| format!("cannot write {name}"), error)
            }
        })
    }

    pub(super) async fn open_blob(&self, name: &BlobName) -> Result<BlobFile, JobError> {
        let path = self.path(name);
        let found = within(PATIENCE, self.store.get(&path)).await;
        let found = found.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => JobError::BlobMissing(name.clone()),
            _ => JobError::file(|| format!("cannot open {name}"), error),
        })?;
        let bytes = found.meta.size;
        let stream = found.into_stream().map_err(|error| cause(&error));
        Ok(BlobFile::of_stream(bytes, StreamReader::new(stream)))
    }

    pub(super) async fn delete(&self, name: &BlobName) -> Result<(), JobError> {
        let deleted = self.delete_at(&self.path(name)).await;
        deleted.map_err(|error| JobError::file(|| format!("cannot delete {name}"), error))
    }

    /// [`Self::delete`] by a task, which ends with the runtime.
    pub(super) fn delete_soon(&self, name: &BlobName) {
        let (objects, name) = (self.clone(), name.clone());
        self.runtime.spawn(async move {
            if let Err(error) = objects.delete(&name).await {
                warn!(%name, ?error, "a file cannot be deleted");
            }
        });
    }

    pub(super) async fn unnamed(&self, age: Duration) -> Result<Vec<BlobName>, JobError> {
        let listed = async {
            // Listed, too, as times are told with other digits elsewhere.
            let clock = self.incoming("clock");
            within(PATIENCE, self.store.put(&clock, PutPayload::new())).await?;
            let found = self.list("incoming").await;
            self.delete_at(&clock).await?;
            let found = found?;
            let now = found.iter().find(|object| object.location == clock);
            let now = now.ok_or_else(|| io::Error::other("what was written is not listed"))?;
            let limit = modified(now).checked_sub(age);
            let is_old = |object: &ObjectMeta| limit.is_some_and(|limit| modified(object) <= limit);
            for object in found.iter().filter(|object| is_old(object)) {
                self.delete_at(&object.location).await?;
            }
            // Other objects are not ours to delete.
            let ours = |object: &ObjectMeta| {
                let name = BlobName::parse(object.location.filename()?).ok()?;
                (self.path(&name) == object.location).then_some(name)
            };
            let whole = self.list("blobs").await?;
            Ok(whole
                .iter()
                .filter(|it| is_old(it))
                .filter_map(ours)
                .collect())
        };
        listed.await.map_err(|error| {
            JobError::file(|| "cannot list the files of the jobs".to_owned(), error)
        })
    }

    /// Writes a small object, reads it and deletes it.
    async fn try_out(&self) -> io::Result<()> {
        let doing = |what: &'static str| {
            move |error: io::Error| io::Error::new(error.kind(), format!("{what}: {error}"))
        };
        let path = self.incoming("trial");
        let text = path.to_string();
        let written = within(PATIENCE, self.store.put(&path, text.clone().into())).await;
        written.map_err(doing("cannot write"))?;
        let read = async { self.store.get(&path).await?.bytes().await };
        let read = within(PATIENCE, read).await;
        let deleted = self.delete_at(&path).await;
        if read.map_err(doing("cannot read"))? != text {
            return Err(io::Error::other("what is read is not what was written"));
        }
        deleted.map_err(doing("cannot delete"))?;
        let listed = within(PATIENCE, self.store.list(Some(&path)).try_next()).await;
        listed.map(drop).map_err(doing("cannot list"))
    }

    /// All objects of a part. Pages come one by one, each within its time.
    async fn list(&self, part: &str) -> io::Result<Vec<ObjectMeta>> {
        let part = self.prefix.clone().join(part);
        let mut objects = Vec::new();
        let mut pages = self.store.list(Some(&part));
        while let Some(object) = within(PATIENCE, pages.try_next()).await? {
            objects.push(object);
        }
        Ok(objects)
    }

    async fn delete_at(&self, path: &Path) -> io::Result<()> {
        match within(PATIENCE, self.store.delete(path)).await {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    fn path(&self, name: &BlobName) -> Path {
        let name = name.as_str();
        let part = self.prefix.clone().join("blobs").join(&name[..2]);
        part.join(name)
    }

    fn incoming(&self, what: &str) -> Path {
        let name = format!("{what}-{}", Uuid::new_v4());
        self.prefix.clone().join("incoming").join(name)
    }
}

/// Without the store, which has secrets.
impl fmt::Debug for Objects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Objects")
            .field("prefix", &self.prefix)
            .finish_non_exhaustive()
    }
}

fn connect(bucket: &Bucket) -> object_store::Result<AmazonS3> {
    // One cryptography for all of the program; whoever was first has chosen the same.
    rustls::crypto::ring::default_provider()
        .install_default()
        .ok();
    let client = ClientOptions::new()
        .with_timeout_disabled()
        .with_connect_timeout(CONNECT)
        .with_read_timeout(SILENCE);
    let retry = RetryConfig {
        backoff: BackoffConfig::default(),
        max_retries: RETRIES,
        retry_timeout: RETRY_FOR,
    };
    let mut builder = AmazonS3Builder::new()
        .with_client_options(client)
        .with_retry(retry);
    for (name, value) in bucket.settings() {
        // The variables that other programs read are passed over.
        if let Ok(key) = name.to_ascii_lowercase().parse() {
            builder = builder.with_config(key, value);
        }
    }
    builder.with_bucket_name(bucket.name()).build()
}

/// The answer of the storage, if it comes in time.
async fn within<T>(
    time: Duration,
    answer: impl Future<Output = object_store::Result<T>>,
) -> io::Result<T> {
    match timeout(time, answer).await {
        Ok(answer) => answer.map_err(|error| cause(&error)),
        Err(_) => Err(io::Error::new(
            io::ErrorKind::TimedOut,
            format!("no answer within {time:?}"),
        )),
    }
}

fn modified(object: &ObjectMeta) -> SystemTime {
    object.last_modified.into()
}
