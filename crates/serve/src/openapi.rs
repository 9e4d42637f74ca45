//! The OpenAPI 3.1 document. Paths are written here; the schemas come from the contract's descriptor, so they match its types.
//! `proto/openapi.json` is a copy of this document; a test fails when the two differ.

use std::sync::LazyLock;

use bytes::Bytes;
use serde_json::{Map, Value, json};

use super::{
    media_types::{
        FORM_DATA, GLB, GLTF, JSON, MULTIPART_MIXED, OBJ, OCTET_STREAM, PLY, PROBLEM_JSON, TEXT,
        ZIP,
    },
    response, schema,
};

mod jobs;
mod keys;
mod sessions;

/// The document's text, as served at `/openapi.json`.
static WRITTEN: LazyLock<Bytes> = LazyLock::new(|| Bytes::from(response::json(&document())));

/// The document's text, written once for the whole process.
pub(super) fn text() -> Bytes {
    WRITTEN.clone()
}

/// The document.
pub fn document() -> Value {
    let mut schemas = schema::schemas();
    schemas.insert("Problem".to_owned(), problem_schema());
    schemas.insert("ProblemCode".to_owned(), problem_codes());
    schemas.insert("Info".to_owned(), info_schema());
    let mut document = json!({
        "openapi": "3.1.0",
        "info": {
            "title": "darn",
            "version": env!("CARGO_PKG_VERSION"),
            "summary": "Mends holes in scanned fabric",
            "description": "A scan (glTF) goes in; a scan whose holes are filled with plausible cloth comes out. \
                Errors are problem documents (RFC 9457) with a stable `code`. Every answer carries `x-request-id`; \
                a caller may give its own. The same is served over gRPC as darn.v1.Darn and darn.v1.Jobs.",
        },
        "paths": {
            "/inpaint": { "post": inpaint() },
            "/holes": { "post": holes() },
            "/optimize-anchor": { "post": optimize_anchor() },
            "/strip": { "post": strip() },
            "/sessions": { "post": sessions::open() },
            "/sessions/{id}": { "get": sessions::describe(), "delete": sessions::delete() },
            "/sessions/{id}/inpaint": { "post": sessions::inpaint() },
            "/sessions/{id}/optimize-anchor": { "post": sessions::optimize_anchor() },
            "/sessions/{id}/result": { "get": sessions::result() },
            "/jobs": { "get": jobs::list(), "post": jobs::submit() },
            "/jobs/{id}": { "get": jobs::describe(), "delete": jobs::delete() },
            "/jobs/{id}/result": { "get": jobs::result() },
            "/jobs/{id}/report": { "get": jobs::report() },
            "/jobs/{id}/events": { "get": jobs::events() },
            "/jobs/{id}/cancel": { "post": jobs::cancel() },
            "/jobs/{id}/retry": { "post": jobs::retry() },
            "/livez": { "get": probe("Whether the process runs", &[]) },
            "/readyz": { "get": probe("Whether the service mends: warmed up and not shutting down", &[503]) },
            "/metrics": { "get": probe("Metrics in Prometheus text format", &[]) },
            "/info": { "get": {
                "summary": "The version and the build, the weights, and the limits of a request",
                "operationId": "info",
                "responses": { "200": { "description": "Version, build, weights and limits", "content": { JSON: { "schema": reference("Info") } } } },
            } },
            "/openapi.json": { "get": {
                "summary": "This document",
                "responses": { "200": { "description": "The document", "content": { JSON: {} } } },
            } },
        },
        "webhooks": { "jobEnded": { "post": jobs::webhook() } },
        "components": { "schemas": schemas, "responses": keys::answers(), "securitySchemes": keys::schemes() },
    });
    keys::add(&mut document["paths"]);
    document
}

fn inpaint() -> Value {
    let mut inpaint = json!({
        "summary": "Fill the holes of a scan",
        "operationId": "inpaint",
        "parameters": jobs::preferences(),
        "requestBody": body(&[("constraints", "Constraints")], &[]),
        "responses": responses(
            "200",
            mended(
                "The mended scan, in the container of the input. One that came with its files goes back as a zip (from a zip) or as the \
                    glTF alone (from parts), or as `Accept` prefers: application/zip, model/gltf+json, or model/gltf-binary for one GLB with \
                    all files in it",
                "scan",
                &[GLB, GLTF, OBJ, PLY, ZIP],
            ),
            "A scan or constraints that cannot be mended; `errors` names the constraints. With code `no_holes`: the scan has no \
                hole to fill",
        ),
    });
    inpaint["responses"]["202"] = jobs::accepted();
    inpaint
}

fn optimize_anchor() -> Value {
    let mut found = found();
    let mended = mended("", "scan", &[GLB, GLTF, OBJ, PLY, ZIP]);
    found["description"] = format!(
        "{}. With `Accept: model/gltf-binary`: the scan mended with that anchor, in the container of the input; with \
            `Accept: multipart/mixed`: the part `report` (application/json, schema Report), then the part `scan`",
        found["description"].as_str().unwrap_or_default()
    )
    .into();
    for media_type in [GLB, GLTF, OBJ, PLY, ZIP, MULTIPART_MIXED] {
        found["content"][media_type] = mended["content"][media_type].clone();
    }
    json!({
        "summary": "Find where on a hole's grid a point in space belongs",
        "operationId": "optimizeAnchor",
        "requestBody": body(&[("query", "AnchorQuery")], &["query"]),
        "responses": responses(
            "200",
            found,
            "A scan or a query that cannot be searched; `errors` names the fields of the query",
        ),
    })
}

fn strip() -> Value {
    let mut found = mended(
        "The scan without what darn put in, in the container of the input; one that came with its files goes back as a mended one does",
        "scan",
        &[GLB, GLTF, OBJ, PLY, ZIP],
    );
    found["content"][MULTIPART_MIXED]["schema"]["properties"]["report"] = reference("StripReport");
    found["headers"] = json!({ "repr-digest": repr_digest(), "darn-strip": {
        "description": "`exact`: the bytes from before the first mend, proven by their digest; `structural`: the file was changed \
            afterwards, and darn's patches were taken out of what it is now",
        "schema": { "type": "string", "enum": ["exact", "structural"] },
    } });
    let description = found["description"].as_str().unwrap_or_default();
    found["description"] = description
        .replace("schema Report", "schema StripReport")
        .into();
    json!({
        "summary": "Take everything out of a scan that darn put in",
        "operationId": "strip",
        "requestBody": body(&[], &[]),
        "responses": responses("200", found, "With code `nothing_to_strip`: the scan has nothing of darn's"),
    })
}

/// The answer of an anchor search.
fn found() -> Value {
    json!({
        "description": "Where the point belongs. In `map` and `mapGradient`, null stands for a cell outside the hole",
        "content": { JSON: { "schema": reference("AnchorFound") } },
    })
}

/// An answer of what was mended: alone in one of some media types, or with its report in multipart/mixed.
fn mended(description: &str, part: &str, media_types: &[&str]) -> Value {
    let bare = media_types.iter().map(|it| ((*it).to_owned(), json!({})));
    let mut content = Map::from_iter(bare);
    content.insert(
        MULTIPART_MIXED.to_owned(),
        json!({ "schema": { "type": "object", "properties": { "report": reference("Report"), part: {} } } }),
    );
    json!({
        "description": format!(
            "{description}. With `Accept: multipart/mixed`: the part `report` (application/json, schema Report), then the part `{part}`"
        ),
        "headers": {
            "darn-holes-filled": { "description": "Holes filled", "schema": { "type": "integer" } },
            "darn-result": mend_result(),
            "repr-digest": repr_digest(),
            "etag": { "description": "The body's SHA-256; absent with multipart/mixed", "schema": { "type": "string" } },
            "cache-status": {
                "description": "Whether the answer was kept from an identical request (RFC 9211); only where the service keeps some",
                "schema": { "type": "string" }
            },
            "darn-loops-skipped": { "description": "Boundary loops left as they were", "schema": { "type": "integer" } },
            "darn-anchor-distance": {
                "description": "Largest distance between the cloth and an anchor, those of gestures included, in the scene's unit; \
                    absent when there are none",
                "schema": { "type": "number" },
            },
        },
        "content": content,
    })
}

fn mend_result() -> Value {
    json!({
        "description": "How it went: `filled=3 skipped=1 doubtful=0`; skipped are holes that should have been filled and could not be",
        "schema": { "type": "string" },
    })
}

fn repr_digest() -> Value {
    json!({
        "description": "SHA-256 and SHA-512 of the answer's body (RFC 9530). `Content-Digest` or `Repr-Digest` of a request are checked",
        "schema": { "type": "string" },
    })
}

fn holes() -> Value {
    let found = json!({
        "description": "Every boundary loop of the scan, and what a mesher has probably sealed where that is asked for",
        "content": { JSON: { "schema": reference("HolesReport") } },
    });
    json!({
        "summary": "Find the boundary loops of a scan, and which of them are holes",
        "operationId": "findHoles",
        "parameters": [{
            "name": "suspects",
            "in": "query",
            "description": "Whether what a mesher has probably sealed is listed, too, each with a cut that takes it out",
            "schema": { "type": "boolean", "default": false },
        }],
        "requestBody": body(&[], &[]),
        "responses": responses("200",
            found, "A scan whose holes cannot be found, or constraints, which are not taken here"),
    })
}

/// A request body with a scan: alone, or with other parts in multipart/form-data; only as the latter when one of them is required.
fn body(beside: &[(&str, &str)], required: &[&str]) -> Value {
    let mut parts = json!({ "scan": { "description": "GLB; glTF, with further parts for the files that it refers to, each named by its URI \
        in the glTF; a zip with a glTF and its files; OBJ; or PLY" } });
    let mut encoding = json!({ "scan": { "contentType": "model/gltf-binary, model/gltf+json, model/obj, model/ply, application/zip, application/octet-stream" } });
    for (part, schema) in beside {
        parts[*part] = reference(schema);
        encoding[*part] = json!({ "contentType": "application/json, application/octet-stream" });
    }
    let needed: Vec<&str> = ["scan"].iter().chain(required).copied().collect();
    let form = json!({
        "schema": { "type": "object", "properties": parts, "required": needed },
        "encoding": encoding,
    });
    let content = if required.is_empty() {
        json!({ GLB: {}, GLTF: {}, OBJ: {}, PLY: {}, ZIP: {}, OCTET_STREAM: {}, FORM_DATA: form })
    } else {
        json!({ FORM_DATA: form })
    };
    json!({ "required": true, "content": content })
}

/// The answers of a route that runs a job: its success, then every error such a route has.
fn responses(status: &str, success: Value, unprocessable: &str) -> Value {
    let mut all = Map::from_iter([(status.to_owned(), success)]);
    for (status, description) in [
        (
            "400",
            "Not readable: an empty or broken body, one that is not what its digest says, not a glTF, no query where one is needed, what is asked not JSON",
        ),
        ("408", "The body stopped coming"),
        (
            "413",
            "Larger than a limit of the service; the limit is named",
        ),
        (
            "415",
            "A content type or a content encoding that is not read here",
        ),
        ("422", unprocessable),
        (
            "500",
            "An error of the service; its log has it under the request id",
        ),
        (
            "503",
            "The queue is full, too many requests are being received, or the service shuts down; `retry-after` says when to come back",
        ),
        ("504", "Waiting and mending took longer than the deadline"),
    ] {
        all.insert(status.to_owned(), refused(description));
    }
    // Where a mend came as far as the scan's holes.
    all["422"]["headers"] = json!({ "darn-result": mend_result() });
    Value::Object(all)
}

fn probe(summary: &str, refusals: &[u16]) -> Value {
    let mut responses = Map::new();
    responses.insert(
        "200".to_owned(),
        json!({ "description": summary, "content": { TEXT: {} } }),
    );
    for status in refusals {
        responses.insert(status.to_string(), refused("Not now; `code` says why"));
    }
    json!({ "summary": summary, "responses": responses })
}

fn refused(description: &str) -> Value {
    json!({ "description": description, "content": { PROBLEM_JSON: { "schema": reference("Problem") } } })
}

fn reference(schema: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{schema}") })
}

fn problem_codes() -> Value {
    let words: Vec<&str> = darn_contract::codes::ALL.iter().map(|c| c.word).collect();
    json!({
        "type": "string",
        "description": "The words of this version; later ones may have more",
        "enum": words,
    })
}

fn problem_schema() -> Value {
    json!({
        "type": "object",
        "description": "A problem document (RFC 9457)",
        "properties": {
            "type": { "type": "string", "const": "about:blank" },
            "title": { "type": "string", "description": "The status in words" },
            "status": { "type": "integer" },
            "code": {
                "description": "Stable word for programs",
                "anyOf": [reference("ProblemCode"), { "type": "string" }],
            },
            "detail": { "type": "string", "description": "What, where and which limit, for a person" },
            "request_id": { "type": "string" },
            "errors": {
                "type": "array",
                "description": "The fields at fault of what was asked",
                "items": {
                    "type": "object",
                    "properties": {
                        "pointer": { "type": "string", "description": "JSON pointer (RFC 6901) into the constraints or the query; absent when they are at fault as a whole" },
                        "detail": { "type": "string" },
                    },
                    "required": ["detail"],
                },
            },
        },
        "required": ["type", "title", "status", "code", "detail", "request_id"],
    })
}

fn info_schema() -> Value {
    json!({
        "type": "object",
        "description": "The version, and the limits that a client can check before it sends a scan",
        "properties": {
            "version": { "type": "string", "description": "darn's version" },
            "build": {
                "type": "object",
                "description": "What the program was built of and for",
                "properties": {
                    "commit": { "type": "string", "description": "The commit, where the build was told it" },
                    "architecture": { "type": "string", "description": "The processor's, such as x86_64" },
                    "system": { "type": "string", "description": "The operating system, such as linux" },
                },
                "required": ["architecture", "system"],
            },
            "weights": {
                "type": "array",
                "description": "The weights that are loaded, those of requests that name none first",
                "items": reference("Weights"),
            },
            "instance": { "type": "string", "description": "This process among those that serve together: the ids of its sessions begin with it" },
            "jobs": { "type": "boolean", "description": "Whether the service keeps jobs: whether it was started with `--data`" },
            "limits": {
                "type": "object",
                "properties": {
                    "bodyBytes": { "type": "integer", "description": "Most bytes of a request's body" },
                    "deadlineSeconds": { "type": "number", "description": "Longest time that a scan may wait and be mended" },
                    "sessionIdleSeconds": { "type": "number", "description": "A session ends after so long without a request" },
                },
                "required": ["bodyBytes", "deadlineSeconds", "sessionIdleSeconds"],
            },
            "key": {
                "type": "object",
                "description": "The key that came with the request; absent where the service takes no keys",
                "properties": {
                    "id": { "type": "string" },
                    "scopes": { "type": "array", "items": { "type": "string", "enum": ["mend", "jobs", "metrics", "admin"] } },
                    "limits": {
                        "type": "object",
                        "description": "What the key may take; nothing bounds what is left out",
                        "properties": {
                            "requestsPerMinute": { "type": "integer" },
                            "bytesPerDay": { "type": "integer" },
                            "waitingJobs": { "type": "integer" },
                            "runningJobs": { "type": "integer" },
                            "sessions": { "type": "integer" },
                        },
                    },
                    "expires": { "type": "string", "format": "date-time" },
                },
                "required": ["id", "scopes", "limits"],
            },
        },
        "required": ["version", "build", "weights", "instance", "jobs", "limits"],
    })
}
