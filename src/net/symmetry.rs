//! The grid's symmetries: the network, asked about a grid turned and mirrored, answers alike but not the same; the mean is better.

use super::{NetError, Network};
use crate::grid::{CELLS, NormalGrid, SIDE, cell_index};

/// The symmetries that answers are averaged over, as [`origins`] numbers them. All eight gain nothing over the flips once the cloth is
/// patched (`weights/README.md` has the table).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Averaging {
    /// The grid as it is, mirrored in u, in v and in both: for cloth that stays.
    Flips,
    /// As it is and turned by half: for the small differences of editing, which should be quick.
    HalfTurn,
}

impl Averaging {
    fn symmetries(self) -> &'static [usize] {
        match self {
            Averaging::Flips => &[0, 1, 2, 3],
            Averaging::HalfTurn => &[0, 3],
        }
    }
}

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
    /// [`Network::fill`], averaged over symmetries of the grid.
    ///
    /// # Errors
    /// As of [`Network::fill`].
    pub fn fill_averaged(
        &self,
        grids: &[NormalGrid],
        averaging: Averaging,
    ) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        super::check_sizes(grids)?;
        let symmetries: Vec<Vec<usize>> = (averaging.symmetries().iter())
            .map(|s| origins(*s))
            .collect();
        let mut turned = Vec::with_capacity(grids.len() * symmetries.len());
        for grid in grids {
            // The base is the same for all, turned: it is not made for each.
            let base = super::base_of(&self.card.architecture, grid);
            turned.extend(symmetries.iter().map(|from| {
                let moved = |cells: &[[f32; 3]]| from.iter().map(|k| cells[*k]).collect();
                NormalGrid {
                    positions: moved(&grid.positions),
                    known: from.iter().map(|k| grid.known[*k]).collect(),
                    base: base.as_deref().map(moved),
                }
            }));
        }
        let mut answers = Vec::with_capacity(grids.len());
        for alike in self.fill(&turned)?.chunks(symmetries.len()) {
            let mut mean = vec![[0.0; 3]; CELLS];
            for (answer, from) in alike.iter().zip(&symmetries) {
                for (p, k) in answer.iter().zip(from) {
                    (0..3).for_each(|axis| mean[*k][axis] += p[axis] / symmetries.len() as f32);
                }
            }
            answers.push(mean);
        }
        Ok(answers)
    }
}
