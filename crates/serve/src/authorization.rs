//! What every request meets before its route where the service has keys: its key is looked up (RFC 6750), and what the route takes is asked of it and of its quotas.
//!
//! Without keys every request passes. Either way a route sees a [`Caller`], and never the header `authorization`.

use std::{sync::Arc, time::SystemTime};

use axum::{
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, header},
    middleware::Next,
    response::{IntoResponse, Response},
};
use tracing::Span;

use super::{
    app::App,
    body,
    client::Caller,
    client_address::ClientAddress,
    editor,
    error::RequestError,
    key_file::Scope,
    key_secret::Secret,
    keys::{Key, KeyRefusal, KeyRing},
    quota_check,
    telemetry::RequestId,
};

/// What a route takes of a service's keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Access {
    /// Nothing.
    Open,
    /// Any key.
    AnyKey,
    /// A key with this scope.
    Scope(Scope),
    /// A key with the scope `jobs` or `admin`.
    Jobs,
}

impl Access {
    /// What a route takes, by its pattern; a route that is not listed here takes a key.
    fn of(route: Option<&str>) -> Self {
        // Nothing is there: the answer says so, and where the contract is.
        let Some(route) = route else {
            return Self::Open;
        };
        match route {
            "/livez" | "/readyz" | "/openapi.json" => Self::Open,
            "/metrics" => Self::Scope(Scope::Metrics),
            "/inpaint" | "/holes" | "/optimize-anchor" | "/strip" => Self::Scope(Scope::Mend),
            _ if is_below(route, "/darn.v1.Jobs") || is_below(route, "/jobs") => Self::Jobs,
            _ if is_below(route, "/sessions") || is_grpc(route) => Self::Scope(Scope::Mend),
            _ if editor::has_file(route) => Self::Open,
            _ => Self::AnyKey,
        }
    }

    /// Asks it of a key.
    fn check(self, key: &Key) -> Result<(), RequestError> {
        let (allowed, scope) = match self {
            Self::Open | Self::AnyKey => return Ok(()),
            Self::Scope(scope) => (key.has(scope), scope),
            Self::Jobs => (key.has(Scope::Jobs) || key.has(Scope::Admin), Scope::Jobs),
        };
        if allowed {
            Ok(())
        } else {
            Err(RequestError::InsufficientScope { scope })
        }
    }
}

fn is_below(route: &str, folder: &str) -> bool {
    let rest = route.strip_prefix(folder);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

fn is_grpc(route: &str) -> bool {
    route.starts_with("/darn.v1.")
}

/// Finds out who sends a request, and refuses it where its route takes a key that it does not have.
pub async fn authorize(State(app): State<Arc<App>>, mut request: Request, next: Next) -> Response {
    let matched = request.extensions().get::<MatchedPath>().cloned();
    let route = matched.as_ref().map(MatchedPath::as_str);
    let access = Access::of(route);
    let key = match &app.keys {
        Some(keys) if access != Access::Open => {
            let key = key_of(keys, request.headers());
            match key.and_then(|key| access.check(&key).map(|()| key)) {
                Ok(key) => Some(key),
                Err(error) => return refuse(&app, error, route, request),
            }
        }
        _ => None,
    };
    request.headers_mut().remove(header::AUTHORIZATION);
    let address = request.extensions().get::<ClientAddress>().copied();
    let Some(key) = key else {
        request.extensions_mut().insert(Caller { key, address });
        return next.run(request).await;
    };
    Span::current().record("key", key.id.as_str());
    let mut response = match quota_check::admit(&key, &mut request) {
        Ok(()) => {
            let key = Some(Arc::clone(&key));
            request.extensions_mut().insert(Caller { key, address });
            next.run(request).await
        }
        Err(exceeded) => refuse(&app, RequestError::Quota(exceeded), route, request),
    };
    let error = response.extensions().get::<RequestError>();
    let exceeded = error.and_then(RequestError::exceeded).copied();
    quota_check::tell(&key, exceeded.as_ref(), response.headers_mut());
    response
}

/// The key that a request names.
fn key_of(keys: &KeyRing, headers: &HeaderMap) -> Result<Arc<Key>, RequestError> {
    let mut values = headers.get_all(header::AUTHORIZATION).iter();
    let value = match (values.next(), values.next()) {
        (None, _) => return Err(RequestError::KeyMissing),
        (Some(value), None) => value,
        (Some(_), Some(_)) => return Err(RequestError::KeyUnknown),
    };
    let text = value.to_str().map_err(|_| RequestError::KeyUnknown)?;
    let (scheme, token) = text.split_once(' ').unwrap_or((text, ""));
    // What another scheme says is no key, as if nothing came.
    if !scheme.eq_ignore_ascii_case("bearer") {
        return Err(RequestError::KeyMissing);
    }
    let secret = Secret::parse(token.trim()).ok_or(RequestError::KeyUnknown)?;
    (keys.identify(&secret, SystemTime::now())).map_err(|refusal| match refusal {
        KeyRefusal::Unknown => RequestError::KeyUnknown,
        KeyRefusal::Expired => RequestError::KeyExpired,
    })
}

/// The answer of a request that is not let in, in the protocol of its route.
fn refuse(app: &App, error: RequestError, route: Option<&str>, request: Request) -> Response {
    if route.is_some_and(is_grpc) {
        let id = request.extensions().get::<RequestId>().cloned();
        return error
            .grpc(&id.map(|id| id.0).unwrap_or_default())
            .into_http();
    }
    body::discard(request, &app.limits);
    error.into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn routes_that_are_not_listed_take_a_key() {
        for (route, access) in [
            ("/livez", Access::Open),
            ("/readyz", Access::Open),
            ("/", Access::Open),
            ("/editor/main.js", Access::Open),
            ("/editor/none.js", Access::AnyKey),
            ("/info", Access::AnyKey),
            ("/metrics", Access::Scope(Scope::Metrics)),
            ("/sessions", Access::Scope(Scope::Mend)),
            ("/sessions/{id}/result", Access::Scope(Scope::Mend)),
            ("/sessionsX", Access::AnyKey),
            ("/darn.v1.Darn/{method}", Access::Scope(Scope::Mend)),
            ("/darn.v1.Jobs/{method}", Access::Jobs),
            ("/jobs", Access::Jobs),
            ("/jobs/{id}/events", Access::Jobs),
            ("/anything", Access::AnyKey),
        ] {
            assert_eq!(Access::of(Some(route)), access, "{route}");
        }
        assert_eq!(Access::of(None), Access::Open);
    }
}
