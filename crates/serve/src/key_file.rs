//! The file of keys (`--keys`): JSON that is read strictly, so that a slip of the pen takes no limit away.
//!
//! ```json
//! {
//!   "defaults": {"requestsPerMinute": 120},
//!   "keys": [
//!     {"id": "textile-lab", "sha256": "66687aad…", "scopes": ["mend", "jobs"],
//!      "limits": {"bytesPerDay": 10000000000, "waitingJobs": 50}, "expires": "2027-01-01T00:00:00Z",
//!      "webhookSecrets": ["whsec_…"]}
//!   ]
//! }
//! ```

use std::{
    fmt,
    marker::PhantomData,
    str::FromStr,
    sync::Arc,
    time::{Duration, SystemTime},
};

use clap::ValueEnum;
use darn_contract::{FieldError, JsonError, excerpt, from_json};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error as _, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

use super::{key_secret::SecretDigest, webhook::WebhookSecrets};

/// Most letters of a key's id.
const MAX_ID_LENGTH: usize = 64;

/// All that the file says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
pub struct KeyFile {
    /// Limits of keys that do not say their own.
    #[serde(default, deserialize_with = "object")]
    pub defaults: KeyLimits,
    /// The keys.
    pub keys: KeyList,
}

impl KeyFile {
    /// Reads the file's text.
    ///
    /// # Errors
    /// What is wrong, with line and column, and the JSON pointer of what has a wrong form.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        match from_json::<Object<Self>>(text) {
            Ok(Object(file)) => Ok(file),
            Err(JsonError::Syntax { detail }) => Err(format!("not JSON: {detail}")),
            Err(JsonError::Shape(FieldError { pointer, detail })) => {
                // The reader of values knows the pointer, the reader of text the place.
                let place = match serde_json::from_slice::<Object<Self>>(text) {
                    Err(error) => format!(" at line {} column {}", error.line(), error.column()),
                    Ok(_) => String::new(),
                };
                let pointer = if pointer.is_empty() { "/" } else { &pointer };
                Err(format!("`{pointer}`: {detail}{place}"))
            }
        }
    }
}

/// A value that is read from an object alone. What serde derives would read an array of the fields' values, too.
struct Object<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ObjectVisitor(PhantomData))
    }
}

struct ObjectVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for ObjectVisitor<T> {
    type Value = Object<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, members: A) -> Result<Object<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(members)).map(Object)
    }
}

fn object<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<T, D::Error> {
    Object::deserialize(deserializer).map(|Object(value)| value)
}

fn optional_object<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    let read = Option::<Object<T>>::deserialize(deserializer)?;
    Ok(read.map(|Object(value)| value))
}

/// The keys; no two have the same id or the same secret.
#[derive(Debug)]
pub struct KeyList(pub Vec<KeyEntry>);

impl<'de> Deserialize<'de> for KeyList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(KeyListVisitor)
    }
}

struct KeyListVisitor;

impl<'de> Visitor<'de> for KeyListVisitor {
    type Value = KeyList;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of keys")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<KeyList, A::Error> {
        let mut keys: Vec<KeyEntry> = Vec::new();
        while let Some(Object(key)) = items.next_element::<Object<KeyEntry>>()? {
            for other in &keys {
                if other.id == key.id {
                    let id = &key.id;
                    return Err(A::Error::custom(format!("the id `{id}` comes twice")));
                }
                if other.sha256.0.is(&key.sha256.0) {
                    let (one, two) = (&other.id, &key.id);
                    return Err(A::Error::custom(format!(
                        "`{one}` and `{two}` have the same sha256"
                    )));
                }
            }
            keys.push(key);
        }
        Ok(KeyList(keys))
    }
}

/// An entry of the file.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
pub struct KeyEntry {
    /// The key's name, for operators and for the jobs that it owns.
    pub id: KeyId,
    /// The digest of its secret.
    pub sha256: EntryDigest,
    /// What it may do.
    pub scopes: Vec<Scope>,
    /// What it may take; the file's defaults where it does not say.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "optional_object"
    )]
    pub limits: Option<KeyLimits>,
    /// From when on it is refused; left out, never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expires: Option<Expiry>,
    /// What signs the webhooks of its jobs; left out, the secret of the service.
    #[serde(default, skip_serializing_if = "WebhookSecrets::is_empty")]
    pub webhook_secrets: WebhookSecrets,
}

/// The name of a key: 1 to 64 letters, digits, `-` and `_`. So it is never the text of an address, by which jobs of a service without keys
/// are told apart.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct KeyId(Arc<str>);

impl KeyId {
    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for KeyId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_plain = |b: u8| b.is_ascii_alphanumeric() || b"-_".contains(&b);
        if (1..=MAX_ID_LENGTH).contains(&text.len()) && text.bytes().all(is_plain) {
            Ok(Self(text.into()))
        } else {
            Err(format!(
                "an id has 1 to {MAX_ID_LENGTH} letters, digits, `-` and `_`, not `{}`",
                excerpt(text)
            ))
        }
    }
}

impl TryFrom<String> for KeyId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<KeyId> for String {
    fn from(id: KeyId) -> Self {
        id.as_str().to_owned()
    }
}

impl fmt::Display for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// The digest of a secret as the file has it.
#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct EntryDigest(pub SecretDigest);

impl TryFrom<String> for EntryDigest {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, &'static str> {
        // The text is not repeated: it may be the secret, put here by mistake.
        let digest = SecretDigest::parse(&text);
        digest
            .map(Self)
            .ok_or("`sha256` has 64 hexadecimal digits, as `darn key new` prints them")
    }
}

impl From<EntryDigest> for String {
    fn from(digest: EntryDigest) -> Self {
        digest.0.to_string()
    }
}

/// What a key may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Deserialize, Serialize)]
#[serde(try_from = "String", into = "&'static str")]
pub enum Scope {
    /// Mend, list holes, search anchors, strip, edit in sessions
    Mend,
    /// Hand over jobs and use its own
    Jobs,
    /// Read the metrics
    Metrics,
    /// See, cancel, retry and delete the jobs of all keys
    Admin,
}

impl Scope {
    /// Its word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Mend => "mend",
            Self::Jobs => "jobs",
            Self::Metrics => "metrics",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl TryFrom<String> for Scope {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let scopes = Self::value_variants();
        let known = scopes.iter().find(|scope| scope.word() == text);
        known.copied().ok_or_else(|| {
            let text = excerpt(&text);
            format!("`{text}` is no scope; the scopes are mend, jobs, metrics and admin")
        })
    }
}

impl From<Scope> for &'static str {
    fn from(scope: Scope) -> Self {
        scope.word()
    }
}

/// What a key may take; nothing bounds what is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
pub struct KeyLimits {
    /// Requests in a minute.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requests_per_minute: Option<u64>,
    /// Bytes of the bodies that it sends in a day.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bytes_per_day: Option<u64>,
    /// Jobs that wait at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub waiting_jobs: Option<u64>,
    /// Jobs that run at once; more wait.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub running_jobs: Option<u64>,
    /// Sessions open at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sessions: Option<u64>,
}

impl KeyLimits {
    /// The limits that it says, and `defaults` where it says none.
    pub fn or(self, defaults: Self) -> Self {
        Self {
            requests_per_minute: self.requests_per_minute.or(defaults.requests_per_minute),
            bytes_per_day: self.bytes_per_day.or(defaults.bytes_per_day),
            waiting_jobs: self.waiting_jobs.or(defaults.waiting_jobs),
            running_jobs: self.running_jobs.or(defaults.running_jobs),
            sessions: self.sessions.or(defaults.sessions),
        }
    }
}

/// A moment, written as RFC 3339 has it: `2027-01-01T00:00:00Z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expiry(pbjson_types::Timestamp);

impl Expiry {
    /// The moment; the year 1970 for one before it.
    pub fn time(&self) -> SystemTime {
        let seconds = u64::try_from(self.0.seconds).unwrap_or(0);
        SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)
    }
}

impl FromStr for Expiry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = serde_json::from_value(text.into()).map(Self);
        read.map_err(|_| {
            let text = excerpt(text);
            format!("`{text}` is no moment such as 2027-01-01T00:00:00Z (RFC 3339)")
        })
    }
}

impl<'de> Deserialize<'de> for Expiry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}

impl Serialize for Expiry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIGEST: &str = "66687aadf862bd776c8fc18b8e9f8e20089714856ee233b3902a591d0d5f2925";
    const OTHER: &str = "00687aadf862bd776c8fc18b8e9f8e20089714856ee233b3902a591d0d5f2925";

    /// A file with these members in its only key, in one line each.
    fn file(members: &str) -> String {
        format!("{{\n\"keys\": [\n{{{members}}}\n]}}")
    }

    #[test]
    fn a_key_is_read_with_the_defaults_of_the_file() {
        let text = format!(
            r#"{{"defaults": {{"requestsPerMinute": 60, "sessions": 2}}, "keys": [
                {{"id": "lab_1", "sha256": "{DIGEST}", "scopes": ["mend", "admin"],
                 "limits": {{"sessions": 5, "bytesPerDay": 1000}}, "expires": "2027-01-01T01:00:00+01:00"}},
                {{"id": "viewer", "sha256": "{OTHER}", "scopes": []}}]}}"#
        );
        let KeyFile { defaults, keys } = KeyFile::parse(text.as_bytes()).unwrap();
        let [lab, viewer] = &keys.0[..] else {
            panic!("{keys:?}");
        };
        assert_eq!(lab.scopes, [Scope::Mend, Scope::Admin]);
        let limits = lab.limits.unwrap().or(defaults);
        assert_eq!(limits.requests_per_minute, Some(60));
        assert_eq!(
            (limits.sessions, limits.bytes_per_day),
            (Some(5), Some(1000))
        );
        assert_eq!(limits.running_jobs, None);
        let midnight = SystemTime::UNIX_EPOCH + Duration::from_secs(1_798_761_600);
        assert_eq!(lab.expires.unwrap().time(), midnight);
        assert!(viewer.limits.is_none() && viewer.expires.is_none());
        let written = serde_json::to_string(viewer).unwrap();
        let expected = format!(r#"{{"id":"viewer","sha256":"{OTHER}","scopes":[]}}"#);
        assert_eq!(written, expected);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let key = format!(r#""id": "a", "sha256": "{DIGEST}", "scopes": ["mend"]"#);
        for (text, parts) in [
            (String::new(), vec!["not JSON", "line 1 column 0"]),
            (
                "{\n  \"keys\": [}\n".into(),
                vec!["not JSON", "line 2 column 12"],
            ),
            ("[]".into(), vec!["`/`", "expected an object", "line 1"]),
            (
                file("").replace("{}", "[]"),
                vec!["`/keys/0`", "expected an object", "line 3"],
            ),
            (
                file(&format!("{key}, \"limits\": [1]")),
                vec!["`/keys/0/limits`", "expected an object"],
            ),
            ("{}".into(), vec!["missing field `keys`", "line 1 column 2"]),
            (
                file(&format!(r#"{key}, "limit": {{}}"#)),
                vec!["`/keys/0/limit`", "unknown field `limit`", "line 3"],
            ),
            (
                file(&key.replace("mend", "mendd")),
                vec!["`/keys/0/scopes/0`", "`mendd` is no scope", "line 3"],
            ),
            (
                file(&key.replace("\"a\"", "\"a b\"")),
                vec!["`/keys/0/id`", "an id has 1 to 64 letters", "line 3"],
            ),
            (
                file(&key.replace("\"a\"", "\"10.0.0.1\"")),
                vec!["`/keys/0/id`", "line 3"],
            ),
            (
                file(&format!(r#"{key}, "limits": {{"sessions": -1}}"#)),
                vec!["`/keys/0/limits/sessions`", "line 3"],
            ),
            (
                file(&format!(r#"{key}, "expires": "tomorrow""#)),
                vec!["`/keys/0/expires`", "`tomorrow` is no moment", "line 3"],
            ),
            (
                file(&format!("{key}}},\n{{{}", key.replace("\"a\"", "\"b\""))),
                vec!["`/keys`", "`a` and `b` have the same sha256", "line 5"],
            ),
            (
                file(&format!("{key}}},\n{{{}", key.replace(DIGEST, OTHER))),
                vec!["`/keys`", "the id `a` comes twice", "line 5"],
            ),
        ] {
            let error = KeyFile::parse(text.as_bytes()).unwrap_err();
            for part in parts {
                assert!(error.contains(part), "{text}: {error}");
            }
        }
    }

    #[test]
    fn a_secret_put_in_place_of_its_digest_is_not_repeated() {
        let secret = "darn_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";
        let text = file(&format!(r#""id": "a", "sha256": "{secret}", "scopes": []"#));
        let error = KeyFile::parse(text.as_bytes()).unwrap_err();
        assert!(error.contains("`/keys/0/sha256`"), "{error}");
        assert!(!error.contains("AAAA"), "{error}");
    }
}
