//! Digests of bodies (RFC 9530): those that a request brings are checked, and an answer of a scan says its own.
//!
//! `Content-Digest` and `Repr-Digest` of a request are both of the bytes as they were sent, before a content coding is undone:
//! a request has no range that would make the two differ.

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use base64::{
    Engine as _,
    engine::{
        DecodePaddingMode,
        general_purpose::{GeneralPurpose, GeneralPurposeConfig, STANDARD},
    },
};
use bytes::Bytes;
use sha2::{Digest as _, Sha256, Sha512};
use tokio::task;

use super::error::RequestError;

/// The digests of a message's content.
pub const CONTENT_DIGEST: HeaderName = HeaderName::from_static("content-digest");
/// The digests of the whole that a message's content is a part of; here always the content.
pub const REPR_DIGEST: HeaderName = HeaderName::from_static("repr-digest");

/// Base64 as structured fields have it: its padding may be left out (RFC 9651, section 4.2.7).
const LENIENT: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// An algorithm that is checked; others are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Algorithm {
    Sha256,
    Sha512,
}

impl Algorithm {
    const ALL: [Algorithm; 2] = [Algorithm::Sha256, Algorithm::Sha512];

    fn name(self) -> &'static str {
        match self {
            Self::Sha256 => "sha-256",
            Self::Sha512 => "sha-512",
        }
    }

    fn of(self, bytes: &[u8]) -> Vec<u8> {
        match self {
            Self::Sha256 => Sha256::digest(bytes).to_vec(),
            Self::Sha512 => Sha512::digest(bytes).to_vec(),
        }
    }
}

/// The value of `Repr-Digest` for some bytes; to be called on a worker.
pub fn of(bytes: &[u8]) -> Option<HeaderValue> {
    let each = Algorithm::ALL.map(|algorithm| {
        let digest = STANDARD.encode(algorithm.of(bytes));
        format!("{}=:{digest}:", algorithm.name())
    });
    HeaderValue::try_from(each.join(", ")).ok()
}

/// The digests that a request says its body has.
#[derive(Debug, Default)]
pub struct ExpectedDigests(Vec<(HeaderName, Algorithm, Vec<u8>)>);

impl ExpectedDigests {
    /// Those of the headers.
    ///
    /// # Errors
    /// `Malformed` for a digest of a known algorithm that is not one.
    pub fn of(headers: &HeaderMap) -> Result<Self, RequestError> {
        let mut all = Vec::new();
        for name in [CONTENT_DIGEST, REPR_DIGEST] {
            let lines = headers.get_all(&name).iter();
            // No digest has a comma in it, so that each is a member of the dictionary.
            let members = lines.flat_map(|line| line.as_bytes().split(|byte| *byte == b','));
            for member in members {
                let member = std::str::from_utf8(member).unwrap_or_default();
                let (key, value) = member.trim().split_once('=').unwrap_or_default();
                let known = Algorithm::ALL.into_iter().find(|it| it.name() == key);
                let Some(algorithm) = known else {
                    continue;
                };
                let digest = byte_sequence(value).ok_or_else(|| {
                    let text = format!("the header `{name}` has no digest at {key}");
                    RequestError::Malformed(text)
                })?;
                // Of repeated keys the last one counts.
                all.retain(|(other, kind, _)| !(*other == name && *kind == algorithm));
                all.push((name.clone(), algorithm, digest));
            }
        }
        Ok(Self(all))
    }

    /// Checks a body that comes in pieces.
    pub fn begin(self) -> RunningDigests {
        let has = |wanted| self.0.iter().any(|(_, algorithm, _)| *algorithm == wanted);
        RunningDigests {
            sha256: has(Algorithm::Sha256).then(Sha256::new),
            sha512: has(Algorithm::Sha512).then(Sha512::new),
            expected: self,
        }
    }

    /// Checks a body.
    ///
    /// # Errors
    /// `DigestMismatch`.
    pub async fn check(self, body: &Bytes) -> Result<(), RequestError> {
        if self.0.is_empty() {
            return Ok(());
        }
        let body = body.clone();
        let checked = task::spawn_blocking(move || self.check_now(&body)).await;
        checked.unwrap_or(Err(RequestError::Internal))
    }

    fn check_now(self, body: &[u8]) -> Result<(), RequestError> {
        let mut running = self.begin();
        running.update(body);
        running.check()
    }
}

/// The digests of a body of which some pieces have come.
#[derive(Debug)]
pub struct RunningDigests {
    sha256: Option<Sha256>,
    sha512: Option<Sha512>,
    expected: ExpectedDigests,
}

impl RunningDigests {
    /// Takes the next piece.
    pub fn update(&mut self, piece: &[u8]) {
        if let Some(sha256) = &mut self.sha256 {
            sha256.update(piece);
        }
        if let Some(sha512) = &mut self.sha512 {
            sha512.update(piece);
        }
    }

    /// Checks the whole body; there is nothing to check then.
    ///
    /// # Errors
    /// `DigestMismatch`.
    pub fn check(&mut self) -> Result<(), RequestError> {
        let sha256 = self.sha256.take().map(|it| it.finalize().to_vec());
        let sha512 = self.sha512.take().map(|it| it.finalize().to_vec());
        for (header, algorithm, expected) in std::mem::take(&mut self.expected.0) {
            let found = match algorithm {
                Algorithm::Sha256 => &sha256,
                Algorithm::Sha512 => &sha512,
            };
            let found = found.clone().unwrap_or_default();
            if found != expected {
                return Err(RequestError::DigestMismatch {
                    header,
                    algorithm: algorithm.name(),
                    found: STANDARD.encode(found),
                });
            }
        }
        Ok(())
    }
}

/// The bytes of an item that is a byte sequence, such as `:Zm9v:`, whatever its parameters.
fn byte_sequence(item: &str) -> Option<Vec<u8>> {
    let item = item.split(';').next()?.trim();
    LENIENT
        .decode(item.strip_prefix(':')?.strip_suffix(':')?)
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(lines: &[(HeaderName, &str)], body: &[u8]) -> Result<(), RequestError> {
        let mut headers = HeaderMap::new();
        for (name, line) in lines {
            headers.append(name.clone(), HeaderValue::from_str(line).unwrap());
        }
        ExpectedDigests::of(&headers)?.check_now(body)
    }

    #[test]
    fn digests_are_checked_as_their_rfc_spells_them() {
        // RFC 9530, appendix B.
        const BODY: &[u8] = b"{\"hello\": \"world\"}\n";
        const RIGHT: &str = "sha-256=:RK/0qy18MlBSVnWgjwz6lZEWjP/lF5HF9bvEF8FabDg=:";
        assert_eq!(check(&[(CONTENT_DIGEST, RIGHT)], BODY), Ok(()));
        assert_eq!(check(&[(REPR_DIGEST, RIGHT)], BODY), Ok(()));
        let bare = RIGHT.replace("=:", ":").replacen(':', "=:", 1);
        assert_eq!(check(&[(CONTENT_DIGEST, &bare)], BODY), Ok(()), "{bare}");
        let both = of(BODY).unwrap();
        assert!(both.to_str().unwrap().starts_with(RIGHT));
        assert_eq!(
            check(&[(REPR_DIGEST, both.to_str().unwrap())], BODY),
            Ok(())
        );
        for wrong in [
            vec![(CONTENT_DIGEST, RIGHT)],
            vec![(CONTENT_DIGEST, "md5=:AAAA:"), (REPR_DIGEST, RIGHT)],
        ] {
            let refused = check(&wrong, b"another body").unwrap_err();
            assert_eq!(refused.code(), darn_contract::codes::DIGEST_MISMATCH);
        }
        for passed_over in ["md5=:AAAA:", "", "sha-256", "unixsum=7, crc32c=:AAAA:;q=1"] {
            assert_eq!(check(&[(CONTENT_DIGEST, passed_over)], BODY), Ok(()));
        }
        for malformed in ["sha-256=abc", "sha-512=:!:", "sha-256=::x"] {
            let refused = check(&[(CONTENT_DIGEST, malformed)], BODY).unwrap_err();
            assert_eq!(
                refused.code(),
                darn_contract::codes::MALFORMED_REQUEST,
                "{malformed}"
            );
        }
    }
}
