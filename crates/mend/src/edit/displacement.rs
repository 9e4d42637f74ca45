//! Spreads the displacements of a few cells over the whole hole: harmonic, zero outside the hole.

use super::cells::{CellMove, HoleCells};
use darn_geometry::grid::{CELLS, SIDE};
use darn_geometry::mesh::Vec3;

/// Factor of over-relaxation; close to optimal for holes that are 10 to 50 cells wide.
const OVER_RELAXATION: f64 = 1.85;
/// Most sweeps over the cells.
const MAX_SWEEPS: usize = 400;
/// The sweeps end with one that moves no cell by more than this share of the largest displacement.
const TOLERANCE: f64 = 1e-7;

/// The discrete harmonic displacement of every cell (4096 of them, zero outside the hole) that has the given values at
/// the `fixed` cells.
///
/// By the maximum principle no cell moves farther than the farthest of the fixed ones. Fixed cells outside the hole
/// have no effect.
pub fn harmonic_displacement(hole: &HoleCells, fixed: &[CellMove]) -> Vec<Vec3> {
    let mut moved = vec![Vec3::zeros(); CELLS];
    let mut open: Vec<bool> = (0..CELLS).map(|k| hole.contains(k)).collect();
    for fixed in fixed.iter().filter(|fixed| hole.contains(fixed.cell)) {
        moved[fixed.cell] = fixed.by;
        open[fixed.cell] = false;
    }
    let largest = fixed
        .iter()
        .map(|fixed| fixed.by.norm())
        .fold(0.0, f64::max);
    if largest == 0.0 {
        return moved;
    }
    let free: Vec<usize> = (hole.indices().iter().copied())
        .filter(|k| open[*k])
        .collect();
    for _ in 0..MAX_SWEEPS {
        let mut change = 0.0f64;
        for &k in &free {
            let sum: Vec3 = neighbours(k).map(|n| moved[n]).sum();
            let step = (sum / 4.0 - moved[k]) * OVER_RELAXATION;
            moved[k] += step;
            change = change.max(step.norm());
        }
        if change <= TOLERANCE * largest {
            break;
        }
    }
    moved
}

/// The 4-neighbours of a cell that lie on the grid. A missing one counts as not moved, like all cells outside the hole.
fn neighbours(cell: usize) -> impl Iterator<Item = usize> {
    let (i, j) = (cell % SIDE, cell / SIDE);
    let left = (i > 0).then(|| cell - 1);
    let right = (i + 1 < SIDE).then_some(cell + 1);
    let below = (j > 0).then(|| cell - SIDE);
    let above = (j + 1 < SIDE).then_some(cell + SIDE);
    [left, right, below, above].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::cells::testing::disk;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_interpolates_and_obeys_the_maximum_principle(
            at in prop::collection::vec((0usize..400, -1.0..1.0f64), 1..6)
        ) {
            let hole = disk(12.0);
            let mut fixed: Vec<CellMove> = at.iter()
                .map(|(k, x)| CellMove {
                    cell: hole.indices()[k % hole.indices().len()],
                    by: Vec3::new(*x, 0.0, -x),
                })
                .collect();
            fixed.sort_by_key(|f| f.cell);
            fixed.dedup_by_key(|f| f.cell);
            let most = fixed.iter().map(|f| f.by.norm()).fold(0.0, f64::max);
            let moved = harmonic_displacement(&hole, &fixed);
            for fixed in &fixed {
                prop_assert_eq!(moved[fixed.cell], fixed.by);
            }
            for (k, by) in moved.iter().enumerate() {
                prop_assert!(by.norm() <= most * (1.0 + 1e-4));
                prop_assert!(hole.contains(k) || by.norm() == 0.0);
            }
        }
    }
}
