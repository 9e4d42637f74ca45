//! Scans that come in several files: how they travel to the mender as one zip, and in which form the mended scan goes back.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{Cursor, Write as _},
    sync::Arc,
};

use axum::http::HeaderMap;
use bytes::Bytes;
use tokio::task;
use zip::{CompressionMethod, ZipWriter, result::ZipError, write::SimpleFileOptions};

use super::{
    accept::preferred,
    counted::{counted, take},
    error::RequestError,
    media_types::{GLB, GLTF, MULTIPART_MIXED, OBJ, PLY, ZIP},
    parameters::Parameters,
};
use darn_budget::MemoryPool;
use darn_contract::{cut, port::ScanForm};

/// The first bytes of a zip.
const ZIP_MAGIC: &[u8] = b"PK\x03\x04";

/// In how many files a scan came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanFiles {
    /// In one: GLB, glTF with data URIs, OBJ or PLY.
    One,
    /// In a zip.
    Zip,
    /// In parts of multipart/form-data.
    Parts,
}

/// The form of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AnswerForm {
    /// Its media type, or multipart/mixed.
    pub media_type: &'static str,
    /// The form of the scan in it.
    pub form: ScanForm,
}

impl ScanFiles {
    /// What a body or the part `scan` alone is.
    pub fn of(scan: &[u8]) -> Self {
        if scan.starts_with(ZIP_MAGIC) {
            Self::Zip
        } else {
            Self::One
        }
    }

    /// The form of the answer that the caller prefers. Without a preference a scan goes back as it came, but of one that came in parts the
    /// glTF alone: its other files stay as they are.
    pub fn answer(self, headers: &HeaderMap) -> AnswerForm {
        let offered: &[&'static str] = match self {
            Self::One => &[GLB, GLTF, OBJ, PLY, MULTIPART_MIXED],
            Self::Zip => &[ZIP, GLB, GLTF, MULTIPART_MIXED],
            Self::Parts => &[GLTF, GLB, ZIP, MULTIPART_MIXED],
        };
        let media_type = preferred(headers, offered);
        let form = match (self, media_type) {
            (Self::One, _) | (_, ZIP) | (Self::Zip, MULTIPART_MIXED) => ScanForm::AsReceived,
            (_, GLB) => ScanForm::Glb,
            _ => ScanForm::Gltf,
        };
        AnswerForm { media_type, form }
    }
}

/// First words of the lines of an OBJ.
const OBJ_WORDS: [&[u8]; 10] = [
    b"v", b"vt", b"vn", b"f", b"o", b"g", b"s", b"mtllib", b"usemtl", b"l",
];

/// Whether bytes begin as a GLB, a zip, a JSON object, a PLY or an OBJ does; reading the scan looks closer.
pub fn looks_like_a_scan(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    bytes.starts_with(b"glTF")
        || bytes.starts_with(ZIP_MAGIC)
        || text.trim_ascii_start().starts_with(b"{")
        || bytes.starts_with(b"ply\n")
        || bytes.starts_with(b"ply\r")
        || begins_as_obj(text)
}

/// Whether the first line that is no comment begins with a word of an OBJ.
fn begins_as_obj(text: &[u8]) -> bool {
    const LOOKED_AT: usize = 4096;
    let head = text.get(..LOOKED_AT).unwrap_or(text);
    let lines = head.split(|byte| matches!(byte, b'\n' | b'\r'));
    let mut said = lines
        .map(<[u8]>::trim_ascii)
        .filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    // A word alone is no evidence: `g` may be the start of anything.
    said.next().is_some_and(|line| {
        let mut words = line.splitn(2, u8::is_ascii_whitespace);
        words.next().is_some_and(|word| OBJ_WORDS.contains(&word)) && words.next().is_some()
    })
}

/// The error of a part that is neither the scan, nor parameters, nor a file of the scan.
pub fn no_such_part<P: Parameters>(name: &str) -> RequestError {
    RequestError::Malformed(format!(
        "there is no part `{}`; the parts are `scan`, `{}`, and files of the scan, each named by its URI there",
        cut(name, 100),
        P::PART
    ))
}

/// The error of a form without the part `scan`.
pub fn no_scan<P: Parameters>(files: &BTreeMap<String, Bytes>) -> RequestError {
    match unnamed(&[], files) {
        Some(name) => no_such_part::<P>(name),
        None => RequestError::EmptyBody,
    }
}

/// The first of the files without a dot in their name that the scan's text does not name: it may be a misspelled part, and would be ignored.
fn unnamed<'f>(scan: &[u8], files: &'f BTreeMap<String, Bytes>) -> Option<&'f str> {
    let names = files.keys().map(String::as_str);
    let doubted: Vec<&str> = names.filter(|name| !name.contains('.')).collect();
    if doubted.is_empty() {
        return None;
    }
    let uris = |name: &str| [name.to_owned(), name.replace(' ', "%20")].map(String::into_bytes);
    let wanted: BTreeSet<Vec<u8>> = doubted.iter().flat_map(|name| uris(name)).collect();
    let texts = scan.split(|byte| *byte == b'"');
    let named: BTreeSet<&[u8]> = texts.filter(|text| wanted.contains(*text)).collect();
    let is_named = |name: &str| uris(name).iter().any(|uri| named.contains(uri.as_slice()));
    doubted.into_iter().find(|name| !is_named(name))
}

/// A zip of a scan and the files that it refers to, by their names in the form, stored as they are. It goes no further than to the mender,
/// which knows what their names mean.
///
/// # Errors
/// `MemoryFull`; `Malformed` for a scan that is a zip itself, a part that is no file of the scan, or one with a name that a zip cannot have.
pub async fn bundle<P: Parameters>(
    scan: Bytes,
    files: BTreeMap<String, Bytes>,
    pool: &Arc<MemoryPool>,
) -> Result<Bytes, RequestError> {
    if ScanFiles::of(&scan) == ScanFiles::Zip {
        let text = "a scan that is a zip holds its files itself; send no others beside it";
        return Err(RequestError::Malformed(text.to_owned()));
    }
    // A name stands twice in a zip, and an entry's headers take about a hundred bytes.
    let entries = files
        .iter()
        .map(|(name, bytes)| 2 * name.len() + 256 + bytes.len());
    let length = entries.sum::<usize>() + scan.len() + (4 << 10);
    let memory = take(pool, length)?;
    let zipped = move || match unnamed(&scan, &files) {
        Some(name) => Err(no_such_part::<P>(name)),
        None => stored(&scan, &files, length),
    };
    let zip = task::spawn_blocking(zipped).await;
    let zip = zip.unwrap_or(Err(RequestError::Internal))?;
    Ok(counted(zip.into(), memory))
}

/// The zip, of about `length` bytes.
fn stored(
    scan: &[u8],
    files: &BTreeMap<String, Bytes>,
    length: usize,
) -> Result<Vec<u8>, RequestError> {
    let text = scan.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(scan);
    let main = if scan.starts_with(b"glTF") {
        "scan.glb"
    } else if scan.starts_with(b"ply\n") || scan.starts_with(b"ply\r") {
        "scan.ply"
    } else if begins_as_obj(text) {
        "scan.obj"
    } else {
        "scan.gltf"
    };
    let mut zip = ZipWriter::new(Cursor::new(Vec::with_capacity(length)));
    let entries = files
        .iter()
        .map(|(name, bytes)| (name.as_str(), bytes.as_ref()));
    for (name, bytes) in entries.chain([(main, scan)]) {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(u32::try_from(bytes.len()).is_err());
        let written = zip.start_file(name, options);
        let written = written.and_then(|()| zip.write_all(bytes).map_err(ZipError::Io));
        written.map_err(|error| malformed(name, &error))?;
    }
    let zip = zip.finish().map_err(|error| malformed(main, &error))?;
    Ok(zip.into_inner())
}

fn malformed(name: &str, error: &ZipError) -> RequestError {
    RequestError::Malformed(format!("the file `{}`: {error}", cut(name, 100)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderValue, header};

    #[test]
    fn scans_are_told_by_how_they_begin() {
        for scan in [
            &b"glTF\x02"[..],
            b"PK\x03\x04",
            b"\xEF\xBB\xBF {}",
            b"ply\nformat ascii 1.0",
            b"# exported\r\n\r\n  mtllib a.mtl",
            b"v 0 0 0",
        ] {
            assert!(looks_like_a_scan(scan), "{scan:?}");
        }
        for other in [
            &b""[..],
            b"<html>",
            b"plywood",
            b"# only a note",
            b"very well",
            b"g",
            b"v\n",
        ] {
            assert!(!looks_like_a_scan(other), "{other:?}");
        }
    }

    #[test]
    fn a_part_without_a_dot_is_a_file_if_the_scan_names_it() {
        let scan = br#"{"buffers":[{"uri":"buffer0"},{"uri":"my%20buffer"}]}"#;
        for (name, expected) in [
            ("buffer0", None),
            ("my buffer", None),
            ("my%20buffer", None),
            ("picture.png", None),
            ("buffer1", Some("buffer1")),
            ("constraint", Some("constraint")),
            ("uri\":\"buffer0", Some("uri\":\"buffer0")),
        ] {
            let files = BTreeMap::from([(name.to_owned(), Bytes::new())]);
            assert_eq!(unnamed(scan, &files), expected);
        }
    }

    #[test]
    fn answers_go_back_as_scans_came_unless_the_caller_prefers_otherwise() {
        let answer = |files: ScanFiles, accept: Option<&'static str>| {
            let accept = accept.map(|accept| (header::ACCEPT, HeaderValue::from_static(accept)));
            let form = files.answer(&HeaderMap::from_iter(accept));
            (form.media_type, form.form)
        };
        use ScanForm::{AsReceived, Glb, Gltf};
        for (files, accept, expected) in [
            (ScanFiles::One, None, (GLB, AsReceived)),
            (ScanFiles::One, Some(GLTF), (GLTF, AsReceived)),
            (ScanFiles::Zip, None, (ZIP, AsReceived)),
            (ScanFiles::Zip, Some("*/*"), (ZIP, AsReceived)),
            (ScanFiles::Zip, Some(GLB), (GLB, Glb)),
            (
                ScanFiles::Zip,
                Some(MULTIPART_MIXED),
                (MULTIPART_MIXED, AsReceived),
            ),
            (ScanFiles::Parts, None, (GLTF, Gltf)),
            (ScanFiles::Parts, Some(GLB), (GLB, Glb)),
            (ScanFiles::Parts, Some(ZIP), (ZIP, AsReceived)),
            (
                ScanFiles::Parts,
                Some(MULTIPART_MIXED),
                (MULTIPART_MIXED, Gltf),
            ),
        ] {
            assert_eq!(answer(files, accept), expected, "{files:?}, {accept:?}");
        }
    }
}
