//! Scans of several files: a glTF and the files that it refers to by relative URIs, an OBJ and its material libraries with their images.
//!
//! Nothing here opens a file: the caller gives the bytes, by path, or in a zip. A URI that leads anywhere else than to a
//! file beside or below the glTF is refused.

use std::collections::BTreeMap;

use bytes::Bytes;
use darn_mesh_files::{MeshFormat, material_images, material_libraries};
use serde_json::Value;

use super::compressed::DecodeAllowance;
use super::error::ScanError;
use super::zip_files::ZipFiles;

/// The files that lie beside a glTF or an OBJ, by their paths relative to it, with `/` between folders.
#[derive(Debug, Clone, Default)]
pub struct Siblings(pub BTreeMap<String, Bytes>);

/// Where a scan's separate files are.
#[derive(Debug, Clone)]
pub(super) enum Companions {
    /// In memory; none, if the scan is one file.
    Siblings(Siblings),
    /// In the zip that the glTF came in.
    Zip(ZipFiles),
}

impl Companions {
    /// The bytes of the file that a URI refers to; `None` if it is not there.
    pub fn file(
        &self,
        uri: &str,
        allowance: &DecodeAllowance<'_>,
    ) -> Result<Option<Bytes>, ScanError> {
        for path in paths(uri) {
            let found = match self {
                Self::Siblings(Siblings(files)) => files.get(&path).cloned(),
                Self::Zip(zip) => zip.sibling(&path, allowance)?,
            };
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Whether there is a file at a path relative to the scan.
    pub fn has(&self, path: &str) -> bool {
        match self {
            Self::Siblings(Siblings(files)) => files.contains_key(path),
            Self::Zip(zip) => zip.place(path).is_some(),
        }
    }

    /// Whether the scan came in several files, or in a zip.
    pub fn are_several(&self) -> bool {
        match self {
            Self::Siblings(Siblings(files)) => !files.is_empty(),
            Self::Zip(_) => true,
        }
    }

    /// Bytes of memory of the files.
    pub fn bytes_held(&self) -> usize {
        match self {
            Self::Siblings(Siblings(files)) => files.values().map(Bytes::len).sum(),
            Self::Zip(zip) => zip.bytes.len(),
        }
    }
}

/// The paths of the files beside a glTF that its buffers and images refer to. Without data URIs, and without URIs that no
/// sibling can have: reading the glTF names those. A URI with escapes stands for two paths: without, and as spelled.
///
/// # Errors
/// The JSON does not parse.
pub fn sibling_paths(gltf: &[u8]) -> Result<Vec<String>, ScanError> {
    Ok(paths_in(&json_of_text(gltf)?).collect())
}

/// [`sibling_paths`] of a JSON.
pub(super) fn paths_in(json: &Value) -> impl Iterator<Item = String> {
    let list = |key: &str| {
        let list = json.get(key).and_then(Value::as_array);
        list.into_iter().flatten()
    };
    let all = list("buffers").chain(list("images"));
    let uris = all.filter_map(|item| item.get("uri")?.as_str());
    uris.filter(|uri| !uri.starts_with("data:")).flat_map(paths)
}

/// The paths of the files beside an OBJ that its `mtllib` lines may name; none of another scan. Without absolute paths, URLs, and paths that lead
/// upward; a line stands for all that it may mean ([`darn_mesh_files::material_libraries`]).
pub fn material_library_paths(obj: &[u8]) -> Vec<String> {
    if MeshFormat::of(obj) != Some(MeshFormat::Obj) {
        return Vec::new();
    }
    let names = material_libraries(obj);
    names.iter().filter_map(|name| relative(name)).collect()
}

/// The paths of the files beside an OBJ that one of its material libraries may name as images, relative to the library or to the OBJ; `library` is
/// the library's path. As [`material_library_paths`].
pub fn material_image_paths(library: &str, bytes: &[u8]) -> Vec<String> {
    let folder = library.rsplit_once('/').map_or("", |(folder, _)| folder);
    let names = material_images(bytes);
    let paths = names.iter().flat_map(|name| {
        // Only a path that is relative by itself is put behind a folder.
        let own = relative(name);
        let below = own.as_ref().map(|own| format!("{folder}/{own}"));
        own.into_iter()
            .chain(below.and_then(|path| relative(path.trim_start_matches('/'))))
    });
    paths.collect()
}

/// The JSON of a glTF that is no GLB, with or without a byte order mark.
pub(super) fn json_of_text(gltf: &[u8]) -> Result<Value, ScanError> {
    let text = gltf.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(gltf);
    darn_json::value(text).map_err(|error| ScanError::Container {
        offset: 0,
        detail: format!("the JSON does not parse: {error}"),
    })
}

/// The paths that a relative URI may mean, the likeliest first: percent-decoded, then as spelled (many exporters do not
/// encode). None for absolute paths, URLs, and paths that lead upward.
fn paths(uri: &str) -> Vec<String> {
    let mut paths: Vec<String> = Vec::new();
    for text in [percent_decoded(uri), Some(uri.to_owned())] {
        let path = text.and_then(|text| relative(&text));
        paths.extend(path.filter(|path| !paths.contains(path)));
    }
    paths
}

/// A path without `.` segments; `None` if it is absolute, a URL, or leads upward.
pub(super) fn relative(path: &str) -> Option<String> {
    // Exporters on Windows write their own separator.
    let path = path.replace('\\', "/");
    let first = path.split('/').next().unwrap_or_default();
    if path.starts_with('/') || first.contains(':') || path.contains('\0') {
        return None;
    }
    let mut segments = Vec::new();
    for segment in path.split('/') {
        match segment {
            "" | "." => {}
            ".." => return None,
            segment => segments.push(segment),
        }
    }
    (!segments.is_empty()).then(|| segments.join("/"))
}

/// A URI without its percent escapes; `None` if one is broken or the result is no UTF-8.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte == b'%' {
            let (digits, after) = rest.split_at_checked(2)?;
            let digits = std::str::from_utf8(digits).ok()?;
            if !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
                return None;
            }
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = after;
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_names_libraries_and_those_name_images_beside_and_below() {
        let obj = b"mtllib mats/a.mtl\nmtllib ../b.mtl\nmtllib /c.mtl\nmtllib C:\\d.mtl\nv 0 0 0\n";
        assert_eq!(material_library_paths(obj), ["mats/a.mtl"]);
        assert_eq!(material_library_paths(b"{}"), Vec::<String>::new());
        let library = b"map_Kd ..\\up.png\nmap_Kd http://example.org/a.png\nmap_Kd ./linen.png\n";
        let expected = ["linen.png", "mats/linen.png"];
        assert_eq!(material_image_paths("mats/a.mtl", library), expected);
        assert_eq!(
            material_image_paths("a.mtl", b"bump x.png"),
            ["x.png", "x.png"]
        );
    }

    #[test]
    fn only_paths_beside_and_below_are_followed() {
        for (uri, expected) in [
            ("cloth.bin", vec!["cloth.bin"]),
            (
                "./maps//cloth%20plaid.png",
                vec!["maps/cloth plaid.png", "maps/cloth%20plaid.png"],
            ),
            ("100%.bin", vec!["100%.bin"]),
            ("maps\\a.png", vec!["maps/a.png"]),
            ("../cloth.bin", vec![]),
            ("maps/../../cloth.bin", vec![]),
            ("%2e%2e/cloth.bin", vec!["%2e%2e/cloth.bin"]),
            ("/etc/passwd", vec![]),
            ("\\\\host\\share", vec![]),
            ("C:\\cloth.bin", vec![]),
            ("https://example.org/cloth.bin", vec![]),
            ("file:cloth.bin", vec![]),
            ("", vec![]),
        ] {
            assert_eq!(paths(uri), expected, "{uri}");
        }
    }
}
