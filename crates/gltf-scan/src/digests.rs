//! Digests of files.

use sha2::{Digest as _, Sha256, Sha512};

/// The digests of a file, in lower-case hexadecimal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileDigests {
    /// SHA-256.
    pub sha256: String,
    /// SHA-512.
    pub sha512: String,
}

impl FileDigests {
    /// The digests of a file's bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let (sha256, sha512) = rayon::join(
            || hexadecimal(&Sha256::digest(bytes)),
            || hexadecimal(&Sha512::digest(bytes)),
        );
        Self { sha256, sha512 }
    }
}

/// The SHA-256 of bytes, in lower-case hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
