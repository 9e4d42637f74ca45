//! The media types that the service reads and writes.

/// A binary glTF.
pub const GLB: &str = "model/gltf-binary";
/// A glTF as JSON.
pub const GLTF: &str = "model/gltf+json";
/// A zip with a glTF and the files that it refers to.
pub const ZIP: &str = "application/zip";
/// A Wavefront OBJ.
pub const OBJ: &str = "model/obj";
/// A PLY; no media type of it is registered.
pub const PLY: &str = "model/ply";
/// JSON.
pub const JSON: &str = "application/json";
/// Bytes of no stated type: positions in answers; what curl declares for any file in requests.
pub const OCTET_STREAM: &str = "application/octet-stream";
/// A report and what was mended, in one answer.
pub const MULTIPART_MIXED: &str = "multipart/mixed";
/// What curl declares for a body of which it is told nothing.
pub const FORM_URLENCODED: &str = "application/x-www-form-urlencoded";
/// A scan and its constraints or query, in one request.
pub const FORM_DATA: &str = "multipart/form-data";
/// A problem document (RFC 9457).
pub const PROBLEM_JSON: &str = "application/problem+json";
/// Plain text.
pub const TEXT: &str = "text/plain";
/// Metrics in the Prometheus text format.
pub const PROMETHEUS: &str = "text/plain; version=0.0.4";
/// One JSON message a line.
pub const NDJSON: &str = "application/x-ndjson";
/// Server-sent events.
pub const EVENT_STREAM: &str = "text/event-stream";
