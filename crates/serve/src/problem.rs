//! Every error a caller can meet, in one table, and its two shapes: a problem document (RFC 9457) and a gRPC status.

use axum::{
    body::Body,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use tonic::{Code, metadata::MetadataValue};

use super::{graves::End, sessions::SessionError};
use darn_contract::port::{Class, Refusal};
use darn_contract::{FieldError, JsonError};

/// Media type of a problem document.
pub const MEDIA_TYPE: &str = "application/problem+json";

/// Why a request was not answered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// No scan came.
    #[error(
        "the request carries no scan; send its bytes as the body, or as the part `scan` of multipart/form-data"
    )]
    EmptyBody,
    /// The request cannot be read.
    #[error("{0}")]
    Malformed(String),
    /// No such path.
    #[error("there is nothing at this path; /openapi.json lists what there is")]
    NotFound,
    /// The path has other methods.
    #[error("this path does not take this method; the header `allow` lists those it takes")]
    MethodNotAllowed,
    /// The body stopped coming.
    #[error(
        "the body came too slowly: no pause may last longer than {seconds} s (DARN_BODY_TIMEOUT), and the whole no longer than {whole} s"
    )]
    BodyTimeout {
        /// Longest pause.
        seconds: f64,
        /// Longest time for the whole.
        whole: f64,
    },
    /// The body is larger than the limit.
    #[error("the body is larger than {limit} bytes, the limit of this service (DARN_BODY_LIMIT)")]
    TooLarge {
        /// The limit, in bytes.
        limit: usize,
    },
    /// A message of a stream is larger than the limit.
    #[error(
        "a message of the stream is larger than {limit} bytes, the limit; send the scan in several"
    )]
    MessageTooLarge {
        /// The limit, in bytes.
        limit: usize,
    },
    /// What is asked is larger than its own limit.
    #[error("the {what} larger than {limit} bytes, the limit")]
    AskedTooLarge {
        /// What is asked.
        what: Asking,
        /// The limit, in bytes.
        limit: usize,
    },
    /// No query came.
    #[error("the request carries no query; send it as {place}")]
    NoQuery {
        /// Where it belongs.
        place: &'static str,
    },
    /// The content type is none of ours.
    #[error("content type {got} is not read here; send {send}")]
    UnsupportedMediaType {
        /// What came.
        got: String,
        /// What would have been read.
        send: &'static str,
    },
    /// The body is compressed.
    #[error("content encoding `{got}` is not read here; send the body as it is")]
    ContentEncoding {
        /// What came.
        got: String,
    },
    /// Constraints or a query that make no sense with any scan.
    #[error("the {what} not valid; `errors` names every field")]
    Invalid {
        /// What is asked.
        what: Asking,
        /// Every field at fault.
        fields: Vec<FieldError>,
    },
    /// The scan was refused.
    #[error("{}", if .0.class == Class::Internal { INTERNAL } else { .0.detail.as_str() })]
    Refused(Refusal),
    /// The session is not there, or not to be had.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Too many jobs wait.
    #[error(
        "{waiting} jobs wait and {running} run, which is all this service takes (DARN_QUEUE); try again in {retry_after} s"
    )]
    QueueFull {
        /// Jobs waiting.
        waiting: usize,
        /// Jobs running.
        running: usize,
        /// Estimated seconds until there is room.
        retry_after: u64,
    },
    /// Too many bodies are being read.
    #[error(
        "{limit} requests are being received, which is all this service receives at once (DARN_UPLOADS); try again in {retry_after} s"
    )]
    UploadsFull {
        /// Bodies read at once.
        limit: usize,
        /// Seconds after which trying again makes sense.
        retry_after: u64,
    },
    /// The service shuts down.
    #[error("the service is shutting down")]
    Draining,
    /// The service is not warm yet.
    #[error("the service is still warming up")]
    WarmingUp,
    /// Waiting and running took too long.
    #[error(
        "waiting and mending took longer than {seconds} s, the limit of this service (DARN_DEADLINE)"
    )]
    Deadline {
        /// The limit.
        seconds: f64,
    },
    /// Our own fault.
    #[error("{INTERNAL}")]
    Internal,
}

/// What a request asks, as a sentence begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asking {
    /// How to mend.
    Constraints,
    /// What to search.
    Query,
}

impl std::fmt::Display for Asking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Constraints => "constraints are",
            Self::Query => "query is",
        })
    }
}

const INTERNAL: &str = "an error of the service itself; its log has it under this request id";

struct Row(StatusCode, &'static str, Code);

impl Fault {
    fn row(&self) -> Row {
        use StatusCode as S;
        match self {
            Self::EmptyBody => Row(S::BAD_REQUEST, "empty_body", Code::InvalidArgument),
            Self::Malformed(_) => Row(S::BAD_REQUEST, "malformed_request", Code::InvalidArgument),
            Self::NotFound => Row(S::NOT_FOUND, "not_found", Code::Unimplemented),
            Self::MethodNotAllowed => Row(
                S::METHOD_NOT_ALLOWED,
                "method_not_allowed",
                Code::Unimplemented,
            ),
            Self::BodyTimeout { .. } => Row(S::REQUEST_TIMEOUT, "body_timeout", Code::Aborted),
            Self::TooLarge { .. } => Row(
                S::PAYLOAD_TOO_LARGE,
                "body_too_large",
                Code::ResourceExhausted,
            ),
            Self::MessageTooLarge { .. } => Row(
                S::PAYLOAD_TOO_LARGE,
                "message_too_large",
                Code::ResourceExhausted,
            ),
            Self::AskedTooLarge { what, .. } => Row(
                S::PAYLOAD_TOO_LARGE,
                match what {
                    Asking::Constraints => "constraints_too_large",
                    Asking::Query => "query_too_large",
                },
                Code::ResourceExhausted,
            ),
            Self::NoQuery { .. } => Row(S::BAD_REQUEST, "no_query", Code::InvalidArgument),
            Self::ContentEncoding { .. } => Row(
                S::UNSUPPORTED_MEDIA_TYPE,
                "unsupported_content_encoding",
                Code::InvalidArgument,
            ),
            Self::UnsupportedMediaType { .. } => Row(
                S::UNSUPPORTED_MEDIA_TYPE,
                "unsupported_media_type",
                Code::InvalidArgument,
            ),
            Self::Invalid { what, .. } => Row(
                S::UNPROCESSABLE_ENTITY,
                match what {
                    Asking::Constraints => "invalid_constraints",
                    Asking::Query => "invalid_query",
                },
                Code::InvalidArgument,
            ),
            Self::Refused(refusal) => match refusal.class {
                Class::Malformed => Row(S::BAD_REQUEST, refusal.code, Code::InvalidArgument),
                Class::TooLarge => Row(S::PAYLOAD_TOO_LARGE, refusal.code, Code::ResourceExhausted),
                Class::Unprocessable => Row(
                    S::UNPROCESSABLE_ENTITY,
                    refusal.code,
                    Code::FailedPrecondition,
                ),
                Class::Internal => Row(S::INTERNAL_SERVER_ERROR, "internal", Code::Internal),
            },
            Self::Session(error) => of_session(error),
            Self::QueueFull { .. } => Row(S::SERVICE_UNAVAILABLE, "queue_full", Code::Unavailable),
            Self::UploadsFull { .. } => {
                Row(S::SERVICE_UNAVAILABLE, "uploads_full", Code::Unavailable)
            }
            Self::Draining => Row(S::SERVICE_UNAVAILABLE, "draining", Code::Unavailable),
            Self::WarmingUp => Row(S::SERVICE_UNAVAILABLE, "warming_up", Code::Unavailable),
            Self::Deadline { .. } => Row(
                S::GATEWAY_TIMEOUT,
                "deadline_exceeded",
                Code::DeadlineExceeded,
            ),
            Self::Internal => Row(S::INTERNAL_SERVER_ERROR, "internal", Code::Internal),
        }
    }

    /// A text that is not what is asked for.
    pub fn unread(what: Asking, error: JsonError) -> Self {
        match error {
            JsonError::Syntax { detail } => {
                Self::Malformed(format!("the {what} not JSON: {detail}"))
            }
            JsonError::Shape(field) => Self::Invalid {
                what,
                fields: vec![field],
            },
        }
    }

    /// The HTTP status.
    pub fn status(&self) -> StatusCode {
        self.row().0
    }

    /// Stable word for programs.
    pub fn code(&self) -> &'static str {
        self.row().1
    }

    fn fields(&self) -> &[FieldError] {
        match self {
            Self::Invalid { fields, .. } => fields,
            Self::Refused(refusal) if refusal.class != Class::Internal => &refusal.fields,
            _ => &[],
        }
    }

    fn retry_after(&self) -> Option<u64> {
        match self {
            Self::QueueFull { retry_after, .. } | Self::UploadsFull { retry_after, .. } => {
                Some(*retry_after)
            }
            Self::Draining | Self::WarmingUp | Self::Session(SessionError::Full { .. }) => Some(5),
            Self::Session(SessionError::Busy { .. }) => Some(1),
            _ => None,
        }
    }

    /// The problem document, under the request's id.
    pub fn document(&self, request_id: &str) -> Problem {
        let Row(status, code, _) = self.row();
        Problem {
            kind: "about:blank",
            title: status.canonical_reason().unwrap_or("Error"),
            status: status.as_u16(),
            code,
            detail: self.to_string(),
            request_id: request_id.to_owned(),
            errors: (self.fields().iter())
                .map(|field| ProblemField {
                    pointer: field.pointer.clone(),
                    detail: field.detail.clone(),
                })
                .collect(),
        }
    }

    /// The HTTP answer, whole; keeps `headers` that were set for it before, such as `allow`.
    pub fn render(&self, request_id: &str, mut headers: HeaderMap) -> Response {
        headers.remove(header::CONTENT_LENGTH);
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after() {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if matches!(self, Self::ContentEncoding { .. }) {
            // RFC 7694: what would have been read.
            headers.insert(
                header::ACCEPT_ENCODING,
                HeaderValue::from_static("identity"),
            );
        }
        let body = serde_json::to_vec(&self.document(request_id)).unwrap_or_default();
        let mut response = Response::new(Body::from(body));
        *response.status_mut() = self.status();
        *response.headers_mut() = headers;
        response
    }

    /// The gRPC status: the same code as `darn-code`, the same document as `darn-problem-bin`, cut to what fits into the headers that
    /// clients take (8 KiB and up).
    pub fn grpc(&self, request_id: &str) -> tonic::Status {
        let Row(_, code, grpc) = self.row();
        let mut status = tonic::Status::new(grpc, cut(self.to_string(), GRPC_MESSAGE));
        let document = self.document(request_id).within(GRPC_DOCUMENT);
        let metadata = status.metadata_mut();
        metadata.insert("darn-code", MetadataValue::from_static(code));
        metadata.insert_bin("darn-problem-bin", MetadataValue::from_bytes(&document));
        if let Some(seconds) = self.retry_after() {
            metadata.insert("retry-after", MetadataValue::from(seconds));
        }
        status
    }
}

/// Bytes of a gRPC status' message; percent-encoding may triple them.
const GRPC_MESSAGE: usize = 600;
/// Bytes of the document beside it; base64 adds a third.
const GRPC_DOCUMENT: usize = 3 << 10;

/// A text cut to so many bytes at most, the last of them an ellipsis.
fn cut(mut text: String, most: usize) -> String {
    const MORE: &str = "…";
    if text.len() > most {
        text.truncate(text.floor_char_boundary(most.saturating_sub(MORE.len())));
        text.push_str(MORE);
    }
    text
}

fn of_session(error: &SessionError) -> Row {
    use StatusCode as S;
    match error {
        SessionError::Unknown => Row(S::NOT_FOUND, "session_not_found", Code::NotFound),
        SessionError::Ended(end) => {
            let code = match end {
                End::Idle => "session_expired",
                End::Evicted => "session_evicted",
                End::Deleted => "session_deleted",
            };
            Row(S::GONE, code, Code::NotFound)
        }
        SessionError::Busy { .. } => Row(
            S::TOO_MANY_REQUESTS,
            "session_busy",
            Code::ResourceExhausted,
        ),
        SessionError::TooLarge { .. } => Row(
            S::PAYLOAD_TOO_LARGE,
            "session_too_large",
            Code::ResourceExhausted,
        ),
        SessionError::Full { .. } => {
            Row(S::SERVICE_UNAVAILABLE, "sessions_full", Code::Unavailable)
        }
    }
}

/// Handlers return faults bare; the outermost layer, which knows the request's id, renders them.
impl IntoResponse for Fault {
    fn into_response(self) -> Response {
        let mut response = Response::new(Body::empty());
        *response.status_mut() = self.status();
        response.extensions_mut().insert(self);
        response
    }
}

impl From<Refusal> for Fault {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

/// A problem document (RFC 9457). `type` is `about:blank`: `code` tells the kinds apart.
#[derive(Debug, Clone, Serialize)]
pub struct Problem {
    #[serde(rename = "type")]
    kind: &'static str,
    title: &'static str,
    status: u16,
    code: &'static str,
    detail: String,
    request_id: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    errors: Vec<ProblemField>,
}

impl Problem {
    /// The document as JSON of at most `most` bytes: with as many of its `errors` as fit, and a word on the others.
    fn within(mut self, most: usize) -> Vec<u8> {
        let whole = self.json();
        if whole.len() <= most {
            return whole;
        }
        self.detail = cut(self.detail, most / 4);
        let errors = std::mem::take(&mut self.errors);
        let all = errors.len();
        for error in errors {
            let detail = cut(error.detail, most / 4);
            let pointer = cut(error.pointer, most / 4);
            self.errors.push(ProblemField { pointer, detail });
            if self.json().len() > most - REST {
                self.errors.pop();
                break;
            }
        }
        let left = all - self.errors.len();
        if left > 0 {
            self.detail.push_str(&format!("; {left} more"));
        }
        self.json()
    }

    fn json(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }
}

/// Bytes kept free for the word on what was left out.
const REST: usize = 64;

#[derive(Debug, Clone, Serialize)]
struct ProblemField {
    /// Left out when what is asked is at fault as a whole.
    #[serde(skip_serializing_if = "String::is_empty")]
    pointer: String,
    detail: String,
}
