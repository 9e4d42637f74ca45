//! The network's answer to a hole whose cloth moves at some cells.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::context::HoleContext;
use crate::edit::CellMove;
use crate::error::MendError;
use crate::limits::EditedFill;
use darn_geometry::grid::NormalGrid;
use darn_geometry::mesh::Vec3;
use darn_net::Averaging;

/// The network's answer when some cells are known to lie where they lie on the unedited cloth.
#[derive(Debug)]
pub struct HeldFill {
    cells: Vec<usize>,
    /// For every cell, scene space.
    pub positions: Vec<Vec3>,
}

/// The last [`HeldFill`] of a hole: while a point is dragged its cell stays the same, and the network is asked half as much.
#[derive(Debug, Default)]
pub struct LastHeldFill(Mutex<Option<Arc<HeldFill>>>);

impl LastHeldFill {
    fn of(&self, cells: &[usize]) -> Option<Arc<HeldFill>> {
        self.lock().clone().filter(|held| held.cells == cells)
    }

    fn keep(&self, cells: Vec<usize>, positions: Vec<Vec3>) -> Arc<HeldFill> {
        let held = Arc::new(HeldFill { cells, positions });
        *self.lock() = Some(Arc::clone(&held));
        held
    }

    fn lock(&self) -> MutexGuard<'_, Option<Arc<HeldFill>>> {
        // No change under the lock can panic half-way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Nanoseconds of work of the network for moved cloth.
const FILL_WORK: u64 = 20_000_000;

impl HoleContext<'_> {
    /// Every cell's position, scene space, when some cells of the hole move away from the unedited cloth.
    ///
    /// The network is given a moved cell's new position, marked as known. That is a soft constraint: the network may
    /// stay away from it.
    ///
    /// # Errors
    /// A failure of the network.
    pub fn moved_fill(&self, moves: &[CellMove]) -> Result<Vec<Vec3>, MendError> {
        let (hole, unedited) = (self.hole, &self.unedited);
        if moves.is_empty() {
            return Ok(unedited.filled.clone());
        }
        let without = hole.normal_grid();
        // With this share of every move.
        let given = |share: f64| -> NormalGrid {
            let mut grid = without.clone();
            for CellMove { cell, by } in moves {
                let at = unedited.predicted[*cell] + by * share;
                grid.positions[*cell] = hole.normal.to_network(&at);
                grid.known[*cell] = 1.0;
            }
            grid
        };
        self.call.budget.spend(FILL_WORK)?;
        let predicted = match self.call.mender.limits.edited_fill {
            EditedFill::Plain => {
                let answers = self.inpainter.fill(&[given(1.0)], Averaging::Flips)?;
                hole.in_scene(answers.first().map_or(&[], |a| a.positions.as_slice()))
            }
            EditedFill::Difference => {
                let cells: Vec<usize> = moves.iter().map(|m| m.cell).collect();
                let held = unedited.held.of(&cells);
                let mut grids = vec![given(1.0)];
                grids.extend(held.is_none().then(|| given(0.0)));
                let answers = self.inpainter.fill(&grids, Averaging::Once)?;
                let mut answers = answers.iter().map(|a| hole.in_scene(&a.positions));
                let moved = answers.next();
                let held = held.or_else(|| Some(unedited.held.keep(cells, answers.next()?)));
                let each = unedited.predicted.iter();
                match moved.zip(held) {
                    Some((moved, held)) => (each.zip(moved.iter().zip(&held.positions)))
                        .map(|(p, (moved, held))| p + (moved - held))
                        .collect(),
                    None => each.copied().collect(),
                }
            }
        };
        Ok(hole.filled(&predicted))
    }
}
