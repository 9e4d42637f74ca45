//! The OpenAPI 3.1 document. Paths are written here; the schemas come from the contract's descriptor, so they cannot drift.
//! `proto/openapi.json` is this document, committed; a test fails when the two differ.

use serde_json::{Map, Value, json};

use super::{problem, schema};

/// The document, as served at `/openapi.json`.
pub fn document() -> Value {
    let mut schemas = schema::schemas();
    schemas.insert("Problem".to_owned(), problem_schema());
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "darn",
            "version": env!("CARGO_PKG_VERSION"),
            "summary": "Mends holes in scanned fabric",
            "description": "A scan (glTF) goes in; a scan whose holes are filled with plausible cloth comes out. \
                Errors are problem documents (RFC 9457) with a stable `code`. Every answer carries `x-request-id`; \
                a caller may give its own. The same jobs are served over gRPC as darn.v1.Darn.",
        },
        "paths": {
            "/inpaint": { "post": inpaint() },
            "/holes": { "post": holes() },
            "/livez": { "get": probe("Whether the process runs", &[]) },
            "/readyz": { "get": probe("Whether the service mends: warmed up and not shutting down", &[503]) },
            "/metrics": { "get": probe("Metrics in Prometheus text format", &[]) },
            "/openapi.json": { "get": {
                "summary": "This document",
                "responses": { "200": { "description": "The document", "content": { "application/json": {} } } },
            } },
        },
        "components": { "schemas": schemas },
    })
}

fn inpaint() -> Value {
    let counted = json!({
        "darn-holes-filled": { "description": "Holes filled", "schema": { "type": "integer" } },
        "darn-loops-skipped": { "description": "Boundary loops left as they were", "schema": { "type": "integer" } },
    });
    let filled = json!({
        "description": "The mended scan, in the container of the input. With `Accept: multipart/mixed`: the part `report` \
            (application/json, schema Report), then the part `scan`.",
        "headers": counted,
        "content": {
            "model/gltf-binary": {},
            "model/gltf+json": {},
            "multipart/mixed": { "schema": {
                "type": "object",
                "properties": { "report": reference("Report"), "scan": {} },
            } },
        },
    });
    json!({
        "summary": "Fill the holes of a scan",
        "operationId": "inpaint",
        "requestBody": body(&[("constraints", "Constraints")]),
        "responses": responses(
            filled,
            "A scan or constraints that cannot be mended; `errors` names the constraints. With code `no_holes`: the scan has no \
                hole to fill",
        ),
    })
}

fn holes() -> Value {
    let found = json!({
        "description": "Every boundary loop of the scan",
        "content": { "application/json": { "schema": reference("HolesReport") } },
    });
    json!({
        "summary": "Find the boundary loops of a scan, and which of them are holes",
        "operationId": "findHoles",
        "requestBody": body(&[]),
        "responses": responses(found, "A scan whose holes cannot be found, or constraints, which are not taken here"),
    })
}

fn body(beside: &[(&str, &str)]) -> Value {
    let mut parts = json!({ "scan": { "description": "GLB, or glTF with data URIs" } });
    let mut encoding = json!({ "scan": { "contentType": "model/gltf-binary, model/gltf+json, application/octet-stream" } });
    for (part, schema) in beside {
        parts[*part] = reference(schema);
        encoding[*part] = json!({ "contentType": "application/json, application/octet-stream" });
    }
    json!({
        "required": true,
        "content": {
            "model/gltf-binary": {},
            "model/gltf+json": {},
            "multipart/form-data": {
                "schema": { "type": "object", "properties": parts, "required": ["scan"] },
                "encoding": encoding,
            },
        },
    })
}

fn responses(success: Value, unprocessable: &str) -> Value {
    let mut all = Map::from_iter([("200".to_owned(), success)]);
    for (status, description) in [
        (
            "400",
            "Not readable: an empty or broken body, not a glTF, constraints that are not JSON",
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
    Value::Object(all)
}

fn probe(summary: &str, refusals: &[u16]) -> Value {
    let mut responses = Map::new();
    responses.insert(
        "200".to_owned(),
        json!({ "description": summary, "content": { "text/plain": {} } }),
    );
    for status in refusals {
        responses.insert(status.to_string(), refused("Not now; `code` says why"));
    }
    json!({ "summary": summary, "responses": responses })
}

fn refused(description: &str) -> Value {
    json!({ "description": description, "content": { problem::MEDIA_TYPE: { "schema": reference("Problem") } } })
}

fn reference(schema: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{schema}") })
}

fn problem_schema() -> Value {
    json!({
        "type": "object",
        "description": "A problem document (RFC 9457)",
        "properties": {
            "type": { "type": "string", "const": "about:blank" },
            "title": { "type": "string", "description": "The status in words" },
            "status": { "type": "integer" },
            "code": { "type": "string", "description": "Stable word for programs" },
            "detail": { "type": "string", "description": "What, where and which limit, for a person" },
            "request_id": { "type": "string" },
            "errors": {
                "type": "array",
                "description": "The constraints at fault",
                "items": {
                    "type": "object",
                    "properties": {
                        "pointer": { "type": "string", "description": "JSON pointer (RFC 6901) into the constraints; absent when they are at fault as a whole" },
                        "detail": { "type": "string" },
                    },
                    "required": ["detail"],
                },
            },
        },
        "required": ["type", "title", "status", "code", "detail", "request_id"],
    })
}
