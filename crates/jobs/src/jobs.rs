//! The jobs of a service: rows and files together.

use std::{fs::TryLockError, path::Path, sync::Arc, time::Duration};

use sha2::{Digest, Sha256};
use tokio::{
    fs,
    io::AsyncRead,
    sync::{
        Mutex, Notify,
        broadcast::{self, error::RecvError},
    },
    time::sleep,
};
use tracing::{error, warn};
use uuid::Uuid;

use super::{
    blobs::{BlobFile, BlobName, Blobs, Files, Written},
    claimed::ClaimedJob,
    company::RunningJobs,
    error::JobError,
    hints::Hints,
    input::ReceivedInput,
    job::{
        Claimant, ClientCounts, Job, ListQuery, NewJob, Page, RunningLimits, State, Submission,
        Submitted,
    },
    place::{Place, Settings},
    store::{ExpiredLeases, Store},
};

/// Changes that a listener may be behind before it only hears that there were some.
const CHANGES_KEPT: usize = 1024;

/// All jobs of a service.
///
/// Calls that take a job's id do not ask whose it is: whoever serves clients gets the job first and compares [`Job::client`], which never changes.
#[derive(Debug)]
pub struct Jobs {
    store: Store,
    blobs: Blobs,
    settings: Settings,
    running: Arc<RunningJobs>,
    /// One claim at a time, so that it knows in what company its job starts.
    claims: Mutex<()>,
    waiting: Arc<Notify>,
    /// Between the processes; there where others may be.
    hints: Option<Hints>,
    /// An end waits that a webhook is to be told of.
    ended: Notify,
    changed: broadcast::Sender<Uuid>,
    /// Jobs whose workers should look whether to stop.
    stopped: broadcast::Sender<Uuid>,
    /// Held as long as the folder is in use.
    _lock: Option<std::fs::File>,
}

impl Jobs {
    /// Opens the jobs of a place, which are made where there are none.
    ///
    /// In a folder, what a crash has left is put in order first: jobs that ran wait again, files without a row are deleted.
    /// On a shared place that is done by [`Self::keep_house`] as time passes.
    ///
    /// # Errors
    /// [`JobError::FolderInUse`] where another process has the folder.
    pub async fn open(place: &Place, settings: Settings) -> Result<Arc<Self>, JobError> {
        let files = place.files();
        if let Files::Folder(folder) = &files {
            fs::create_dir_all(folder).await.map_err(|error| {
                JobError::file(|| format!("cannot make the folder {files}"), error)
            })?;
        }
        let (lease, clock) = (settings.lease, settings.clock.clone());
        let (lock, store) = match place {
            Place::Folder(folder) => {
                let lock = lock(folder)?;
                (Some(lock), Store::sqlite(folder, lease, clock).await?)
            }
            Place::Shared { url, .. } => (None, Store::postgres(url, lease, clock).await?),
        };
        let is_ours_alone = lock.is_some();
        let blobs = Blobs::open(&files).await?;
        let waiting = Arc::new(Notify::new());
        let jobs = Arc::new(Self {
            hints: store.start_hints(&waiting).await,
            store,
            blobs,
            settings,
            running: Arc::default(),
            claims: Mutex::default(),
            waiting,
            ended: Notify::new(),
            changed: broadcast::channel(CHANGES_KEPT).0,
            stopped: broadcast::channel(CHANGES_KEPT).0,
            _lock: lock,
        });
        if is_ours_alone {
            jobs.store.expire_leases(ExpiredLeases::OfTheDead).await?;
            jobs.store.release_deliveries().await?;
            // It frees space, and is worth no failure to start.
            if let Err(error) = jobs.sweep(Duration::ZERO).await {
                warn!(?error, "files without a job cannot be looked for");
            }
        }
        Ok(jobs)
    }

    /// Stores an input and makes its job. When this returns, both are on disk, and the job waits.
    ///
    /// A repeated idempotency key is answered with the first one's job. The payload that must be the same then is the input and all of the
    /// submission.
    ///
    /// # Errors
    /// [`JobError::IdempotencyMismatch`], [`JobError::StorageFull`], [`JobError::Stream`] where the stream fails. Nothing is left then.
    pub async fn submit(
        &self,
        submission: Submission,
        input: impl AsyncRead,
    ) -> Result<Submitted, JobError> {
        let received = self.receive(input).await?;
        self.submit_received(submission, received).await
    }

    /// [`Self::submit`] of an input that has been stored before.
    ///
    /// # Errors
    /// [`JobError::IdempotencyMismatch`], [`JobError::StorageFull`]. Nothing is left then.
    pub async fn submit_received(
        &self,
        submission: Submission,
        input: ReceivedInput,
    ) -> Result<Submitted, JobError> {
        let new = NewJob {
            id: input.id,
            digest: digest(&submission, &input.written.sha256),
            submission,
            input: input.name.clone(),
            bytes: i64::try_from(input.written.bytes).unwrap_or(i64::MAX),
        };
        let name = input.name.clone();
        // From here on a row may name it, also where this future is dropped.
        input.keep();
        let created = self.store.create(&new).await;
        match &created {
            Ok(Submitted::New(_)) => self.announce_waiting(),
            Ok(Submitted::Repeated(_))
            | Err(JobError::IdempotencyMismatch { .. } | JobError::StorageFull) => {
                self.discard([&name]).await;
            }
            // The row may be there nevertheless: the file stays, and is swept if it is not.
            Err(_) => {}
        }
        created
    }

    /// Whether a client has made a job with this idempotency key that is not forgotten.
    pub async fn has_key(&self, client: &str, key: &str) -> Result<bool, JobError> {
        Ok(self.store.keyed(client, key).await?.is_some())
    }

    /// The job that an earlier submission with the same idempotency key has made, whatever there is room for; `None` where there is none.
    ///
    /// # Errors
    /// [`JobError::IdempotencyMismatch`] where that one had another payload.
    pub async fn repeated(
        &self,
        submission: &Submission,
        input: &Written,
    ) -> Result<Option<Job>, JobError> {
        let Some(key) = &submission.idempotency_key else {
            return Ok(None);
        };
        match self.store.keyed(&submission.client, key).await? {
            None => Ok(None),
            Some(first) => first.of(&digest(submission, &input.sha256)).map(Some),
        }
    }

    /// A job.
    pub async fn get(&self, id: Uuid) -> Result<Job, JobError> {
        self.store.get(id).await
    }

    /// A page of jobs, the newest first.
    pub async fn list(&self, query: &ListQuery) -> Result<Page, JobError> {
        self.store.list(query).await
    }

    /// How many jobs are in each state, on all machines.
    pub async fn counts(&self) -> Result<std::collections::BTreeMap<State, i64>, JobError> {
        self.store.counts().await
    }

    /// How many jobs of a client wait and run.
    pub async fn client_counts(&self, client: &str) -> Result<ClientCounts, JobError> {
        self.store.client_counts(client).await
    }

    /// The job, once its version is not this one any more: at once where it is another already.
    ///
    /// # Errors
    /// [`JobError::NoSuchJob`] once it is deleted.
    pub async fn changed_since(&self, id: Uuid, version: i64) -> Result<Job, JobError> {
        let mut changes = self.changes();
        loop {
            let job = self.store.get(id).await?;
            if job.version != version {
                return Ok(job);
            }
            // What another machine changes is seen at the next poll.
            tokio::select! {
                () = sleep(self.settings.poll) => {}
                () = changes.of(id) => {}
            }
        }
    }

    /// Opens the result of a job that is done.
    ///
    /// # Errors
    /// [`JobError::WrongState`] where it is not done, [`JobError::Expired`].
    pub async fn result(&self, id: Uuid) -> Result<(Job, BlobFile), JobError> {
        self.open_file(id, |job| job.result.as_ref()).await
    }

    /// Opens the report of a job that is done; errors as [`Self::result`].
    pub async fn report(&self, id: Uuid) -> Result<(Job, BlobFile), JobError> {
        self.open_file(id, |job| job.report.as_ref()).await
    }

    async fn open_file(
        &self,
        id: Uuid,
        which: impl Fn(&Job) -> Option<&BlobName>,
    ) -> Result<(Job, BlobFile), JobError> {
        let job = self.store.get(id).await?;
        let Some(name) = which(&job) else {
            return Err(match job.expired_at {
                Some(_) => JobError::Expired(id),
                None => JobError::WrongState {
                    job: id,
                    state: job.state,
                    asked: "read",
                },
            });
        };
        match self.blobs.open_blob(name).await {
            // Deleted or expired since the row was read; where the row still names it, something else took it.
            Err(JobError::BlobMissing(name)) => match self.store.get(id).await? {
                job if job.expired_at.is_some() => Err(JobError::Expired(id)),
                _ => {
                    error!(%name, "a file of a job is missing");
                    Err(JobError::BlobMissing(name))
                }
            },
            file => Ok((job, file?)),
        }
    }

    /// Cancels a job; see [`Store::cancel`].
    pub async fn cancel(&self, id: Uuid) -> Result<Job, JobError> {
        let job = self.store.cancel(id).await?;
        self.announce_end(&job);
        self.announce_stop(id);
        Ok(job)
    }

    /// Lets a failed or cancelled job wait again; see [`Store::retry`].
    pub async fn retry(&self, id: Uuid) -> Result<Job, JobError> {
        let job = self.store.retry(id).await?;
        self.announce(id);
        self.announce_waiting();
        Ok(job)
    }

    /// Deletes a job in any state, with its files. A worker that runs it is told to stop.
    pub async fn delete(&self, id: Uuid) -> Result<(), JobError> {
        let job = self.store.delete(id).await?;
        self.announce(id);
        self.announce_stop(id);
        self.discard(job.blobs()).await;
        Ok(())
    }

    /// Takes the next job, if one waits and may run beside those that run in this process; see [`Store::claim`].
    ///
    /// Safe to drop: a job that was claimed by then is given back.
    pub async fn claim(self: &Arc<Self>, worker: &str) -> Result<Option<ClaimedJob>, JobError> {
        self.claim_within(worker, &Arc::default()).await
    }

    /// [`Self::claim`] that passes over clients of whom as many jobs run as may.
    pub async fn claim_within(
        self: &Arc<Self>,
        worker: &str,
        limits: &Arc<RunningLimits>,
    ) -> Result<Option<ClaimedJob>, JobError> {
        let (jobs, worker) = (Arc::clone(self), worker.to_owned());
        let limits = Arc::clone(limits);
        // In a task of its own, so that an answer of the database finds somebody who gives the job back.
        let claim = tokio::spawn(async move {
            let _turn = jobs.claims.lock().await;
            let Some(company) = jobs.running.company() else {
                return Ok(None);
            };
            let claimant = Claimant {
                worker: &worker,
                company,
                limits: Some(&limits),
            };
            let stops = jobs.stops();
            let Some(claimed) = jobs.store.claim(&claimant).await? else {
                return Ok(None);
            };
            let running = jobs.running.start(&claimed.job);
            jobs.announce(claimed.job.id);
            let jobs = Arc::clone(&jobs);
            Ok(Some(ClaimedJob::new(jobs, claimed, running, stops)))
        });
        match claim.await {
            Ok(claimed) => claimed,
            // Only when the runtime shuts down.
            Err(_) => Ok(None),
        }
    }

    /// The next job: looks for one now, whenever a process has made one wait, and once a second. Safe to drop.
    ///
    /// While the database fails, this goes on trying, and logs why.
    pub async fn next_job(self: &Arc<Self>, worker: &str) -> ClaimedJob {
        loop {
            match self.claim(worker).await {
                Ok(Some(claimed)) => {
                    // One call wakes one worker: where more wait, the next one looks, too.
                    self.wake();
                    return claimed;
                }
                Ok(None) => self.look_again().await,
                Err(error) => {
                    warn!(?error, "no job can be claimed");
                    sleep(self.settings.poll).await;
                }
            }
        }
    }

    /// Waits until a job may wait that [`Self::claim`] has not seen: until a process makes one wait, at most a second.
    pub async fn look_again(&self) {
        tokio::select! {
            () = self.waiting.notified() => {}
            () = sleep(self.settings.poll) => {}
        }
    }

    /// Waits until a delivery may be due that [`Store::claim_delivery`] has not seen: until this process ends a job with a webhook, at most a second.
    pub async fn look_for_deliveries(&self) {
        tokio::select! {
            () = self.ended.notified() => {}
            () = sleep(self.settings.poll) => {}
        }
    }

    /// Closes the connections to the database. Workers have ended, or given back, their jobs before.
    pub async fn close(&self) {
        if let Some(hints) = &self.hints {
            hints.end().await;
        }
        self.store.close().await;
    }

    /// The rows alone.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The files alone.
    pub fn blobs(&self) -> &Blobs {
        &self.blobs
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Deletes files that no row names any more. One that cannot be deleted is swept later.
    pub(crate) async fn discard<'a>(&self, names: impl IntoIterator<Item = &'a BlobName>) {
        for name in names {
            if let Err(error) = self.blobs.delete(name).await {
                warn!(%name, ?error, "a file cannot be deleted");
            }
        }
    }

    /// Lets a worker of this process look for a job.
    pub(crate) fn wake(&self) {
        self.waiting.notify_one();
    }

    /// Lets a worker of this process look for a job that now waits, and one of each other process.
    pub(crate) fn announce_waiting(&self) {
        self.wake();
        if let Some(hints) = &self.hints {
            hints.tell();
        }
    }

    /// Tells this process that a job has changed.
    pub(crate) fn announce(&self, job: Uuid) {
        // Nobody may be listening.
        let _ = self.changed.send(job);
    }

    /// Tells this process that a job has changed, and whoever delivers if it has ended and a webhook is to be told.
    pub(crate) fn announce_end(&self, job: &Job) {
        self.announce(job.id);
        if job.webhook.is_some() && job.state.is_finished() {
            self.ended.notify_one();
        }
    }

    fn announce_stop(&self, job: Uuid) {
        let _ = self.stopped.send(job);
    }

    fn changes(&self) -> Changes {
        Changes(self.changed.subscribe())
    }

    /// The jobs that this process cancels and deletes from now on.
    fn stops(&self) -> Changes {
        Changes(self.stopped.subscribe())
    }
}

/// Jobs that this process changes, or tells to stop.
#[derive(Debug)]
pub(crate) struct Changes(broadcast::Receiver<Uuid>);

impl Changes {
    /// Waits until the job is, or may be, one of them.
    pub(crate) async fn of(&mut self, job: Uuid) {
        loop {
            match self.0.recv().await {
                Ok(changed) if changed == job => return,
                Ok(_) => {}
                Err(RecvError::Lagged(_)) => return,
                // Its sender lives as long as the jobs.
                Err(RecvError::Closed) => std::future::pending().await,
            }
        }
    }
}

/// Keeps other processes out of a folder; the system gives it free when this process ends, however it does.
fn lock(folder: &Path) -> Result<std::fs::File, JobError> {
    let path = folder.join("lock");
    let failed = |error| JobError::file(|| format!("cannot lock {}", path.display()), error);
    let file = std::fs::File::create(&path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(JobError::FolderInUse(folder.to_owned())),
        Err(TryLockError::Error(error)) => Err(failed(error)),
    }
}

/// Digest of all that a client sent, apart from the key.
fn digest(submission: &Submission, input: &[u8; 32]) -> String {
    let Submission {
        client: _,
        idempotency_key: _,
        name,
        priority,
        webhook,
        trace: _,
        request,
    } = submission;
    let mut sha256 = Sha256::new();
    for part in [name, webhook, &Some(request.clone())] {
        // The length keeps the parts apart.
        sha256.update(
            part.as_ref()
                .map_or(u64::MAX, |part| part.len() as u64)
                .to_le_bytes(),
        );
        sha256.update(part.as_deref().unwrap_or_default());
    }
    sha256.update(priority.to_le_bytes());
    sha256.update(input);
    format!("{:x}", sha256.finalize())
}
