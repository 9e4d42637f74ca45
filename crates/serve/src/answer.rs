//! The shapes of what went well: cloth alone, cloth and report as parts, JSON; and which of them a caller wants.

use axum::{
    body::Body,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use uuid::Uuid;

use darn_contract::port::{Mended, PatchForm, Patches};
use darn_contract::v1;

/// How many holes were filled, as a header beside the cloth.
pub const HOLES_FILLED: HeaderName = HeaderName::from_static("darn-holes-filled");
/// How many loops were left as they were.
pub const LOOPS_SKIPPED: HeaderName = HeaderName::from_static("darn-loops-skipped");
/// Largest distance between the cloth and an anchor, those of gestures included; only when there are some.
pub const ANCHOR_DISTANCE: HeaderName = HeaderName::from_static("darn-anchor-distance");

/// Media type of a binary glTF.
pub const GLB: &str = "model/gltf-binary";
/// Media type of a glTF as JSON.
pub const GLTF: &str = "model/gltf+json";
/// Media type of bare bytes.
pub const OCTETS: &str = "application/octet-stream";
/// Media type of cloth and report in one answer.
pub const PARTS: &str = "multipart/mixed";
/// Media type of JSON.
pub const JSON: &str = "application/json";

/// The media type a caller would have most of those on offer (RFC 9110, 12.5.1), among equals the one named first; the first on
/// offer when none is named.
pub fn preferred<'o>(headers: &HeaderMap, offered: &[&'o str]) -> &'o str {
    let mut best = (0.0, offered.first().copied().unwrap_or_default());
    let accepted = headers.get_all(header::ACCEPT).iter();
    for range in accepted
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
    {
        let mut parameters = range.split(';').map(str::trim);
        let media = parameters.next().unwrap_or_default();
        let weight = parameters
            .find_map(|parameter| parameter.strip_prefix("q=")?.parse().ok())
            .unwrap_or(1.0);
        let named = (offered.iter()).find(|offer| offer.eq_ignore_ascii_case(media));
        if let Some(offer) = named
            && weight > best.0
        {
            best = (weight, offer);
        }
    }
    best.1
}

/// A message as JSON. Messages of the contract have text keys only, so writing one does not fail.
pub fn json(message: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(message).unwrap_or_default()
}

/// JSON already written, of something that changes.
pub fn json_response(text: Vec<u8>) -> Response {
    let headers = [(header::CONTENT_TYPE, JSON), UNSTORED];
    (headers, text).into_response()
}

/// What a cache is told of something that changes.
const UNSTORED: (HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// Cloth, and what was done to it.
#[derive(Debug)]
pub struct Cloth {
    /// What it is, as the name of its part.
    name: &'static str,
    media: &'static str,
    bytes: Vec<u8>,
    report: v1::Report,
}

impl From<Mended> for Cloth {
    fn from(mended: Mended) -> Self {
        let is_binary = mended.bytes.starts_with(b"glTF");
        Self {
            name: "scan",
            media: if is_binary { GLB } else { GLTF },
            bytes: mended.bytes,
            report: mended.report,
        }
    }
}

impl Cloth {
    /// Patches in a form.
    pub fn of_patches(patches: Patches, form: PatchForm) -> Self {
        Self {
            name: "patches",
            media: match form {
                PatchForm::Glb => GLB,
                PatchForm::Positions => OCTETS,
            },
            bytes: patches.bytes,
            report: patches.report,
        }
    }

    /// The answer as a caller would have it: with its report when that is `PARTS`, else alone.
    pub fn response(self, wanted: &str) -> Response {
        let headers = headers(&self.report);
        let (media, body) = if wanted == PARTS {
            self.parts()
        } else {
            (self.media.to_owned(), self.bytes)
        };
        let media = [(header::CONTENT_TYPE, media)];
        (StatusCode::OK, media, [UNSTORED], headers, Body::from(body)).into_response()
    }

    fn parts(self) -> (String, Vec<u8>) {
        let boundary = format!("darn-{}", Uuid::new_v4().simple());
        let report = json(&self.report);
        let mut body = Vec::with_capacity(self.bytes.len() + report.len() + 512);
        for (name, media, bytes) in [
            ("report", JSON, &report),
            (self.name, self.media, &self.bytes),
        ] {
            let head = format!(
                "--{boundary}\r\ncontent-disposition: attachment; name=\"{name}\"\r\ncontent-type: {media}\r\ncontent-length: {}\r\n\r\n",
                bytes.len()
            );
            body.extend_from_slice(head.as_bytes());
            body.extend_from_slice(bytes);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
        (format!("{PARTS}; boundary={boundary}"), body)
    }
}

fn headers(report: &v1::Report) -> HeaderMap {
    let mut headers = HeaderMap::from_iter([
        (HOLES_FILLED, HeaderValue::from(report.holes.len())),
        (LOOPS_SKIPPED, HeaderValue::from(report.skipped.len())),
    ]);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weightiest_media_type_on_offer_wins() {
        let offered = [JSON, GLB, PARTS];
        for (accept, wanted) in [
            ("", JSON),
            ("*/*", JSON),
            ("text/html", JSON),
            ("Model/GLTF-binary", GLB),
            ("model/gltf-binary, application/json", GLB),
            (
                "application/json; q=0.5, multipart/mixed;boundary=x;q=0.8",
                PARTS,
            ),
            ("model/gltf-binary;q=0", JSON),
            ("model/gltf-binary;q=NaN", JSON),
        ] {
            let headers = HeaderMap::from_iter([(header::ACCEPT, accept.parse().unwrap())]);
            assert_eq!(preferred(&headers, &offered), wanted, "{accept}");
        }
        assert_eq!(preferred(&HeaderMap::new(), &offered), JSON);
    }
}
