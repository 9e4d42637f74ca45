//! Compressed request bodies: the header `Content-Encoding` (RFC 9110, section 8.4).

use std::io::Read;

use axum::http::{HeaderMap, header};
use bytes::Bytes;
use flate2::bufread::{DeflateDecoder, MultiGzDecoder, ZlibDecoder};
use tokio::task;

use super::{counted::CountedBytes, error::RequestError, request_limits::RequestLimits};
use darn_contract::cut;

/// Bytes decompressed at a time.
const PIECE_BYTES: usize = 64 << 10;

/// How a body is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContentCoding {
    /// `gzip`.
    Gzip,
    /// `deflate`: zlib, or what many clients send under this name, deflate without its wrapper.
    Deflate,
}

impl ContentCoding {
    /// The coding of a body; `None` when it is sent as it is.
    ///
    /// # Errors
    /// `ContentEncoding` for any other coding, and for more than one.
    pub fn of(headers: &HeaderMap) -> Result<Option<Self>, RequestError> {
        let mut found = None;
        for value in headers.get_all(header::CONTENT_ENCODING) {
            let got = value.to_str().unwrap_or("(not text)");
            for name in got.split(',') {
                let coding = match name.trim().to_ascii_lowercase().as_str() {
                    "" | "identity" => continue,
                    "gzip" | "x-gzip" => Some(Self::Gzip),
                    "deflate" => Some(Self::Deflate),
                    _ => None,
                };
                if coding.is_none() || found.is_some() {
                    return Err(RequestError::ContentEncoding {
                        got: cut(got, 100).into_owned(),
                    });
                }
                found = coding;
            }
        }
        Ok(found)
    }

    /// The body behind the coding, of at most as many bytes as any body may have.
    ///
    /// # Errors
    /// `TooLarge`, `MemoryFull`; `Malformed` for a broken stream.
    pub async fn decode(self, bytes: Bytes, limits: &RequestLimits) -> Result<Bytes, RequestError> {
        let limits = limits.clone();
        let decoded = task::spawn_blocking(move || self.decode_within(&bytes, &limits)).await;
        decoded.unwrap_or(Err(RequestError::Internal))
    }

    fn decode_within(self, bytes: &[u8], limits: &RequestLimits) -> Result<Bytes, RequestError> {
        let mut decoder: Box<dyn Read + '_> = match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(bytes)),
            Self::Deflate if is_zlib(bytes) => Box::new(ZlibDecoder::new(bytes)),
            Self::Deflate => Box::new(DeflateDecoder::new(bytes)),
        };
        let mut out = CountedBytes::new(&limits.memory)?;
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            let read = decoder.read(&mut piece).map_err(|error| {
                RequestError::Malformed(format!("the compressed body is broken: {error}"))
            })?;
            let Some(piece) = piece.get(..read).filter(|piece| !piece.is_empty()) else {
                return Ok(out.freeze());
            };
            if out.len() + piece.len() > limits.body {
                return Err(RequestError::TooLarge { limit: limits.body });
            }
            out.extend(piece)?;
        }
    }
}

/// Whether bytes begin as a zlib stream does (RFC 1950, section 2.2).
fn is_zlib(bytes: &[u8]) -> bool {
    matches!(bytes, [method, flags, ..]
        if method & 0x0F == 8 && u16::from_be_bytes([*method, *flags]).is_multiple_of(31))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn one_known_coding_is_read() {
        let of = |values: &[&'static str]| {
            let mut headers = HeaderMap::new();
            for value in values {
                headers.append(header::CONTENT_ENCODING, HeaderValue::from_static(value));
            }
            ContentCoding::of(&headers).ok()
        };
        assert_eq!(of(&[]), Some(None));
        assert_eq!(of(&["identity"]), Some(None));
        assert_eq!(of(&["GZIP"]), Some(Some(ContentCoding::Gzip)));
        assert_eq!(
            of(&["identity, deflate"]),
            Some(Some(ContentCoding::Deflate))
        );
        assert_eq!(of(&["gzip, gzip"]), None);
        assert_eq!(of(&["gzip", "deflate"]), None);
        assert_eq!(of(&["br"]), None);
    }
}
