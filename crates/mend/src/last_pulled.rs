//! The last patch that pulls made of a hole's cloth: while one hole is edited, the edits of the others stay as they are.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::context::Pace;
use darn_geometry::patch::{Patch, Pull};

/// The last patch of a hole under pulls.
#[derive(Default)]
pub struct LastPulled(Mutex<Option<Arc<PulledPatch>>>);

struct PulledPatch {
    pulls: Vec<Pull>,
    pace: Pace,
    patch: Patch,
}

impl LastPulled {
    /// The patch under the same pulls. One that was made from the patch before it has other bits, and serves drags alone.
    pub fn of(&self, pulls: &[Pull], pace: Pace) -> Option<Patch> {
        let last = self.lock().clone()?;
        let is_same = last.pulls == pulls && (last.pace == Pace::Anew || pace == Pace::Dragged);
        is_same.then(|| last.patch.clone())
    }

    /// Keeps a patch in place of the one before.
    pub fn keep(&self, pulls: Vec<Pull>, pace: Pace, patch: &Patch) {
        let patch = patch.clone();
        *self.lock() = Some(Arc::new(PulledPatch { pulls, pace, patch }));
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        let last = self.lock();
        let each = last.iter().map(|it| {
            size_of_val(&it.pulls[..]) + 40 * it.patch.positions.len() + 12 * it.patch.faces.len()
        });
        each.sum()
    }

    fn lock(&self) -> MutexGuard<'_, Option<Arc<PulledPatch>>> {
        // No change under the lock can panic half-way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
