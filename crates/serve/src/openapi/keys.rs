//! What keys add to every operation: the header that they take, and the answers to who may not call.

use serde_json::{Value, json};

use super::refused;

/// The paths that take no key.
const OPEN: [&str; 3] = ["/livez", "/readyz", "/openapi.json"];

/// How a key is sent.
pub(super) fn schemes() -> Value {
    json!({ "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "A key of this service, where it was started with `--keys`: `darn_` and 43 letters. The names beside it are the scopes, one \
            of which the key must have",
    } })
}

/// Adds to every operation what it takes of keys.
pub(super) fn add(paths: &mut Value) {
    for (path, operations) in paths.as_object_mut().into_iter().flatten() {
        for (_, operation) in operations.as_object_mut().into_iter().flatten() {
            if OPEN.contains(&path.as_str()) {
                operation["security"] = json!([]);
            } else {
                operation["security"] = security(scopes(path));
                add_answers(&mut operation["responses"]);
            }
        }
    }
}

/// The scopes of which a key must have one; none where any key will do.
fn scopes(path: &str) -> &'static [&'static str] {
    match path {
        "/info" => &[],
        "/metrics" => &["metrics"],
        _ if path.starts_with("/jobs") => &["jobs", "admin"],
        _ => &["mend"],
    }
}

/// Nothing, where the service has no keys, or a key with one of these scopes.
fn security(scopes: &[&str]) -> Value {
    let mut ways = vec![json!({})];
    if scopes.is_empty() {
        ways.push(json!({ "key": [] }));
    }
    ways.extend(scopes.iter().map(|scope| json!({ "key": [scope] })));
    Value::Array(ways)
}

fn add_answers(answers: &mut Value) {
    for (status, name) in [
        ("401", "KeyRefused"),
        ("403", "ScopeMissing"),
        ("429", "QuotaExceeded"),
    ] {
        answers[status] = json!({ "$ref": format!("#/components/responses/{name}") });
    }
}

/// The answers to who may not call.
pub(super) fn answers() -> Value {
    let header =
        |description: &str| json!({ "description": description, "schema": { "type": "string" } });
    let mut unknown = refused(
        "The service takes keys, and the request has none (`key_missing`) or one that is not known (`key_unknown`) or has expired (`key_expired`)",
    );
    unknown["headers"] =
        json!({ "www-authenticate": header("`Bearer`, with what is wrong (RFC 6750)") });
    let mut spent = refused(
        "The key has used up a quota (`quota_exceeded`), or too many requests for one session came at once (`session_busy`)",
    );
    spent["headers"] = json!({
        "ratelimit": header("What is left of each quota"),
        "ratelimit-policy": header("The quotas of the key (draft-ietf-httpapi-ratelimit-headers)"),
        "retry-after": header("Seconds after which there is room again"),
    });
    json!({
        "KeyRefused": unknown,
        "ScopeMissing": refused("The key does not have the scope that this takes (`insufficient_scope`)"),
        "QuotaExceeded": spent,
    })
}
