//! `GET /info`: the version and the build, the weights, and the limits that a client can check before it sends a scan.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use darn_contract::v1;
use serde::Serialize;

use super::{
    app::App,
    client::Caller,
    key_file::{Expiry, KeyId, KeyLimits, Scope},
    response,
};

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct Info {
    /// darn's version.
    version: &'static str,
    build: InfoBuild,
    /// The weights that are loaded, those of requests that name none first.
    weights: Vec<v1::Weights>,
    /// This process among those that serve together: the ids of its sessions begin with it.
    instance: String,
    /// Whether the service keeps jobs.
    jobs: bool,
    limits: InfoLimits,
    /// The caller's key, where the service takes keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<InfoKey>,
}

/// The commit that the program was built of, where the build was told it (`DARN_COMMIT`).
const COMMIT: Option<&str> = option_env!("DARN_COMMIT");

#[derive(Debug, Serialize)]
struct InfoBuild {
    #[serde(skip_serializing_if = "Option::is_none")]
    commit: Option<&'static str>,
    /// The processor's, such as `x86_64`.
    architecture: &'static str,
    /// The operating system, such as `linux`.
    system: &'static str,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct InfoKey {
    /// Its name.
    id: KeyId,
    /// What it may do.
    scopes: Vec<Scope>,
    /// What it may take; nothing bounds what is left out.
    limits: KeyLimits,
    /// From when on it is refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    expires: Option<Expiry>,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct InfoLimits {
    /// Most bytes of a request's body.
    body_bytes: usize,
    /// Longest time that a scan may wait and be mended, in seconds.
    deadline_seconds: f64,
    /// A session ends after so many seconds without a request.
    session_idle_seconds: f64,
}

/// Answers `GET /info`.
pub async fn answer(State(app): State<Arc<App>>, caller: Caller) -> Response {
    response::json_response(response::json(&Info {
        version: env!("CARGO_PKG_VERSION"),
        build: InfoBuild {
            commit: COMMIT.filter(|commit| !commit.is_empty()),
            architecture: std::env::consts::ARCH,
            system: std::env::consts::OS,
        },
        weights: app.weights(),
        instance: app.instance.name().to_string(),
        jobs: app.jobs.is_some(),
        limits: InfoLimits {
            body_bytes: app.limits.body,
            deadline_seconds: app.limits.deadline.as_secs_f64(),
            session_idle_seconds: app.sessions.limits().idle.as_secs_f64(),
        },
        key: caller.key.map(|key| InfoKey {
            id: key.id.clone(),
            scopes: key.scopes().to_vec(),
            limits: key.limits,
            expires: key.expires,
        }),
    }))
}
