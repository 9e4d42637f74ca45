//! The user's hand on the cloth: gestures become anchors, anchors are brought within the cloth's reach, a target in space finds its cell.
//! May use `grid`, `mesh`'s vectors and the contract's gestures; the network comes in as a trait that answers losses and their gradients.
//! No scans, charts, networks or patches here: cloth is a function from uv to space, a hole is a set of cells.

mod drape;
mod gesture;
pub mod map;
mod reach;
mod search;

pub use darn_geometry::patch::Firmness;
pub use gesture::Hand;
pub use reach::{Point, Reach};
pub use search::{
    Found, Landscape, SearchOptions, Slope, Step, descend, exhaust, nearest_cell, seeds,
};

use darn_geometry::grid::CELLS;
use darn_geometry::mesh::{Vec2, Vec3};

/// A place on the cloth and where in space it should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Where on the chart.
    pub uv: Vec2,
    /// Where in scene space.
    pub position: Vec3,
    /// Whether others make room for it.
    pub firmness: Firmness,
}

/// The grid's cells that lie in a hole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HoleCells {
    cells: Vec<usize>,
    among: Vec<bool>,
}

impl HoleCells {
    /// The cells, by index, that `lies_in` the hole.
    pub fn new(lies_in: impl Fn(usize) -> bool) -> HoleCells {
        let among: Vec<bool> = (0..CELLS).map(lies_in).collect();
        HoleCells {
            cells: (0..CELLS).filter(|k| among[*k]).collect(),
            among,
        }
    }

    /// Their indices, ascending.
    pub fn indices(&self) -> &[usize] {
        &self.cells
    }

    /// Whether a cell is one of them.
    pub fn contains(&self, cell: usize) -> bool {
        self.among.get(cell).copied().unwrap_or(false)
    }
}

#[cfg(test)]
mod testing {
    use super::HoleCells;
    use darn_geometry::grid::cell_centre;
    use darn_geometry::mesh::Vec2;

    /// A round hole in the middle of the grid, radius in cells.
    pub fn disk(radius: f64) -> HoleCells {
        let middle = Vec2::repeat(0.5);
        HoleCells::new(|k| (cell_centre(k) - middle).norm() * 64.0 < radius)
    }
}
