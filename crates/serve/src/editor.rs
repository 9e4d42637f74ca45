//! The editor: a web page at `/` that opens a scan, mends it and edits the new cloth by the routes of this service.
//!
//! Its files are those of `web/dist` and the example scan, built into the program by `build.rs`, plain and compressed.

use std::sync::Arc;

use axum::{
    Router,
    body::Body,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
    routing::get,
};
use bytes::Bytes;

use super::{app::App, entity_tag};

/// What the page may load: its own files and this service's answers, textures that it unpacks from a scan (`blob:`, `data:`), WebAssembly
/// of decoders, and scans from the address that a person names in the page's own address (`#scan=URL`). No inline script or style.
const CONTENT_SECURITY_POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; \
    img-src 'self' blob: data:; connect-src 'self' blob: data: https: http:; object-src 'none'; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'";

/// A file of the editor.
#[derive(Debug)]
struct EditorFile {
    /// Its path in a URL.
    path: &'static str,
    media_type: &'static str,
    /// The first 16 hexadecimal digits of its SHA-256.
    hash: &'static str,
    plain: &'static [u8],
    gzip: &'static [u8],
}

include!(concat!(env!("OUT_DIR"), "/editor_files.rs"));

/// The routes of the editor's files.
pub fn routes() -> Router<Arc<App>> {
    FILES.iter().fold(Router::new(), |router, file| {
        router.route(
            file.path,
            get(move |headers: HeaderMap| async move { answer(file, &headers) }),
        )
    })
}

/// Whether a path is that of a file of the editor.
pub fn has_file(path: &str) -> bool {
    FILES.iter().any(|file| file.path == path)
}

/// A file, compressed where the client takes that, or 304 where the client has it.
fn answer(file: &'static EditorFile, request: &HeaderMap) -> Response {
    let compressed = takes_gzip(request);
    let suffix = if compressed { "-gzip" } else { "" };
    let tag = format!("\"{}{suffix}\"", file.hash);
    let known = entity_tag::is_known(request, &tag);
    let headers = [
        (header::ETAG, tag),
        // Asked for again at every load; the answer is then 304 unless darn is another version.
        (header::CACHE_CONTROL, "no-cache".to_owned()),
        (header::VARY, "accept-encoding".to_owned()),
    ];
    if known {
        return (StatusCode::NOT_MODIFIED, headers).into_response();
    }
    let body = if compressed { file.gzip } else { file.plain };
    let fixed = [
        (header::CONTENT_TYPE, file.media_type),
        (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let mut response = (headers, fixed, Body::from(Bytes::from_static(body))).into_response();
    if compressed {
        let gzip = HeaderValue::from_static("gzip");
        (response.headers_mut()).insert(header::CONTENT_ENCODING, gzip);
    }
    response
}

/// Whether a client takes gzip (RFC 9110, section 12.5.3): it names `gzip` or `*`, and not with weight 0.
fn takes_gzip(request: &HeaderMap) -> bool {
    let values = request.get_all(header::ACCEPT_ENCODING).iter();
    let mut codings = values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|text| text.split(','))
        .filter_map(|coding| {
            let mut parts = coding.split(';').map(str::trim);
            let name = parts.next()?.to_ascii_lowercase();
            let weight = parts.find_map(|part| part.strip_prefix("q=")?.parse::<f32>().ok());
            Some((name, weight.unwrap_or(1.0) > 0.0))
        })
        .collect::<Vec<_>>();
    // A coding's own entry counts before `*`.
    codings.sort_by_key(|(name, _)| name == "*");
    (codings.iter())
        .find(|(name, _)| name == "gzip" || name == "*")
        .is_some_and(|(_, taken)| *taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: header::HeaderName, value: &'static str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_static(value))])
    }

    #[test]
    fn gzip_goes_to_those_who_take_it() {
        for taken in ["gzip", "br, gzip;q=0.5", "*", "GZIP", "*;q=0, gzip"] {
            assert!(
                takes_gzip(&headers(header::ACCEPT_ENCODING, taken)),
                "{taken}"
            );
        }
        for refused in ["", "br", "gzip;q=0", "gzip; q=0, *", "identity"] {
            assert!(
                !takes_gzip(&headers(header::ACCEPT_ENCODING, refused)),
                "{refused}"
            );
        }
        assert!(!takes_gzip(&HeaderMap::new()));
    }

    #[test]
    fn every_file_the_page_names_is_there_and_none_is_empty() {
        let page = FILES.iter().find(|file| file.path == "/").unwrap();
        let html = std::str::from_utf8(page.plain).unwrap();
        let named = html.match_indices("=\"editor/").map(|(at, _)| {
            let rest = &html[at + 2..];
            rest.split('"').next().unwrap_or_default()
        });
        let named: Vec<_> = named.collect();
        assert!(!named.is_empty());
        for name in named {
            assert!(
                FILES.iter().any(|file| file.path == format!("/{name}")),
                "{name}"
            );
        }
        for file in FILES {
            assert!(
                !file.plain.is_empty() && !file.gzip.is_empty(),
                "{}",
                file.path
            );
        }
    }

    #[test]
    fn a_file_that_the_client_has_is_not_sent_again() {
        let file = &FILES[0];
        let first = answer(file, &HeaderMap::new());
        let tag = first.headers()[header::ETAG].to_str().unwrap().to_owned();
        let again = HeaderMap::from_iter([(header::IF_NONE_MATCH, tag.parse().unwrap())]);
        assert_eq!(answer(file, &again).status(), StatusCode::NOT_MODIFIED);
        let other = headers(header::IF_NONE_MATCH, "\"0\"");
        assert_eq!(answer(file, &other).status(), StatusCode::OK);
    }
}
