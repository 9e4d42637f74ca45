//! Jobs to test on, over either database and either storage of files, with a clock that a test sets.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use darn_jobs::{
    Claimant, Claimed, Clock, Company, Failure, Job, Jobs, Outcome, Place, Product, Retention,
    Settings, Store, Submission,
    blobs::{BlobName, Files},
};
use tempfile::TempDir;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::{postgres::Server, s3::S3};

/// Makes two tests of a law, one over each database; and others over the engines that are named after it.
macro_rules! law {
    (async fn $name:ident($bench:ident: Bench) $body:block $($test:ident: $engine:ident)*) => {
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
            $(
                #[tokio::test]
                async fn $test() {
                    law(Bench::new(crate::bench::Engine::$engine).await).await;
                }
            )*
        }
    };
}
pub(crate) use law;

/// Makes three tests of a law about files: with a folder over each database, and with S3.
macro_rules! law_of_files {
    (async fn $name:ident($bench:ident: Bench) $body:block) => {
        crate::bench::law! { async fn $name($bench: Bench) $body on_postgres_and_s3: PostgresAndS3 }
    };
}
pub(crate) use law_of_files;

/// The lease of all benches.
pub const LEASE: Duration = Duration::from_secs(30);
/// Longer than a lease, in milliseconds.
pub const PAST_LEASE: i64 = 31_000;

/// One of the two databases; with files in a folder, or in S3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    Sqlite,
    Postgres,
    PostgresAndS3,
}

/// A place for jobs that is deleted in the end, and the clock of its jobs.
pub struct Bench {
    pub place: Place,
    pub clock: TestClock,
    pub settings: Settings,
    pub folder: TempDir,
    /// Where the files are, if that is S3.
    pub s3: Option<S3>,
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
        let s3 = (engine == Engine::PostgresAndS3).then(|| S3::start(folder.path().join("s3")));
        let place = match engine {
            Engine::Sqlite => Place::Folder(path),
            Engine::Postgres | Engine::PostgresAndS3 => Place::Shared {
                url: Server::shared().database().await,
                files: match &s3 {
                    Some(s3) => Files::Bucket(s3.bucket()),
                    None => Files::Folder(path),
                },
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
            s3,
        }
    }

    /// Opens the jobs as a process does.
    pub async fn open(&self) -> Arc<Jobs> {
        Jobs::open(&self.place, self.settings.clone())
            .await
            .unwrap()
    }

    /// The file, or the object as the server keeps it, at a path such as `incoming/x`.
    pub fn path(&self, path: &str) -> PathBuf {
        let root = match &self.s3 {
            Some(s3) => s3.objects(),
            None => self.folder.path().join("data"),
        };
        root.join(path)
    }

    /// Puts a file there that the jobs know nothing of.
    pub fn plant(&self, path: &str, text: &str) {
        let path = self.path(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    /// The names of all files, whole ones and others.
    pub fn files(&self) -> Vec<String> {
        let mut names = self.s3.as_ref().map(S3::unfinished).unwrap_or_default();
        let mut folders = vec![self.path("blobs"), self.path("incoming")];
        while let Some(folder) = folders.pop() {
            // The server makes them when they are needed.
            let entries = std::fs::read_dir(folder).into_iter().flatten();
            for entry in entries {
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

/// Far longer than anything takes that a test waits for.
pub const SOON: Duration = Duration::from_secs(10);

/// Waits until something is so.
pub async fn until<F: Future<Output = bool>>(is_so: impl Fn() -> F) {
    let waited = timeout(SOON, async {
        while !is_so().await {
            sleep(Duration::from_millis(10)).await;
        }
    });
    waited.await.expect("it becomes so");
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
