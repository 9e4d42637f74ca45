//! Whom a request is from: its key where the service has keys, else the address of its connection.

use std::{convert::Infallible, sync::Arc, time::SystemTime};

use axum::{
    extract::FromRequestParts,
    http::{Extensions, request::Parts},
};
use darn_jobs::Job;

use super::{
    app::App,
    client_address::ClientAddress,
    key_file::{KeyId, Scope},
    keys::Key,
    session_store::Opener,
};

/// What tells clients apart. Requests without it share one place among the clients.
pub type Client = Option<ClientId>;

/// One client.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ClientId {
    /// Whoever has the key of this id.
    Key(KeyId),
    /// Whoever has this address.
    Address(ClientAddress),
}

impl ClientId {
    /// The text under which its jobs are kept.
    pub fn text(&self) -> String {
        match self {
            Self::Key(id) => id.to_string(),
            Self::Address(address) => address.0.to_string(),
        }
    }
}

/// Whether what a client has opened may be used by another: what has a key belongs to that key; without keys, whoever knows the id may.
pub fn may_use(owner: &Client, asker: &Client) -> bool {
    match owner {
        Some(ClientId::Key(_)) => owner == asker,
        Some(ClientId::Address(_)) | None => true,
    }
}

/// Whether addresses tell clients apart. Keys always do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sharing {
    /// Each address is a client.
    ByAddress,
    /// Addresses say nothing: behind a proxy all clients have one.
    Anybody,
}

/// The sender of a request, as an extension of it.
#[derive(Debug, Clone, Default)]
pub struct Caller {
    /// Its key; `None` where the service has no keys, and on routes that take none.
    pub key: Option<Arc<Key>>,
    /// The address of its connection.
    pub address: Option<ClientAddress>,
}

impl Caller {
    /// The sender of a request with these extensions.
    pub fn of(extensions: &Extensions) -> Self {
        extensions.get::<Self>().cloned().unwrap_or_default()
    }

    /// What tells it from others.
    pub fn client(&self, sharing: Sharing) -> Client {
        match (&self.key, self.address) {
            (Some(key), _) => Some(ClientId::Key(key.id.clone())),
            (None, Some(address)) if sharing == Sharing::ByAddress => {
                Some(ClientId::Address(address))
            }
            (None, _) => None,
        }
    }

    /// Whether it may hand over jobs.
    pub fn may_hand_over(&self) -> bool {
        (self.key.as_ref()).is_none_or(|key| key.has(Scope::Jobs))
    }

    /// Whether a job is shown to it: its own, or any where the service has no keys or its key has the scope `admin`.
    pub fn sees(&self, job: &Job) -> bool {
        self.only_jobs_of()
            .is_none_or(|id| id.as_str() == job.client)
    }

    /// The key whose jobs alone it sees; `None` when it sees all.
    pub fn only_jobs_of(&self) -> Option<&KeyId> {
        let key = self.key.as_ref()?;
        (!key.has(Scope::Admin)).then_some(&key.id)
    }
}

impl App {
    /// What tells a caller from others.
    pub fn client(&self, caller: &Caller) -> Client {
        caller.client(self.sharing)
    }

    /// The text under which a caller's jobs are kept.
    pub fn job_owner(&self, caller: &Caller) -> String {
        self.client(caller)
            .as_ref()
            .map_or_else(String::new, ClientId::text)
    }

    /// A caller as it opens sessions.
    pub fn opener(&self, caller: &Caller) -> Opener {
        Opener {
            client: self.client(caller),
            most: caller.key.as_ref().and_then(|key| key.limits.sessions),
        }
    }

    /// Whether a caller that was let in would still be.
    pub fn still_takes(&self, caller: &Caller) -> bool {
        match (&self.keys, &caller.key) {
            (Some(keys), Some(key)) => keys.is_current(key, SystemTime::now()),
            _ => true,
        }
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(Self::of(&parts.extensions))
    }
}
