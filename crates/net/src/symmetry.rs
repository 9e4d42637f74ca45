//! The grid's symmetries. The network's predictions for a grid and for its mirror images differ a little; their mean is better.

use darn_geometry::grid::{CELLS, SIDE, cell_index};

/// The symmetries that predictions are averaged over. All eight are no better than the flips once the cloth is patched (the table is in
/// `weights/README.md`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Averaging {
    /// The grid as it is: one pass.
    Once,
    /// The grid as it is, mirrored in u, in v and in both: for a mend's result.
    Flips,
}

impl Averaging {
    /// The symmetries as [`origins`] numbers them.
    pub(crate) fn symmetries(self) -> &'static [usize] {
        match self {
            Averaging::Once => &[0],
            Averaging::Flips => &[0, 1, 2, 3],
        }
    }
}

/// For each cell of the transformed grid, the cell of the grid that it comes from. Bit 0 of `symmetry` flips u, bit 1 flips v, bit 2
/// swaps them.
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
