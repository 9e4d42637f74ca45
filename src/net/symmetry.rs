//! The grid's eight symmetries: the network, asked about a grid turned and mirrored, answers alike but not the same; the mean is better.

use super::{NetError, Network};
use crate::grid::{CELLS, NormalGrid, SIDE, cell_index};

/// Symmetries of the square.
const COUNT: usize = 8;

/// Per cell, the cell it comes from: bit 0 flips u, bit 1 flips v, bit 2 swaps them.
pub fn origins(symmetry: usize) -> Vec<usize> {
    let origin = |k: usize| {
        let (mut i, mut j) = (k % SIDE, k / SIDE);
        if symmetry & 1 != 0 {
            i = SIDE - 1 - i;
        }
        if symmetry & 2 != 0 {
            j = SIDE - 1 - j;
        }
        if symmetry & 4 != 0 {
            cell_index(j, i)
        } else {
            cell_index(i, j)
        }
    };
    (0..CELLS).map(origin).collect()
}

impl Network {
    /// [`Network::fill`], averaged over the grid's eight symmetries.
    ///
    /// # Errors
    /// As of [`Network::fill`].
    pub fn fill_averaged(&self, grids: &[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        super::check_sizes(grids)?;
        let all: Vec<Vec<usize>> = (0..COUNT).map(origins).collect();
        let mut answers = Vec::with_capacity(grids.len());
        for grid in grids {
            // The base is the same for all, turned: it is not made eight times.
            let base = super::base_of(&self.card.architecture, grid);
            let turned: Vec<NormalGrid> = (all.iter())
                .map(|from| {
                    let moved = |cells: &[[f32; 3]]| from.iter().map(|k| cells[*k]).collect();
                    NormalGrid {
                        positions: moved(&grid.positions),
                        known: from.iter().map(|k| grid.known[*k]).collect(),
                        base: base.as_deref().map(moved),
                    }
                })
                .collect();
            let mut mean = vec![[0.0; 3]; CELLS];
            for (answer, from) in self.fill(&turned)?.iter().zip(&all) {
                for (p, k) in answer.iter().zip(from) {
                    (0..3).for_each(|axis| mean[*k][axis] += p[axis] / COUNT as f32);
                }
            }
            answers.push(mean);
        }
        Ok(answers)
    }
}
