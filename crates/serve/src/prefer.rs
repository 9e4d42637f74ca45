//! The header `Prefer` (RFC 7240): a client that would rather be answered with a job than wait.

use std::time::Duration;

use axum::http::{HeaderMap, HeaderName, HeaderValue};

/// What a client would like.
pub const PREFER: HeaderName = HeaderName::from_static("prefer");
/// Which of it was done.
pub const PREFERENCE_APPLIED: HeaderName = HeaderName::from_static("preference-applied");

/// The preferences of a request that are known; others are passed over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Preferences {
    /// `respond-async`: an answer at once is worth more than the result.
    pub respond_async: bool,
    /// `wait=N`: how long the client would wait for the result.
    pub wait: Option<Duration>,
}

impl Preferences {
    /// Those of the headers. Of a repeated one the first counts (RFC 7240, section 2).
    pub fn of(headers: &HeaderMap) -> Self {
        let mut all = Self::default();
        let lines = headers.get_all(PREFER).iter();
        let texts = lines.filter_map(|line| line.to_str().ok());
        for preference in texts.flat_map(|text| text.split(',')) {
            let bare = preference.split(';').next().unwrap_or_default();
            let (name, value) = bare.split_once('=').unwrap_or((bare, ""));
            match name.trim().to_ascii_lowercase().as_str() {
                "respond-async" => all.respond_async = true,
                "wait" if all.wait.is_none() => {
                    let seconds = value.trim().trim_matches('"').parse::<u32>().ok();
                    all.wait = seconds.map(|seconds| Duration::from_secs(seconds.into()));
                }
                _ => {}
            }
        }
        all
    }

    /// The value of `Preference-Applied`.
    pub fn applied(self) -> HeaderValue {
        let text = match self.wait {
            Some(wait) => format!("respond-async, wait={}", wait.as_secs()),
            None => "respond-async".to_owned(),
        };
        HeaderValue::try_from(text).unwrap_or(HeaderValue::from_static("respond-async"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preferences_are_read_as_their_rfc_spells_them() {
        let of = |lines: &[&'static str]| {
            let lines = lines.iter().map(|line| HeaderValue::from_static(line));
            Preferences::of(&lines.map(|line| (PREFER, line)).fold(
                HeaderMap::new(),
                |mut headers, (name, line)| {
                    headers.append(name, line);
                    headers
                },
            ))
        };
        let wait = |seconds| Some(Duration::from_secs(seconds));
        for (lines, respond_async, wait) in [
            (vec!["respond-async, wait=10"], true, wait(10)),
            (vec!["Respond-Async", "wait=3"], true, wait(3)),
            (vec!["wait = \"7\"; x=y, wait=9"], false, wait(7)),
            (vec!["respond-async;foo, wait=soon"], true, None),
            (vec!["return=minimal, handling=lenient"], false, None),
            (vec![], false, None),
        ] {
            let expected = Preferences {
                respond_async,
                wait,
            };
            assert_eq!(of(&lines), expected, "{lines:?}");
        }
    }
}
