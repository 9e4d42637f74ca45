//! Which of several media types a caller prefers: the header `Accept` (RFC 9110, section 12.5.1).
//!
//! `mediatype` parses the header. It is matched here because `headers-accept` drops the whole header for one malformed range, reads a
//! malformed weight as 1, and does not tell a refused type (`q=0`) from one that is not mentioned.

use axum::http::{HeaderMap, header};
use mediatype::{MediaType, MediaTypeList, Name, ReadParams as _, names};

/// A media range of the header, and its weight from 0 to 1.
struct WeightedRange<'h> {
    range: MediaType<'h>,
    weight: f32,
}

impl WeightedRange<'_> {
    /// How exactly the range names a media type: 1 for `*/*`, 2 for `type/*`, 3 for the type itself; `None` when it does not match.
    /// Parameters of a range, such as a charset, are ignored: no type on offer has any.
    fn precision(&self, offer: &MediaType<'_>) -> Option<u8> {
        let any = |name: Name<'_>| name == names::_STAR;
        if any(self.range.ty) && any(self.range.subty) {
            Some(1)
        } else if self.range.ty == offer.ty && any(self.range.subty) {
            Some(2)
        } else {
            (self.range.essence() == offer.essence()).then_some(3)
        }
    }
}

/// The media type on offer that the caller accepts with the greatest weight. Among equal weights a type named exactly comes before a
/// range, then the range named first, then the type offered first. When the header is absent or accepts none of them: the first on
/// offer that it does not refuse with `q=0`, or else the first.
pub fn preferred<'o>(headers: &HeaderMap, offered: &[&'o str]) -> &'o str {
    let ranges = ranges(headers);
    let mut best: Option<(Rank, &'o str)> = None;
    let mut fallback = None;
    for offer in offered {
        let Some(rank) = rank(offer, &ranges) else {
            fallback = fallback.or(Some(*offer));
            continue;
        };
        if rank.weight > 0.0 && best.as_ref().is_none_or(|(other, _)| rank.is_above(other)) {
            best = Some((rank, offer));
        }
    }
    let first = offered.first().copied().unwrap_or_default();
    best.map(|(_, offer)| offer).or(fallback).unwrap_or(first)
}

/// The ranges of all `Accept` headers in order, without those that are malformed.
fn ranges(headers: &HeaderMap) -> Vec<WeightedRange<'_>> {
    let values = headers.get_all(header::ACCEPT).iter();
    let texts = values.filter_map(|value| value.to_str().ok());
    let ranges = texts.flat_map(MediaTypeList::new).flatten();
    ranges
        .filter_map(|range| {
            let weight = match range.get_param(names::Q) {
                None => 1.0,
                Some(weight) => weight.as_str().parse().ok()?,
            };
            let is_weight = (0.0..=1.0).contains(&weight);
            is_weight.then_some(WeightedRange { range, weight })
        })
        .collect()
}

/// How much a caller wants a media type.
struct Rank {
    weight: f32,
    precision: u8,
    /// Index of the matching range in the header.
    place: usize,
}

impl Rank {
    fn is_above(&self, other: &Self) -> bool {
        let key = |rank: &Self| (rank.weight, rank.precision);
        key(self) > key(other) || key(self) == key(other) && self.place < other.place
    }
}

/// The rank that the most precise matching range gives a media type; `None` when no range matches.
fn rank(offer: &str, ranges: &[WeightedRange<'_>]) -> Option<Rank> {
    let offer = MediaType::parse(offer).ok()?;
    let mut best: Option<Rank> = None;
    for (place, range) in ranges.iter().enumerate() {
        let Some(precision) = range.precision(&offer) else {
            continue;
        };
        if best
            .as_ref()
            .is_none_or(|other| precision > other.precision)
        {
            let weight = range.weight;
            best = Some(Rank {
                weight,
                precision,
                place,
            });
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media_types::{GLB, GLTF, JSON, MULTIPART_MIXED, OCTET_STREAM};

    fn preferred_of(accept: &str, offered: &[&'static str]) -> &'static str {
        let headers = HeaderMap::from_iter([(header::ACCEPT, accept.parse().unwrap())]);
        preferred(&headers, offered)
    }

    #[test]
    fn the_greatest_weight_on_offer_wins() {
        let offered = [JSON, GLB, MULTIPART_MIXED];
        for (accept, wanted) in [
            ("", JSON),
            ("*/*", JSON),
            ("text/html", JSON),
            ("Model/GLTF-binary", GLB),
            ("model/gltf-binary, application/json", GLB),
            (
                "application/json; q=0.5, multipart/mixed;boundary=x;q=0.8",
                MULTIPART_MIXED,
            ),
            ("model/gltf-binary;q=0", JSON),
            ("model/gltf-binary;q=NaN", JSON),
            ("model/gltf-binary;q=7", JSON),
            (
                "model/gltf-binary;q=much, multipart/mixed;q=0.1",
                MULTIPART_MIXED,
            ),
            // What Java's HttpURLConnection sends, with a malformed range.
            ("text/html, image/gif, *; q=.2, */*; q=.2", JSON),
        ] {
            assert_eq!(preferred_of(accept, &offered), wanted, "{accept}");
        }
        assert_eq!(preferred(&HeaderMap::new(), &offered), JSON);
    }

    #[test]
    fn ranges_match_all_their_types_and_yield_to_exact_names() {
        let offered = [JSON, GLB, GLTF, MULTIPART_MIXED];
        for (accept, wanted) in [
            ("model/*", GLB),
            ("MODEL/*;q=0.5", GLB),
            ("multipart/*, model/*;q=0.9", MULTIPART_MIXED),
            ("model/*, model/gltf+json", GLTF),
            ("*/*, model/gltf+json", GLTF),
            ("*/*;q=0.1, model/gltf+json;q=0.2", GLTF),
            ("*/*;q=0.1", JSON),
            ("text/html, */*;q=0.1", JSON),
            ("model/gltf+json;q=0.5, */*;q=0.8", JSON),
            ("application/json;q=0.1, */*;q=0.8", GLB),
            ("*/gltf+json", JSON),
        ] {
            assert_eq!(preferred_of(accept, &offered), wanted, "{accept}");
        }
    }

    #[test]
    fn a_weight_of_zero_refuses() {
        let offered = [GLB, OCTET_STREAM, MULTIPART_MIXED];
        for (accept, wanted) in [
            ("model/gltf-binary;q=0", OCTET_STREAM),
            ("model/gltf-binary;q=0.000, */*", OCTET_STREAM),
            ("model/*;q=0, application/*;q=0", MULTIPART_MIXED),
            ("model/*;q=0, model/gltf-binary;q=0.1", GLB),
            ("*/*;q=0, multipart/mixed", MULTIPART_MIXED),
            ("*/*;q=0", GLB),
        ] {
            assert_eq!(preferred_of(accept, &offered), wanted, "{accept}");
        }
    }

    #[test]
    fn several_headers_are_one_list() {
        let values = ["application/json;q=0.2", "multipart/mixed;q=0.3"];
        let mut headers = HeaderMap::new();
        for value in values {
            headers.append(header::ACCEPT, value.parse().unwrap());
        }
        assert_eq!(
            preferred(&headers, &[JSON, MULTIPART_MIXED]),
            MULTIPART_MIXED
        );
    }
}
