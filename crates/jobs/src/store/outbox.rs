//! The outbox: ends of jobs that webhooks are to be told of. The database writes a row in the transaction that ends its job.
//!
//! A try is claimed as a job is: it is counted, and a token is written, before it begins. Whoever claims it has a time in which to end it; after that
//! another one may, and the first one's end changes nothing.

use std::{collections::BTreeMap, time::Duration};

use uuid::Uuid;

use super::{Store, first, milliseconds, state};
use crate::{
    delivery::{ClaimedDelivery, Delivery, DeliveryOutcome, TryOutcome},
    engine::{Row, Urgency, args},
    error::JobError,
};

impl Store {
    /// Claims the delivery that has been due for longest, for at most `time`. Those of the `busy` clients are passed over.
    pub async fn claim_delivery(
        &self,
        busy: &[String],
        time: Duration,
    ) -> Result<Option<ClaimedDelivery>, JobError> {
        let dialect = self.engine.dialect();
        let (now, skip_locked) = (dialect.now, dialect.skip_locked);
        let token = Uuid::new_v4();
        let mut args = args![self.now(), token, milliseconds(time)];
        let mut others = String::new();
        for client in busy {
            args.push(client.as_str().into());
            others.push_str(&format!(" AND client <> ${}", args.len()));
        }
        let sql = format!(
            "UPDATE outbox SET tries = tries + 1, lease = $2, next_try_at = {now} + $3
             WHERE (job, version) = (
                SELECT job, version FROM outbox WHERE next_try_at <= {now}{others}
                ORDER BY next_try_at LIMIT 1 {skip_locked})
             RETURNING *"
        );
        let rows = self.engine.write(Urgency::Ordinary, &sql, args).await?;
        let claimed = first(rows).map(|row| {
            Ok(ClaimedDelivery {
                delivery: delivery(&row)?,
                token,
            })
        });
        claimed.transpose()
    }

    /// Writes how a try ended. Answers with the delivery as it is then; nothing where another one has claimed it since, or its job was deleted.
    pub async fn end_delivery(
        &self,
        claimed: &ClaimedDelivery,
        outcome: &TryOutcome,
    ) -> Result<Option<Delivery>, JobError> {
        let now = self.engine.dialect().now;
        let Delivery { job, version, .. } = claimed.delivery;
        let mut args = args![self.now(), job, version, claimed.token];
        let mine = "job = $2 AND version = $3 AND lease = $4";
        let (change, which) = match outcome {
            TryOutcome::Delivered { status } => {
                args.extend(args![*status]);
                let change = format!(
                    "outcome = 'delivered', next_try_at = NULL, last_try_at = {now}, last_status = $5, last_error = NULL"
                );
                (change, mine.to_owned())
            }
            TryOutcome::Failed {
                status,
                error,
                again_after,
            } => {
                let again_after = again_after.map(milliseconds);
                args.extend(args![*status, error.as_str(), again_after]);
                let change = format!(
                    "outcome = CASE WHEN $7 IS NULL THEN 'given_up' ELSE 'waiting' END, next_try_at = {now} + $7,
                     last_try_at = {now}, last_status = $5, last_error = $6"
                );
                (change, mine.to_owned())
            }
            TryOutcome::Disabled { status } => {
                args.extend(args![*status]);
                let change = format!(
                    "outcome = 'disabled', next_try_at = NULL, last_try_at = {now}, last_status = $5, last_error = NULL"
                );
                // The other ends of the job that wait, too.
                let which = format!(
                    "job = $2 AND (version = $3 OR next_try_at IS NOT NULL)
                     AND EXISTS (SELECT 1 FROM outbox WHERE {mine})"
                );
                (change, which)
            }
            TryOutcome::GivenBack => {
                let change = format!("tries = tries - 1, next_try_at = {now}");
                (change, mine.to_owned())
            }
        };
        let sql = format!("UPDATE outbox SET {change}, lease = NULL WHERE {which} RETURNING *");
        let rows = self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        for row in &rows {
            let delivery = delivery(row)?;
            if delivery.version == version {
                return Ok(Some(delivery));
            }
        }
        Ok(None)
    }

    /// The newest delivery of each of the jobs that has one.
    pub async fn deliveries(&self, jobs: &[Uuid]) -> Result<BTreeMap<Uuid, Delivery>, JobError> {
        let mut newest = BTreeMap::new();
        if jobs.is_empty() {
            return Ok(newest);
        }
        let places: Vec<_> = (1..=jobs.len()).map(|place| format!("${place}")).collect();
        let sql = format!(
            "SELECT * FROM outbox WHERE job IN ({}) ORDER BY version",
            places.join(", ")
        );
        let args = jobs.iter().map(|job| (*job).into()).collect();
        for row in self.engine.read(&sql, args).await? {
            let delivery = delivery(&row)?;
            newest.insert(delivery.job, delivery);
        }
        Ok(newest)
    }

    /// How many deliveries are still to be made, on all machines.
    pub async fn waiting_deliveries(&self) -> Result<i64, JobError> {
        let sql = "SELECT count(*) AS waiting FROM outbox WHERE next_try_at IS NOT NULL";
        let rows = self.engine.read(sql, args![]).await?;
        rows.first()
            .map_or(Ok(0), |row| row.some("waiting", Row::int))
    }

    /// Makes those due at once that a process had claimed which is no more. Only for a store that has just been opened by the one process that may
    /// use it.
    pub(crate) async fn release_deliveries(&self) -> Result<(), JobError> {
        let now = self.engine.dialect().now;
        let sql =
            format!("UPDATE outbox SET lease = NULL, next_try_at = {now} WHERE lease IS NOT NULL");
        let args = args![self.now()];
        self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        Ok(())
    }
}

/// The delivery of a row with all columns.
fn delivery(row: &Row) -> Result<Delivery, JobError> {
    let word = row.some("outcome", Row::text)?;
    let mut outcomes = DeliveryOutcome::ALL.into_iter();
    let outcome = outcomes.find(|outcome| outcome.word() == word);
    Ok(Delivery {
        job: row.some("job", Row::id)?,
        version: row.some("version", Row::int)?,
        client: row.some("client", Row::text)?,
        name: row.text("name")?,
        webhook: row.some("webhook", Row::text)?,
        state: state(row)?,
        ended_at: row.some("ended_at", Row::int)?,
        outcome: outcome.ok_or_else(|| JobError::UnexpectedValue("outcome".to_owned()))?,
        tries: row.some("tries", Row::int)?,
        next_try_at: row.int("next_try_at")?,
        last_try_at: row.int("last_try_at")?,
        last_status: row.int("last_status")?,
        last_error: row.text("last_error")?,
    })
}
