//! Jobs to test on, over either database, with a clock that a test sets.

use std::{
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use darn_jobs::{
    Claimant, Claimed, Clock, Company, Failure, Job, Jobs, Outcome, Place, Product, Retention,
    Settings, Store, Submission, blobs::BlobName,
};
use tempfile::TempDir;
use uuid::Uuid;

use super::postgres::Server;

/// Makes two tests of a law, one over each database.
macro_rules! law {
    (async fn $name:ident($bench:ident: Bench) $body:block) => {
        mod $name {
            use super::*;

            async fn law($bench: Bench) $body

            #[tokio::test]
            async fn on_sqlite() {
                law(Bench::new(crate::bench::Engine::Sqlite).await).await;
            }

            #[tokio::test]
            async fn on_postgres() {
                law(Bench::new(crate::bench::Engine::Postgres).await).await;
            }
        }
    };
}
pub(crate) use law;

/// The lease of all benches.
pub const LEASE: Duration = Duration::from_secs(30);
/// Longer than a lease, in milliseconds.
pub const PAST_LEASE: i64 = 31_000;

/// One of the two databases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    Sqlite,
    Postgres,
}

/// A place for jobs that is deleted in the end, and the clock of its jobs.
pub struct Bench {
    pub place: Place,
    pub clock: TestClock,
    pub settings: Settings,
    pub folder: TempDir,
}

/// A clock that stands still until it is set forward.
#[derive(Debug, Clone)]
pub struct TestClock(Arc<AtomicI64>);

impl TestClock {
    fn new() -> Self {
        Self(Arc::new(AtomicI64::new(1_000_000)))
    }

    pub fn now(&self) -> i64 {
        self.0.load(Ordering::SeqCst)
    }

    pub fn advance(&self, milliseconds: i64) {
        self.0.fetch_add(milliseconds, Ordering::SeqCst);
    }
}

impl Bench {
    pub async fn new(engine: Engine) -> Self {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("data");
        let place = match engine {
            Engine::Sqlite => Place::Folder(path),
            Engine::Postgres => Place::Shared {
                url: Server::shared().database().await,
                folder: path,
            },
        };
        let clock = TestClock::new();
        let told = clock.clone();
        let settings = Settings {
            lease: LEASE,
            renewal: Duration::from_millis(50),
            poll: Duration::from_millis(50),
            retention: Retention::default(),
            clock: Clock::Injected(Arc::new(move || told.now())),
        };
        Self {
            place,
            clock,
            settings,
            folder,
        }
    }

    /// Opens the jobs as a process does.
    pub async fn open(&self) -> Arc<Jobs> {
        Jobs::open(&self.place, self.settings.clone())
            .await
            .unwrap()
    }

    /// The names of all files, whole ones and others.
    pub fn files(&self) -> Vec<String> {
        let data = self.folder.path().join("data");
        let mut names = Vec::new();
        let mut folders = vec![data.join("blobs"), data.join("incoming")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let entry = entry.unwrap();
                if entry.file_type().unwrap().is_dir() {
                    folders.push(entry.path());
                } else {
                    names.push(entry.file_name().into_string().unwrap());
                }
            }
        }
        names.sort();
        names
    }
}

/// A submission of a client.
pub fn submission(client: &str) -> Submission {
    Submission {
        client: client.to_owned(),
        request: "{}".to_owned(),
        ..Submission::default()
    }
}

/// Submits a small job.
pub async fn submit(jobs: &Jobs, client: &str) -> Job {
    let submitted = jobs.submit(submission(client), &b"scan"[..]).await.unwrap();
    submitted.into_job()
}

/// Claims a job as a worker that runs no other does; its lease is not kept.
pub async fn claim(store: &Store) -> Option<Claimed> {
    let claimant = Claimant {
        worker: "worker",
        company: Company::Alone,
        limits: None,
    };
    store.claim(&claimant).await.unwrap()
}

/// A result's files, of which nobody looks whether they are there.
pub fn product(claimed: &Claimed) -> Outcome {
    Outcome::Done(Product {
        result: BlobName::result(claimed.lease),
        report: BlobName::report(claimed.lease),
        bytes: 10,
        answer: "{}".to_owned(),
    })
}

/// A failure.
pub fn failed() -> Outcome {
    Outcome::Failed {
        failure: Failure {
            code: "no_holes".to_owned(),
            message: "the scan has no holes".to_owned(),
        },
        answer: None,
    }
}

/// An id that no job has.
pub fn nobody() -> Uuid {
    Uuid::new_v4()
}
