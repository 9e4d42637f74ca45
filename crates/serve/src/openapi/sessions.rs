//! The paths below `/sessions`.

use serde_json::{Map, Value, json};

use super::{body, found, mend_result, mended, reference, refused, responses};
use crate::media_types::{GLB, GLTF, JSON, NDJSON, OCTET_STREAM};

/// `POST /sessions`.
pub(super) fn open() -> Value {
    let mut opened = described("Kept; constraints alone can be sent from now on");
    opened["headers"] = json!({
        "location": { "description": "The session's path", "schema": { "type": "string", "format": "uri-reference" } },
        "darn-result": mend_result(),
    });
    json!({
        "summary": "Keep a scan for editing",
        "description": "The scan's holes are laid flat once. A session ends when it is deleted, when no request comes for some time, \
            or when its memory is needed for another.",
        "operationId": "openSession",
        "requestBody": body(&[("constraints", "Constraints")], &[]),
        "responses": with(
            responses(
                "201",
                opened,
                "A scan that cannot be mended, or constraints: they choose holes and weights here, anchors and edits come later",
            ),
            &[("413", "Larger than a limit of the service; the limit is named. With code `session_too_large`: kept, it would be")],
        ),
    })
}

/// `GET /sessions/{id}`.
pub(super) fn describe() -> Value {
    let responses = Map::from_iter([(
        "200".to_owned(),
        described("What was answered when it was opened"),
    )]);
    json!({
        "summary": "Describe a session",
        "operationId": "describeSession",
        "parameters": [id()],
        "responses": with(with(Value::Object(responses), &JOB_ERRORS), &SESSION_ERRORS),
    })
}

/// `DELETE /sessions/{id}`.
pub(super) fn delete() -> Value {
    let responses =
        json!({ "204": { "description": "Ended; requests that work on it may finish" } });
    json!({
        "summary": "End a session",
        "operationId": "deleteSession",
        "parameters": [id()],
        "responses": with(with(responses, &SESSION_ERRORS[..2]), &[("503", "The service shuts down")]),
    })
}

/// `POST /sessions/{id}/inpaint`.
pub(super) fn inpaint() -> Value {
    let patches = mended(
        "The patches alone: as a GLB, or as positions on the session's topology: patch after patch, in order of hole id, x, y, z of \
            every vertex as little-endian 32-bit floats, in the order of `patchUvs`. With `draft=true`: those positions of the session's holes, then \
            the normals of all vertices in the same order, and neither report nor headers of one",
        "patches",
        &[GLB, OCTET_STREAM],
    );
    json!({
        "summary": "Fill the holes of a session",
        "operationId": "inpaintSession",
        "parameters": [id(), draft()],
        "requestBody": json_body("Constraints", "Anchors and edits; left out, the cloth as it is without any"),
        "responses": with(
            responses(
                "200",
                patches,
                "Constraints that cannot be met, or that choose holes or weights; `errors` names them",
            ),
            &SESSION_ERRORS,
        ),
    })
}

fn draft() -> Value {
    json!({
        "name": "draft",
        "in": "query",
        "description": "While something is dragged: the patches at once, not measured, without a report; `GET /sessions/{id}/result` does not take note of it",
        "schema": {"type": "boolean", "default": false},
    })
}

/// `POST /sessions/{id}/optimize-anchor`.
pub(super) fn optimize_anchor() -> Value {
    let mut found = found();
    let description = found["description"].as_str().unwrap_or_default();
    found["description"] = format!(
        "{description}. With `Accept: application/x-ndjson` the map comes as it is computed, one message a line; it waits while the session is edited, \
            and ends when the request is closed"
    )
    .into();
    found["content"][NDJSON] = json!({ "schema": reference("AnchorLine") });
    json!({
        "summary": "Find where on the grid of a session's hole a point in space belongs",
        "operationId": "optimizeSessionAnchor",
        "parameters": [id()],
        "requestBody": required(json_body("AnchorQuery", "What to search")),
        "responses": with(
            responses("200", found, "A query that cannot be searched; `errors` names its fields"),
            &SESSION_ERRORS,
        ),
    })
}

/// `GET /sessions/{id}/result`.
pub(super) fn result() -> Value {
    let mended = mended(
        "The whole scan, mended with the constraints that the session met last, in the container of the input",
        "scan",
        &[GLB, GLTF],
    );
    let responses = Map::from_iter([("200".to_owned(), mended)]);
    json!({
        "summary": "The whole scan of a session, mended",
        "operationId": "sessionResult",
        "parameters": [id()],
        "responses": with(with(Value::Object(responses), &JOB_ERRORS), &SESSION_ERRORS),
    })
}

/// Errors of a route that names a session.
const SESSION_ERRORS: [(&str, &str); 4] = [
    ("404", "There is no session of this id"),
    (
        "410",
        "The session is gone: `session_expired`, `session_evicted`, `session_deleted` or `session_lost`",
    ),
    (
        "421",
        "Another process keeps the session (`session_elsewhere`), or this one has no workers (`no_workers`)",
    ),
    ("429", "Too many requests for this session are under way"),
];

/// Errors of a route that runs a job and takes no body.
const JOB_ERRORS: [(&str, &str); 4] = [
    ("422", "Cloth that cannot be mended as it was asked"),
    (
        "500",
        "An error of the service; its log has it under the request id",
    ),
    (
        "503",
        "The queue is full or the service shuts down; `retry-after` says when to come back",
    ),
    ("504", "Waiting and mending took longer than the deadline"),
];

/// Adds errors to the answers of a route.
fn with(mut responses: Value, errors: &[(&str, &str)]) -> Value {
    for (status, description) in errors {
        responses[*status] = refused(description);
    }
    responses
}

fn described(description: &str) -> Value {
    json!({
        "description": description,
        "content": { JSON: { "schema": reference("Session") } },
    })
}

/// A request body of JSON that may be left out.
fn json_body(schema: &str, description: &str) -> Value {
    let schema = json!({ "schema": reference(schema) });
    json!({
        "description": description,
        "required": false,
        "content": { JSON: schema, OCTET_STREAM: schema },
    })
}

fn required(mut body: Value) -> Value {
    body["required"] = true.into();
    body
}

fn id() -> Value {
    json!({ "name": "id", "in": "path", "required": true, "schema": { "type": "string", "format": "uuid" } })
}
