//! The smooth fills that a learned one has to beat: a membrane and a thin plate over the hole, each the exact minimum of its energy.

use serde::Serialize;

use crate::flatten::cholesky::{NotPositive, Symmetric};
use crate::grid::{CELLS, Grid, SIDE, neighbour_pairs};
use crate::mesh::Vec3;

/// An energy of the grid, each coordinate by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Smooth {
    /// Σ (first differences)²: the discrete harmonic fill.
    Membrane,
    /// Σ x_uu² + 2 x_uv² + x_vv² of second differences: the discrete biharmonic fill, smooth across the rim.
    ThinPlate,
}

/// A difference of cells: Σ coefficient · position.
type Difference = Vec<(usize, f64)>;

/// The grid with its hole filled to the least energy; cells neither known nor in the hole keep what they hold.
///
/// Differences that reach a cell neither known nor in the hole are left out. One sparse Cholesky factor, three right-hand sides.
/// `None` when the known cells do not determine the fill.
pub fn smooth(grid: &Grid, hole: &[bool], energy: Smooth) -> Option<Vec<Vec3>> {
    let mut unknown = vec![usize::MAX; CELLS];
    let open: Vec<usize> = (0..CELLS).filter(|&k| hole[k]).collect();
    for (place, &cell) in open.iter().enumerate() {
        unknown[cell] = place;
    }
    let mut system = Symmetric::zero(open.len());
    let mut rhs = vec![[0.0; 3]; open.len()];
    let present = |k: usize| hole[k] || grid.known[k];
    for (weight, row) in differences(energy) {
        let counts = row.iter().all(|&(k, _)| present(k)) && row.iter().any(|&(k, _)| hole[k]);
        if !counts {
            continue;
        }
        let (free, given): (Difference, Difference) = row.iter().partition(|&&(k, _)| hole[k]);
        let free: Difference = free.iter().map(|&(k, c)| (unknown[k], c)).collect();
        let constant: Vec3 = given.iter().map(|&(k, c)| grid.positions[k] * c).sum();
        system.add_square(&free, weight);
        for &(place, c) in &free {
            for axis in 0..3 {
                rhs[place][axis] -= weight * c * constant[axis];
            }
        }
    }
    solved(&system, &mut rhs).ok()?;
    let mut filled = grid.positions.clone();
    for (&cell, p) in open.iter().zip(&rhs) {
        filled[cell] = Vec3::from(*p);
    }
    Some(filled)
}

fn solved(system: &Symmetric, rhs: &mut [[f64; 3]]) -> Result<(), NotPositive> {
    if rhs.is_empty() {
        return Ok(());
    }
    system.factor()?.solve(rhs)
}

/// All differences of an energy on the whole grid, with their weights.
fn differences(energy: Smooth) -> Vec<(f64, Difference)> {
    match energy {
        Smooth::Membrane => neighbour_pairs()
            .map(|(a, b)| (1.0, vec![(a, -1.0), (b, 1.0)]))
            .collect(),
        Smooth::ThinPlate => (0..CELLS).flat_map(bendings).collect(),
    }
}

/// The second differences whose least cell is `k`: along u, along v, and mixed.
fn bendings(k: usize) -> impl Iterator<Item = (f64, Difference)> {
    let (i, j) = (k % SIDE, k / SIDE);
    let straight = |step: usize| (1.0, vec![(k, 1.0), (k + step, -2.0), (k + 2 * step, 1.0)]);
    let along_u = (i + 2 < SIDE).then(|| straight(1));
    let along_v = (j + 2 < SIDE).then(|| straight(SIDE));
    let mixed = (i + 1 < SIDE && j + 1 < SIDE).then(|| {
        let corners = vec![
            (k, 1.0),
            (k + 1, -1.0),
            (k + SIDE, -1.0),
            (k + SIDE + 1, 1.0),
        ];
        (2.0, corners)
    });
    [along_u, along_v, mixed].into_iter().flatten()
}
