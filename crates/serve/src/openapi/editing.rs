//! The paths below `/sessions`.

use serde_json::{Map, Value, json};

use super::{body, cloth, found, reference, refused, responses};

/// `POST /sessions`.
pub(super) fn open() -> Value {
    let mut opened = described("Kept; constraints alone can be sent from now on");
    opened["headers"] = json!({
        "location": { "description": "The session's path", "schema": { "type": "string", "format": "uri-reference" } },
    });
    json!({
        "summary": "Keep a scan for editing",
        "description": "The scan's holes are laid flat once. A session ends when it is deleted, when no request comes for some time, \
            or when its memory is needed for another.",
        "operationId": "openSession",
        "requestBody": body(&[("constraints", "Constraints")], &[]),
        "responses": with(
            responses(
                ("201", opened),
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
        "responses": with(with(Value::Object(responses), &WORKING), &GONE),
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
        "responses": with(with(responses, &GONE[..2]), &[("503", "The service shuts down")]),
    })
}

/// `POST /sessions/{id}/inpaint`.
pub(super) fn inpaint() -> Value {
    let patches = cloth(
        "The patches alone: as a GLB, or as positions on the session's topology: patch after patch, in order of hole id, x, y, z of \
            every vertex as little-endian 32-bit floats, in the order of `patchUvs`",
        "patches",
        &["model/gltf-binary", "application/octet-stream"],
    );
    json!({
        "summary": "Fill the holes of a session",
        "operationId": "inpaintSession",
        "parameters": [id()],
        "requestBody": asked("Constraints", "Anchors and edits; left out, the cloth as it is without any", false),
        "responses": with(
            responses(
                ("200", patches),
                "Constraints that cannot be met, or that choose holes or weights; `errors` names them",
            ),
            &GONE,
        ),
    })
}

/// `POST /sessions/{id}/optimize-anchor`.
pub(super) fn optimize_anchor() -> Value {
    json!({
        "summary": "Find where on the grid of a session's hole a point in space belongs",
        "operationId": "optimizeSessionAnchor",
        "parameters": [id()],
        "requestBody": asked("AnchorQuery", "What to search", true),
        "responses": with(
            responses(("200", found()), "A query that cannot be searched; `errors` names its fields"),
            &GONE,
        ),
    })
}

/// `GET /sessions/{id}/result`.
pub(super) fn result() -> Value {
    let mended = cloth(
        "The whole scan, mended with the constraints that the session met last, in the container of the input",
        "scan",
        &["model/gltf-binary", "model/gltf+json"],
    );
    let responses = Map::from_iter([("200".to_owned(), mended)]);
    json!({
        "summary": "The whole scan of a session, mended",
        "operationId": "sessionResult",
        "parameters": [id()],
        "responses": with(with(Value::Object(responses), &WORKING), &GONE),
    })
}

/// Refusals of a route that names a session.
const GONE: [(&str, &str); 3] = [
    ("404", "There is no session of this id"),
    (
        "410",
        "The session is gone: `session_expired`, `session_evicted` or `session_deleted`",
    ),
    ("429", "Too many requests for this session are under way"),
];

/// Refusals of a route without a body that works.
const WORKING: [(&str, &str); 4] = [
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

fn with(mut responses: Value, refusals: &[(&str, &str)]) -> Value {
    for (status, description) in refusals {
        responses[*status] = refused(description);
    }
    responses
}

fn described(description: &str) -> Value {
    json!({
        "description": description,
        "content": { "application/json": { "schema": reference("Session") } },
    })
}

fn asked(schema: &str, description: &str, required: bool) -> Value {
    let schema = json!({ "schema": reference(schema) });
    json!({
        "description": description,
        "required": required,
        "content": { "application/json": schema, "application/octet-stream": schema },
    })
}

fn id() -> Value {
    json!({ "name": "id", "in": "path", "required": true, "schema": { "type": "string", "format": "uuid" } })
}
