//! Where the new bytes of a mended glTF go: into its JSON, or into a file beside it.

use serde_json::Value;

use super::digests::sha256;
use super::files::paths_in;
use super::scan::Scan;

/// Start and end of the names of darn's files.
const NAME: &str = "darn-patch-";
const ENDING: &str = ".bin";
/// Digits of the file's SHA-256 between them.
const DIGITS: usize = 16;

/// Where the new bytes of a glTF go. Those of a GLB go into its BIN chunk in any case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PatchBuffer {
    /// Into a data URI.
    #[default]
    DataUri,
    /// Into a file of their own, if the scan came in several files.
    File,
}

/// A file that a mended glTF refers to and that was not there before.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewFile {
    /// Its path relative to the glTF.
    pub path: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

impl NewFile {
    /// The file of some bytes for a scan, named after the bytes, so that mended scans may share a folder. No file that the scan has or names has
    /// this path.
    pub(super) fn of(bytes: Vec<u8>, scan: &Scan) -> Self {
        let digest = sha256(&bytes);
        let digits = digest.get(..DIGITS).unwrap_or_default();
        let named: Vec<String> = paths_in(&scan.json).collect();
        let numbered = (1_u64..).map(|number| match number {
            1 => format!("{NAME}{digits}{ENDING}"),
            number => format!("{NAME}{digits}-{number}{ENDING}"),
        });
        let mut free = numbered.filter(|path| !named.contains(path) && !scan.companions.has(path));
        Self {
            // There are fewer files than numbers.
            path: free.next().unwrap_or_default(),
            bytes,
        }
    }
}

/// Whether the bytes that were appended last to a mended glTF are in a file of their own.
pub(super) fn ends_in_a_file(json: &Value) -> bool {
    let last = |list: &str| json.get(list)?.as_array()?.last();
    let uri = || {
        let buffer = last("bufferViews")?.get("buffer")?.as_u64()?;
        let buffer = json.get("buffers")?.get(usize::try_from(buffer).ok()?)?;
        buffer.get("uri")?.as_str()
    };
    uri().is_some_and(|uri| uri.starts_with(NAME) && uri.ends_with(ENDING))
}
