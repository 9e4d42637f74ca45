//! The service with its real router on a real socket, around a fake mender that behaves as each test says.

mod anchor_maps;
mod anchors;
mod cached;
mod digests;
mod editor;
mod every_request;
mod fake;
mod faults;
mod grpc_jobs;
mod harness;
mod instances;
mod job_uploads;
mod jobs;
mod key_logs;
mod keyed;
mod keys;
mod load;
mod logs;
mod openapi;
mod peers;
#[path = "../../crates/jobs/tests/laws/postgres.rs"]
mod postgres;
mod protocols;
mod quotas;
mod sessions;
mod signals;
mod strip;
mod tls;
mod uploads;
mod webhook_sink;
mod webhooks;
