//! How errors are sent: as a problem document (RFC 9457) over HTTP, and as a gRPC status that carries the same document.

use axum::{
    body::Body,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use tonic::metadata::MetadataValue;

use super::{
    error::RequestError, grpc_chunks::insert_result, media_types::PROBLEM_JSON,
    response::result_header,
};
use darn_contract::cut;

/// Most bytes of one text of an error, whatever the mender says in it.
const TEXT_BYTES: usize = 2 << 10;

/// Most bytes of a gRPC status' message; percent-encoding may triple them.
const GRPC_MESSAGE_BYTES: usize = 600;
/// Most bytes of the problem document in gRPC metadata; base64 adds a third.
const GRPC_DOCUMENT_BYTES: usize = 3 << 10;
/// Bytes kept free to say how many errors were left out.
const OMITTED_NOTE: usize = 64;

impl RequestError {
    /// The HTTP status.
    fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.code().status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }

    /// The problem document.
    pub fn document(&self, request_id: &str) -> Problem {
        let code = self.code();
        Problem {
            kind: "about:blank",
            title: self.status().canonical_reason().unwrap_or("Error"),
            status: code.status,
            code: code.word,
            detail: short(&self.to_string()),
            request_id: request_id.to_owned(),
            errors: (self.fields().iter())
                .map(|field| ProblemField {
                    pointer: short(&field.pointer),
                    detail: short(&field.detail),
                })
                .collect(),
        }
    }

    /// The complete HTTP answer; keeps `headers` that were set for it before, such as `allow`.
    pub fn render(&self, request_id: &str, mut headers: HeaderMap) -> Response {
        headers.remove(header::CONTENT_LENGTH);
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(PROBLEM_JSON));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after() {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if let Some(outcome) = self.outcome() {
            headers.extend(result_header(&outcome));
        }
        if let Some(challenge) = self.challenge() {
            headers.insert(header::WWW_AUTHENTICATE, challenge);
        }
        if matches!(self, Self::ContentEncoding { .. }) {
            // RFC 7694: the encodings that are read.
            headers.insert(
                header::ACCEPT_ENCODING,
                HeaderValue::from_static("gzip, deflate"),
            );
        }
        let body = serde_json::to_vec(&self.document(request_id)).unwrap_or_default();
        let mut response = Response::new(Body::from(body));
        *response.status_mut() = self.status();
        *response.headers_mut() = headers;
        response
    }

    /// What the header `www-authenticate` says (RFC 6750, section 3): nothing of errors to who sent no key.
    fn challenge(&self) -> Option<HeaderValue> {
        Some(match self {
            Self::KeyMissing => HeaderValue::from_static("Bearer realm=\"darn\""),
            Self::KeyUnknown => HeaderValue::from_static(
                "Bearer realm=\"darn\", error=\"invalid_token\", error_description=\"unknown key\"",
            ),
            Self::KeyExpired => HeaderValue::from_static(
                "Bearer realm=\"darn\", error=\"invalid_token\", error_description=\"expired key\"",
            ),
            Self::InsufficientScope { scope } => {
                let text = format!(
                    "Bearer realm=\"darn\", error=\"insufficient_scope\", scope=\"{scope}\""
                );
                HeaderValue::from_str(&text).ok()?
            }
            _ => return None,
        })
    }

    /// The gRPC status, with the code's word as `darn-code` and the problem document as `darn-problem-bin` in its metadata, cut so that
    /// they fit into the 8 KiB of headers that every client accepts.
    pub fn grpc(&self, request_id: &str) -> tonic::Status {
        let code = self.code();
        let mut status = tonic::Status::new(
            tonic::Code::from_i32(code.grpc as i32),
            cut(&self.to_string(), GRPC_MESSAGE_BYTES),
        );
        let document = self.document(request_id).json_within(GRPC_DOCUMENT_BYTES);
        let metadata = status.metadata_mut();
        metadata.insert("darn-code", MetadataValue::from_static(code.word));
        metadata.insert_bin("darn-problem-bin", MetadataValue::from_bytes(&document));
        if let Some(seconds) = self.retry_after() {
            metadata.insert("retry-after", MetadataValue::from(seconds));
        }
        if let Some(outcome) = self.outcome() {
            insert_result(metadata, &outcome.to_string());
        }
        status
    }
}

/// Handlers return bare errors as a response extension; the outermost layer, which knows the request's id, renders them.
impl IntoResponse for RequestError {
    fn into_response(self) -> Response {
        let mut response = Response::new(Body::empty());
        *response.status_mut() = self.status();
        response.extensions_mut().insert(self);
        response
    }
}

/// A problem document (RFC 9457). `type` is always `about:blank`: `code` identifies the kind of problem.
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
    /// The document as JSON of at most `limit` bytes: with as many of its `errors` as fit, and how many were left out.
    fn json_within(mut self, limit: usize) -> Vec<u8> {
        let whole = self.json();
        if whole.len() <= limit {
            return whole;
        }
        self.detail = cut(&self.detail, limit / 4).into_owned();
        let errors = std::mem::take(&mut self.errors);
        let all = errors.len();
        for error in errors {
            let detail = cut(&error.detail, limit / 4).into_owned();
            let pointer = cut(&error.pointer, limit / 4).into_owned();
            self.errors.push(ProblemField { pointer, detail });
            if self.json().len() > limit - OMITTED_NOTE {
                self.errors.pop();
                break;
            }
        }
        let omitted = all - self.errors.len();
        if omitted > 0 {
            self.detail.push_str(&format!("; {omitted} more"));
        }
        self.json()
    }

    fn json(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }
}

#[derive(Debug, Clone, Serialize)]
struct ProblemField {
    /// Left out when the whole of the constraints or the query is at fault.
    #[serde(skip_serializing_if = "String::is_empty")]
    pointer: String,
    detail: String,
}

fn short(text: &str) -> String {
    cut(text, TEXT_BYTES).into_owned()
}
