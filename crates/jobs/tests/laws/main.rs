//! The laws of durable jobs, each over SQLite and over PostgreSQL.

mod attempts;
mod bench;
mod claims;
mod files;
#[cfg(target_os = "linux")]
mod full_disk;
mod instances;
mod kills;
mod model;
mod outbox;
mod postgres;
mod requests;
mod running;
