//! One kept scan: its calls, who may use it now, and the constraints of its last successful edit.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use darn_budget::Budget;
use darn_contract::port::{EditSession, MapSpan, Mended, PatchForm, Patches, Refusal};
use darn_contract::{Anchor, Constraints, Edit, Search, v1};

/// Bytes a session takes beside its scan.
pub(super) const OVERHEAD: usize = 1024;

/// A scan kept for editing, and the constraints of its last successful edit.
pub struct KeptSession {
    session: Box<dyn EditSession>,
    last: Mutex<Constraints>,
    /// When it was edited last.
    edited: Mutex<Option<Instant>>,
    /// One permit: one request at a time uses the session.
    exclusive: Arc<Semaphore>,
}

impl KeptSession {
    /// A session without constraints yet.
    pub fn new(session: Box<dyn EditSession>) -> Self {
        Self {
            session,
            last: Mutex::default(),
            edited: Mutex::default(),
            exclusive: Arc::new(Semaphore::new(1)),
        }
    }

    /// The session's description; `id` and `idle_seconds` are left empty.
    pub fn described(&self) -> v1::Session {
        v1::Session {
            constraints: Some(self.last().edits_message()),
            ..self.session.described()
        }
    }

    /// The patches alone. The constraints are remembered if they could be met and the caller still waits for the answer.
    ///
    /// # Errors
    /// The mender's refusal.
    pub fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        budget: &Budget<'_>,
    ) -> Result<Patches, Refusal> {
        let patches = self.session.patches(constraints, form, budget);
        *self.edited() = Some(Instant::now());
        let patches = patches?;
        if budget.check().is_ok() {
            *self.last() = constraints.clone();
        }
        Ok(patches)
    }

    /// The patches as a drag shows them; the constraints are not remembered.
    ///
    /// # Errors
    /// The mender's refusal.
    pub fn draft(
        &self,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Vec<u8>, Refusal> {
        let draft = self.session.draft(constraints, budget);
        *self.edited() = Some(Instant::now());
        draft
    }

    /// The whole scan, mended with the remembered constraints.
    ///
    /// # Errors
    /// The mender's refusal.
    pub fn result(&self, budget: &Budget<'_>) -> Result<Mended, Refusal> {
        let last = self.last().clone();
        self.session.mended(&last, budget)
    }

    /// Searches the uv of a hole's grid for a point.
    ///
    /// # Errors
    /// The mender's refusal.
    pub fn optimize_anchor(
        &self,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        self.session.optimize_anchor(search, budget)
    }

    /// Some cells of the map of that search; `None` while edits follow one another, none longer than `quiet` after another: those go first.
    ///
    /// # Errors
    /// The mender's refusal.
    pub fn map_piece(
        &self,
        search: &Search,
        span: MapSpan,
        quiet: Duration,
        budget: &Budget<'_>,
    ) -> Result<Option<v1::MapPiece>, Refusal> {
        if (*self.edited()).is_some_and(|edited| edited.elapsed() < quiet) {
            return Ok(None);
        }
        self.session.map_piece(search, span, budget).map(Some)
    }

    /// Waits for exclusive use, in order of arrival, until the permit is dropped. Blocks no thread.
    pub async fn exclusive(&self) -> Option<OwnedSemaphorePermit> {
        // The semaphore is never closed, so this is never `None`.
        Arc::clone(&self.exclusive).acquire_owned().await.ok()
    }

    fn last(&self) -> MutexGuard<'_, Constraints> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn edited(&self) -> MutexGuard<'_, Option<Instant>> {
        self.edited.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Memory it takes, in bytes.
    pub fn bytes(&self) -> usize {
        let last = self.last();
        let lists = size_of::<Anchor>() * last.anchors.len() + size_of::<Edit>() * last.edits.len();
        self.session.bytes().saturating_add(lists + OVERHEAD)
    }
}
