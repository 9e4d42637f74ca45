//! Reads a request's body: its bytes within the limit, then the scan in them and what is asked of it.

use std::{future::poll_fn, pin::Pin};

use axum::{
    body::{Body, HttpBody},
    extract::{DefaultBodyLimit, FromRequest, Multipart, Request, multipart::MultipartError},
    http::{HeaderMap, header, request::Parts},
};
use bytes::{Bytes, BytesMut};
use tokio::time::{Duration, Instant, timeout, timeout_at};

use super::{
    app::{RequestLimits, Upload},
    problem::Fault,
    question::{self, Question},
};
use darn_contract::{Constraints, FieldError};

/// Bytes of an unwanted body read on, as a multiple of the limit, so that the caller gets to see the answer.
const DRAIN_FACTOR: u64 = 4;
/// Longest time an unwanted body is read on.
const DRAIN_TIME: Duration = Duration::from_secs(2);
/// How many of the longest pauses a whole body may take.
const PAUSES: u32 = 8;
/// What the body, and its part `scan`, may be sent as; for a person.
const SCAN_MEDIA: &str = "model/gltf-binary, model/gltf+json or multipart/form-data";
const SCAN_PART_MEDIA: &str = "model/gltf-binary or model/gltf+json";
/// The same of the part, for us. `application/octet-stream` is what curl says of a file.
const SCAN_PART_MEDIA_READ: [&str; 3] = [
    "model/gltf-binary",
    "model/gltf+json",
    "application/octet-stream",
];

/// What a request carries.
#[derive(Debug)]
pub struct Asked<Q> {
    /// The scan's bytes; not empty.
    pub scan: Bytes,
    /// What is asked of it, checked; none when none came.
    pub question: Option<Q>,
    /// The right to be put into the queue.
    pub upload: Upload,
}

impl Asked<Constraints> {
    /// The same, for a job that takes no constraints.
    ///
    /// # Errors
    /// `Invalid` when some came.
    pub fn unconstrained(self) -> Result<Self, Fault> {
        if self.question.is_none() {
            return Ok(self);
        }
        let detail = "finding holes takes no constraints in this version";
        Err(Constraints::invalid(vec![FieldError::new("", detail)]))
    }
}

/// When a body must have come.
#[derive(Debug)]
pub struct Patience {
    pause: Duration,
    end: Instant,
}

impl Patience {
    /// Starts now.
    pub fn new(limits: &RequestLimits) -> Self {
        let end = Instant::now() + limits.body_pause * PAUSES;
        Self {
            pause: limits.body_pause,
            end,
        }
    }

    /// Waits for the next piece of a body.
    ///
    /// # Errors
    /// `BodyTimeout` after too long a pause, or when the whole takes too long: a trickle would hold its place for ever.
    pub async fn next<T>(&self, piece: impl Future<Output = T>) -> Result<T, Fault> {
        let until = self.end.min(Instant::now() + self.pause);
        (timeout_at(until, piece).await).map_err(|_| Fault::BodyTimeout {
            seconds: self.pause.as_secs_f64(),
            whole: (self.pause * PAUSES).as_secs_f64(),
        })
    }
}

/// The media types a scan comes in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Envelope {
    Raw,
    Multipart,
}

/// Reads a request whose headers have been accepted: a scan, and what is asked of it as the other part of multipart/form-data.
///
/// # Errors
/// `UnsupportedMediaType`, `ContentEncoding`, `TooLarge`, `AskedTooLarge`, `BodyTimeout`, `EmptyBody`, `Malformed` or
/// `Invalid`.
pub async fn asked<Q: Question>(
    request: Request,
    upload: Upload,
    limits: &RequestLimits,
) -> Result<Asked<Q>, Fault> {
    let (parts, body) = request.into_parts();
    let fits = || {
        let envelope = envelope(&parts.headers)?;
        plain(&parts.headers)?;
        announced(&parts.headers, limits.body)?;
        Ok(envelope)
    };
    let (envelope, bytes) = match whole(&parts, body, limits, fits).await {
        Ok(read) => read,
        Err(fault) => {
            drop(upload);
            return Err(fault);
        }
    };
    let (scan, question) = match envelope {
        Envelope::Raw => (bytes, None),
        Envelope::Multipart => split(parts, bytes).await?,
    };
    if scan.is_empty() {
        return Err(Fault::EmptyBody);
    }
    Ok(Asked {
        scan,
        question,
        upload,
    })
}

/// Reads a request that asks of a scan already here: its JSON is the body. None when the body is empty.
///
/// # Errors
/// `UnsupportedMediaType`, `ContentEncoding`, `AskedTooLarge`, `BodyTimeout`, `Malformed` or `Invalid`.
pub async fn question<Q: Question>(
    request: Request,
    limits: &RequestLimits,
) -> Result<Option<Q>, Fault> {
    let (parts, body) = request.into_parts();
    let limits = RequestLimits {
        body: question::LIMIT,
        ..*limits
    };
    let fits = || {
        plain(&parts.headers)?;
        announced(&parts.headers, limits.body)?;
        match essence(content_type(&parts.headers)).as_str() {
            "" => Ok(false),
            media if question::MEDIA_READ.contains(&media) => Ok(true),
            _ => Err(unsupported(&parts.headers, question::MEDIA)),
        }
    };
    let read = whole(&parts, body, &limits, fits).await;
    let (is_json, text) = read.map_err(|fault| match fault {
        Fault::TooLarge { limit } => Fault::AskedTooLarge {
            what: Q::ASKING,
            limit,
        },
        fault => fault,
    })?;
    match (text.is_empty(), is_json) {
        (true, _) => Ok(None),
        (false, true) => Q::parse(&text).map(Some),
        (false, false) => Err(unsupported(&parts.headers, question::MEDIA)),
    }
}

/// Reads a body to its end when its headers are fit for it; reads it on when it is not wanted.
async fn whole<T>(
    parts: &Parts,
    mut body: Body,
    limits: &RequestLimits,
    fits: impl FnOnce() -> Result<T, Fault>,
) -> Result<(T, Bytes), Fault> {
    let read = async {
        let headers = fits()?;
        Ok((headers, read(&mut body, limits).await?))
    };
    let outcome = read.await;
    if outcome
        .as_ref()
        .is_err_and(|fault| !matches!(fault, Fault::BodyTimeout { .. }))
    {
        refuse(&parts.headers, body, limits);
    }
    outcome
}

/// Reads an unwanted body on, within bounds and beside the answer, which does not wait for it: a caller that is still
/// sending would otherwise see a broken connection and not the answer. One that waits to be told to send is just not told.
pub fn refuse(headers: &HeaderMap, mut body: Body, limits: &RequestLimits) {
    if headers.contains_key(header::EXPECT) {
        return;
    }
    let most = (limits.body as u64).saturating_mul(DRAIN_FACTOR);
    let drained = async move {
        let mut seen = 0;
        while let Some(Ok(piece)) = piece(&mut body).await {
            seen += piece.len() as u64;
            if seen > most {
                return;
            }
        }
    };
    tokio::spawn(timeout(DRAIN_TIME, drained));
}

fn envelope(headers: &HeaderMap) -> Result<Envelope, Fault> {
    match essence(content_type(headers)).as_str() {
        "model/gltf-binary" | "model/gltf+json" => Ok(Envelope::Raw),
        "multipart/form-data" => Ok(Envelope::Multipart),
        _ => Err(unsupported(headers, SCAN_MEDIA)),
    }
}

fn content_type(headers: &HeaderMap) -> &str {
    headers
        .get(header::CONTENT_TYPE)
        .map_or("", |value| value.to_str().unwrap_or("(not text)"))
}

/// A media type without its parameters, in small letters.
fn essence(media: &str) -> String {
    let bare = media.split(';').next().unwrap_or_default();
    bare.trim().to_ascii_lowercase()
}

fn unsupported(headers: &HeaderMap, send: &'static str) -> Fault {
    let got = match content_type(headers) {
        "" => "(none)".to_owned(),
        got => format!("`{}`", cut(got, 100)),
    };
    Fault::UnsupportedMediaType { got, send }
}

/// Refuses a compressed body: it would be read as a broken scan.
fn plain(headers: &HeaderMap) -> Result<(), Fault> {
    for value in headers.get_all(header::CONTENT_ENCODING) {
        let got = value.to_str().unwrap_or("(not text)");
        let foreign = |coding: &str| {
            let coding = coding.trim();
            !coding.is_empty() && !coding.eq_ignore_ascii_case("identity")
        };
        if got.split(',').any(foreign) {
            return Err(Fault::ContentEncoding { got: cut(got, 100) });
        }
    }
    Ok(())
}

fn announced(headers: &HeaderMap, limit: usize) -> Result<(), Fault> {
    let length = (headers.get(header::CONTENT_LENGTH))
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    match length {
        Some(length) if length > limit as u64 => Err(Fault::TooLarge { limit }),
        _ => Ok(()),
    }
}

async fn read(body: &mut Body, limits: &RequestLimits) -> Result<Bytes, Fault> {
    let patience = Patience::new(limits);
    let mut bytes = BytesMut::new();
    while let Some(piece) = patience.next(piece(body)).await? {
        let piece =
            piece.map_err(|error| Fault::Malformed(format!("the body broke off: {error}")))?;
        if bytes.len() + piece.len() > limits.body {
            return Err(Fault::TooLarge { limit: limits.body });
        }
        bytes.extend_from_slice(&piece);
    }
    Ok(bytes.freeze())
}

async fn piece(body: &mut Body) -> Option<Result<Bytes, axum::Error>> {
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

async fn split<Q: Question>(parts: Parts, bytes: Bytes) -> Result<(Bytes, Option<Q>), Fault> {
    let malformed = |error: MultipartError| {
        Fault::Malformed(format!("the multipart body: {}", error.body_text()))
    };
    let mut request = Request::from_parts(parts, Body::from(bytes));
    // axum's own limit is 2 MB; ours was applied when the bytes came.
    DefaultBodyLimit::disable().apply(&mut request);
    let mut form = (Multipart::from_request(request, &()).await).map_err(|rejection| {
        Fault::Malformed(format!("the multipart body: {}", rejection.body_text()))
    })?;
    let mut scan = None;
    let mut question = None;
    while let Some(field) = form.next_field().await.map_err(malformed)? {
        let name = field.name().unwrap_or_default().to_owned();
        let media = field.content_type().map(essence);
        let (slot, send, read): (_, _, &[&str]) = match name.as_str() {
            "scan" => (&mut scan, SCAN_PART_MEDIA, &SCAN_PART_MEDIA_READ),
            part if part == Q::PART => (&mut question, question::MEDIA, &question::MEDIA_READ),
            _ => {
                return Err(Fault::Malformed(format!(
                    "there is no part `{}`; the parts are `scan` and `{}`",
                    cut(&name, 100),
                    Q::PART
                )));
            }
        };
        if let Some(media) = media.filter(|media| !read.contains(&media.as_str())) {
            return Err(Fault::UnsupportedMediaType {
                got: format!("`{}` of part `{name}`", cut(&media, 100)),
                send,
            });
        }
        if slot
            .replace(field.bytes().await.map_err(malformed)?)
            .is_some()
        {
            return Err(Fault::Malformed(format!("the part `{name}` comes twice")));
        }
    }
    let question = question.map(|text| Q::parse(&text)).transpose()?;
    Ok((scan.ok_or(Fault::EmptyBody)?, question))
}

fn cut(text: &str, most: usize) -> String {
    text.chars().take(most).collect()
}
