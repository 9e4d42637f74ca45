//! Runs durable jobs beside requests, on the same pool of workers.
//!
//! One task claims: only while a worker is idle, or while no job runs here, so that requests go first and jobs keep one worker. Each claimed
//! job has a task of its own, which reads its input, has it mended on the pool and writes what came of it.

use std::{sync::Arc, time::Duration};

use bytes::Bytes;
use darn_jobs::{Attempt, ClaimedJob, Failure, JobError, Jobs, Progress, StopReason};
use opentelemetry::{
    Context,
    trace::{FutureExt as _, TraceContextExt as _},
};
use tokio::{io::AsyncReadExt as _, select, task::JoinSet, time::sleep};
use tokio_util::sync::CancellationToken;
use tracing::{Instrument as _, error, info, info_span, warn};

use super::{
    app::App,
    counted::{counted, take},
    error::RequestError,
    job_request::JobRequest,
    pool::JobTurn,
    request_limits::DurableSize,
    response::{self, KeptMend, MendResponse},
    traces,
    webhook::sender::WebhookSender,
};
use darn_budget::Listener;
use darn_contract::codes;

/// The stage of a job that waits.
pub const WAITING: &str = "waiting";
/// The stage in which the input is read. Those that follow are the mender's.
pub const READING: &str = "reading";
/// The stage in which the result is stored.
const STORING: &str = "storing";

/// How often a job that is mended looks whether it is to stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// How long a job that finds no memory beside requests waits before it is given back.
const MEMORY_PAUSE: Duration = Duration::from_secs(2);

/// What claims jobs and runs them.
#[derive(Debug)]
pub struct JobWorker {
    app: Arc<App>,
    jobs: Arc<Jobs>,
    /// Cancelled when the service begins to shut down.
    stop: CancellationToken,
    /// For operators.
    name: String,
}

/// How the work of an attempt ended.
enum Worked {
    Mended(KeptMend),
    Failed(RequestError),
    /// Other work holds the memory that it needs.
    NoMemory,
    /// The attempt is to stop.
    Told(StopReason),
    /// The service shuts down.
    Interrupted,
}

impl JobWorker {
    /// A worker of a service.
    pub fn new(app: &Arc<App>, jobs: &Arc<Jobs>, stop: CancellationToken) -> Self {
        Self {
            app: Arc::clone(app),
            jobs: Arc::clone(jobs),
            stop,
            name: format!(
                "instance {}, process {}",
                app.instance.name(),
                std::process::id()
            ),
        }
    }

    /// Runs jobs once `ready` is, and tells webhooks of ended ones, until the service shuts down; then gives back those that run and closes the
    /// database. All the time it says that this instance lives.
    pub async fn work_once(self, ready: impl Future<Output = ()>) {
        let instance = self.app.instance.name().to_string();
        let mut beside = JoinSet::new();
        beside.spawn({
            let jobs = Arc::clone(&self.jobs);
            async move { jobs.keep_house().await }
        });
        beside.spawn({
            let (jobs, instance) = (Arc::clone(&self.jobs), instance.clone());
            async move { jobs.live_as(&instance).await }
        });
        let telling = self
            .webhooks()
            .map(|sender| tokio::spawn(sender.deliver_all()));
        let jobs = Arc::clone(&self.jobs);
        let worker = Arc::new(self);
        select! {
            () = worker.stop.cancelled() => {}
            () = ready => worker.claim_and_run().await,
        }
        beside.shutdown().await;
        if let Some(telling) = telling {
            telling.await.ok();
        }
        if let Err(error) = jobs.store().instance_ends(&instance).await {
            warn!(?error, "the database was not told that this instance ends");
        }
        jobs.close().await;
    }

    fn webhooks(&self) -> Option<WebhookSender> {
        Some(WebhookSender {
            app: Arc::clone(&self.app),
            jobs: Arc::clone(&self.jobs),
            webhooks: Arc::clone(self.app.webhooks.as_ref()?),
            stop: self.stop.clone(),
        })
    }

    async fn claim_and_run(self: &Arc<Self>) {
        let mut running = JoinSet::new();
        while let Some((claimed, turn)) = self.next().await {
            let span = info_span!("job", id = %claimed.job().id);
            let worker = Arc::clone(self);
            let job = claimed.job();
            let trace = traces::job_span(&job.id.to_string(), job.attempt, job.trace.as_deref());
            let run = async move {
                worker.run(claimed, turn).await;
                Context::current().span().end();
            };
            running.spawn(run.with_context(trace).instrument(span));
            while running.try_join_next().is_some() {}
        }
        while running.join_next().await.is_some() {}
    }

    /// The next job, and a turn for it; `None` once the service shuts down.
    async fn next(&self) -> Option<(ClaimedJob, JobTurn)> {
        loop {
            let turn = select! {
                biased;
                () = self.stop.cancelled() => return None,
                turn = self.app.job_turn() => turn,
            };
            loop {
                if self.stop.is_cancelled() {
                    return None;
                }
                let keys = self.app.keys.as_ref();
                let limits = keys.map(|keys| keys.running_limits()).unwrap_or_default();
                // Not in a `select`: a claim is never dropped, so that the database is open until it has ended.
                match self.jobs.claim_within(&self.name, &limits).await {
                    Ok(Some(claimed)) => return Some((claimed, turn)),
                    Ok(None) => {}
                    Err(error) => warn!(?error, "no job can be claimed"),
                }
                select! {
                    biased;
                    () = self.stop.cancelled() => return None,
                    () = turn.needed_by_requests() => break,
                    () = self.jobs.look_again() => {}
                }
            }
        }
    }

    async fn run(&self, mut claimed: ClaimedJob, turn: JobTurn) {
        let attempt = claimed.attempt();
        let worked = select! {
            biased;
            reason = told_to_stop(&attempt) => Worked::Told(reason),
            () = self.stop.cancelled() => Worked::Interrupted,
            worked = self.work(&mut claimed, turn) => worked,
        };
        let ended = match worked {
            Worked::Mended(mend) => self.finish(&mut claimed, mend).await,
            Worked::Failed(error) => {
                traces::note_failure(error.code().word);
                fail(&mut claimed, &error).await
            }
            Worked::NoMemory => {
                select! {
                    () = self.stop.cancelled() => {}
                    () = sleep(MEMORY_PAUSE) => {}
                }
                claimed.give_back().await.map(drop)
            }
            Worked::Told(StopReason::Cancelled) => claimed.cancelled().await.map(drop),
            Worked::Told(StopReason::LeaseLost) => Ok(()),
            Worked::Interrupted => claimed.give_back().await.map(drop),
        };
        match ended {
            Ok(()) => info!("the attempt has ended"),
            // Another worker has the job, or it was deleted.
            Err(JobError::LeaseLost(_)) => info!("the lease is lost"),
            // Its lease runs out, and it is tried again.
            Err(error) => error!(?error, "the job could not be ended"),
        }
    }

    /// Reads the input and mends it. Dropping the future cancels the mend.
    async fn work(&self, claimed: &mut ClaimedJob, turn: JobTurn) -> Worked {
        match self.mend(claimed, turn).await {
            Ok(mend) => Worked::Mended(mend),
            Err(RequestError::Draining) => Worked::Interrupted,
            Err(error) if error.code() == codes::MEMORY_FULL => {
                let memory = &self.app.limits.memory;
                if memory.used() > memory.limit() / 2 {
                    Worked::NoMemory
                } else {
                    // It does not fit even where little else is held.
                    Worked::Failed(error)
                }
            }
            Err(error) => Worked::Failed(error),
        }
    }

    async fn mend(
        &self,
        claimed: &mut ClaimedJob,
        turn: JobTurn,
    ) -> Result<KeptMend, RequestError> {
        let attempt = claimed.attempt();
        report(&attempt, READING);
        let scan = self.read_input(claimed).await?;
        let request = JobRequest::read(&claimed.job().request).ok_or(RequestError::Internal)?;
        let (constraints, form) = (request.constraints()?, request.form());
        let app = Arc::clone(&self.app);
        let work = move |mender: &dyn darn_contract::port::Mender,
                         budget: &darn_budget::Budget<'_>| {
            let mended = mender.inpaint(scan, &constraints, budget)?;
            let mended = mender.repacked(mended, form, budget)?;
            Ok(MendResponse::from(mended).keep(&app.metrics))
        };
        let bytes = usize::try_from(claimed.job().bytes).unwrap_or(usize::MAX);
        let listener = Listener::new(move |progress| tell(&attempt, progress));
        let size = DurableSize { bytes, listener };
        self.app.run_durable(turn, size, work).await
    }

    async fn read_input(&self, claimed: &mut ClaimedJob) -> Result<Bytes, RequestError> {
        let mut file = claimed.input().await?;
        let length = usize::try_from(file.bytes()).unwrap_or(usize::MAX);
        let memory = take(&self.app.limits.memory, length)?;
        let mut scan = Vec::with_capacity(length);
        file.read_to_end(&mut scan).await.map_err(unreadable)?;
        Ok(counted(scan.into(), memory))
    }

    async fn finish(&self, claimed: &mut ClaimedJob, mend: KeptMend) -> Result<(), JobError> {
        report(&claimed.attempt(), STORING);
        let KeptMend {
            answer,
            bytes,
            report,
        } = mend;
        let answer = String::from_utf8(response::json(&answer)).unwrap_or_default();
        match claimed.finish(&bytes[..], &report[..], answer).await {
            Err(JobError::StorageFull) => fail(claimed, &RequestError::StorageFull).await,
            Err(error @ JobError::File { .. }) => fail(claimed, &error.into()).await,
            ended => ended.map(drop),
        }
    }
}

/// Ends a job with the problem document that the synchronous request would have been answered with.
async fn fail(claimed: &mut ClaimedJob, error: &RequestError) -> Result<(), JobError> {
    let document = error.document(&claimed.job().id.to_string());
    let document = String::from_utf8(response::json(&document)).ok();
    let failure = Failure {
        code: error.code().word.to_owned(),
        message: error.to_string(),
    };
    claimed.fail(failure, document).await.map(drop)
}

/// Waits until an attempt is to stop.
async fn told_to_stop(attempt: &Attempt) -> StopReason {
    loop {
        if let Some(reason) = attempt.stop_reason() {
            return reason;
        }
        sleep(LOOK_EVERY).await;
    }
}

/// Passes on how far the mender is.
fn tell(attempt: &Attempt, progress: darn_budget::Progress) {
    let count = |pieces| i64::try_from(pieces).unwrap_or(i64::MAX);
    attempt.report(Progress {
        stage: progress.stage.to_owned(),
        hole: count(progress.done),
        holes: count(progress.all),
    });
}

/// Tells of a stage without counts.
fn report(attempt: &Attempt, stage: &str) {
    attempt.report(Progress {
        stage: stage.to_owned(),
        hole: 0,
        holes: 0,
    });
}

fn unreadable(error: std::io::Error) -> RequestError {
    error!(%error, "the input of a job cannot be read");
    RequestError::Internal
}
