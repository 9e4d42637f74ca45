//! Durable jobs: what a client has been promised survives the process, and the machine.
//!
//! [`Jobs`] puts two parts together: the [`Store`], rows in SQLite or PostgreSQL, and the [`blobs`], files. It knows nothing of what a job is:
//! the input is a file, the request that goes with it is JSON that nobody here reads; so are the result, its report and its answer.
//!
//! # A job's life
//!
//! ```text
//! submit ──▶ waiting ──claim──▶ running ──finish──▶ done
//!              ▲ │                │ │ └────fail────▶ error ──────┐
//!              │ └─cancel─┐       │ └─cancel seen─▶ cancelled ───┤
//!              │          └───────┼───────────────────▲          │
//!              ├──give back, or the lease runs out ───┘          │ after three crashed attempts: error
//!              └──────────────────── retry ──────────────────────┘
//! ```
//!
//! - A worker that claims a job holds a lease of 30 s on it, which it renews every 10 s. A worker that dies renews no more; another one takes
//!   its job. Each claim makes a new token, and every change a worker makes names its token, so one that was only asleep changes nothing.
//! - A claim counts an attempt, on disk, before the work begins. A job whose attempts crash three times is given up ([`CRASHED`]).
//!   After the first crash it runs alone in its process, so that a job that takes its process down is not the end of others.
//! - Finished jobs keep their files, and then their rows, as long as [`Retention`] says.
//!
//! # A worker
//!
//! ```
//! use std::sync::Arc;
//! use darn_jobs::{Failure, JobError, Jobs, Progress, StopReason};
//! use tokio::io::AsyncReadExt;
//!
//! /// Claims and runs jobs until `drain` ends. Start as many of these as jobs may run at once, and `Jobs::keep_house` once.
//! async fn work(jobs: Arc<Jobs>, drain: impl Future<Output = ()>) -> Result<(), JobError> {
//!     let mut drain = std::pin::pin!(drain);
//!     loop {
//!         let mut claimed = tokio::select! {
//!             () = &mut drain => return Ok(()),
//!             // Safe to drop: a job that was claimed meanwhile is given back.
//!             claimed = jobs.next_job("host-1:4711") => claimed,
//!         };
//!         let mut input = Vec::new();
//!         claimed.input().await?.read_to_end(&mut input).await.map_err(|error| JobError::File {
//!             doing: "cannot read the input".to_owned(),
//!             source: error,
//!         })?;
//!         let request = claimed.job().request.clone();
//!         // Goes to the thread that works: it may be called from anywhere, and never waits.
//!         let attempt = claimed.attempt();
//!         let mend = tokio::task::spawn_blocking(move || {
//!             attempt.report(Progress { stage: "flatten".to_owned(), hole: 0, holes: 1 });
//!             // Ask this wherever the work could stop.
//!             if attempt.stop_reason().is_some() {
//!                 return Err("stopped");
//!             }
//!             Ok((input, request))
//!         });
//!         // A panic is the job's failure, not a crash: the process lives on.
//!         let ended = match mend.await.unwrap_or(Err("panicked")) {
//!             Ok((result, answer)) => claimed.finish(&result[..], &b"{}"[..], answer).await,
//!             Err(_) if claimed.attempt().stop_reason() == Some(StopReason::Cancelled) => claimed.cancelled().await,
//!             Err(error) => {
//!                 let failure = Failure { code: "internal".to_owned(), message: error.to_owned() };
//!                 claimed.fail(failure, None).await
//!             }
//!         };
//!         match ended {
//!             // Somebody else has the job, or it was deleted: what was made is gone already.
//!             Ok(_) | Err(JobError::LeaseLost(_)) => {}
//!             // The result found no room. The input is kept, and the client may retry.
//!             Err(JobError::StorageFull) => {
//!                 let failure = Failure { code: "storage_full".to_owned(), message: "the storage is full".to_owned() };
//!                 claimed.fail(failure, None).await?;
//!             }
//!             Err(error) => return Err(error),
//!         }
//!     }
//! }
//! ```
//!
//! A worker that has to go before its job is ready calls [`ClaimedJob::give_back`].
#![forbid(unsafe_code)]

mod attempt;
pub mod blobs;
mod claimed;
mod company;
mod engine;
mod error;
mod housekeeping;
mod job;
mod jobs;
mod reserve;
mod store;

pub use attempt::{Attempt, StopReason};
pub use claimed::ClaimedJob;
pub use error::JobError;
pub use job::*;
pub use jobs::{Jobs, Place, Settings};
pub use store::{Clock, ExpiredLeases, Freed, Store};
