//! The URL of a webhook: what may stand in it.

use std::{net::IpAddr, sync::Arc};

use ipnet::IpNet;
use url::{Host, Url};

use super::address;
use darn_contract::excerpt;

/// Most bytes of a URL.
const MAX_BYTES: usize = 2000;

/// Where webhooks may go.
#[derive(Debug, Clone, Default)]
pub struct UrlRules {
    /// Networks that are allowed although they are not public.
    pub allowed: Arc<[IpNet]>,
    /// Whether http is, beside https.
    pub http: bool,
}

/// A URL to which a webhook may go, as far as one can say without resolving its host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WebhookUrl(Url);

/// Where a connection goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// A name that is to be resolved.
    Name(String),
    /// An address.
    Address(IpAddr),
}

impl WebhookUrl {
    /// Reads a URL.
    ///
    /// # Errors
    /// What is wrong, as the rest of a sentence.
    pub fn parse(text: &str, rules: &UrlRules) -> Result<Self, String> {
        if text.len() > MAX_BYTES {
            return Err(format!(
                "has {} bytes; the limit is {MAX_BYTES}",
                text.len()
            ));
        }
        // The parser would pass over them, and the URL be another one than it looks.
        if text.chars().any(|c| c.is_control() || c == ' ') {
            return Err("has spaces or control characters".to_owned());
        }
        let url = Url::parse(text).map_err(|error| {
            format!(
                "must be a URL such as https://example.org/darn, not `{}`: {error}",
                excerpt(text)
            )
        })?;
        match url.scheme() {
            "https" => {}
            "http" if rules.http => {}
            "http" => {
                return Err(
                    "must begin with https: this service sends no webhooks without TLS (DARN_WEBHOOK_HTTP)"
                        .to_owned(),
                );
            }
            other => return Err(format!("must begin with https, not {}", excerpt(other))),
        }
        if !url.username().is_empty() || url.password().is_some() {
            return Err(
                "must not have a user's name or password: the signature says who sends".to_owned(),
            );
        }
        if url.fragment().is_some() {
            return Err("must not have a fragment (#…), which is never sent".to_owned());
        }
        if url.as_str().len() > MAX_BYTES {
            return Err(format!(
                "has {} bytes once it is encoded; the limit is {MAX_BYTES}",
                url.as_str().len()
            ));
        }
        let url = Self(url);
        match url.target() {
            Some(Target::Address(address)) => {
                address::check(address, &rules.allowed).map_err(|kind| {
                    format!(
                        "must not go to {address}, which is {kind}; DARN_WEBHOOK_ALLOW allows networks"
                    )
                })?;
            }
            Some(Target::Name(_)) => {}
            None => return Err("must name a host".to_owned()),
        }
        Ok(url)
    }

    /// The URL in its normal form.
    pub fn text(&self) -> &str {
        self.0.as_str()
    }

    /// Whether the connection is encrypted.
    pub fn is_https(&self) -> bool {
        self.0.scheme() == "https"
    }

    /// The host.
    pub fn target(&self) -> Option<Target> {
        Some(match self.0.host()? {
            Host::Domain(name) => Target::Name(name.to_owned()),
            Host::Ipv4(address) => Target::Address(address.into()),
            Host::Ipv6(address) => Target::Address(address.into()),
        })
    }

    /// The host as it is logged and as the header `host` has it, without the port.
    pub fn host(&self) -> &str {
        self.0.host_str().unwrap_or_default()
    }

    /// The port.
    pub fn port(&self) -> u16 {
        let standard = if self.is_https() { 443 } else { 80 };
        self.0.port().unwrap_or(standard)
    }

    /// The header `host`.
    pub fn authority(&self) -> String {
        match self.0.port() {
            Some(port) => format!("{}:{port}", self.host()),
            None => self.host().to_owned(),
        }
    }

    /// Path and query.
    pub fn path(&self) -> String {
        let path = self.0.path();
        match self.0.query() {
            Some(query) => format!("{path}?{query}"),
            None => path.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(allowed: &[&str]) -> UrlRules {
        UrlRules {
            allowed: allowed.iter().map(|text| text.parse().unwrap()).collect(),
            http: false,
        }
    }

    #[test]
    fn a_url_has_the_parts_of_a_request() {
        let rules = rules(&[]);
        let url = WebhookUrl::parse("https://Example.org:8443/a%20b?c=d", &rules).unwrap();
        assert_eq!(url.text(), "https://example.org:8443/a%20b?c=d");
        assert_eq!(url.authority(), "example.org:8443");
        assert_eq!(url.path(), "/a%20b?c=d");
        assert_eq!(url.target(), Some(Target::Name("example.org".to_owned())));
        let url = WebhookUrl::parse("https://example.org", &rules).unwrap();
        assert_eq!((url.port(), url.path().as_str()), (443, "/"));
        assert_eq!(super::super::shown("https://a.b/c?d=e?f"), "https://a.b/c");
        assert_eq!(super::super::shown("https://a.b/c"), "https://a.b/c");
    }

    #[test]
    fn what_may_not_stand_in_it_is_told() {
        let long = format!("https://example.org/{}", "a".repeat(MAX_BYTES));
        let growing = format!("https://example.org/{}", "ä".repeat(MAX_BYTES / 3));
        for (text, part) in [
            ("", "must be a URL"),
            ("example.org/hook", "must be a URL"),
            ("/hook", "must be a URL"),
            ("https://", "must be a URL"),
            ("https://[::1", "must be a URL"),
            ("https://example.org:99999/", "must be a URL"),
            ("http://example.org/", "must begin with https"),
            ("ftp://example.org/", "must begin with https"),
            ("file:///etc/passwd", "must begin with https"),
            ("javascript:alert(1)", "must begin with https"),
            ("https://user@example.org/", "a user's name"),
            ("https://user:secret@example.org/", "a user's name"),
            ("https://example.org/#part", "a fragment"),
            ("https://example.org/ hook", "spaces"),
            ("https://exam\nple.org/hook", "control characters"),
            (long.as_str(), "the limit is 2000"),
            (growing.as_str(), "the limit is 2000"),
            // Addresses in every spelling that a resolver would take.
            ("https://127.0.0.1/", "loopback"),
            ("https://127.1/", "loopback"),
            ("https://2130706433/", "loopback"),
            ("https://0x7f000001/", "loopback"),
            ("https://0177.0.0.1/", "loopback"),
            ("https://127.0.0.1./", "loopback"),
            ("https://%31%32%37.0.0.1/", "loopback"),
            ("https://１２７.0.0.1/", "loopback"),
            ("https://[::1]/", "loopback"),
            ("https://[::ffff:7f00:1]/", "loopback"),
            ("https://169.254.169.254/latest/meta-data", "link-local"),
            ("https://10.1.2.3:8443/", "a private network"),
            ("https://[64:ff9b::a00:1]/", "a private network"),
        ] {
            let refused = WebhookUrl::parse(text, &rules(&[])).unwrap_err();
            assert!(refused.contains(part), "{text}: {refused}");
            assert!(!refused.contains("secret"), "{refused}");
        }
    }

    #[test]
    fn settings_allow_more() {
        let allowed = rules(&["10.1.0.0/16"]);
        assert!(WebhookUrl::parse("https://10.1.2.3/", &allowed).is_ok());
        assert!(WebhookUrl::parse("https://10.2.2.3/", &allowed).is_err());
        let http = UrlRules {
            http: true,
            ..rules(&[])
        };
        let url = WebhookUrl::parse("http://example.org/", &http).unwrap();
        assert_eq!((url.port(), url.is_https()), (80, false));
        assert!(WebhookUrl::parse("http://127.0.0.1/", &http).is_err());
    }
}
