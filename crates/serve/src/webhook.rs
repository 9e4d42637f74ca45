//! Webhooks: a client is told of its job's end by a signed request (<https://www.standardwebhooks.com>), so that it need not ask.
//!
//! A job names a URL. When it ends, the jobs' database keeps that end in an outbox, in the same transaction; [`sender`] takes it from there and tries
//! until the receiver has it. Where a request may go is decided in [`destination`] and, once its host is resolved, in [`address`].

mod address;
mod destination;
mod event;
mod post;
mod schedule;
mod secret;
pub mod sender;
mod settings;

use std::{sync::Arc, time::SystemTime};

use super::{
    error::RequestError,
    key_file::KeyId,
    keys::{Key, KeyRing},
    watched_files::Watched,
};
use destination::{UrlRules, WebhookUrl};
use post::Poster;
pub use secret::WebhookSecrets;
use settings::{SecretsFile, roots, service_secrets};
pub use settings::{WebhookArgs, WebhookSettingsError};

/// What the webhooks of a service need.
#[derive(Debug)]
pub struct Webhooks {
    /// Where they may go.
    rules: UrlRules,
    poster: Poster,
    /// What signs those of clients without secrets of their own; `None`: they may have none.
    secrets: Option<Watched<SecretsFile>>,
}

/// Why no webhook can be signed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum Unsigned {
    #[error("this service has no secret to sign webhooks of this client with")]
    NoSecret,
    #[error("the key that handed the job over is no longer taken")]
    NoKey,
}

impl Webhooks {
    /// Reads the files that the settings name.
    ///
    /// # Errors
    /// A file cannot be read, or says something else.
    pub fn new(settings: &WebhookArgs) -> Result<Self, WebhookSettingsError> {
        let rules = UrlRules {
            allowed: settings.webhook_allow.clone().into(),
            http: settings.webhook_http,
        };
        Ok(Self {
            poster: Poster::new(roots(settings)?, rules.clone(), settings.webhook_timeout)?,
            secrets: service_secrets(settings)?,
            rules,
        })
    }

    /// Reads the file of secrets again whenever it changes; never ends with such a file.
    pub async fn watch(&self) {
        if let Some(secrets) = &self.secrets {
            secrets.watch().await;
        }
    }

    /// The secrets of the service; empty without a file of them.
    fn service_secrets(&self) -> WebhookSecrets {
        let secrets = self.secrets.as_ref();
        secrets.map_or_else(WebhookSecrets::default, |secrets| {
            WebhookSecrets::clone(&secrets.value())
        })
    }

    /// A URL that a caller names for a job, in the form in which it is kept.
    ///
    /// # Errors
    /// `Malformed`, or `WebhooksOff` where nothing could sign its requests.
    pub fn check(&self, text: &str, key: Option<&Arc<Key>>) -> Result<String, RequestError> {
        let url = WebhookUrl::parse(text, &self.rules)
            .map_err(|detail| RequestError::Malformed(format!("`webhook` {detail}")))?;
        let own = key.is_some_and(|key| !key.webhook_secrets.is_empty());
        if !own && self.service_secrets().is_empty() {
            return Err(RequestError::WebhooksOff);
        }
        Ok(url.text().to_owned())
    }

    /// The secrets that sign the webhooks of a client's jobs: its key's own, or else the service's.
    fn secrets_of(
        &self,
        client: &str,
        keys: Option<&Arc<KeyRing>>,
    ) -> Result<WebhookSecrets, Unsigned> {
        let own = match (keys, client.parse::<KeyId>()) {
            (Some(keys), Ok(id)) => {
                let key = keys.find(&id, SystemTime::now()).ok_or(Unsigned::NoKey)?;
                key.webhook_secrets.clone()
            }
            // Handed over without a key.
            _ => WebhookSecrets::default(),
        };
        let secrets = if own.is_empty() {
            self.service_secrets()
        } else {
            own
        };
        if secrets.is_empty() {
            return Err(Unsigned::NoSecret);
        }
        Ok(secrets)
    }
}

/// A webhook's URL as it is shown: without its query, which may have secrets.
pub fn shown(url: &str) -> String {
    url.split_once('?')
        .map_or(url, |(shown, _)| shown)
        .to_owned()
}
