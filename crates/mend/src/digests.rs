//! Digests as reports have them.

use darn_contract::v1;
use darn_gltf_scan::FileDigests;

/// The digests of a file as a message.
pub fn message(digests: FileDigests) -> v1::FileDigests {
    v1::FileDigests {
        sha256: digests.sha256,
        sha512: digests.sha512,
    }
}

/// The digests of a file's bytes, as reports have them.
pub fn file_digests(bytes: &[u8]) -> v1::FileDigests {
    message(FileDigests::of(bytes))
}
