//! Takes ends of jobs from the outbox and tells them to their webhooks.
//!
//! One task claims, and each try has a task of its own. A process tries a few at once, and fewer of a client, so that a receiver that does not answer holds
//! up its own client only. Several processes share an outbox: a try is one process's, as long as that lives.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use axum::http::StatusCode;
use darn_jobs::{ClaimedDelivery, Delivery, DeliveryOutcome, Jobs, TryOutcome};
use tokio::{select, task::JoinSet, time::sleep};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};
use uuid::Uuid;

use super::{
    Webhooks,
    destination::WebhookUrl,
    event,
    post::{Message, PostAnswer, PostError},
    schedule::{pause_after, pause_as_asked},
};
use crate::app::App;
use darn_contract::cut;

/// Tries of a process at once.
const TRIES: usize = 32;
/// Tries of a process at once of one client.
const TRIES_OF_CLIENT: usize = 4;
/// How much longer than a try its claim lasts.
const SLACK: Duration = Duration::from_secs(30);
/// How long a shutdown waits for tries under way.
const GRACE: Duration = Duration::from_secs(2);
/// Most bytes of what is kept of an error.
const ERROR_BYTES: usize = 300;

/// What delivers.
#[derive(Debug)]
pub struct WebhookSender {
    /// The service.
    pub app: Arc<App>,
    /// Its jobs.
    pub jobs: Arc<Jobs>,
    /// What the webhooks need.
    pub webhooks: Arc<Webhooks>,
    /// Cancelled when the service begins to shut down.
    pub stop: CancellationToken,
}

/// How a try failed, or that it did not.
enum Tried {
    Answered(PostAnswer),
    Failed(String),
    Interrupted,
}

/// Tries under way, by client.
type Running = Arc<Mutex<BTreeMap<String, usize>>>;

/// Counts a try as long as it lives.
struct Slot {
    running: Running,
    client: String,
}

impl Slot {
    fn take(running: &Running, client: &str) -> Self {
        let mut counts = running.lock().unwrap_or_else(PoisonError::into_inner);
        *counts.entry(client.to_owned()).or_default() += 1;
        Self {
            running: Arc::clone(running),
            client: client.to_owned(),
        }
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut counts = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = counts.get_mut(&self.client) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.client);
            }
        }
    }
}

impl WebhookSender {
    /// Delivers until the service shuts down; tries under way then have a short time to end, and are given back after it.
    pub async fn deliver_all(self) {
        let sender = Arc::new(self);
        let running = Running::default();
        let mut tries = JoinSet::new();
        while !sender.stop.is_cancelled() {
            while tries.try_join_next().is_some() {}
            // Not in a `select`: a claim is never dropped.
            if tries.len() < TRIES
                && let Some(claimed) = sender.claim(&running).await
            {
                let slot = Slot::take(&running, &claimed.delivery.client);
                let sender = Arc::clone(&sender);
                tries.spawn(async move {
                    sender.deliver(claimed).await;
                    drop(slot);
                });
                continue;
            }
            select! {
                () = sender.stop.cancelled() => {}
                () = sender.jobs.look_for_deliveries() => {}
                Some(_) = tries.join_next() => {}
            }
        }
        while tries.join_next().await.is_some() {}
    }

    async fn claim(&self, running: &Running) -> Option<ClaimedDelivery> {
        let busy: Vec<String> = {
            let counts = running.lock().unwrap_or_else(PoisonError::into_inner);
            let busy = counts
                .iter()
                .filter(|(_, count)| **count >= TRIES_OF_CLIENT);
            busy.map(|(client, _)| client.clone()).collect()
        };
        let time = self.webhooks.poster.time() + SLACK;
        match self.jobs.store().claim_delivery(&busy, time).await {
            Ok(claimed) => claimed,
            Err(error) => {
                warn!(?error, "no webhook can be claimed");
                None
            }
        }
    }

    async fn deliver(&self, claimed: ClaimedDelivery) {
        let delivery = &claimed.delivery;
        let began = Instant::now();
        let stopped = async {
            self.stop.cancelled().await;
            sleep(GRACE).await;
        };
        let tried = select! {
            biased;
            tried = self.try_once(delivery) => tried,
            () = stopped => Tried::Interrupted,
        };
        let outcome = outcome(tried, delivery.tries);
        match self.jobs.store().end_delivery(&claimed, &outcome).await {
            Ok(Some(ended)) => self.tell(&ended, began.elapsed(), &outcome),
            // The job was deleted.
            Ok(None) => {}
            // The claim runs out, and it is tried again.
            Err(error) => {
                warn!(job = %delivery.job, ?error, "what came of a webhook cannot be written")
            }
        }
    }

    async fn try_once(&self, delivery: &Delivery) -> Tried {
        let Webhooks { rules, poster, .. } = &*self.webhooks;
        let secrets = self
            .webhooks
            .secrets_of(&delivery.client, self.app.keys.as_ref());
        let secrets = match secrets {
            Ok(secrets) => secrets,
            Err(error) => return Tried::Failed(error.to_string()),
        };
        // Again: the settings may be others than when the job came.
        let url = match WebhookUrl::parse(&delivery.webhook, rules) {
            Ok(url) => url,
            Err(detail) => return Tried::Failed(format!("the URL {detail}")),
        };
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let (id, timestamp) = (event::id(delivery), now.unwrap_or_default().as_secs());
        let body = event::body(delivery);
        let message = Message {
            signature: secrets.sign(&id, timestamp, &body),
            id,
            timestamp,
            body: body.into(),
        };
        match poster.post(&url, &message).await {
            Ok(answer) => Tried::Answered(answer),
            Err(error) => {
                if let PostError::NotPublic { address, kind } = &error {
                    warn!(job = %delivery.job, host = url.host(), %address, kind, "a webhook would go where none may");
                }
                Tried::Failed(error.to_string())
            }
        }
    }

    /// Logs and counts a try. The URL is not logged: its path and query may have secrets.
    fn tell(&self, delivery: &Delivery, took: Duration, outcome: &TryOutcome) {
        let end = match (outcome, delivery.outcome) {
            (TryOutcome::GivenBack, _) => "interrupted",
            (_, DeliveryOutcome::Delivered) => "delivered",
            (_, DeliveryOutcome::Disabled) => "disabled",
            (_, DeliveryOutcome::GivenUp) => "given_up",
            (_, DeliveryOutcome::Waiting) => "failed",
        };
        self.app.metrics.webhook_tried(end, took);
        let url = WebhookUrl::parse(&delivery.webhook, &self.webhooks.rules).ok();
        info!(
            job = %delivery.job,
            version = delivery.version,
            host = url.as_ref().map(WebhookUrl::host),
            tries = delivery.tries,
            status = delivery.last_status,
            fault = delivery.last_error,
            end,
            ms = took.as_secs_f64() * 1000.0,
            "webhook tried"
        );
    }
}

/// What is written of a try, which was this one of its delivery.
fn outcome(tried: Tried, tries: i64) -> TryOutcome {
    // The last 32 bits of an id are random.
    let random = f64::from(Uuid::new_v4().as_u128() as u32) / f64::from(u32::MAX);
    let (status, error, asked) = match tried {
        Tried::Interrupted => return TryOutcome::GivenBack,
        Tried::Failed(error) => (None, error, None),
        Tried::Answered(PostAnswer {
            status,
            again_after,
        }) => {
            let number = i64::from(status.as_u16());
            if status.is_success() {
                return TryOutcome::Delivered { status: number };
            }
            if status == StatusCode::GONE {
                return TryOutcome::Disabled { status: number };
            }
            let error = match status.is_redirection() {
                true => format!("the receiver answered with {number}; redirects are not followed"),
                false => format!("the receiver answered with {number}"),
            };
            (Some(number), error, again_after)
        }
    };
    TryOutcome::Failed {
        status,
        error: cut(&error, ERROR_BYTES).into_owned(),
        again_after: pause_after(tries, random).map(|pause| pause_as_asked(pause, asked)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_2xx_is_a_delivery_and_410_ends_them() {
        let of = |status: u16, tries| {
            let status = StatusCode::from_u16(status).unwrap();
            let answer = PostAnswer {
                status,
                again_after: None,
            };
            outcome(Tried::Answered(answer), tries)
        };
        for status in [200, 201, 204, 299] {
            let status_kept = i64::from(status);
            assert_eq!(
                of(status, 1),
                TryOutcome::Delivered {
                    status: status_kept
                }
            );
        }
        assert_eq!(of(410, 1), TryOutcome::Disabled { status: 410 });
        for status in [300, 301, 302, 304, 307, 308, 400, 401, 404, 429, 500, 503] {
            let TryOutcome::Failed {
                status: kept,
                again_after,
                ..
            } = of(status, 1)
            else {
                panic!("{status}");
            };
            assert_eq!(kept, Some(i64::from(status)));
            let pause = again_after.unwrap().as_secs_f64();
            assert!((4.5..=5.5).contains(&pause), "{pause}");
            let TryOutcome::Failed { again_after, .. } = of(status, 10) else {
                panic!("{status}");
            };
            assert_eq!(again_after, None);
        }
    }
}
