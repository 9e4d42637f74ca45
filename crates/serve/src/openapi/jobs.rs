//! The paths below `/jobs`.

use serde_json::{Map, Value, json};

use super::{body, mended, reference, refused, responses};
use crate::media_types::{EVENT_STREAM, GLB, GLTF, JSON, ZIP};

/// `POST /jobs`.
pub(super) fn submit() -> Value {
    let mut answers = responses(
        "202",
        accepted(),
        "Constraints that are valid with no scan; `errors` names them. With code `idempotency_mismatch`: the key came before with another \
            payload; with code `webhooks_off`: the service has no secret to sign webhooks with. What is wrong with the scan itself becomes the job's \
            `problem`",
    );
    if let Some(answers) = answers.as_object_mut() {
        // Nobody waits for the mend.
        answers.remove("504");
    }
    json!({
        "summary": "Hand over a scan to be mended later",
        "description": "When this is answered, the scan is on disk and its job outlives the process. The form of the result follows `Accept` \
            as that of /inpaint does",
        "operationId": "submitJob",
        "parameters": [
            key(),
            query("name", json!({ "type": "string", "maxLength": 200 }), "The client's name for the job"),
            query(
                "priority",
                json!({ "type": "integer", "minimum": -100, "maximum": 100, "default": 0 }),
                "Of a client's jobs those with a higher priority start first",
            ),
            query(
                "webhook",
                json!({ "type": "string", "format": "uri", "maxLength": 2000 }),
                "Where the end of the job is told, by a request as `webhooks` of this document describes it: an https URL of a public address",
            ),
        ],
        "requestBody": body(&[("constraints", "Constraints")], &[]),
        "responses": with(answers, &[NOT_KEPT, ("507", "The disk on which jobs are kept is full")]),
    })
}

/// What a webhook is sent.
pub(super) fn webhook() -> Value {
    let header = |name: &str, description: &str| json!({ "name": name, "in": "header", "required": true, "description": description, "schema": { "type": "string" } });
    json!({
        "summary": "A job has ended",
        "description": "Sent to the webhook of a job when it is done, has failed or is cancelled, and again later until an answer has a status of \
            200 to 299: ten times in some three days. 410 ends that for this job. Redirects are not followed. An event may come twice, and events of \
            a job that was retried in another order; its `version` tells",
        "operationId": "jobEnded",
        "security": [],
        "parameters": [
            header("webhook-id", "The same in all tries of this event, and in no other one"),
            header("webhook-timestamp", "When this try was made, in seconds since 1970"),
            header(
                "webhook-signature",
                "`v1,` and the base64 of the HMAC-SHA256 of id, timestamp and body with full stops between \
                    (https://www.standardwebhooks.com); of several secrets several, with a space between",
            ),
        ],
        "requestBody": { "required": true, "content": { JSON: { "schema": reference("WebhookEvent") } } },
        "responses": {
            "2XX": { "description": "Taken" },
            "410": { "description": "Nothing more is to be told of this job" },
        },
    })
}

/// `GET /jobs`.
pub(super) fn list() -> Value {
    let states = [
        "created",
        "waiting",
        "running",
        "done",
        "error",
        "cancelled",
    ];
    let page = answer(
        "200",
        "A page of jobs, the newest first",
        reference("JobList"),
    );
    json!({
        "summary": "List jobs",
        "operationId": "listJobs",
        "parameters": [
            query(
                "state",
                json!({ "type": "string", "enum": states }),
                "Only jobs in this state. None is ever `created`: a job is made when its scan is on disk, and waits from then on; the word is taken \
                    for pipelines that ask for it",
            ),
            query("from", json!({ "type": "string" }), "The `next` of the page before"),
            query(
                "limit",
                json!({ "type": "integer", "minimum": 1, "maximum": 200, "default": 50 }),
                "Most jobs of the page",
            ),
        ],
        "responses": with(page, &[("400", "A parameter that cannot be read"), NOT_KEPT]),
    })
}

/// `GET /jobs/{id}`.
pub(super) fn describe() -> Value {
    json!({
        "summary": "Describe a job",
        "operationId": "describeJob",
        "parameters": [id()],
        "responses": with(answer("200", "The job", reference("Job")), &[NO_JOB]),
    })
}

/// `DELETE /jobs/{id}`.
pub(super) fn delete() -> Value {
    json!({
        "summary": "Delete a job in any state, with its files",
        "operationId": "deleteJob",
        "parameters": [id()],
        "responses": with(json!({ "204": { "description": "Deleted" } }), &[NO_JOB]),
    })
}

/// `GET /jobs/{id}/result`.
pub(super) fn result() -> Value {
    let mended = mended(
        "The mended scan, with the bytes and the headers of the answer of /inpaint",
        "scan",
        &[GLB, GLTF, ZIP],
    );
    json!({
        "summary": "The mended scan of a job",
        "operationId": "jobResult",
        "parameters": [id()],
        "responses": with(json!({ "200": mended }), &FILE_ERRORS),
    })
}

/// `GET /jobs/{id}/report`.
pub(super) fn report() -> Value {
    json!({
        "summary": "The report of a job's mend",
        "operationId": "jobReport",
        "parameters": [id()],
        "responses": with(answer("200", "The report", reference("Report")), &FILE_ERRORS),
    })
}

/// `GET /jobs/{id}/events`.
pub(super) fn events() -> Value {
    json!({
        "summary": "The changes of a job as server-sent events",
        "description": "An event `job` for the present state and for each change; its `id` is the job's `version`, its data the job as JSON. \
            The stream ends once the job is finished; a comment every 15 seconds keeps it open",
        "operationId": "jobEvents",
        "parameters": [id(), {
            "name": "last-event-id",
            "in": "header",
            "description": "The version seen last; only later ones are told",
            "schema": { "type": "string" },
        }],
        "responses": with(
            json!({
                "200": { "description": "The events", "content": { EVENT_STREAM: {} } },
                "204": { "description": "The job is finished, and the client has seen that" },
            }),
            &[NO_JOB],
        ),
    })
}

/// `POST /jobs/{id}/cancel`.
pub(super) fn cancel() -> Value {
    json!({
        "summary": "Cancel a job that waits or runs",
        "operationId": "cancelJob",
        "parameters": [id()],
        "responses": with(
            answer("200", "Cancelled; or, of one that runs, told to stop (`cancelling`)", reference("Job")),
            &[NO_JOB, ("409", "The job is finished")],
        ),
    })
}

/// `POST /jobs/{id}/retry`.
pub(super) fn retry() -> Value {
    json!({
        "summary": "Let a failed or cancelled job wait again",
        "operationId": "retryJob",
        "parameters": [id()],
        "responses": with(
            answer("200", "It waits", reference("Job")),
            &[NO_JOB, ("409", "The job is neither failed nor cancelled"), ("410", "Its scan was deleted")],
        ),
    })
}

/// The preferences and the key of `POST /inpaint`.
pub(super) fn preferences() -> Value {
    json!([
        {
            "name": "prefer",
            "in": "header",
            "description": "`respond-async`: a job is made, and answered with (202) unless the mend ends within `wait=N` seconds \
                (RFC 7240), and `Preference-Applied` says so. Passed over by a service that keeps no jobs, and by all other routes",
            "schema": { "type": "string" },
        },
        key(),
    ])
}

/// The answer of a request whose scan has become a job.
pub(super) fn accepted() -> Value {
    json!({
        "description": "The job",
        "headers": {
            "location": { "description": "The job's path", "schema": { "type": "string", "format": "uri-reference" } },
        },
        "content": { JSON: { "schema": reference("Job") } },
    })
}

const NOT_KEPT: (&str, &str) = (
    "404",
    "With code `jobs_not_kept`: the service was started without `--data`",
);
const NO_JOB: (&str, &str) = (
    "404",
    "There is no job of this id, or it is forgotten; with code `jobs_not_kept`: the service was started without `--data`",
);
/// Errors of the files of a job.
const FILE_ERRORS: [(&str, &str); 3] = [
    NO_JOB,
    (
        "409",
        "There is no result: `job_unfinished`, or `job_wrong_state` of a job that failed or was cancelled",
    ),
    (
        "410",
        "The files were deleted because of their age or the space they took",
    ),
];

fn answer(status: &str, description: &str, schema: Value) -> Value {
    let success = json!({ "description": description, "content": { JSON: { "schema": schema } } });
    Value::Object(Map::from_iter([(status.to_owned(), success)]))
}

/// Adds errors to the answers of a route.
fn with(mut responses: Value, errors: &[(&str, &str)]) -> Value {
    for (status, description) in errors {
        responses[*status] = refused(description);
    }
    responses
}

fn key() -> Value {
    json!({
        "name": "idempotency-key",
        "in": "header",
        "description": "A repeated request with the same key and payload is answered with the first one's job, also where no more jobs may wait or \
            the disk is full; keys of different client \
            addresses are apart",
        "schema": { "type": "string", "maxLength": 255 },
    })
}

fn query(name: &str, schema: Value, description: &str) -> Value {
    json!({ "name": name, "in": "query", "description": description, "schema": schema })
}

fn id() -> Value {
    json!({ "name": "id", "in": "path", "required": true, "schema": { "type": "string", "format": "uuid" } })
}
