//! The settings of webhooks.

use std::{
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use clap::Args;
use ipnet::IpNet;
use rustls::{
    RootCertStore,
    pki_types::{CertificateDer, pem::PemObject},
};
use tracing::warn;

use super::WebhookSecrets;
use crate::config::duration;
use crate::watched_files::{Watched, WatchedSource, read_file};

/// Webhooks of jobs
#[derive(Debug, Clone, Args)]
pub struct WebhookArgs {
    /// File with the secret that signs webhooks: `whsec_` and the base64 of 24 to 64 bytes. Of several, one a line, each signs; read again when it changes. Left out, only
    /// jobs of keys with `webhookSecrets` may name a webhook
    #[arg(long, env = "DARN_WEBHOOK_SECRET", value_name = "FILE")]
    pub webhook_secret: Option<PathBuf>,

    /// Networks that webhooks may go to although they are not public, such as 10.1.0.0/16
    #[arg(
        long,
        env = "DARN_WEBHOOK_ALLOW",
        value_name = "NETWORK",
        value_delimiter = ',',
        value_parser = network
    )]
    pub webhook_allow: Vec<IpNet>,

    /// Let webhooks go without TLS, too: to http URLs
    #[arg(long, env = "DARN_WEBHOOK_HTTP")]
    pub webhook_http: bool,

    /// File of certificates (PEM) of authorities that may have signed those of webhooks' receivers, beside the system's
    #[arg(long, env = "DARN_WEBHOOK_CA", value_name = "FILE")]
    pub webhook_ca: Option<PathBuf>,

    /// Longest time in which the receiver of a webhook may answer, at most 1m
    #[arg(long, env = "DARN_WEBHOOK_TIMEOUT", value_name = "TIME", default_value = "15s", value_parser = timeout)]
    pub webhook_timeout: Duration,
}

/// Why the settings of webhooks cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WebhookSettingsError {
    /// A file cannot be read.
    #[error("{} cannot be read: {source} ({setting})", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The setting that names it.
        setting: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// A file says something else.
    #[error("{} is not valid: {detail} ({setting})", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The setting that names it.
        setting: &'static str,
        /// What is wrong.
        detail: String,
    },
    /// The secret itself stands where its file is to be named.
    #[error(
        "DARN_WEBHOOK_SECRET names a file with the secret, and not the secret itself, which others would see in the list of processes"
    )]
    SecretItself,
    /// TLS cannot be set up.
    #[error("TLS cannot be set up: {0}")]
    Tls(#[from] rustls::Error),
}

/// The setting of the file of secrets.
const SECRETS: &str = "DARN_WEBHOOK_SECRET";

/// The file of the service's secrets, one a line; empty lines and those that begin with # say nothing.
#[derive(Debug)]
pub struct SecretsFile(PathBuf);

impl WatchedSource for SecretsFile {
    type Value = WebhookSecrets;
    type Error = WebhookSettingsError;
    const READ_AGAIN: &'static str = "secrets of webhooks read again";
    const STAYS: &'static str = "the secrets of webhooks stay as they are";

    fn texts(&self) -> Result<Vec<Vec<u8>>, WebhookSettingsError> {
        Ok(vec![read(&self.0, SECRETS)?])
    }

    fn value(
        &self,
        texts: &[Vec<u8>],
        _: Option<&WebhookSecrets>,
    ) -> Result<WebhookSecrets, WebhookSettingsError> {
        let text = texts.concat();
        let text = String::from_utf8_lossy(&text);
        let lines = text.lines().map(str::trim);
        let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
        let secrets = match WebhookSecrets::parse(lines) {
            Ok(secrets) if secrets.is_empty() => Err("it has no secret".to_owned()),
            secrets => secrets,
        };
        secrets.map_err(|detail| WebhookSettingsError::Invalid {
            path: self.0.clone(),
            setting: SECRETS,
            detail,
        })
    }
}

/// The secrets of the service; `None` without a file.
///
/// # Errors
/// The file cannot be read, or has no secrets.
pub fn service_secrets(
    settings: &WebhookArgs,
) -> Result<Option<Watched<SecretsFile>>, WebhookSettingsError> {
    let Some(path) = &settings.webhook_secret else {
        return Ok(None);
    };
    if path.to_str().is_some_and(|text| text.starts_with("whsec_")) {
        return Err(WebhookSettingsError::SecretItself);
    }
    Watched::open(SecretsFile(path.clone())).map(Some)
}

fn read(path: &Path, setting: &'static str) -> Result<Vec<u8>, WebhookSettingsError> {
    read_file(path).map_err(|source| WebhookSettingsError::Unreadable {
        path: path.to_owned(),
        setting,
        source,
    })
}

/// The certificates of the authorities that are trusted: the system's, and those of the settings' file.
///
/// # Errors
/// The file cannot be read, or has no certificate.
pub fn roots(settings: &WebhookArgs) -> Result<RootCertStore, WebhookSettingsError> {
    const SETTING: &str = "DARN_WEBHOOK_CA";
    let mut roots = RootCertStore::empty();
    let system = rustls_native_certs::load_native_certs();
    for fault in &system.errors {
        warn!(%fault, "some of the system's certificates cannot be read; webhooks may not go where they are needed");
    }
    roots.add_parsable_certificates(system.certs);
    let Some(path) = &settings.webhook_ca else {
        return Ok(roots);
    };
    let invalid = |detail: String| WebhookSettingsError::Invalid {
        path: path.clone(),
        setting: SETTING,
        detail,
    };
    let text = read(path, SETTING)?;
    let mut count = 0;
    for certificate in CertificateDer::pem_slice_iter(&text) {
        let certificate = certificate.map_err(|error| invalid(error.to_string()))?;
        let added = roots.add(certificate);
        added.map_err(|error| invalid(format!("certificate {count}: {error}")))?;
        count += 1;
    }
    if count == 0 {
        return Err(invalid("it has no certificate in PEM".to_owned()));
    }
    Ok(roots)
}

fn network(text: &str) -> Result<IpNet, String> {
    text.trim()
        .parse()
        .map_err(|_| "must be a network such as 10.1.0.0/16 or fd00:1::/32".to_owned())
}

fn timeout(text: &str) -> Result<Duration, String> {
    match duration(text)? {
        time if time <= Duration::from_secs(60) => Ok(time),
        _ => Err("must be at most 1m".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        webhooks: WebhookArgs,
    }

    fn settings(arguments: &[&str]) -> Result<WebhookArgs, String> {
        let parsed = Command::try_parse_from([&["darn"], arguments].concat());
        parsed
            .map(|command| command.webhooks)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn values_are_checked() {
        let allowed = settings(&["--webhook-allow", "10.1.0.0/16,fd00::/8"]).unwrap();
        assert_eq!(allowed.webhook_allow.len(), 2);
        for bad in [
            ["--webhook-allow", "10.1.0.0"],
            ["--webhook-allow", "10.1.0.0/33"],
            ["--webhook-allow", "example.org"],
            ["--webhook-timeout", "61s"],
            ["--webhook-timeout", "0s"],
        ] {
            let refused = settings(&bad).unwrap_err();
            assert!(refused.contains(bad[0]), "{refused}");
        }
    }

    #[test]
    fn files_are_checked() {
        let folder = std::env::temp_dir().join(format!("darn-webhooks-{}", uuid::Uuid::new_v4()));
        fs::create_dir(&folder).unwrap();
        let file = |text: &str| {
            let path = folder.join(uuid::Uuid::new_v4().to_string());
            fs::write(&path, text).unwrap();
            path.to_str().unwrap().to_owned()
        };
        let secrets = |path: &str| service_secrets(&settings(&["--webhook-secret", path]).unwrap());
        let good = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
        let read = secrets(&file(&format!("# ours\n\n{good} \n"))).unwrap();
        let read = read.map(|secrets| WebhookSecrets::clone(&secrets.value()));
        assert_eq!(read, Some(WebhookSecrets::parse([good]).unwrap()));
        for path in [
            &file("# nothing"),
            &file("password"),
            good,
            "/no/such/file",
            &file(&" ".repeat(2 << 20)),
        ] {
            let refused = secrets(path).unwrap_err().to_string();
            assert!(refused.contains("DARN_WEBHOOK_SECRET"), "{refused}");
            assert!(!refused.contains("MfKQ"), "{refused}");
        }
        let authorities = |path: &str| roots(&settings(&["--webhook-ca", path]).unwrap());
        let broken = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
        let long = file(&" ".repeat(2 << 20));
        for path in [&file("nothing"), &file(broken), &long, "/no/such/file"] {
            let refused = authorities(path).unwrap_err().to_string();
            assert!(refused.contains("DARN_WEBHOOK_CA"), "{refused}");
        }
        fs::remove_dir_all(folder).unwrap();
    }
}
