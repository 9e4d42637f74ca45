//! Successful answers: what was mended, alone or with its report in multipart/mixed, and JSON.
//!
//! Answers grow with the scan, so they are written by the job that computes them, on a worker; an async thread only sends their bytes.

use axum::{
    body::Body,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{
    digest::{self, REPR_DIGEST},
    entity_tag,
    media_types::{GLB, JSON, MULTIPART_MIXED, OCTET_STREAM},
    telemetry::Metrics,
};
use darn_contract::port::{Mended, PatchForm, Patches, Stripped};
use darn_contract::{Outcome, v1};

/// How many holes were filled.
pub const HOLES_FILLED: HeaderName = HeaderName::from_static("darn-holes-filled");
/// How it went, without reading the report: `filled=3 skipped=1 doubtful=0`. Skipped are holes that should have been filled and could not be; doubtful
/// are patches that are no plausible cloth and were applied because the request accepts them.
pub const RESULT: HeaderName = HeaderName::from_static("darn-result");
/// How many boundary loops were left as they were.
pub const LOOPS_SKIPPED: HeaderName = HeaderName::from_static("darn-loops-skipped");
/// Largest distance between the cloth and an anchor, those of gestures included, in the scene's unit; absent without anchors.
pub const ANCHOR_DISTANCE: HeaderName = HeaderName::from_static("darn-anchor-distance");

/// Whether a stripped scan has its bytes from before the first mend (`exact`), or only its patches were taken out of what it is now (`structural`).
pub const STRIP: HeaderName = HeaderName::from_static("darn-strip");

/// Keeps caches from storing an answer whose content changes.
const NO_STORE: (HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// A message as JSON; to be called on a worker. Messages of the contract have text keys only, so writing one does not fail.
pub fn json(message: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(message).unwrap_or_default()
}

/// An answer of JSON already written.
pub fn json_response(text: Vec<u8>) -> Response {
    let headers = [(header::CONTENT_TYPE, JSON), NO_STORE];
    (headers, text).into_response()
}

/// An answer of what was mended, the whole scan or patches, and its report.
#[derive(Debug)]
pub struct MendResponse {
    /// Name of its part in multipart/mixed.
    part: &'static str,
    media_type: &'static str,
    bytes: Vec<u8>,
    report: v1::Report,
}

impl From<Mended> for MendResponse {
    fn from(mended: Mended) -> Self {
        Self {
            part: "scan",
            media_type: mended.media_type,
            bytes: mended.bytes,
            report: mended.report,
        }
    }
}

impl MendResponse {
    /// Patches in the given form.
    pub fn of_patches(patches: Patches, form: PatchForm) -> Self {
        Self {
            part: "patches",
            media_type: match form {
                PatchForm::Glb => GLB,
                PatchForm::Positions => OCTET_STREAM,
            },
            bytes: patches.bytes,
            report: patches.report,
        }
    }

    /// Counts the mend and writes its answer in the media type that the caller prefers: with its report when that is multipart/mixed,
    /// else alone; to be called on a worker.
    pub fn render(self, preferred: &str, metrics: &Metrics) -> Response {
        metrics.mended(&self.report);
        let headers = report_headers(&self.report);
        let report = (preferred == MULTIPART_MIXED).then(|| json(&self.report));
        let file = FilePart {
            name: self.part,
            media_type: self.media_type.to_owned(),
            bytes: self.bytes,
        };
        file.render(report, headers)
    }

    /// Counts the mend and takes it apart, for a job that keeps it; to be called on a worker.
    pub fn keep(self, metrics: &Metrics) -> KeptMend {
        metrics.mended(&self.report);
        let digest = digest::of(&self.bytes).map(|value| (REPR_DIGEST, value));
        let headers = report_headers(&self.report);
        KeptMend {
            answer: KeptAnswer::new(
                self.media_type,
                headers
                    .into_iter()
                    .chain(digest.map(|(name, value)| (Some(name), value))),
            ),
            bytes: self.bytes,
            report: json(&self.report),
        }
    }
}

/// A mend taken apart.
#[derive(Debug)]
pub struct KeptMend {
    /// What goes with its scan in an answer.
    pub answer: KeptAnswer,
    /// The mended scan.
    pub bytes: Vec<u8>,
    /// The report, as JSON.
    pub report: Vec<u8>,
}

impl KeptMend {
    /// The answer in the media type that the caller prefers, as [`MendResponse::render`] writes it; to be called on a worker.
    pub fn render(&self, preferred: &str) -> Response {
        match preferred {
            MULTIPART_MIXED => self
                .answer
                .with_report(self.bytes.clone(), self.report.clone()),
            _ => (self.answer.headers(), Body::from(self.bytes.clone())).into_response(),
        }
    }
}

/// What goes with a mended scan in an answer, as it is kept with a job.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct KeptAnswer {
    media_type: String,
    headers: Vec<(String, String)>,
}

impl KeptAnswer {
    fn new(
        media_type: &str,
        headers: impl Iterator<Item = (Option<HeaderName>, HeaderValue)>,
    ) -> Self {
        let texts = headers.filter_map(|(name, value)| {
            let value = value.to_str().ok()?.to_owned();
            Some((name?.as_str().to_owned(), value))
        });
        Self {
            media_type: media_type.to_owned(),
            headers: texts.collect(),
        }
    }

    /// The scan's media type.
    pub fn media_type(&self) -> &str {
        &self.media_type
    }

    /// How the mend went; see [`RESULT`].
    pub fn result(&self) -> Option<&str> {
        let found = self
            .headers
            .iter()
            .find(|(name, _)| RESULT == name.as_str());
        found.map(|(_, value)| value.as_str())
    }

    /// The headers of an answer of the scan alone.
    pub fn headers(&self) -> HeaderMap {
        let texts = self.headers.iter().filter_map(|(name, value)| {
            let name = HeaderName::try_from(name.as_str()).ok()?;
            Some((name, HeaderValue::try_from(value.as_str()).ok()?))
        });
        let mut headers: HeaderMap = texts.collect();
        headers.extend(
            HeaderValue::try_from(self.media_type.as_str())
                .map(|value| (header::CONTENT_TYPE, value)),
        );
        headers.insert(NO_STORE.0, HeaderValue::from_static(NO_STORE.1));
        let tag = headers.get(REPR_DIGEST).and_then(entity_tag::of_digest);
        headers.extend(tag.map(|tag| (header::ETAG, tag)));
        headers
    }

    /// An answer of the scan with its report, in multipart/mixed; to be called on a thread that may block.
    pub fn with_report(&self, bytes: Vec<u8>, report: Vec<u8>) -> Response {
        let mut headers = self.headers();
        for replaced in [
            header::CONTENT_TYPE,
            header::CACHE_CONTROL,
            header::ETAG,
            REPR_DIGEST,
        ] {
            headers.remove(replaced);
        }
        let file = FilePart {
            name: "scan",
            media_type: self.media_type.clone(),
            bytes,
        };
        file.render(Some(report), headers)
    }
}

/// The answer of a stripped scan in the media type that the caller prefers, as [`MendResponse::render`] writes it; to be called on a worker.
pub fn stripped(stripped: Stripped, preferred: &str) -> Response {
    let how = if stripped.report.exact {
        "exact"
    } else {
        "structural"
    };
    let headers = HeaderMap::from_iter([(STRIP, HeaderValue::from_static(how))]);
    let report = (preferred == MULTIPART_MIXED).then(|| json(&stripped.report));
    let file = FilePart {
        name: "scan",
        media_type: stripped.media_type.to_owned(),
        bytes: stripped.bytes,
    };
    file.render(report, headers)
}

/// The answer of patches as a drag shows them.
pub fn draft(bytes: Vec<u8>) -> Response {
    let headers = [(header::CONTENT_TYPE, OCTET_STREAM), NO_STORE];
    (headers, bytes).into_response()
}

/// A file to answer with.
struct FilePart {
    /// Name of its part in multipart/mixed.
    name: &'static str,
    media_type: String,
    bytes: Vec<u8>,
}

impl FilePart {
    /// The file after a report in multipart/mixed, or alone.
    fn render(self, report: Option<Vec<u8>>, mut headers: HeaderMap) -> Response {
        let (media_type, body) = match report {
            Some(report) => self.multipart(&report),
            None => (self.media_type, self.bytes),
        };
        let digest = digest::of(&body);
        // Each multipart answer has a boundary of its own.
        let tag = match media_type.starts_with(MULTIPART_MIXED) {
            true => None,
            false => digest.as_ref().and_then(entity_tag::of_digest),
        };
        headers.extend(digest.map(|value| (REPR_DIGEST, value)));
        headers.extend(tag.map(|value| (header::ETAG, value)));
        let media_type = [(header::CONTENT_TYPE, media_type)];
        let body = Body::from(body);
        (StatusCode::OK, media_type, [NO_STORE], headers, body).into_response()
    }

    fn multipart(self, report: &[u8]) -> (String, Vec<u8>) {
        let boundary = format!("darn-{}", Uuid::new_v4().simple());
        let mut body = Vec::with_capacity(self.bytes.len() + report.len() + 512);
        for (name, media_type, bytes) in [
            ("report", JSON, report),
            (self.name, &self.media_type, &self.bytes),
        ] {
            let head = format!(
                "--{boundary}\r\ncontent-disposition: attachment; name=\"{name}\"\r\ncontent-type: {media_type}\r\ncontent-length: {}\r\n\r\n",
                bytes.len()
            );
            body.extend_from_slice(head.as_bytes());
            body.extend_from_slice(bytes);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
        (format!("{MULTIPART_MIXED}; boundary={boundary}"), body)
    }
}

/// The header that says how it went.
pub fn result_header(outcome: &Outcome) -> Option<(HeaderName, HeaderValue)> {
    let value = HeaderValue::try_from(outcome.to_string()).ok()?;
    Some((RESULT, value))
}

fn report_headers(report: &v1::Report) -> HeaderMap {
    let mut headers = HeaderMap::from_iter([
        (HOLES_FILLED, HeaderValue::from(report.holes.len())),
        (LOOPS_SKIPPED, HeaderValue::from(report.skipped.len())),
    ]);
    headers.extend(result_header(&Outcome::of(report)));
    let distances = report.holes.iter().flat_map(|hole| {
        let anchors = hole.anchors.iter().map(|anchor| anchor.distance);
        anchors.chain(hole.edits.iter().map(|edit| edit.distance))
    });
    let largest = distances.reduce(f64::max);
    if let Some(value) = largest.and_then(|d| HeaderValue::try_from(d.to_string()).ok()) {
        headers.insert(ANCHOR_DISTANCE, value);
    }
    headers
}
