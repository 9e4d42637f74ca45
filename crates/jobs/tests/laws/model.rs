//! Random sequences of everything that can happen to jobs, against a model in memory: the store's rows are always what the model says.

mod steps;

use std::{future::Future, sync::Arc};

use darn_jobs::{
    CRASHED, Claimant, Company, ExpiredLeases, Failure, Job, JobError, Jobs, Lease, ListQuery,
    MAX_ATTEMPTS, NewJob, Outcome, Product, Progress, Retention, Signal, State, Submission,
    Submitted, blobs::BlobName,
};
use proptest::{prelude::*, test_runner::TestRunner};
use uuid::Uuid;

use crate::bench::{Bench, Engine, LEASE, TestClock};
use steps::{Step, steps};

const RETENTION: Retention = Retention {
    files_ms: 100_000,
    rows_ms: 300_000,
    bytes: 500,
    jobs: 6,
};

/// A job of the model: its row, and what the row does not show.
#[derive(Debug, Clone)]
struct Modelled {
    job: Job,
    key: Option<String>,
    digest: String,
    /// The token of the present attempt, and when it runs out.
    lease: Option<(Uuid, i64)>,
}

impl Modelled {
    /// A change that is shown.
    fn change(&mut self, now: i64) -> &mut Job {
        self.job.version += 1;
        self.job.changed_at = now;
        &mut self.job
    }

    fn leave_running(&mut self, state: State, now: i64) -> &mut Job {
        self.lease = None;
        let job = self.change(now);
        job.state = state;
        job.finished_at = state.is_finished().then_some(now);
        job.progress = None;
        job.cancel_wanted = false;
        job
    }
}

/// All of it.
struct Model {
    jobs: Vec<Modelled>,
    /// Every id and every lease that there ever was.
    ids: Vec<Uuid>,
    leases: Vec<Lease>,
    clock: TestClock,
    store: Arc<Jobs>,
}

impl Model {
    fn find(&mut self, id: Uuid) -> Option<&mut Modelled> {
        self.jobs.iter_mut().find(|job| job.job.id == id)
    }

    fn holder(&mut self, lease: Lease) -> Option<&mut Modelled> {
        (self.jobs.iter_mut()).find(|job| {
            job.job.id == lease.job && job.lease.is_some_and(|(token, _)| token == lease.token)
        })
    }

    /// The finished jobs, the newest first.
    fn finished(&mut self) -> Vec<&mut Modelled> {
        let mut finished: Vec<_> = self
            .jobs
            .iter_mut()
            .filter(|job| job.job.state.is_finished())
            .collect();
        finished.sort_by_key(|job| std::cmp::Reverse((job.job.finished_at, job.job.number)));
        finished
    }

    async fn take(&mut self, step: &Step) {
        let now = self.clock.now();
        let jobs = Arc::clone(&self.store);
        let store = jobs.store();
        match *step {
            Step::Create {
                client,
                key,
                payload,
                priority,
            } => self.create(client, key, payload, priority).await,
            Step::Claim(alone) => {
                self.claim(if alone {
                    Company::Alone
                } else {
                    Company::Shared
                })
                .await
            }
            Step::Renew(place) => {
                let Some(&lease) = pick(&self.leases, place) else {
                    return;
                };
                let found = store.renew(lease).await;
                let held = self.holder(lease).map(|job| {
                    job.lease = Some((lease.token, now + LEASE.as_millis() as i64));
                    job.job.cancel_wanted
                });
                is_signal(found, held);
            }
            Step::Progress(place) => {
                let Some(&lease) = pick(&self.leases, place) else {
                    return;
                };
                let progress = Progress {
                    stage: "grid".to_owned(),
                    hole: 1,
                    holes: 2,
                };
                let found = store.progress(lease, &progress).await;
                let held = self.holder(lease).map(|job| {
                    job.lease = Some((lease.token, now + LEASE.as_millis() as i64));
                    job.change(now).progress = Some(progress);
                    job.job.cancel_wanted
                });
                is_signal(found, held);
            }
            Step::End(place, how) => {
                let Some(&lease) = pick(&self.leases, place) else {
                    return;
                };
                self.end(lease, how).await;
            }
            Step::Cancel(place) => {
                let Some(&id) = pick(&self.ids, place) else {
                    return;
                };
                let found = store.cancel(id).await;
                match self.find(id) {
                    None => assert!(matches!(found, Err(JobError::NoSuchJob(_)))),
                    Some(job) => match job.job.state {
                        State::Waiting => drop(job.leave_running(State::Cancelled, now)),
                        State::Running if !job.job.cancel_wanted => {
                            job.change(now).cancel_wanted = true
                        }
                        State::Running | State::Cancelled => {}
                        State::Done | State::Error => {
                            assert!(matches!(found, Err(JobError::WrongState { .. })))
                        }
                    },
                }
            }
            Step::Retry(place) => {
                let Some(&id) = pick(&self.ids, place) else {
                    return;
                };
                let found = store.retry(id).await;
                match self.find(id) {
                    None => assert!(matches!(found, Err(JobError::NoSuchJob(_)))),
                    Some(job) if matches!(job.job.state, State::Error | State::Cancelled) => {
                        if job.job.expired_at.is_some() {
                            assert!(matches!(found, Err(JobError::Expired(_))));
                            return;
                        }
                        let job = job.leave_running(State::Waiting, now);
                        job.attempt = 0;
                        (job.started_at, job.worker) = (None, None);
                        (job.answer, job.failure) = (None, None);
                    }
                    Some(_) => assert!(matches!(found, Err(JobError::WrongState { .. }))),
                }
            }
            Step::Delete(place) => {
                let Some(&id) = pick(&self.ids, place) else {
                    return;
                };
                let found = store.delete(id).await;
                match self.find(id) {
                    None => assert!(matches!(found, Err(JobError::NoSuchJob(_)))),
                    Some(job) => assert_eq!(found.unwrap(), job.job),
                }
                self.jobs.retain(|job| job.job.id != id);
            }
            Step::Advance(milliseconds) => self.clock.advance(milliseconds),
            Step::ExpireLeases => {
                store.expire_leases(ExpiredLeases::ByTime).await.unwrap();
                for job in &mut self.jobs {
                    if job.lease.is_some_and(|(_, until)| until < now) {
                        expire(job, now);
                    }
                }
            }
            Step::ExpireFiles => {
                let freed = store.expire_files(&RETENTION).await.unwrap();
                let unfinished: i64 = self
                    .jobs
                    .iter()
                    .map(|job| &job.job)
                    .filter(|job| !job.state.is_finished())
                    .map(|job| job.bytes)
                    .sum();
                let (mut kept, mut expired) = (unfinished, 0);
                for job in self.finished() {
                    if job.job.expired_at.is_some() {
                        continue;
                    }
                    kept += job.job.bytes;
                    if kept > RETENTION.bytes
                        || job.job.finished_at.unwrap() <= now - RETENTION.files_ms
                    {
                        let job = job.change(now);
                        (job.input, job.result, job.report) = (None, None, None);
                        (job.bytes, job.expired_at) = (0, Some(now));
                        expired += 1;
                    }
                }
                assert_eq!(freed.jobs, expired);
            }
            Step::Forget => {
                store.forget(&RETENTION).await.unwrap();
                let forgotten: Vec<_> = (self.finished().into_iter().enumerate())
                    .filter(|(place, job)| {
                        *place as i64 >= RETENTION.jobs
                            || job.job.finished_at.unwrap() <= now - RETENTION.rows_ms
                    })
                    .map(|(_, job)| job.job.id)
                    .collect();
                self.jobs.retain(|job| !forgotten.contains(&job.job.id));
            }
        }
    }

    async fn create(&mut self, client: u8, key: Option<u8>, payload: u8, priority: i64) {
        let (now, id) = (self.clock.now(), Uuid::new_v4());
        let new = NewJob {
            id,
            submission: Submission {
                client: format!("client {client}"),
                idempotency_key: key.map(|key| key.to_string()),
                priority,
                request: "{}".to_owned(),
                ..Submission::default()
            },
            digest: payload.to_string(),
            input: BlobName::input(id),
            bytes: 100,
        };
        let found = self.store.store().create(&new).await;
        let Submission {
            client,
            idempotency_key,
            ..
        } = new.submission;
        let earlier = (self.jobs.iter()).find(|job| {
            job.key.is_some() && job.key == idempotency_key && job.job.client == client
        });
        match (earlier, found) {
            (Some(job), Ok(Submitted::Repeated(found))) => {
                assert_eq!(job.digest, new.digest);
                assert_eq!(job.job, found);
            }
            (Some(earlier), Err(JobError::IdempotencyMismatch { job })) => {
                assert_ne!(earlier.digest, new.digest);
                assert_eq!(earlier.job.id, job);
            }
            (None, Ok(Submitted::New(found))) => {
                let job = Job {
                    id,
                    // The database's; it only grows.
                    number: found.number,
                    client,
                    name: None,
                    priority,
                    webhook: None,
                    trace: None,
                    request: "{}".to_owned(),
                    state: State::Waiting,
                    version: 1,
                    attempt: 0,
                    cancel_wanted: false,
                    worker: None,
                    progress: None,
                    created_at: now,
                    changed_at: now,
                    started_at: None,
                    finished_at: None,
                    expired_at: None,
                    input: Some(BlobName::input(id)),
                    result: None,
                    report: None,
                    bytes: 100,
                    answer: None,
                    failure: None,
                };
                assert!(
                    self.jobs
                        .last()
                        .is_none_or(|last| last.job.number < job.number)
                );
                self.ids.push(id);
                self.jobs.push(Modelled {
                    job,
                    key: idempotency_key,
                    digest: new.digest,
                    lease: None,
                });
            }
            (earlier, found) => panic!("{earlier:?}, but {found:?}"),
        }
    }

    async fn claim(&mut self, company: Company) {
        let now = self.clock.now();
        let claimant = Claimant {
            worker: "worker",
            company,
            limits: None,
        };
        let found = self.store.store().claim(&claimant).await.unwrap();
        let running = |client: &str| {
            self.jobs
                .iter()
                .filter(|job| job.lease.is_some() && job.job.client == client)
                .count()
        };
        let next = (self.jobs.iter())
            .filter(|job| job.job.state == State::Waiting)
            .min_by_key(|job| {
                // Within a client the same order is that of priority and age.
                (running(&job.job.client), -job.job.priority, job.job.number)
            })
            .map(|job| job.job.id);
        let next = next
            .and_then(|id| self.find(id))
            .filter(|job| company == Company::Alone || job.job.attempt == 0);
        let Some(next) = next else {
            assert_eq!(found, None);
            return;
        };
        let claimed = found.expect("a job waits");
        next.lease = Some((claimed.lease.token, now + LEASE.as_millis() as i64));
        let job = next.change(now);
        job.state = State::Running;
        job.attempt += 1;
        job.started_at = Some(now);
        job.worker = Some("worker".to_owned());
        assert_eq!(claimed.job, *job);
        assert_eq!(claimed.lease.job, job.id);
        self.leases.push(claimed.lease);
    }

    async fn end(&mut self, lease: Lease, how: usize) {
        let now = self.clock.now();
        let failure = Failure {
            code: "no_holes".to_owned(),
            message: "none".to_owned(),
        };
        let product = Product {
            result: BlobName::result(lease),
            report: BlobName::report(lease),
            bytes: 30,
            answer: "{}".to_owned(),
        };
        let outcome = match how {
            0 => Outcome::Done(product.clone()),
            1 => Outcome::Failed {
                failure: failure.clone(),
                answer: Some("[]".to_owned()),
            },
            2 => Outcome::Cancelled,
            _ => Outcome::GivenBack,
        };
        let found = self.store.store().end(lease, &outcome).await;
        let Some(job) = self.holder(lease) else {
            match found {
                Ok(job) => assert!(how == 0 && job.result == Some(product.result)),
                Err(error) => assert!(matches!(error, JobError::LeaseLost(_)), "{error}"),
            }
            return;
        };
        match outcome {
            Outcome::Done(product) => {
                let job = job.leave_running(State::Done, now);
                (job.input, job.result, job.report) =
                    (None, Some(product.result), Some(product.report));
                (job.bytes, job.answer) = (product.bytes, Some(product.answer));
            }
            Outcome::Failed { failure, answer } => {
                let job = job.leave_running(State::Error, now);
                (job.failure, job.answer) = (Some(failure), answer);
            }
            Outcome::Cancelled => drop(job.leave_running(State::Cancelled, now)),
            Outcome::GivenBack => {
                let state = if job.job.cancel_wanted {
                    State::Cancelled
                } else {
                    State::Waiting
                };
                job.leave_running(state, now).attempt -= 1;
            }
        }
        assert_eq!(found.unwrap(), job.job);
    }

    /// The rows are what the model says.
    async fn check(&mut self) {
        let query = ListQuery {
            client: None,
            state: None,
            before: None,
            limit: 1000,
        };
        let mut rows = self.store.list(&query).await.unwrap().jobs;
        rows.reverse();
        let model: Vec<_> = self.jobs.iter().map(|job| job.job.clone()).collect();
        assert_eq!(rows, model);
        let counts = self.store.counts().await.unwrap();
        for state in State::ALL {
            assert_eq!(
                counts[&state],
                model.iter().filter(|job| job.state == state).count() as i64
            );
        }
    }
}

fn expire(job: &mut Modelled, now: i64) {
    let state = match &job.job {
        job if job.cancel_wanted => State::Cancelled,
        job if job.attempt >= MAX_ATTEMPTS => State::Error,
        _ => State::Waiting,
    };
    let job = job.leave_running(state, now);
    if state == State::Error {
        job.failure = Some(Failure {
            code: CRASHED.to_owned(),
            message: "3 workers ended or lost their connection while they ran this job".to_owned(),
        });
    }
}

fn is_signal(found: Result<Signal, JobError>, cancel_wanted: Option<bool>) {
    match (found, cancel_wanted) {
        (Ok(Signal::Continue), Some(false))
        | (Ok(Signal::Cancel), Some(true))
        | (Err(JobError::LeaseLost(_)), None) => {}
        (found, cancel_wanted) => panic!("{found:?}, but {cancel_wanted:?}"),
    }
}

fn pick<T>(all: &[T], place: usize) -> Option<&T> {
    all.get(place % all.len().max(1))
}

/// Runs random sequences, each over jobs of its own.
fn rows_follow_the_model<F: Future<Output = Bench>>(bench: impl Fn() -> F) {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let mut runner = TestRunner::new(ProptestConfig {
        cases: 40,
        max_shrink_iters: 400,
        ..ProptestConfig::default()
    });
    let ran = runner.run(&steps(), |steps| {
        runtime.block_on(async {
            let bench = bench().await;
            let mut model = Model {
                jobs: Vec::new(),
                ids: Vec::new(),
                leases: Vec::new(),
                clock: bench.clock.clone(),
                store: bench.open().await,
            };
            for step in &steps {
                model.take(step).await;
                model.check().await;
            }
            model.store.close().await;
        });
        Ok(())
    });
    ran.unwrap();
}

#[test]
fn rows_follow_the_model_on_sqlite() {
    rows_follow_the_model(|| Bench::new(Engine::Sqlite));
}

#[test]
fn rows_follow_the_model_on_postgres() {
    rows_follow_the_model(|| Bench::new(Engine::Postgres));
}
