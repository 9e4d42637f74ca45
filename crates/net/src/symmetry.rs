//! The grid's symmetries: the network, asked about a grid turned and mirrored, answers alike but not the same; the mean is better.

use darn_geometry::grid::{CELLS, SIDE, cell_index};

/// The symmetries that answers are averaged over, as [`origins`] numbers them. All eight gain nothing over the flips once the cloth is
/// patched (`weights/README.md` has the table).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Averaging {
    /// The grid as it is: one pass.
    Once,
    /// The grid as it is, mirrored in u, in v and in both: for cloth that stays.
    Flips,
    /// As it is and turned by half: for the small differences of editing, which should be quick.
    HalfTurn,
}

impl Averaging {
    pub(crate) fn symmetries(self) -> &'static [usize] {
        match self {
            Averaging::Once => &[0],
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
