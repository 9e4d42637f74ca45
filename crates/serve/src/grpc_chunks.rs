//! Scans over gRPC: streams of chunks, in and out.

use std::{
    pin::Pin,
    task::{Context, Poll},
};

use bytes::Bytes;
use tonic::{
    Code, Status, Streaming,
    codegen::tokio_stream::Stream,
    metadata::{MetadataMap, MetadataValue},
};

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

/// Says in an answer's metadata how a mend went, as the header `darn-result` does over HTTP.
pub fn insert_result(metadata: &mut MetadataMap, result: &str) {
    if let Ok(value) = MetadataValue::try_from(result) {
        metadata.insert("darn-result", value);
    }
}

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

/// The chunks of a call, within the limits of a body.
#[derive(Debug)]
pub struct Chunks<C> {
    stream: Streaming<C>,
    timer: BodyTimer,
    place: ChunkPlace,
    limit: usize,
    seen: usize,
}

impl<C: DataChunk> Chunks<C> {
    /// Those of a stream.
    pub fn new(app: &App, stream: Streaming<C>) -> Self {
        Self {
            stream,
            timer: BodyTimer::new(&app.limits),
            place: ChunkPlace::First,
            limit: app.limits.body,
            seen: 0,
        }
    }

    /// The next one, with its place.
    ///
    /// # Errors
    /// `TooLarge`, `MessageTooLarge`, `BodyTimeout` or `Malformed`.
    pub async fn next(&mut self) -> Result<Option<(C, ChunkPlace)>, RequestError> {
        let chunk = self.timer.next(self.stream.message()).await?;
        let Some(chunk) = chunk.map_err(|status| stream_error(&status))? else {
            return Ok(None);
        };
        self.seen = self.seen.saturating_add(chunk.data().len());
        if self.seen > self.limit {
            return Err(RequestError::TooLarge { limit: self.limit });
        }
        let place = std::mem::replace(&mut self.place, ChunkPlace::Later);
        Ok(Some((chunk, place)))
    }
}

/// Reads the chunks of a call; answers with the scan, and gives each chunk to `read` for what it has beside that.
///
/// # Errors
/// Those of the chunks and of `read`; `EmptyBody`, `MemoryFull`.
pub async fn collect<C: DataChunk>(
    app: &App,
    stream: Streaming<C>,
    mut read: impl FnMut(&mut C, ChunkPlace) -> Result<(), RequestError>,
) -> Result<Bytes, RequestError> {
    let mut chunks = Chunks::new(app, stream);
    let mut scan = CountedBytes::new(&app.limits.memory)?;
    while let Some((mut chunk, place)) = chunks.next().await? {
        read(&mut chunk, place)?;
        scan.extend(chunk.data())?;
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
