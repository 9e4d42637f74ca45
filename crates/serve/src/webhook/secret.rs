//! The secrets of webhooks, and what they sign (<https://github.com/standard-webhooks/standard-webhooks/blob/main/spec/standard-webhooks.md>).

use std::{fmt, sync::Arc};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use hmac::{Hmac, Mac};
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error as _, SeqAccess, Visitor},
};
use sha2::Sha256;

/// How the text of a secret begins.
const PREFIX: &str = "whsec_";
/// Fewest and most bytes of a secret.
const BYTES: std::ops::RangeInclusive<usize> = 24..=64;
/// Most secrets of a client.
const MOST: usize = 4;

/// One secret.
#[derive(Clone, PartialEq, Eq)]
struct WebhookSecret(Vec<u8>);

impl fmt::Debug for WebhookSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("WebhookSecret")
    }
}

/// The secrets of a client. Each of them signs, so that a receiver can change from one to the next.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(into = "Vec<String>")]
pub struct WebhookSecrets(Arc<[WebhookSecret]>);

impl WebhookSecrets {
    /// Reads secrets, each `whsec_` and base64 of 24 to 64 bytes.
    ///
    /// # Errors
    /// What is wrong; without the text, which is secret.
    pub fn parse<'a>(texts: impl IntoIterator<Item = &'a str>) -> Result<Self, String> {
        let read = |text: &str| {
            let encoded = text.strip_prefix(PREFIX)?;
            let bytes = STANDARD.decode(encoded).ok()?;
            BYTES.contains(&bytes.len()).then_some(WebhookSecret(bytes))
        };
        let secrets: Option<Vec<_>> = texts.into_iter().map(read).collect();
        let secrets = secrets.ok_or_else(|| {
            format!(
                "a secret of webhooks is `{PREFIX}` and the base64 of {} to {} bytes, as `echo {PREFIX}$(openssl rand -base64 32)` prints it",
                BYTES.start(),
                BYTES.end()
            )
        })?;
        if secrets.len() > MOST {
            return Err(format!("at most {MOST} secrets of webhooks sign at once"));
        }
        Ok(Self(secrets.into()))
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The header `webhook-signature` of a message: a signature of each secret, with a space between.
    pub fn sign(&self, id: &str, timestamp: u64, body: &[u8]) -> String {
        let signatures = self.0.iter().filter_map(|secret| {
            // A key may have any length.
            let mut mac = Hmac::<Sha256>::new_from_slice(&secret.0).ok()?;
            mac.update(format!("{id}.{timestamp}.").as_bytes());
            mac.update(body);
            let signature = STANDARD.encode(mac.finalize().into_bytes());
            Some(format!("v1,{signature}"))
        });
        signatures.collect::<Vec<_>>().join(" ")
    }
}

/// By hand: what serde derives repeats a text in the error where a list is expected.
impl<'de> Deserialize<'de> for WebhookSecrets {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SecretsVisitor)
    }
}

struct SecretsVisitor;

impl<'de> Visitor<'de> for SecretsVisitor {
    type Value = WebhookSecrets;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of secrets of webhooks")
    }

    fn visit_str<E: serde::de::Error>(self, _: &str) -> Result<WebhookSecrets, E> {
        Err(E::custom("secrets of webhooks stand in an array"))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<WebhookSecrets, A::Error> {
        let mut texts = Vec::new();
        while let Some(text) = items.next_element::<String>()? {
            texts.push(text);
        }
        WebhookSecrets::parse(texts.iter().map(String::as_str)).map_err(A::Error::custom)
    }
}

impl From<WebhookSecrets> for Vec<String> {
    fn from(secrets: WebhookSecrets) -> Self {
        let text = |secret: &WebhookSecret| format!("{PREFIX}{}", STANDARD.encode(&secret.0));
        secrets.0.iter().map(text).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What PyPI's `standardwebhooks` 1.0.1 signs; `scripts/webhooks` computes it again.
    ///
    /// ```text
    /// python3 -c 'import datetime as d; from standardwebhooks.webhooks import Webhook as W
    /// print(W("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").sign("msg_p5jXN8AQM9LWM0D4loKWxJek",
    ///     d.datetime.fromtimestamp(1614265330, d.timezone.utc), "{\"test\": 2432232314}"))'
    /// ```
    #[test]
    fn a_message_is_signed_as_the_specification_has_it() {
        let sign = |secrets: &[&str]| {
            let secrets = WebhookSecrets::parse(secrets.iter().copied()).unwrap();
            let id = "msg_p5jXN8AQM9LWM0D4loKWxJek";
            secrets.sign(id, 1_614_265_330, br#"{"test": 2432232314}"#)
        };
        let first = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
        let signature = "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=";
        assert_eq!(sign(&[first]), signature);
        let second = "whsec_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";
        let both = sign(&[first, second]);
        assert_eq!(both, format!("{signature} {}", sign(&[second])));
        assert_ne!(sign(&[first]), sign(&[second]));
    }

    #[test]
    fn what_is_no_secret_is_refused_and_not_repeated() {
        let long = format!("whsec_{}", STANDARD.encode([7; 65]));
        for text in [
            "",
            "whsec_",
            "MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
            "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLa",
            "whsec_!fKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
            long.as_str(),
        ] {
            let refused = WebhookSecrets::parse([text]).unwrap_err();
            assert!(!refused.contains("MfKQ"), "{refused}");
        }
        let good = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
        assert!(WebhookSecrets::parse([good; 4]).is_ok());
        assert!(WebhookSecrets::parse([good; 5]).is_err());
        let secrets = WebhookSecrets::parse([good]).unwrap();
        assert!(!format!("{secrets:?}").contains("49"));
        let written = serde_json::to_string(&secrets).unwrap();
        assert_eq!(written, format!("[\"{good}\"]"));
        let read = |text: &str| serde_json::from_str::<WebhookSecrets>(text);
        assert_eq!(read(&written).unwrap(), secrets);
        for wrong in [
            &written[1..written.len() - 1],
            "[\"whsec_MfKQ\"]",
            "{}",
            "7",
        ] {
            let refused = read(wrong).unwrap_err().to_string();
            assert!(!refused.contains("MfKQ"), "{refused}");
        }
    }
}
