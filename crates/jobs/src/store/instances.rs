//! The processes that serve together: each says from time to time that it lives, so that others can tell one that is busy from one that is gone.

use super::{Store, first};
use crate::{
    engine::{Urgency, args},
    error::JobError,
};

impl Store {
    /// Says that an instance lives, for the time of a lease from now on. Rows of instances that are long gone are deleted.
    pub async fn instance_lives(&self, name: &str) -> Result<(), JobError> {
        let now = self.engine.dialect().now;
        let sql = format!(
            "INSERT INTO instances (name, alive_until) VALUES ($2, {now} + $3)
             ON CONFLICT (name) DO UPDATE SET alive_until = excluded.alive_until RETURNING name"
        );
        let args = args![self.now(), name, self.lease_ms];
        self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        // It counts as dead long before.
        let sql =
            format!("DELETE FROM instances WHERE alive_until < {now} - 100 * $2 RETURNING name");
        let args = args![self.now(), self.lease_ms];
        self.engine.write(Urgency::EvenWhenFull, &sql, args).await?;
        Ok(())
    }

    /// Says that an instance ends.
    pub async fn instance_ends(&self, name: &str) -> Result<(), JobError> {
        let sql = "DELETE FROM instances WHERE name = $1 RETURNING name";
        self.engine
            .write(Urgency::EvenWhenFull, sql, args![name])
            .await?;
        Ok(())
    }

    /// Whether an instance has said within the time of a lease that it lives.
    pub async fn is_instance_alive(&self, name: &str) -> Result<bool, JobError> {
        let now = self.engine.dialect().now;
        let sql = format!("SELECT name FROM instances WHERE name = $2 AND alive_until > {now}");
        let rows = self.engine.read(&sql, args![self.now(), name]).await?;
        Ok(first(rows).is_some())
    }
}
