//! The laws of durable jobs, each over SQLite and over PostgreSQL, and those of their files over S3, too.
#![cfg(feature = "s3")]

mod attempts;
mod bench;
mod claims;
mod files;
#[cfg(target_os = "linux")]
mod full_disk;
mod hints;
mod instances;
mod kills;
mod model;
mod objects;
mod outbox;
mod postgres;
mod requests;
mod running;
mod s3;
#[cfg(target_os = "linux")]
mod small_disk;
