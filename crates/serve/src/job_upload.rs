//! Receives the scan of a job straight into its file, so that a large one takes no memory while it comes.
//!
//! Two kinds are read into memory first, as for a request that is answered at once: compressed bodies, and the further files of a scan that comes in several.

use std::collections::{BTreeMap, BTreeSet};

use axum::{
    body::Body,
    extract::{Request, multipart::Field},
    http::request::Parts,
};
use bytes::Bytes;
use darn_jobs::ReceivedInput;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, duplex},
    try_join,
};
use tokio_util::io::ReaderStream;

use super::{
    app::{App, UploadPermit},
    body::{
        self, BodyTimer, ScanBody, ScanRequest, check_length, check_part, discard_body, form_of,
        malformed_form, next_piece, scan_body,
    },
    content_coding::ContentCoding,
    counted::{CountedBytes, take},
    digest::{ExpectedDigests, RunningDigests},
    error::RequestError,
    job_input::{Inlet, JobInput},
    job_request::KeptConstraints,
    parameters::{self, Parameters},
    request_limits::RequestLimits,
    scan_files::{self, ScanFiles},
};

/// Bytes on their way from the connection to the file.
const PIPE_BYTES: usize = 256 << 10;
/// Bytes at the start of a scan by which its kind is told.
const HEAD_BYTES: usize = 4 << 10;
/// Memory of an upload: two pipes, and the pieces that are read and written.
const UPLOAD_BYTES: usize = 4 * PIPE_BYTES;

/// A scan that has been received for a job.
#[derive(Debug)]
pub struct JobUpload {
    /// Its file, or its digest.
    pub input: JobInput,
    /// In how many files it came.
    pub files: ScanFiles,
    /// The constraints that came with it.
    pub constraints: Option<KeptConstraints>,
    /// Its place among uploads.
    pub permit: UploadPermit,
}

/// What came, apart from the place among uploads.
type Taken = (JobInput, ScanFiles, Option<KeptConstraints>);

/// Receives a request with a scan that becomes a job, whatever waits in the queue.
///
/// # Errors
/// `UploadsFull`, `UploadShareFull` or `Draining` before the body is read, and those of reading it; `StorageFull`.
pub async fn receive(
    app: &App,
    inlet: Inlet<'_>,
    request: Request,
) -> Result<JobUpload, RequestError> {
    let is_plain = matches!(ContentCoding::of(request.headers()), Ok(None));
    // What is not stored cannot be read back when its further files have come.
    let may_need_memory = matches!(inlet, Inlet::Compare(_))
        && matches!(scan_body(request.headers()), Ok(ScanBody::Form));
    if !is_plain || may_need_memory {
        let ScanRequest {
            scan,
            files,
            parameters,
            upload,
        } = body::receive_job_scan::<KeptConstraints>(app, request).await?;
        return Ok(JobUpload {
            input: inlet.take(&scan[..]).await?,
            files,
            constraints: parameters,
            permit: upload,
        });
    }
    let permit = match app.job_upload_permit_of(&request) {
        Ok(permit) => permit,
        Err(error) => {
            body::discard(request, &app.limits);
            return Err(error);
        }
    };
    let (parts, mut body) = request.into_parts();
    let taken = take_in(&app.limits, inlet, &parts, &mut body).await;
    if taken
        .as_ref()
        .is_err_and(|error| !matches!(error, RequestError::BodyTimeout { .. }))
    {
        discard_body(&parts.headers, body, &app.limits);
    }
    let (input, files, constraints) = taken?;
    Ok(JobUpload {
        input,
        files,
        constraints,
        permit,
    })
}

async fn take_in(
    limits: &RequestLimits,
    inlet: Inlet<'_>,
    parts: &Parts,
    body: &mut Body,
) -> Result<Taken, RequestError> {
    let kind = scan_body(&parts.headers)?;
    check_length(&parts.headers, limits.body)?;
    let pieces = BodyPieces {
        timer: BodyTimer::new(limits),
        digests: ExpectedDigests::of(&parts.headers)?.begin(),
        limit: limits.body,
        seen: 0,
        body,
    };
    let _memory = take(&limits.memory, UPLOAD_BYTES)?;
    let (writer, reader) = duplex(PIPE_BYTES);
    let taken = async {
        match kind {
            ScanBody::Form => form(limits, inlet, parts, reader).await,
            ScanBody::Bare | ScanBody::Untold => bare(inlet, parts, kind, reader).await,
        }
    };
    let ((), (input, files, constraints)) = try_join!(feed(pieces, writer), taken)?;
    if input.bytes() == 0 {
        return Err(RequestError::EmptyBody);
    }
    Ok((input, files, constraints))
}

/// A body that is the scan.
async fn bare(
    inlet: Inlet<'_>,
    parts: &Parts,
    kind: ScanBody,
    mut reader: DuplexStream,
) -> Result<Taken, RequestError> {
    let mut head = Vec::new();
    let mut first = (&mut reader).take(HEAD_BYTES as u64);
    let read = first.read_to_end(&mut head).await;
    // A pipe does not fail.
    read.map_err(|_| RequestError::Internal)?;
    kind.check_head(&parts.headers, &head)?;
    let input = inlet.take(head.as_slice().chain(reader)).await?;
    Ok((input, ScanFiles::of(&head), None))
}

/// A body of multipart/form-data.
async fn form(
    limits: &RequestLimits,
    inlet: Inlet<'_>,
    parts: &Parts,
    reader: DuplexStream,
) -> Result<Taken, RequestError> {
    let mut form = form_of(parts, Body::from_stream(ReaderStream::new(reader))).await?;
    let (mut scan, mut constraints) = (None, None);
    let mut files: BTreeMap<String, Bytes> = BTreeMap::new();
    let mut names = BTreeSet::new();
    while let Some(field) = form.next_field().await.map_err(|it| malformed_form(&it))? {
        let name = check_part::<KeptConstraints>(&field)?;
        if !names.insert(name.clone()) {
            return Err(body::part_twice(&name));
        }
        if name == "scan" {
            let mut head = Vec::new();
            let pieces = FieldPieces {
                field,
                head: &mut head,
            };
            let input = take_pieces(inlet, pieces).await?;
            scan = Some((input, ScanFiles::of(&head)));
            continue;
        }
        let bytes = read_field(field, &name, limits).await?;
        if name == KeptConstraints::PART {
            constraints = Some(KeptConstraints::parse(&bytes)?);
        } else {
            files.insert(name, bytes);
        }
    }
    let Some((input, kind)) = scan else {
        return Err(scan_files::no_scan::<KeptConstraints>(&files));
    };
    if files.is_empty() || input.bytes() == 0 {
        return Ok((input, kind, constraints));
    }
    // A scan that is compared is not taken in here when it comes in a form.
    let JobInput::Stored(stored) = &input else {
        return Err(RequestError::Internal);
    };
    let scan = read_back(stored, limits).await?;
    let zip = scan_files::bundle::<KeptConstraints>(scan, files, &limits.memory).await?;
    drop(input);
    Ok((inlet.take(&zip[..]).await?, ScanFiles::Parts, constraints))
}

async fn read_field(
    mut field: Field<'_>,
    name: &str,
    limits: &RequestLimits,
) -> Result<Bytes, RequestError> {
    let mut bytes = CountedBytes::new(&limits.memory)?;
    while let Some(piece) = field.chunk().await.map_err(|it| malformed_form(&it))? {
        bytes.extend(&piece)?;
        // Beyond their limit they are refused by it, whatever their length.
        if name == KeptConstraints::PART && bytes.len() > parameters::MAX_BYTES {
            break;
        }
    }
    Ok(bytes.freeze())
}

async fn read_back(input: &ReceivedInput, limits: &RequestLimits) -> Result<Bytes, RequestError> {
    let mut file = input.open().await?;
    let mut scan = CountedBytes::new(&limits.memory)?;
    let mut piece = vec![0; PIPE_BYTES];
    loop {
        let read = file.read(&mut piece).await.map_err(|error| {
            tracing::error!(%error, "the input of a job cannot be read");
            RequestError::Internal
        })?;
        if read == 0 {
            return Ok(scan.freeze());
        }
        scan.extend(&piece[..read])?;
    }
}

/// What comes in pieces.
pub trait Pieces: Send {
    /// The next one; `None` at the end.
    ///
    /// # Errors
    /// It does not come, or may not be.
    fn next(&mut self) -> impl Future<Output = Result<Option<Bytes>, RequestError>> + Send;
}

/// Takes what comes in pieces as the input of a job.
///
/// # Errors
/// Those of the pieces; `StorageFull`.
pub async fn take_pieces(inlet: Inlet<'_>, pieces: impl Pieces) -> Result<JobInput, RequestError> {
    let (writer, reader) = duplex(PIPE_BYTES);
    let ((), input) = try_join!(feed(pieces, writer), inlet.take(reader))?;
    Ok(input)
}

/// Hands pieces on to whoever reads. What that one does not want, such as the bytes after a form's last line, is read nevertheless.
async fn feed(mut pieces: impl Pieces, writer: DuplexStream) -> Result<(), RequestError> {
    let mut writer = Some(writer);
    while let Some(piece) = pieces.next().await? {
        if let Some(open) = &mut writer
            && open.write_all(&piece).await.is_err()
        {
            writer = None;
        }
    }
    Ok(())
}

/// A request's body, within its limits and with the digests that it is said to have.
struct BodyPieces<'a> {
    body: &'a mut Body,
    timer: BodyTimer,
    digests: RunningDigests,
    limit: usize,
    seen: usize,
}

impl Pieces for BodyPieces<'_> {
    async fn next(&mut self) -> Result<Option<Bytes>, RequestError> {
        let Some(piece) = self.timer.next(next_piece(self.body)).await? else {
            self.digests.check()?;
            return Ok(None);
        };
        let piece = piece.map_err(|error| self.timer.broken_off(&error))?;
        self.seen += piece.len();
        if self.seen > self.limit {
            return Err(RequestError::TooLarge { limit: self.limit });
        }
        self.digests.update(&piece);
        Ok(Some(piece))
    }
}

/// A part of a form.
struct FieldPieces<'a> {
    field: Field<'a>,
    /// Its first bytes, some of them at least.
    head: &'a mut Vec<u8>,
}

impl Pieces for FieldPieces<'_> {
    async fn next(&mut self) -> Result<Option<Bytes>, RequestError> {
        let piece = self.field.chunk().await.map_err(|it| malformed_form(&it))?;
        if let Some(piece) = &piece {
            let wanted = HEAD_BYTES.saturating_sub(self.head.len()).min(piece.len());
            self.head.extend_from_slice(&piece[..wanted]);
        }
        Ok(piece)
    }
}
