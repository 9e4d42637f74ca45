//! Uploads: small files in one request, larger ones in parts, of which one is in memory at a time.

use std::{io, time::Duration};

use object_store::{MultipartUpload, ObjectStoreExt as _, PutPayload, path::Path};
use tokio::{io::AsyncRead, runtime::Handle, time::timeout};
use tracing::warn;

use super::{Objects, PATIENCE, within};
use crate::{
    blobs::{CHUNK, Source, Written},
    error::JobError,
};

/// Bytes of a part: the fewest that S3 allows. At most 10,000 parts make a file of 48 GiB.
const PART: usize = 5 << 20;

/// How long a part may take, with all tries.
const PART_PATIENCE: Duration = Duration::from_secs(60);

/// How long an upload may take. S3 counts a file's age from the beginning of its upload: one that took longer than files without a row are
/// left alone would be swept before its row is written.
const LONGEST: Duration = Duration::from_secs(30 * 60);

/// Why a file was not written.
pub(super) enum Failed {
    /// What was to be written could not be read.
    Stream(JobError),
    /// The storage.
    Storage(io::Error),
}

impl From<io::Error> for Failed {
    fn from(error: io::Error) -> Self {
        Self::Storage(error)
    }
}

/// Writes all of a stream to a path.
pub(super) async fn put(
    objects: &Objects,
    path: &Path,
    content: impl AsyncRead,
) -> Result<Written, Failed> {
    let content = std::pin::pin!(content);
    let mut source = Source::new(content);
    let whole = async {
        let first = part(&mut source).await?;
        if first.len() < PART {
            let payload = PutPayload::from(first);
            within(PART_PATIENCE, objects.store.put(path, payload)).await?;
            return Ok::<_, Failed>(());
        }
        let mut upload = Unfinished::begin(objects, path).await?;
        let mut next = first;
        while !next.is_empty() {
            upload.add(next).await?;
            next = part(&mut source).await?;
        }
        upload.complete().await?;
        Ok(())
    };
    match timeout(LONGEST, whole).await {
        Ok(done) => done?,
        Err(_) => return Err(too_long().into()),
    }
    Ok(source.written())
}

/// The next bytes: [`PART`] of them, or what is left.
async fn part<R: std::ops::DerefMut<Target: AsyncRead>>(
    source: &mut Source<R>,
) -> Result<Vec<u8>, Failed> {
    // Doubling it makes a part of it, and small files take little.
    let mut bytes = Vec::with_capacity(PART / 16);
    while bytes.len() < PART {
        if source.read(&mut bytes).await.map_err(Failed::Stream)? < CHUNK {
            break;
        }
    }
    Ok(bytes)
}

fn too_long() -> io::Error {
    let minutes = LONGEST.as_secs() / 60;
    io::Error::new(
        io::ErrorKind::TimedOut,
        format!("the upload took longer than {minutes} minutes"),
    )
}

/// An upload in parts, which is aborted when this is dropped before its end: because the stream failed, or because nobody waits any more.
struct Unfinished {
    upload: Option<Box<dyn MultipartUpload>>,
    path: Path,
    runtime: Handle,
}

impl Unfinished {
    async fn begin(objects: &Objects, path: &Path) -> io::Result<Self> {
        let upload = within(PATIENCE, objects.store.put_multipart(path)).await?;
        Ok(Self {
            upload: Some(upload),
            path: path.clone(),
            runtime: objects.runtime.clone(),
        })
    }

    async fn add(&mut self, part: Vec<u8>) -> io::Result<()> {
        match &mut self.upload {
            Some(upload) => within(PART_PATIENCE, upload.put_part(part.into())).await,
            None => Ok(()),
        }
    }

    async fn complete(mut self) -> io::Result<()> {
        if let Some(upload) = &mut self.upload {
            within(PART_PATIENCE, upload.complete()).await?;
        }
        self.upload = None;
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let Some(mut upload) = self.upload.take() else {
            return;
        };
        let path = self.path.clone();
        self.runtime.spawn(async move {
            // The bucket's lifecycle deletes what is left then.
            if let Err(error) = within(PATIENCE, upload.abort()).await {
                warn!(%path, %error, "an upload cannot be aborted");
            }
        });
    }
}
