//! Scans over gRPC: streams of chunks, in and out.

use std::{
    pin::Pin,
    task::{Context, Poll},
};

use bytes::Bytes;
use tonic::{Code, Status, Streaming, codegen::tokio_stream::Stream};

use super::{app::App, body::BodyTimer, counted::CountedBytes, error::RequestError};
use darn_contract::port::{Mended, Stripped};
use darn_contract::{
    excerpt,
    v1::{InpaintChunk, JobChunk, ScanChunk, StripChunk, inpaint_chunk::Part, strip_chunk},
};

/// Bytes of a scan per message of an answer.
pub const CHUNK_BYTES: usize = 256 << 10;
/// Most bytes of an incoming message. Decoded, its nested messages take up to 36 times as much memory: about the default body limit.
pub const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// A chunk with bytes of a scan.
pub trait DataChunk {
    /// Its bytes.
    fn data(&self) -> &Bytes;
}

impl DataChunk for ScanChunk {
    fn data(&self) -> &Bytes {
        &self.data
    }
}

impl DataChunk for JobChunk {
    fn data(&self) -> &Bytes {
        &self.data
    }
}

/// Where a chunk stands in its stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChunkPlace {
    /// It is the first one.
    First,
    /// Others came before it.
    Later,
}

impl ChunkPlace {
    /// Checks that a chunk may carry something beside the scan's bytes.
    ///
    /// # Errors
    /// `Malformed`.
    pub fn check_first(self, field: &str) -> Result<(), RequestError> {
        match self {
            Self::First => Ok(()),
            Self::Later => {
                let detail = format!("only the first chunk carries `{field}`");
                Err(RequestError::Malformed(detail))
            }
        }
    }
}

/// Reads the chunks of a call; answers with the scan, and gives each chunk to `read` for what it has beside that.
///
/// # Errors
/// `TooLarge`, `MessageTooLarge`, `BodyTimeout`, `EmptyBody`, `Malformed`, `MemoryFull`, and those of `read`.
pub async fn collect<C: DataChunk>(
    app: &App,
    mut stream: Streaming<C>,
    mut read: impl FnMut(&mut C, ChunkPlace) -> Result<(), RequestError>,
) -> Result<Bytes, RequestError> {
    let limit = app.limits.body;
    let timer = BodyTimer::new(&app.limits);
    let mut scan = CountedBytes::new(&app.limits.memory)?;
    let mut place = ChunkPlace::First;
    while let Some(mut chunk) = timer
        .next(stream.message())
        .await?
        .map_err(|status| stream_error(&status))?
    {
        read(&mut chunk, place)?;
        let data = chunk.data();
        if scan.len() + data.len() > limit {
            return Err(RequestError::TooLarge { limit });
        }
        scan.extend(data)?;
        place = ChunkPlace::Later;
    }
    if scan.len() == 0 {
        return Err(RequestError::EmptyBody);
    }
    Ok(scan.freeze())
}

fn stream_error(status: &Status) -> RequestError {
    match status.code() {
        // tonic's code for a message above its limit.
        Code::OutOfRange => RequestError::MessageTooLarge {
            limit: MAX_MESSAGE_BYTES,
        },
        _ => RequestError::Malformed(format!(
            "the stream broke off: {}",
            excerpt(status.message())
        )),
    }
}

/// A scan in chunks: the report, then the scan's bytes in order.
#[derive(Debug)]
pub struct ChunkStream<C> {
    /// The first chunk, until it is sent.
    report: Option<C>,
    scan: Bytes,
    /// Makes a chunk of bytes.
    data: fn(Bytes) -> C,
}

impl ChunkStream<InpaintChunk> {
    /// A mended scan.
    pub fn of_mended(mended: Mended) -> Self {
        Self {
            report: Some(InpaintChunk {
                part: Some(Part::Report(mended.report)),
            }),
            scan: mended.bytes.into(),
            data: |bytes| InpaintChunk {
                part: Some(Part::Data(bytes)),
            },
        }
    }
}

impl ChunkStream<StripChunk> {
    /// A stripped scan.
    pub fn of_stripped(stripped: Stripped) -> Self {
        Self {
            report: Some(StripChunk {
                part: Some(strip_chunk::Part::Report(stripped.report)),
            }),
            scan: stripped.bytes.into(),
            data: |bytes| StripChunk {
                part: Some(strip_chunk::Part::Data(bytes)),
            },
        }
    }
}

impl<C: Unpin> Stream for ChunkStream<C> {
    type Item = Result<C, Status>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let chunk = self.report.take().or_else(|| {
            let next = self.scan.len().min(CHUNK_BYTES);
            (next > 0).then(|| (self.data)(self.scan.split_to(next)))
        });
        Poll::Ready(chunk.map(Ok))
    }
}
