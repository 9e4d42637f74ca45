//! How many jobs of a key may wait.

use darn_jobs::Jobs;
use tokio::sync::MutexGuard;

use super::{client::Caller, error::RequestError, quota::Exceeded};

/// Checks that one more job of a caller may wait.
///
/// # Errors
/// `Quota`, or `Internal` when they cannot be counted.
pub async fn check(jobs: &Jobs, caller: &Caller) -> Result<(), RequestError> {
    let Some(key) = &caller.key else {
        return Ok(());
    };
    let Some(limit) = key.limits.waiting_jobs else {
        return Ok(());
    };
    let counts = jobs.client_counts(key.id.as_str()).await?;
    if u64::try_from(counts.waiting).unwrap_or(0) >= limit {
        return Err(RequestError::Quota(Exceeded::waiting_jobs(limit)));
    }
    Ok(())
}

/// Waits until no other request makes a job of this caller wait; [`check`] is to follow. As long as the guard is held, this process makes none
/// wait but its holder. `None` for a caller without such a limit.
pub async fn turn(caller: &Caller) -> Option<MutexGuard<'_, ()>> {
    let key = caller.key.as_ref()?;
    key.limits.waiting_jobs?;
    Some(key.usage.handing_over.lock().await)
}
