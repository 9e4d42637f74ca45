//! The files of jobs as answers.

use std::{
    pin::Pin,
    task::{Context, Poll, ready},
};

use axum::{
    body::Body,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use darn_jobs::{Jobs, blobs::BlobFile};
use hyper::body::Frame;
use tokio::{
    io::{AsyncRead as _, AsyncReadExt as _, ReadBuf},
    task,
};
use tracing::error;
use uuid::Uuid;

use super::{
    accept::preferred,
    app::App,
    counted::take,
    entity_tag,
    error::RequestError,
    job_message::kept_answer,
    media_types::{JSON, MULTIPART_MIXED},
};

/// Bytes that are read from a file at once.
const PIECE_BYTES: usize = 64 << 10;

/// The result of a job with the headers of the synchronous answer; with its report where the caller prefers multipart/mixed.
///
/// # Errors
/// `NoSuchJob`, `JobUnfinished`, `JobWrongState` or `JobExpired`; `MemoryFull` with the report.
pub async fn result(
    app: &App,
    jobs: &Jobs,
    id: Uuid,
    headers: &HeaderMap,
) -> Result<Response, RequestError> {
    let (job, file) = jobs.result(id).await?;
    let answer = kept_answer(&job).ok_or(RequestError::Internal)?;
    if preferred(headers, &[answer.media_type(), MULTIPART_MIXED]) != MULTIPART_MIXED {
        let answer = answer.headers();
        let tag = answer.get(header::ETAG).and_then(|tag| tag.to_str().ok());
        if tag.is_some_and(|tag| entity_tag::is_known(headers, tag)) {
            return Ok((StatusCode::NOT_MODIFIED, not_modified(answer)).into_response());
        }
        return Ok(alone(file, answer));
    }
    let (_, report) = jobs.report(id).await?;
    // Once as they are read, once in the answer.
    let bytes = 2 * (file.bytes() + report.bytes());
    let memory = take(
        &app.limits.memory,
        usize::try_from(bytes).unwrap_or(usize::MAX),
    )?;
    let (scan, report) = (read(file).await?, read(report).await?);
    let rendered = task::spawn_blocking(move || {
        let response = answer.with_report(scan, report);
        drop(memory);
        response
    });
    rendered.await.map_err(|_| RequestError::Internal)
}

/// The report of a job.
///
/// # Errors
/// `NoSuchJob`, `JobUnfinished`, `JobWrongState` or `JobExpired`.
pub async fn report(jobs: &Jobs, id: Uuid) -> Result<Response, RequestError> {
    let (_, file) = jobs.report(id).await?;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(JSON)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    Ok(alone(file, HeaderMap::from_iter(headers)))
}

/// What is said of a file that is not sent, as the caller has it (RFC 9110, section 15.4.5).
fn not_modified(mut headers: HeaderMap) -> HeaderMap {
    headers.remove(header::CONTENT_TYPE);
    headers
}

fn alone(file: BlobFile, mut headers: HeaderMap) -> Response {
    headers.insert(header::CONTENT_LENGTH, file.bytes().into());
    (headers, Body::new(FileBody { file })).into_response()
}

async fn read(mut file: BlobFile) -> Result<Vec<u8>, RequestError> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).await.map_err(unreadable)?;
    Ok(bytes)
}

fn unreadable(error: std::io::Error) -> RequestError {
    error!(%error, "a file of a job cannot be read");
    RequestError::Internal
}

/// A file that is read as it is sent. It does not tell its length, since what tells one counts as memory that is held; the header does.
struct FileBody {
    file: BlobFile,
}

impl hyper::body::Body for FileBody {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, std::io::Error>>> {
        let mut piece = vec![0; PIECE_BYTES];
        let mut buffer = ReadBuf::new(&mut piece);
        if let Err(error) = ready!(Pin::new(&mut self.file).poll_read(cx, &mut buffer)) {
            return Poll::Ready(Some(Err(error)));
        }
        let read = buffer.filled().len();
        if read == 0 {
            return Poll::Ready(None);
        }
        piece.truncate(read);
        Poll::Ready(Some(Ok(Frame::data(piece.into()))))
    }
}
