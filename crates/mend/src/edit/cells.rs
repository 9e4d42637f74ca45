//! The grid cells of a hole.

use darn_geometry::grid::{CELLS, cell_at, cell_centre};
use darn_geometry::mesh::{Vec2, Vec3};

/// The grid's cells that lie in a hole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HoleCells {
    indices: Vec<usize>,
    is_hole: Vec<bool>,
}

/// A cell of the hole and how far it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellMove {
    /// The cell's index.
    pub cell: usize,
    /// The move, scene units.
    pub by: Vec3,
}

impl HoleCells {
    /// The cells for whose index `lies_in_hole` is true.
    pub fn new(lies_in_hole: impl Fn(usize) -> bool) -> HoleCells {
        let is_hole: Vec<bool> = (0..CELLS).map(lies_in_hole).collect();
        HoleCells {
            indices: (0..CELLS).filter(|k| is_hole[*k]).collect(),
            is_hole,
        }
    }

    /// Their indices, ascending.
    pub fn indices(&self) -> &[usize] {
        &self.indices
    }

    /// Whether a cell is one of them.
    pub fn contains(&self, cell: usize) -> bool {
        self.is_hole.get(cell).copied().unwrap_or(false)
    }
}

/// The hole's cell whose centre is nearest to a uv; the cell that the uv lies in if that is one of the hole's.
pub fn nearest_cell(hole: &HoleCells, uv: Vec2) -> Option<usize> {
    let own = cell_at(uv);
    if hole.contains(own) {
        return Some(own);
    }
    let away = |k: &usize| (cell_centre(*k) - uv).norm_squared();
    let each = hole.indices().iter().copied();
    each.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
}

/// Holes for tests.
#[cfg(test)]
pub mod testing {
    use super::HoleCells;
    use darn_geometry::grid::cell_centre;
    use darn_geometry::mesh::Vec2;

    /// A round hole in the middle of the grid, radius in cells.
    pub fn disk(radius: f64) -> HoleCells {
        let middle = Vec2::repeat(0.5);
        HoleCells::new(|k| (cell_centre(k) - middle).norm() * 64.0 < radius)
    }
}
