//! The secret of a key as a client sends it, and the digest by which the service knows it.

use std::fmt;

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

/// What every secret begins with, so that programs that look for leaked secrets know it.
const PREFIX: &str = "darn_";
/// Bytes of a secret.
const BYTES: usize = 32;

/// A secret: `darn_` and 43 letters, 32 random bytes in base64url (RFC 4648, section 5) without padding.
///
/// It is shown by [`Secret::text`] alone, so that no error and no log line can hold it.
pub struct Secret([u8; BYTES]);

impl Secret {
    /// The secret of random bytes.
    pub fn of(random: [u8; BYTES]) -> Self {
        Self(random)
    }

    /// Reads what a client sent; `None` for what no secret looks like.
    pub fn parse(text: &str) -> Option<Self> {
        let bytes = URL_SAFE_NO_PAD.decode(text.strip_prefix(PREFIX)?).ok()?;
        bytes.try_into().ok().map(Self)
    }

    /// The text that a client sends.
    pub fn text(&self) -> String {
        format!("{PREFIX}{}", URL_SAFE_NO_PAD.encode(self.0))
    }

    /// What the service keeps.
    pub fn digest(&self) -> SecretDigest {
        SecretDigest(Sha256::digest(self.0).into())
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

/// The SHA-256 of a secret's bytes. The secret cannot be found from it: it is as random as the digest is long.
#[derive(Clone, Copy)]
pub struct SecretDigest([u8; 32]);

impl SecretDigest {
    /// Reads 64 hexadecimal digits.
    pub fn parse(hex: &str) -> Option<Self> {
        let mut bytes = [0; 32];
        if hex.len() != 2 * bytes.len() || !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
            return None;
        }
        for (byte, digits) in bytes.iter_mut().zip(hex.as_bytes().chunks_exact(2)) {
            *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
        }
        Some(Self(bytes))
    }

    /// Whether both are the same, in a time that does not depend on where they differ.
    pub fn is(&self, other: &Self) -> bool {
        self.0.ct_eq(&other.0).into()
    }
}

impl fmt::Display for SecretDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for SecretDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_secret_and_its_digest_are_read_as_they_are_written(bytes in any::<[u8; 32]>()) {
            let secret = Secret::of(bytes);
            let text = secret.text();
            prop_assert!(text.starts_with("darn_") && text.len() == 48);
            prop_assert_eq!(Secret::parse(&text).map(|read| read.0), Some(bytes));
            let digest = secret.digest();
            let read = SecretDigest::parse(&digest.to_string()).unwrap();
            prop_assert!(read.is(&digest));
            let shown = format!("{secret:?}");
            prop_assert!(!shown.contains(&text[5..]));
        }

        #[test]
        fn any_other_text_is_no_secret_and_no_digest(text in ".{0,80}") {
            prop_assert!(Secret::parse(&text).is_none());
            prop_assert!(SecretDigest::parse(&text).is_none());
        }
    }

    #[test]
    fn a_digest_is_that_of_the_bytes() {
        // SHA-256 of 32 zero bytes, as `head -c32 /dev/zero | sha256sum` says.
        let digest = "66687aadf862bd776c8fc18b8e9f8e20089714856ee233b3902a591d0d5f2925";
        assert_eq!(Secret::of([0; 32]).digest().to_string(), digest);
        assert!(SecretDigest::parse(&digest.to_uppercase()).is_some());
        let other = Secret::of([1; 32]).digest();
        assert!(!other.is(&Secret::of([0; 32]).digest()));
        let text = Secret::of([0; 32]).text();
        for wrong in [
            text.replace("darn_", "barn_"),
            text.clone() + "A",
            text.clone() + "=",
            text[..47].to_owned(),
            // The last letter stands for four bits and two that must be 0.
            text[..47].to_owned() + "B",
        ] {
            assert!(Secret::parse(&wrong).is_none(), "{wrong}");
        }
    }
}
