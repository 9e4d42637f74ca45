//! Displacements of a few cells carried over the whole hole: harmonic, zero where the hole ends.

use super::HoleCells;
use darn_geometry::grid::{CELLS, SIDE};
use darn_geometry::mesh::Vec3;

/// Over-relaxation; near the best for holes of 10 to 50 cells across.
const OMEGA: f64 = 1.85;
/// Most sweeps.
const SWEEPS: usize = 400;
/// A sweep that moves no cell by more than this share of the largest displacement is the last.
const SETTLED: f64 = 1e-7;

/// The discrete harmonic displacement of every cell (zero outside the hole) that takes the given values at the `fixed` cells.
///
/// By the maximum principle no cell moves farther than the farthest of the fixed ones. Fixed cells outside the hole have no effect.
pub fn drape(hole: &HoleCells, fixed: &[(usize, Vec3)]) -> Vec<Vec3> {
    let mut moved = vec![Vec3::zeros(); CELLS];
    let mut open: Vec<bool> = (0..CELLS).map(|k| hole.contains(k)).collect();
    for (cell, by) in fixed.iter().filter(|(cell, _)| hole.contains(*cell)) {
        moved[*cell] = *by;
        open[*cell] = false;
    }
    let largest = fixed.iter().map(|(_, by)| by.norm()).fold(0.0, f64::max);
    if largest == 0.0 {
        return moved;
    }
    let free: Vec<usize> = (hole.indices().iter().copied())
        .filter(|k| open[*k])
        .collect();
    for _ in 0..SWEEPS {
        let mut change = 0.0f64;
        for &k in &free {
            let sum: Vec3 = neighbours(k).map(|n| moved[n]).sum();
            let step = (sum / 4.0 - moved[k]) * OMEGA;
            moved[k] += step;
            change = change.max(step.norm());
        }
        if change <= SETTLED * largest {
            break;
        }
    }
    moved
}

/// The 4-neighbours of a cell that are on the grid; a missing one stands still, as all cells outside the hole do.
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
    use crate::edit::testing::disk;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_interpolates_and_obeys_the_maximum_principle(
            at in prop::collection::vec((0usize..400, -1.0..1.0f64), 1..6)
        ) {
            let hole = disk(12.0);
            let mut fixed: Vec<(usize, Vec3)> = at.iter()
                .map(|(k, x)| (hole.indices()[k % hole.indices().len()], Vec3::new(*x, 0.0, -x)))
                .collect();
            fixed.sort_by_key(|f| f.0);
            fixed.dedup_by_key(|f| f.0);
            let most = fixed.iter().map(|f| f.1.norm()).fold(0.0, f64::max);
            let moved = drape(&hole, &fixed);
            for (cell, by) in &fixed {
                prop_assert_eq!(moved[*cell], *by);
            }
            for (k, by) in moved.iter().enumerate() {
                prop_assert!(by.norm() <= most * (1.0 + 1e-4));
                prop_assert!(hole.contains(k) || by.norm() == 0.0);
            }
        }
    }
}
