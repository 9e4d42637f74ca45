//! The address of storage that speaks S3.

use std::{fmt, str::FromStr};

/// A bucket, and what the names of all files in it begin with: `s3://BUCKET/PREFIX`.
///
/// Where the storage is and who asks for it stands in the environment, in the variables of AWS (`AWS_ENDPOINT_URL`, `AWS_REGION`,
/// `AWS_ACCESS_KEY_ID` and so on), unless [`Self::with_settings`] gives others.
#[derive(Clone, PartialEq, Eq)]
pub struct Bucket {
    name: String,
    prefix: String,
    settings: Option<Vec<(String, String)>>,
}

/// A text that is no address of a bucket.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "must be s3://BUCKET or s3://BUCKET/PREFIX: a bucket of 3 to 63 lower-case letters, digits, `-` and `.`; a prefix of letters, digits, `-`, `_` and `.` between slashes, without parts that are empty, `.` or `..`"
)]
pub struct InvalidBucket;

impl Bucket {
    /// The same bucket with settings in place of those of the environment, under the names of its variables. For tests.
    pub fn with_settings(self, settings: impl IntoIterator<Item = (String, String)>) -> Self {
        Self {
            settings: Some(settings.into_iter().collect()),
            ..self
        }
    }

    /// Its name.
    #[cfg(feature = "s3")]
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// What names begin with, without a slash at its end; empty for nothing.
    #[cfg(feature = "s3")]
    pub(super) fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The variables of AWS and their values.
    #[cfg(feature = "s3")]
    pub(super) fn settings(&self) -> Vec<(String, String)> {
        match &self.settings {
            Some(settings) => settings.clone(),
            None => std::env::vars_os()
                .filter_map(|(name, value)| {
                    Some((name.into_string().ok()?, value.into_string().ok()?))
                })
                .filter(|(name, _)| name.starts_with("AWS_"))
                .collect(),
        }
    }
}

impl FromStr for Bucket {
    type Err = InvalidBucket;

    fn from_str(text: &str) -> Result<Self, InvalidBucket> {
        let rest = text.strip_prefix("s3://").ok_or(InvalidBucket)?;
        let (name, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        let prefix = prefix.strip_suffix('/').unwrap_or(prefix);
        let is_of_name = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
        let is_name = (3..=63).contains(&name.len())
            && name.bytes().all(|it| is_of_name(it) || b"-.".contains(&it))
            && name.bytes().next().is_some_and(is_of_name);
        let is_part = |part: &str| {
            !["", ".", ".."].contains(&part)
                && part
                    .bytes()
                    .all(|it| it.is_ascii_alphanumeric() || b"-_.".contains(&it))
        };
        if !is_name || !(prefix.is_empty() || prefix.split('/').all(is_part)) {
            return Err(InvalidBucket);
        }
        Ok(Self {
            name: name.to_owned(),
            prefix: prefix.to_owned(),
            settings: None,
        })
    }
}

impl fmt::Display for Bucket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "s3://{}", self.name)?;
        match self.prefix.as_str() {
            "" => Ok(()),
            prefix => write!(f, "/{prefix}"),
        }
    }
}

/// Without the settings, which have secrets.
impl fmt::Debug for Bucket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Bucket({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_back_and_nothing_else_is_one() {
        for (text, read) in [
            ("s3://scans", "s3://scans"),
            ("s3://scans/", "s3://scans"),
            (
                "s3://scans.2026/museum/darn_1/",
                "s3://scans.2026/museum/darn_1",
            ),
        ] {
            assert_eq!(text.parse::<Bucket>().unwrap().to_string(), read);
        }
        for bad in [
            "",
            "scans",
            "s3:/scans",
            "s3://",
            "s3://ab",
            "s3:///prefix",
            "https://scans",
            "s3://key:secret@scans",
            "s3://Scans",
            "s3://scans//a",
            "s3://scans/a//b",
            "s3://scans/../a",
            "s3://scans/a b",
            "s3://scans/a?b",
        ] {
            assert_eq!(bad.parse::<Bucket>(), Err(InvalidBucket), "{bad}");
        }
    }

    #[test]
    fn secrets_are_not_shown() {
        let bucket: Bucket = "s3://scans/darn".parse().unwrap();
        let setting = ("AWS_SECRET_ACCESS_KEY".to_owned(), "hush".to_owned());
        let shown = format!("{:?}", bucket.with_settings([setting]));
        assert_eq!(shown, "Bucket(s3://scans/darn)");
    }
}
