//! One scan kept for editing: what it answers, whose turn it is, and the constraints it met last.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use darn_contract::port::{Cancellation, EditSession, Mended, PatchForm, Patches, Refusal};
use darn_contract::{Anchor, Constraints, Edit, Search, v1};

/// Bytes a session takes beside what it keeps.
pub(super) const OVERHEAD: usize = 1024;

/// A scan kept for editing, and the constraints last answered.
pub struct Session {
    kept: Box<dyn EditSession>,
    last: Mutex<Constraints>,
    turn: Arc<Semaphore>,
}

impl Session {
    /// Kept from now on; without constraints yet.
    pub fn new(kept: Box<dyn EditSession>) -> Self {
        Self {
            kept,
            last: Mutex::default(),
            turn: Arc::new(Semaphore::new(1)),
        }
    }

    /// What it is; the service's own fields are left empty.
    pub fn described(&self) -> v1::Session {
        self.kept.described()
    }

    /// The patches alone; the constraints are remembered once they have been met and somebody hears of it.
    ///
    /// # Errors
    /// Why they cannot be met.
    pub fn patches(
        &self,
        asked: &Constraints,
        form: PatchForm,
        cancellation: Cancellation<'_>,
    ) -> Result<Patches, Refusal> {
        let patches = self.kept.patches(asked, form, cancellation)?;
        if !cancellation.is_cancelled() {
            *self.last() = asked.clone();
        }
        Ok(patches)
    }

    /// The whole scan with the constraints remembered.
    ///
    /// # Errors
    /// Why not.
    pub fn result(&self, cancellation: Cancellation<'_>) -> Result<Mended, Refusal> {
        let last = self.last().clone();
        self.kept.mended(&last, cancellation)
    }

    /// Where on a hole's grid a point belongs.
    ///
    /// # Errors
    /// Why not.
    pub fn optimize_anchor(
        &self,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        self.kept.optimize_anchor(search, cancellation)
    }

    /// Waits for its turn: first come, first served; over when the permit is dropped. No thread waits with it.
    pub async fn turn(&self) -> Option<OwnedSemaphorePermit> {
        // Never closed, so never none.
        Arc::clone(&self.turn).acquire_owned().await.ok()
    }

    fn last(&self) -> MutexGuard<'_, Constraints> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes of memory it takes.
    pub fn bytes(&self) -> usize {
        let last = self.last();
        let lists = size_of::<Anchor>() * last.anchors.len() + size_of::<Edit>() * last.edits.len();
        self.kept.bytes().saturating_add(lists + OVERHEAD)
    }
}
