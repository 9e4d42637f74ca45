//! What strain limiting found last for a patch: while something is dragged, the next patch is near it.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::mesh::{Vec2, Vec3};

/// The last patch of a plan, as strain limiting left it. A patch that starts from it takes fewer rounds and ends within their tolerance of the
/// patch that starts anew, not at the same bits.
#[derive(Debug, Default)]
pub struct LastStrain(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    /// Where the grid put the vertices, and where they came to rest.
    rest: Option<Movement>,
    /// Where they lay at rest, and where pulls took them.
    pulled: Option<Movement>,
    /// Where these pulls hold the patch, chart coordinates.
    pulls: Vec<Vec2>,
}

#[derive(Debug)]
struct Movement {
    from: Vec<Vec3>,
    to: Vec<Vec3>,
}

impl Movement {
    /// Other positions moved as these were.
    fn applied_to(&self, positions: &[Vec3]) -> Option<Vec<Vec3>> {
        let each = self.from.iter().zip(&self.to).zip(positions);
        let is_same_mesh = self.from.len() == positions.len();
        is_same_mesh.then(|| each.map(|((from, to), p)| p + (to - from)).collect())
    }
}

impl LastStrain {
    /// Where vertices that the grid puts at `positions` probably come to rest.
    pub(super) fn at_rest(&self, positions: &[Vec3]) -> Option<Vec<Vec3>> {
        self.lock().rest.as_ref()?.applied_to(positions)
    }

    /// Keeps where vertices came to rest.
    pub(super) fn keep_rest(&self, from: Vec<Vec3>, to: &[Vec3]) {
        let to = to.to_vec();
        self.lock().rest = Some(Movement { from, to });
    }

    /// Where pulls at these places probably take vertices at rest.
    pub(super) fn pulled(&self, pulls: &[Vec2], positions: &[Vec3]) -> Option<Vec<Vec3>> {
        let state = self.lock();
        let pulled = state.pulled.as_ref().filter(|_| state.pulls == pulls)?;
        pulled.applied_to(positions)
    }

    /// Keeps where pulls took vertices at rest.
    pub(super) fn keep_pulled(&self, pulls: Vec<Vec2>, from: Vec<Vec3>, to: &[Vec3]) {
        let to = to.to_vec();
        let mut state = self.lock();
        state.pulled = Some(Movement { from, to });
        state.pulls = pulls;
    }

    /// Bytes of memory held.
    pub fn bytes(&self) -> usize {
        let state = self.lock();
        let each = [&state.rest, &state.pulled].into_iter().flatten();
        each.map(|it| size_of_val(&it.from[..]) + size_of_val(&it.to[..]))
            .sum()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing under the lock panics halfway through a change.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
