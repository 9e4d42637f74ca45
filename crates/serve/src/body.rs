//! Reads a request's body within its limits, and finds in it the scan and the parameters: constraints or a query.

use std::{collections::BTreeMap, error::Error, future::poll_fn, pin::Pin};

use axum::{
    body::{Body, HttpBody},
    extract::{
        DefaultBodyLimit, FromRequest, Multipart, Request,
        multipart::{Field, MultipartError},
    },
    http::{HeaderMap, header, request::Parts},
};
use bytes::Bytes;
use tokio::time::{Duration, Instant, timeout, timeout_at};

use super::{
    app::{App, UploadPermit},
    content_coding::ContentCoding,
    counted::{CountedBytes, counted, take},
    digest::ExpectedDigests,
    error::RequestError,
    media_types::{FORM_DATA, FORM_URLENCODED, GLB, GLTF, JSON, OBJ, OCTET_STREAM, PLY, ZIP},
    pace::{PaceLimits, TooSlow},
    parameters::{self, Parameters},
    request_limits::RequestLimits,
    scan_files::{self, ScanFiles, looks_like_a_scan},
};
use darn_contract::{Constraints, FieldError, cut};

/// Most bytes of an unwanted body that are read and dropped, as a multiple of the body limit.
const DRAIN_FACTOR: u64 = 4;
/// Longest time for which an unwanted body is read and dropped.
const DRAIN_TIME: Duration = Duration::from_secs(2);
/// The media types of a body with a scan, for an error's text.
const SCAN_BODY_MEDIA_TYPES: &str = "model/gltf-binary, model/gltf+json, model/obj, model/ply, application/zip or multipart/form-data";
/// The media types of the part `scan`, for an error's text.
const SCAN_PART_MEDIA_TYPES: &str =
    "model/gltf-binary, model/gltf+json, model/obj, model/ply or application/zip";
/// The media types that the part `scan` is read from. `application/octet-stream` is what curl declares for any file.
const SCAN_PART_READ: [&str; 6] = [GLB, GLTF, OBJ, PLY, ZIP, OCTET_STREAM];

/// A request with a scan.
#[derive(Debug)]
pub struct ScanRequest<P> {
    /// The scan's bytes; not empty. A zip when it came in several files.
    pub scan: Bytes,
    /// In how many files it came.
    pub files: ScanFiles,
    /// Checked constraints or query; `None` when the request carries none.
    pub parameters: Option<P>,
    /// Allows the request to queue its job.
    pub upload: UploadPermit,
}

impl ScanRequest<Constraints> {
    /// The same request, for a job that takes no constraints.
    ///
    /// # Errors
    /// `Invalid` when it carries some.
    pub fn without_constraints(self) -> Result<Self, RequestError> {
        if self.parameters.is_none() {
            return Ok(self);
        }
        let detail = "this request takes no constraints";
        Err(Constraints::invalid(vec![FieldError::new("", detail)]))
    }
}

/// Limits the time in which a body comes.
#[derive(Debug)]
pub struct BodyTimer {
    limits: PaceLimits,
    /// When the whole body must have come.
    end: Instant,
}

impl BodyTimer {
    /// Starts now.
    pub fn new(limits: &RequestLimits) -> Self {
        let limits = limits.pace();
        let end = Instant::now() + limits.whole();
        Self { limits, end }
    }

    /// Waits for the next piece of a body.
    ///
    /// # Errors
    /// `BodyTimeout` when this piece or the whole body takes too long.
    pub async fn next<T>(&self, piece: impl Future<Output = T>) -> Result<T, RequestError> {
        let until = self.end.min(Instant::now() + self.limits.pause);
        (timeout_at(until, piece).await).map_err(|_| self.error())
    }

    fn error(&self) -> RequestError {
        RequestError::BodyTimeout {
            seconds: self.limits.pause.as_secs_f64(),
            whole: self.limits.whole().as_secs_f64(),
            rate: self.limits.rate,
        }
    }

    /// The error of a body that broke off: its connection notices first when it comes below the rate.
    pub fn broken_off(&self, error: &axum::Error) -> RequestError {
        let mut cause: Option<&(dyn Error + 'static)> = Some(error);
        while let Some(error) = cause {
            if error.is::<TooSlow>() {
                return self.error();
            }
            cause = error.source();
        }
        RequestError::Malformed(format!("the body broke off: {error}"))
    }
}

/// How a body carries a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanBody {
    /// The body is the scan.
    Bare,
    /// The body is the scan if its first bytes say so: no media type says what it is.
    Untold,
    /// The scan is a part of multipart/form-data.
    Form,
}

impl ScanBody {
    /// Checks the first bytes of a body that is the scan.
    ///
    /// # Errors
    /// `UnsupportedMediaType` for one whose type nobody told, and that does not look like a scan.
    pub fn check_head(self, headers: &HeaderMap, head: &[u8]) -> Result<(), RequestError> {
        match self {
            Self::Untold if !head.is_empty() && !looks_like_a_scan(head) => {
                Err(unsupported(headers, SCAN_BODY_MEDIA_TYPES))
            }
            _ => Ok(()),
        }
    }
}

/// Receives a request with a scan, unless the service is full or shuts down.
///
/// # Errors
/// `UploadsFull`, `UploadShareFull`, `QueueFull` or `Draining` before the body is read, and those of reading it: `UnsupportedMediaType`,
/// `ContentEncoding`, `TooLarge`, `ParametersTooLarge`, `BodyTimeout`, `EmptyBody`, `Malformed` or `Invalid`.
pub async fn receive_scan<P: Parameters>(
    app: &App,
    request: Request,
) -> Result<ScanRequest<P>, RequestError> {
    let upload = app.upload_permit_of(&request, app.limits.body);
    receive_with(app, request, upload).await
}

/// Receives a request with a scan that becomes a durable job, whatever waits in the queue.
///
/// # Errors
/// Those of [`receive_scan`] but `QueueFull`.
pub async fn receive_job_scan<P: Parameters>(
    app: &App,
    request: Request,
) -> Result<ScanRequest<P>, RequestError> {
    let upload = app.job_upload_permit_of(&request);
    receive_with(app, request, upload).await
}

async fn receive_with<P: Parameters>(
    app: &App,
    request: Request,
    upload: Result<UploadPermit, RequestError>,
) -> Result<ScanRequest<P>, RequestError> {
    match upload {
        Ok(upload) => read_scan(request, upload, &app.limits).await,
        Err(error) => {
            discard(request, &app.limits);
            Err(error)
        }
    }
}

async fn read_scan<P: Parameters>(
    request: Request,
    upload: UploadPermit,
    limits: &RequestLimits,
) -> Result<ScanRequest<P>, RequestError> {
    let (parts, body) = request.into_parts();
    let check_headers = || {
        let kind = scan_body(&parts.headers)?;
        check_length(&parts.headers, limits.body)?;
        Ok(kind)
    };
    let (kind, bytes) = read_body(&parts, body, limits, check_headers).await?;
    let (scan, files, parameters) = match kind {
        ScanBody::Bare | ScanBody::Untold => {
            kind.check_head(&parts.headers, &bytes)?;
            let files = ScanFiles::of(&bytes);
            (bytes, files, None)
        }
        ScanBody::Form => {
            // Splitting copies the parts.
            let memory = take(&limits.memory, bytes.len())?;
            let form = split_form(&parts, bytes).await?;
            if form.files.is_empty() {
                let files = ScanFiles::of(&form.scan);
                (counted(form.scan, memory), files, form.parameters)
            } else {
                let zip = scan_files::bundle::<P>(form.scan, form.files, &limits.memory).await?;
                (zip, ScanFiles::Parts, form.parameters)
            }
        }
    };
    if scan.is_empty() {
        return Err(RequestError::EmptyBody);
    }
    Ok(ScanRequest {
        scan,
        files,
        parameters,
        upload,
    })
}

/// Reads a request without a scan, whose body is the JSON of its parameters; `None` when the body is empty.
///
/// # Errors
/// `UnsupportedMediaType`, `ContentEncoding`, `ParametersTooLarge`, `BodyTimeout`, `Malformed` or `Invalid`.
pub async fn read_parameters<P: Parameters>(
    request: Request,
    limits: &RequestLimits,
) -> Result<Option<P>, RequestError> {
    let (parts, body) = request.into_parts();
    let limits = RequestLimits {
        body: parameters::MAX_BYTES,
        ..limits.clone()
    };
    let check_headers = || {
        check_length(&parts.headers, limits.body)?;
        match essence(content_type(&parts.headers)).as_str() {
            "" => Ok(false),
            media_type if parameters::MEDIA_TYPES.contains(&media_type) => Ok(true),
            _ => Err(unsupported(&parts.headers, JSON)),
        }
    };
    let read = read_body(&parts, body, &limits, check_headers).await;
    let (is_json, text) = read.map_err(|error| match error {
        RequestError::TooLarge { limit } => RequestError::ParametersTooLarge {
            kind: P::KIND,
            limit,
        },
        error => error,
    })?;
    if text.is_empty() {
        Ok(None)
    } else if is_json {
        P::parse(&text).map(Some)
    } else {
        Err(unsupported(&parts.headers, JSON))
    }
}

/// Reads a body to its end if its headers pass `check_headers`; discards it after any error but a timeout.
async fn read_body<T>(
    parts: &Parts,
    mut body: Body,
    limits: &RequestLimits,
    check_headers: impl FnOnce() -> Result<T, RequestError>,
) -> Result<(T, Bytes), RequestError> {
    let read = async {
        let checked = check_headers()?;
        let coding = ContentCoding::of(&parts.headers)?;
        let digests = ExpectedDigests::of(&parts.headers)?;
        let bytes = read_bytes(&mut body, limits).await?;
        digests.check(&bytes).await?;
        let bytes = match coding {
            Some(coding) => coding.decode(bytes, limits).await?,
            None => bytes,
        };
        Ok((checked, bytes))
    };
    let outcome = read.await;
    if outcome
        .as_ref()
        .is_err_and(|error| !matches!(error, RequestError::BodyTimeout { .. }))
    {
        discard_body(&parts.headers, body, limits);
    }
    outcome
}

/// Reads and drops the body of a refused request, within bounds and without delaying the answer: a client that is still sending would
/// otherwise see a broken connection instead of the answer. A client that waits for `100 Continue` sends nothing to read.
pub fn discard(request: Request, limits: &RequestLimits) {
    let (parts, body) = request.into_parts();
    discard_body(&parts.headers, body, limits);
}

/// [`discard`], for a request that has been taken apart.
pub fn discard_body(headers: &HeaderMap, mut body: Body, limits: &RequestLimits) {
    if headers.contains_key(header::EXPECT) {
        return;
    }
    let limit = (limits.body as u64).saturating_mul(DRAIN_FACTOR);
    let drained = async move {
        let mut seen = 0;
        while let Some(Ok(piece)) = next_piece(&mut body).await {
            seen += piece.len() as u64;
            if seen > limit {
                return;
            }
        }
    };
    tokio::spawn(timeout(DRAIN_TIME, drained));
}

/// How a body carries a scan, by its media type.
///
/// # Errors
/// `UnsupportedMediaType`.
pub fn scan_body(headers: &HeaderMap) -> Result<ScanBody, RequestError> {
    match essence(content_type(headers)).as_str() {
        GLB | GLTF | OBJ | PLY | ZIP => Ok(ScanBody::Bare),
        "" | OCTET_STREAM | FORM_URLENCODED => Ok(ScanBody::Untold),
        FORM_DATA => Ok(ScanBody::Form),
        _ => Err(unsupported(headers, SCAN_BODY_MEDIA_TYPES)),
    }
}

fn content_type(headers: &HeaderMap) -> &str {
    headers
        .get(header::CONTENT_TYPE)
        .map_or("", |value| value.to_str().unwrap_or("(not text)"))
}

/// A media type without its parameters, in lower case.
fn essence(media_type: &str) -> String {
    let bare = media_type.split(';').next().unwrap_or_default();
    bare.trim().to_ascii_lowercase()
}

fn unsupported(headers: &HeaderMap, send: &'static str) -> RequestError {
    let got = match content_type(headers) {
        "" => "(none)".to_owned(),
        got => format!("`{}`", cut(got, 100)),
    };
    RequestError::UnsupportedMediaType { got, send }
}

/// Refuses a body that its `content-length` declares too large.
///
/// # Errors
/// `TooLarge`.
pub fn check_length(headers: &HeaderMap, limit: usize) -> Result<(), RequestError> {
    let length = (headers.get(header::CONTENT_LENGTH))
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    match length {
        Some(length) if length > limit as u64 => Err(RequestError::TooLarge { limit }),
        _ => Ok(()),
    }
}

async fn read_bytes(body: &mut Body, limits: &RequestLimits) -> Result<Bytes, RequestError> {
    let timer = BodyTimer::new(limits);
    let mut bytes = CountedBytes::new(&limits.memory)?;
    while let Some(piece) = timer.next(next_piece(body)).await? {
        let piece = piece.map_err(|error| timer.broken_off(&error))?;
        if bytes.len() + piece.len() > limits.body {
            return Err(RequestError::TooLarge { limit: limits.body });
        }
        bytes.extend(&piece)?;
    }
    Ok(bytes.freeze())
}

/// The next bytes of a body; `None` at its end.
pub async fn next_piece(body: &mut Body) -> Option<Result<Bytes, axum::Error>> {
    loop {
        match poll_fn(|cx| Pin::new(&mut *body).poll_frame(cx)).await? {
            Ok(frame) => {
                if let Ok(data) = frame.into_data() {
                    return Some(Ok(data));
                }
            }
            Err(error) => return Some(Err(error)),
        }
    }
}

/// The parts of multipart/form-data.
struct FormParts<P> {
    scan: Bytes,
    /// The files that the scan refers to, by their URIs.
    files: BTreeMap<String, Bytes>,
    parameters: Option<P>,
}

/// The error of a form that cannot be read.
pub fn malformed_form(error: &MultipartError) -> RequestError {
    RequestError::Malformed(format!("the multipart body: {}", error.body_text()))
}

/// The parts of a body of multipart/form-data, as they come.
///
/// # Errors
/// `Malformed` without a boundary.
pub async fn form_of(parts: &Parts, body: Body) -> Result<Multipart, RequestError> {
    let mut request = Request::new(body);
    *request.headers_mut() = parts.headers.clone();
    // axum's own limit is 2 MB; the service's limit is applied while the bytes come.
    DefaultBodyLimit::disable().apply(&mut request);
    (Multipart::from_request(request, &()).await).map_err(|rejection| {
        RequestError::Malformed(format!("the multipart body: {}", rejection.body_text()))
    })
}

/// The name of a part, which has a media type that is read.
///
/// # Errors
/// `Malformed` or `UnsupportedMediaType`.
pub fn check_part<P: Parameters>(field: &Field<'_>) -> Result<String, RequestError> {
    let name = field.name().unwrap_or_default().to_owned();
    let media_type = field.content_type().map(essence);
    let (expected, read): (_, &[&str]) = match name.as_str() {
        "scan" => (SCAN_PART_MEDIA_TYPES, &SCAN_PART_READ),
        part if part == P::PART => (JSON, &parameters::MEDIA_TYPES),
        part if part.is_empty() || parameters::PARTS.contains(&part) => {
            return Err(scan_files::no_such_part::<P>(part));
        }
        // A file that the scan refers to, which knows its type; [`scan_files::bundle`] looks at the scan.
        _ => ("", &[]),
    };
    let unread = |it: &String| !read.is_empty() && !read.contains(&it.as_str());
    match media_type.filter(unread) {
        Some(media_type) => Err(RequestError::UnsupportedMediaType {
            got: format!("`{}` of part `{name}`", cut(&media_type, 100)),
            send: expected,
        }),
        None => Ok(name),
    }
}

/// The error of a part that comes twice.
pub fn part_twice(name: &str) -> RequestError {
    RequestError::Malformed(format!("the part `{}` comes twice", cut(name, 100)))
}

async fn split_form<P: Parameters>(
    parts: &Parts,
    bytes: Bytes,
) -> Result<FormParts<P>, RequestError> {
    let mut form = form_of(parts, Body::from(bytes)).await?;
    let mut named: BTreeMap<String, Bytes> = BTreeMap::new();
    while let Some(field) = form.next_field().await.map_err(|it| malformed_form(&it))? {
        let name = check_part::<P>(&field)?;
        let bytes = field.bytes().await.map_err(|it| malformed_form(&it))?;
        if named.insert(name.clone(), bytes).is_some() {
            return Err(part_twice(&name));
        }
    }
    let parameters = named.remove(P::PART);
    let parameters = parameters.map(|text| P::parse(&text)).transpose()?;
    let Some(scan) = named.remove("scan") else {
        return Err(scan_files::no_scan::<P>(&named));
    };
    Ok(FormParts {
        scan,
        files: named,
        parameters,
    })
}
