//! Durable jobs: what a client has been promised survives the process, and the machine.
//!
//! [`Jobs`] puts two parts together: the [`Store`], rows in SQLite or PostgreSQL, and the [`blobs`], files. It knows nothing of what a job does:
//! the input is a file, and the request that goes with it is JSON that nobody here reads; so are the result, its report and its answer.
//!
//! # A job's life
//!
//! | from | by | to |
//! |---|---|---|
//! | – | [`Jobs::submit`] | waiting |
//! | waiting | [`Jobs::claim`], [`Jobs::next_job`] | running |
//! | running | [`ClaimedJob::finish`] | done |
//! | running | [`ClaimedJob::fail`] | error |
//! | running | [`ClaimedJob::give_back`]; the lease runs out | waiting; cancelled where that is wanted; error after the third crash |
//! | waiting | [`Jobs::cancel`] | cancelled |
//! | running | [`Jobs::cancel`], and then its worker by [`ClaimedJob::cancelled`] | cancelled |
//! | error, cancelled | [`Jobs::retry`] | waiting |
//! | any | [`Jobs::delete`], or [`Retention`] once it is finished | – |
//!
//! - A worker that claims a job holds a lease of 30 s on it, which it renews every 10 s. A worker that dies renews no more; another one takes
//!   its job. Each claim makes a new token, and every change a worker makes names its token, so one that was only asleep changes nothing.
//! - A claim counts an attempt, on disk, before the work begins. A job whose attempts crash three times is given up ([`CRASHED`]).
//!   After the first crash it runs alone in its process, so that a job that takes its process down is not the end of others.
//! - Finished jobs keep their files, and then their rows, as long as [`Retention`] says.
//!
//! Where a job names a webhook, the end of the job and a row of an outbox are written together. Whoever delivers claims such a row
//! ([`Store::claim_delivery`]), tells the webhook, and writes what came of it ([`Store::end_delivery`]); this crate sends nothing.
//!
//! # A worker
//!
//! ```
//! use std::sync::Arc;
//! use darn_jobs::{ClaimedJob, Failure, JobError, Jobs, Progress, StopReason};
//! use tokio::io::AsyncReadExt;
//!
//! /// Claims and runs jobs until `drain` ends. Start as many of these as jobs may run at once, and `Jobs::keep_house` once.
//! async fn work(jobs: Arc<Jobs>, drain: impl Future<Output = ()>) {
//!     let mut drain = std::pin::pin!(drain);
//!     loop {
//!         let mut claimed = tokio::select! {
//!             () = &mut drain => return,
//!             // Safe to drop: a job that was claimed meanwhile is given back.
//!             claimed = jobs.next_job("host-1:4711") => claimed,
//!         };
//!         match run(&mut claimed).await {
//!             // Where the lease is lost, somebody else has the job, or it was deleted; what was made here is deleted already.
//!             Ok(()) | Err(JobError::LeaseLost(_)) => {}
//!             // Nobody knows of an end: the lease runs out, and the job is tried again.
//!             Err(error) => tracing::error!(job = %claimed.job().id, ?error, "a job could not be ended"),
//!         }
//!     }
//! }
//!
//! async fn run(claimed: &mut ClaimedJob) -> Result<(), JobError> {
//!     let mut input = Vec::new();
//!     let read = claimed.input().await?.read_to_end(&mut input).await;
//!     read.map_err(|source| JobError::File { doing: "cannot read an input".to_owned(), source })?;
//!     let request = claimed.job().request.clone();
//!     // Goes to the thread that works: its calls never wait.
//!     let attempt = claimed.attempt();
//!     let mend = move || {
//!         attempt.report(Progress { stage: "flatten".to_owned(), hole: 0, holes: 1 });
//!         // To be asked wherever the work can stop, as by a budget's cancellation check.
//!         if attempt.stop_reason().is_some() {
//!             return Err("stopped");
//!         }
//!         Ok((input, request))
//!     };
//!     // A panic is this job's failure and no crash: the process lives on.
//!     match tokio::task::spawn_blocking(mend).await.unwrap_or(Err("panicked")) {
//!         Ok((result, answer)) => match claimed.finish(&result[..], &b"{}"[..], answer).await {
//!             // The input is kept, and the client may retry.
//!             Err(JobError::StorageFull) => fail(claimed, "storage_full", "there is no space for the result").await,
//!             ended => ended.map(drop),
//!         },
//!         Err(_) if claimed.attempt().stop_reason() == Some(StopReason::Cancelled) => claimed.cancelled().await.map(drop),
//!         Err(error) => fail(claimed, "internal", error).await,
//!     }
//! }
//!
//! async fn fail(claimed: &mut ClaimedJob, code: &str, message: &str) -> Result<(), JobError> {
//!     let failure = Failure { code: code.to_owned(), message: message.to_owned() };
//!     claimed.fail(failure, None).await.map(drop)
//! }
//! ```
//!
//! A worker that has to go before its job is ready calls [`ClaimedJob::give_back`].
#![forbid(unsafe_code)]

mod attempt;
pub mod blobs;
mod claimed;
mod company;
mod delivery;
mod engine;
mod error;
mod hints;
mod housekeeping;
mod input;
mod job;
mod jobs;
mod place;
mod reserve;
mod store;

pub use attempt::{Attempt, StopReason};
pub use claimed::ClaimedJob;
pub use delivery::{ClaimedDelivery, Delivery, DeliveryOutcome, TryOutcome};
pub use error::JobError;
pub use input::ReceivedInput;
pub use job::*;
pub use jobs::Jobs;
pub use place::{Place, Settings};
pub use store::{Clock, ExpiredLeases, Freed, Store};
