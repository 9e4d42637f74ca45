//! Hints between the processes on one PostgreSQL: a job waits.
//!
//! Whoever makes a job wait sends a notification; each process listens, and lets one of its workers look. A hint that is lost costs nothing but the
//! time until the next look, which every idle worker takes once a second anyway.
//!
//! The notification is a statement of its own, after the change, and not a part of it: a transaction that notifies is committed, and waits for
//! the disk, under a lock of the whole server. Sixteen connections that insert a row each do 2,400 transactions a second, and 260 where each
//! notifies (PostgreSQL 15, pgbench, two processors).

use std::{io, sync::Arc, time::Duration};

use sqlx::{
    PgPool,
    postgres::{PgListener, PgPoolOptions},
};
use tokio::{
    sync::Notify,
    task::AbortHandle,
    time::{sleep, timeout},
};
use tracing::{debug, info, warn};
use uuid::Uuid;

/// The channel's name, in the service's database.
const CHANNEL: &str = "darn_waiting";

/// What the server calls the connection that listens.
const LISTENER: &str = "darn, listening";

/// Said once until it is otherwise.
const DEAF: &str = "other processes are not heard when a job waits; this one looks once a second";

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long nothing may come before the listener asks whether the connection still lives.
const SILENCE: Duration = Duration::from_secs(60);

/// The pause before the listener connects again.
const PAUSE: Duration = Duration::from_secs(5);

/// What a process tells others, and hears from them.
#[derive(Debug)]
pub(crate) struct Hints {
    pool: PgPool,
    /// Tells this process's own notifications from those of others.
    own: String,
    due: Arc<Notify>,
    tasks: [AbortHandle; 2],
}

impl Hints {
    /// Starts to listen; what comes wakes one waiter. When this returns, the process listens, or the log says why it does not yet.
    pub(crate) async fn start(pool: &PgPool, waiting: &Arc<Notify>) -> Self {
        let options = (*pool.connect_options()).clone();
        let lonely = PgPoolOptions::new()
            .max_connections(1)
            .max_lifetime(None)
            .idle_timeout(None)
            .connect_lazy_with(options.application_name(LISTENER));
        let own = Uuid::new_v4().to_string();
        let due = Arc::new(Notify::new());
        let ear = Ear {
            pool: lonely,
            own: own.clone(),
            waiting: Arc::clone(waiting),
        };
        let first = ear.connect().await;
        if let Err(error) = &first {
            warn!(%error, "{DEAF}");
        }
        let listening = tokio::spawn(ear.listen(first.ok()));
        let telling = tokio::spawn(tell(pool.clone(), own.clone(), Arc::clone(&due)));
        Self {
            pool: pool.clone(),
            own,
            due,
            tasks: [listening.abort_handle(), telling.abort_handle()],
        }
    }

    /// Tells the other processes soon that a job waits; several calls at once are one hint.
    pub(crate) fn tell(&self) {
        self.due.notify_one();
    }

    /// Listens no more, and tells what may not have been told yet: that jobs were given back.
    pub(crate) async fn end(&self) {
        self.stop();
        notify(&self.pool, &self.own).await;
    }

    fn stop(&self) {
        for task in &self.tasks {
            task.abort();
        }
    }
}

impl Drop for Hints {
    fn drop(&mut self) {
        self.stop();
    }
}

async fn tell(pool: PgPool, own: String, due: Arc<Notify>) {
    loop {
        due.notified().await;
        notify(&pool, &own).await;
    }
}

async fn notify(pool: &PgPool, own: &str) {
    let told = sqlx::query("SELECT pg_notify($1, $2)")
        .bind(CHANNEL)
        .bind(own)
        .execute(pool);
    match timeout(PATIENCE, told).await {
        Ok(Ok(_)) => {}
        Ok(Err(error)) => debug!(%error, "other processes were not told that a job waits"),
        Err(_) => debug!("other processes were not told that a job waits: no answer"),
    }
}

/// What listens.
struct Ear {
    /// One connection, which is not taken from those of statements.
    pool: PgPool,
    own: String,
    waiting: Arc<Notify>,
}

impl Ear {
    async fn connect(&self) -> Result<PgListener, sqlx::Error> {
        let connected = async {
            let mut listener = PgListener::connect_with(&self.pool).await?;
            // It tells of a lost connection, and this connects again.
            listener.eager_reconnect(false);
            listener.listen(CHANNEL).await?;
            Ok(listener)
        };
        in_time(connected).await
    }

    /// Listens for ever. A connection that breaks, and one that cannot be made, is logged once until one is there again.
    async fn listen(self, first: Option<PgListener>) {
        let mut is_deaf = first.is_none();
        let mut next = first;
        loop {
            let listener = match next.take() {
                Some(listener) => Ok(listener),
                None => self.connect().await,
            };
            let error = match listener {
                Ok(listener) => {
                    if std::mem::take(&mut is_deaf) {
                        info!("other processes are heard again when a job waits");
                        // One may have come meanwhile.
                        self.waiting.notify_one();
                    }
                    self.hear(listener).await
                }
                Err(error) => error,
            };
            if !std::mem::replace(&mut is_deaf, true) {
                warn!(%error, "{DEAF}");
            }
            sleep(PAUSE).await;
        }
    }

    /// Wakes one waiter for each notification of another process, until the connection is lost.
    async fn hear(&self, mut listener: PgListener) -> sqlx::Error {
        loop {
            match timeout(SILENCE, listener.try_recv()).await {
                Ok(Ok(Some(notification))) => {
                    if notification.payload() != self.own {
                        self.waiting.notify_one();
                    }
                }
                Ok(Ok(None)) => return io::Error::from(io::ErrorKind::ConnectionAborted).into(),
                Ok(Err(error)) => return error,
                Err(_) => {
                    let question = sqlx::query("SELECT 1").execute(&mut listener);
                    if let Err(error) = in_time(question).await {
                        return error;
                    }
                }
            }
        }
    }
}

async fn in_time<T>(
    answer: impl Future<Output = Result<T, sqlx::Error>>,
) -> Result<T, sqlx::Error> {
    let answer = timeout(PATIENCE, answer).await;
    answer.unwrap_or_else(|late| Err(sqlx::Error::Io(late.into())))
}
