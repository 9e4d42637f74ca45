//! A file that is read, wherever it is.

use std::{
    fmt, io,
    pin::Pin,
    task::{Context, Poll},
};

use tokio::{
    fs::File,
    io::{AsyncRead, ReadBuf},
};

/// A file that is read from its beginning to its end.
pub struct BlobFile {
    bytes: u64,
    content: Content,
}

enum Content {
    File(File),
    #[cfg(feature = "s3")]
    Stream(Pin<Box<dyn AsyncRead + Send>>),
}

impl BlobFile {
    /// A file on disk.
    pub(super) async fn of_disk(file: File) -> io::Result<Self> {
        Ok(Self {
            bytes: file.metadata().await?.len(),
            content: Content::File(file),
        })
    }

    /// A stream of so many bytes.
    #[cfg(feature = "s3")]
    pub(super) fn of_stream(bytes: u64, stream: impl AsyncRead + Send + 'static) -> Self {
        Self {
            bytes,
            content: Content::Stream(Box::pin(stream)),
        }
    }

    /// Its bytes in all.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl fmt::Debug for BlobFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BlobFile")
            .field("bytes", &self.bytes)
            .finish_non_exhaustive()
    }
}

impl AsyncRead for BlobFile {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match &mut self.content {
            Content::File(file) => Pin::new(file).poll_read(cx, buffer),
            #[cfg(feature = "s3")]
            Content::Stream(stream) => stream.as_mut().poll_read(cx, buffer),
        }
    }
}
