//! Entity tags (RFC 9110, section 8.8.3): what is sent under the same tag is the same, byte for byte.

use axum::http::{HeaderMap, HeaderValue, header};

/// The tag of a body whose value of `Repr-Digest` this is: its SHA-256.
pub fn of_digest(digest: &HeaderValue) -> Option<HeaderValue> {
    let text = digest.to_str().ok()?.strip_prefix("sha-256=:")?;
    let (sha256, _) = text.split_once(':')?;
    HeaderValue::try_from(format!("\"{sha256}\"")).ok()
}

/// Whether `if-none-match` names a tag. Tags are compared weakly (RFC 9110, section 13.1.2).
pub fn is_known(request: &HeaderMap, tag: &str) -> bool {
    let values = request.get_all(header::IF_NONE_MATCH).iter();
    let mut tags = values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|text| text.split(','))
        .map(|text| text.trim().trim_start_matches("W/"));
    tags.any(|known| known == tag || known == "*")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tag_is_the_sha256_of_its_body() {
        let digest = crate::digest::of(b"cloth").unwrap();
        let tag = of_digest(&digest).unwrap();
        let tag = tag.to_str().unwrap();
        assert_eq!(tag.len(), 46);
        assert!(digest.to_str().unwrap().contains(tag.trim_matches('"')));
        for (value, known) in [(tag, true), ("*", true), ("\"other\"", false)] {
            let request = HeaderMap::from_iter([(header::IF_NONE_MATCH, value.parse().unwrap())]);
            assert_eq!(is_known(&request, tag), known, "{value}");
        }
        let weak = format!("\"other\", W/{tag}").parse().unwrap();
        assert!(is_known(
            &HeaderMap::from_iter([(header::IF_NONE_MATCH, weak)]),
            tag
        ));
    }
}
