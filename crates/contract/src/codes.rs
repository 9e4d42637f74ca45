//! The one table of error codes: the stable word of every refusal, with its HTTP status and its gRPC code.
//!
//! Clients compare the words: a word or its statuses never change once released. Nothing else in the workspace maps a refusal to a status.

use std::fmt;

/// gRPC status codes, with their numbers (<https://grpc.io/docs/guides/status-codes/>); those that darn answers with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum GrpcCode {
    /// The request itself is wrong.
    InvalidArgument = 3,
    /// Time ran out.
    DeadlineExceeded = 4,
    /// What is asked for is not there.
    NotFound = 5,
    /// The caller is known and may not do this.
    PermissionDenied = 7,
    /// A limit is reached.
    ResourceExhausted = 8,
    /// The request is right, but not for this scan.
    FailedPrecondition = 9,
    /// The request was broken off.
    Aborted = 10,
    /// No such method.
    Unimplemented = 12,
    /// An error of the service itself.
    Internal = 13,
    /// Not now; try again.
    Unavailable = 14,
    /// Nobody knows the caller.
    Unauthenticated = 16,
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// Stable word for programs, such as `not_a_disk`: the member `code` of a problem document, `darn-code` in gRPC metadata.
    pub word: &'static str,
    /// HTTP status.
    pub status: u16,
    /// gRPC status code.
    pub grpc: GrpcCode,
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word)
    }
}

/// Writes one constant per row, and `ALL`, which lists them.
macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $word:literal, $status:literal, $grpc:ident;)*) => {
        $($(#[$doc])* pub const $name: Code = Code { word: $word, status: $status, grpc: GrpcCode::$grpc };)*

        /// Every code.
        pub const ALL: &[Code] = &[$($name),*];
    };
}

codes! {
    // Requests.

    /// The request carries no scan.
    EMPTY_BODY = "empty_body", 400, InvalidArgument;
    /// The request cannot be read.
    MALFORMED_REQUEST = "malformed_request", 400, InvalidArgument;
    /// The body is not the one that its digest tells of.
    DIGEST_MISMATCH = "digest_mismatch", 400, InvalidArgument;
    /// An anchor search came without its query.
    NO_QUERY = "no_query", 400, InvalidArgument;
    /// No such path.
    NOT_FOUND = "not_found", 404, Unimplemented;
    /// The path has other methods.
    METHOD_NOT_ALLOWED = "method_not_allowed", 405, Unimplemented;
    /// The body came too slowly.
    BODY_TIMEOUT = "body_timeout", 408, Aborted;
    /// The body is larger than the limit.
    BODY_TOO_LARGE = "body_too_large", 413, ResourceExhausted;
    /// A message of a gRPC stream is larger than the limit.
    MESSAGE_TOO_LARGE = "message_too_large", 413, ResourceExhausted;
    /// The constraints are larger than their limit.
    CONSTRAINTS_TOO_LARGE = "constraints_too_large", 413, ResourceExhausted;
    /// The query is larger than its limit.
    QUERY_TOO_LARGE = "query_too_large", 413, ResourceExhausted;
    /// The body is compressed.
    UNSUPPORTED_CONTENT_ENCODING = "unsupported_content_encoding", 415, InvalidArgument;
    /// The content type is not read here.
    UNSUPPORTED_MEDIA_TYPE = "unsupported_media_type", 415, InvalidArgument;
    /// Constraints that are valid with no scan.
    INVALID_CONSTRAINTS = "invalid_constraints", 422, InvalidArgument;
    /// A query that is valid with no scan.
    INVALID_QUERY = "invalid_query", 422, InvalidArgument;

    // Keys.

    /// The request carries no key, and this service wants one.
    KEY_MISSING = "key_missing", 401, Unauthenticated;
    /// The service does not know the request's key.
    KEY_UNKNOWN = "key_unknown", 401, Unauthenticated;
    /// The request's key has expired.
    KEY_EXPIRED = "key_expired", 401, Unauthenticated;
    /// The request's key does not have the scope that this takes.
    INSUFFICIENT_SCOPE = "insufficient_scope", 403, PermissionDenied;
    /// The request's key has used up one of its quotas.
    QUOTA_EXCEEDED = "quota_exceeded", 429, ResourceExhausted;

    // Sessions.

    /// The session's id is unknown.
    SESSION_NOT_FOUND = "session_not_found", 404, NotFound;
    /// The session received no request for too long.
    SESSION_EXPIRED = "session_expired", 410, NotFound;
    /// The session's memory was needed for others.
    SESSION_EVICTED = "session_evicted", 410, NotFound;
    /// The session was deleted.
    SESSION_DELETED = "session_deleted", 410, NotFound;
    /// The process that kept the session has ended.
    SESSION_LOST = "session_lost", 410, NotFound;
    /// Another instance of the service keeps the session.
    SESSION_ELSEWHERE = "session_elsewhere", 421, FailedPrecondition;
    /// The session alone is larger than all sessions may be.
    SESSION_TOO_LARGE = "session_too_large", 413, ResourceExhausted;
    /// Too many requests for one session at once.
    SESSION_BUSY = "session_busy", 429, ResourceExhausted;
    /// The sessions in use leave no room for another.
    SESSIONS_FULL = "sessions_full", 503, Unavailable;

    // Jobs.

    /// The service was started without a data folder and keeps no jobs.
    JOBS_NOT_KEPT = "jobs_not_kept", 404, NotFound;
    /// The job's id is unknown, or the job is forgotten.
    NO_SUCH_JOB = "no_such_job", 404, NotFound;
    /// The job has no result yet.
    JOB_UNFINISHED = "job_unfinished", 409, FailedPrecondition;
    /// The job's state does not allow what was asked.
    JOB_WRONG_STATE = "job_wrong_state", 409, FailedPrecondition;
    /// The job's files were deleted because of their age or the space they took.
    JOB_EXPIRED = "job_expired", 410, NotFound;
    /// The idempotency key was used with another payload.
    IDEMPOTENCY_MISMATCH = "idempotency_mismatch", 422, InvalidArgument;
    /// The job names a webhook, and the service has no secret to sign webhooks with.
    WEBHOOKS_OFF = "webhooks_off", 422, FailedPrecondition;
    /// Every attempt at the job ended its process.
    JOB_CRASHED_WORKER = "job_crashed_worker", 500, Internal;
    /// The database, or the storage of files, of the jobs cannot be reached.
    JOBS_UNAVAILABLE = "jobs_unavailable", 503, Unavailable;
    /// The disk on which jobs are kept is full.
    STORAGE_FULL = "storage_full", 507, Unavailable;

    // The service's own state.

    /// An error of the service itself; its details are logged, never sent.
    INTERNAL = "internal", 500, Internal;
    /// Too many jobs wait.
    QUEUE_FULL = "queue_full", 503, Unavailable;
    /// Other requests hold the service's memory.
    MEMORY_FULL = "memory_full", 503, Unavailable;
    /// Too many bodies are being received.
    UPLOADS_FULL = "uploads_full", 503, Unavailable;
    /// The service shuts down.
    DRAINING = "draining", 503, Unavailable;
    /// The process has no workers; it takes jobs alone.
    NO_WORKERS = "no_workers", 421, FailedPrecondition;
    /// The service has not finished its warm-up mend.
    WARMING_UP = "warming_up", 503, Unavailable;
    /// Waiting and mending took longer than the deadline.
    DEADLINE_EXCEEDED = "deadline_exceeded", 504, DeadlineExceeded;

    // Scans.

    /// The bytes are not a glTF.
    NOT_A_GLTF = "not_a_gltf", 400, InvalidArgument;
    /// A glTF that contradicts itself or its specification.
    INVALID_GLTF = "invalid_gltf", 400, InvalidArgument;
    /// An OBJ or a PLY that breaks a rule of its format.
    INVALID_MESH_FILE = "invalid_mesh_file", 400, InvalidArgument;
    /// The scan decodes to more than a limit allows.
    SCAN_TOO_LARGE = "scan_too_large", 413, ResourceExhausted;
    /// A triangle names a vertex that does not exist.
    INDEX_OUT_OF_RANGE = "index_out_of_range", 422, FailedPrecondition;
    /// A vertex position is infinite or not a number.
    POSITION_NOT_FINITE = "position_not_finite", 422, FailedPrecondition;
    /// The scan requires a glTF extension that is not supported.
    UNSUPPORTED_EXTENSION = "unsupported_extension", 422, FailedPrecondition;
    /// The scan refers to data outside its own bytes.
    EXTERNAL_DATA = "external_data", 422, FailedPrecondition;
    /// The scan has no triangles.
    NO_TRIANGLES = "no_triangles", 422, FailedPrecondition;
    /// A node's transform cannot be inverted.
    SINGULAR_TRANSFORM = "singular_transform", 422, FailedPrecondition;

    // Mending.

    /// Constraints that are valid, but not with this scan.
    CONSTRAINTS_DO_NOT_FIT = "constraints_do_not_fit", 422, FailedPrecondition;
    /// The cloth does not reach a hard anchor.
    ANCHOR_OUT_OF_REACH = "anchor_out_of_reach", 422, FailedPrecondition;
    /// The request needs more work than its size allows.
    TOO_MUCH_WORK = "too_much_work", 422, FailedPrecondition;
    /// The request needs more memory than its size allows.
    TOO_MUCH_MEMORY = "too_much_memory", 422, FailedPrecondition;
    /// The answer would be larger than its limit.
    ANSWER_TOO_LARGE = "answer_too_large", 422, FailedPrecondition;
    /// The scan has no hole to fill.
    NO_HOLES = "no_holes", 422, FailedPrecondition;
    /// The scan has nothing of darn's that could be taken out.
    NOTHING_TO_STRIP = "nothing_to_strip", 422, FailedPrecondition;
    /// More holes than are filled at once.
    TOO_MANY_HOLES = "too_many_holes", 422, FailedPrecondition;
    /// The hole's rim runs through an edge that more than two triangles share.
    NON_MANIFOLD_RIM = "non_manifold_rim", 422, FailedPrecondition;
    /// The region around the hole has coordinates beyond the limit.
    COORDINATES_TOO_LARGE = "coordinates_too_large", 422, FailedPrecondition;
    /// The region around the hole is not a disk.
    NOT_A_DISK = "not_a_disk", 422, FailedPrecondition;
    /// The region around the hole cannot be flattened as cloth can.
    NOT_CLOTH_LIKE = "not_cloth_like", 422, FailedPrecondition;
    /// The cloth around the hole covers too few cells of the grid.
    TOO_LITTLE_KNOWN = "too_little_known", 422, FailedPrecondition;
    /// The hole's rim crosses itself in the chart.
    RIM_CROSSES_ITSELF = "rim_crosses_itself", 422, FailedPrecondition;
    /// The patch would have degenerate triangles.
    PATCH_DEGENERATE = "patch_degenerate", 422, FailedPrecondition;
    /// The patch is stretched or cuts itself beyond what cloth does.
    NO_PLAUSIBLE_FILL = "no_plausible_fill", 422, FailedPrecondition;
    /// No cell of the grid lies in the hole.
    HOLE_TOO_NARROW = "hole_too_narrow", 422, FailedPrecondition;
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_word_is_snake_case_and_occurs_once() {
        let mut words = HashSet::new();
        for code in ALL {
            let snake = |b: u8| b.is_ascii_lowercase() || b == b'_';
            assert!(code.word.bytes().all(snake), "{code}");
            assert!(words.insert(code.word), "{code} occurs twice");
        }
    }

    #[test]
    fn both_protocols_blame_the_same_side() {
        for code in ALL {
            let ours = matches!(
                code.grpc,
                GrpcCode::Internal | GrpcCode::Unavailable | GrpcCode::DeadlineExceeded
            );
            assert_eq!(code.status >= 500, ours, "{code}");
        }
    }
}
