//! Grids as planes: all x, then all y, then all z; what the network is shown at once.

use darn_geometry::grid::CELLS;

use crate::engine::Input;

/// The planes of some grids, in the network's frame.
#[derive(Debug, Clone)]
pub struct GridPlanes {
    /// `[n, 3, 64, 64]`.
    pub positions: Vec<f32>,
    /// `[n, 1, 64, 64]` in 0..=1.
    pub known: Vec<f32>,
    /// The plate, `[n, 3, 64, 64]`, for networks that see one.
    pub base: Option<Vec<f32>>,
    /// The up direction, `[n, 3]`, for networks that are told it.
    pub up: Option<Vec<f32>>,
}

impl GridPlanes {
    /// The same as slices.
    pub fn as_input(&self) -> Input<'_> {
        Input {
            positions: &self.positions,
            known: &self.known,
            base: self.base.as_deref(),
            up: self.up.as_deref(),
        }
    }
}

/// Positions of cells as planes, grid after grid: `[n][4096] -> [n, 3, 64, 64]`.
pub fn planes(grids: &[Vec<[f32; 3]>]) -> Vec<f32> {
    grids
        .iter()
        .flat_map(|grid| (0..3).flat_map(move |axis| grid.iter().map(move |p| p[axis])))
        .collect()
}

/// The cells of one grid's three planes: `[3, 64, 64] -> [4096]`.
pub fn cells(planes: &[f32]) -> Vec<[f32; 3]> {
    let (x, rest) = planes.split_at(CELLS);
    let (y, z) = rest.split_at(CELLS);
    x.iter()
        .zip(y)
        .zip(z)
        .map(|((x, y), z)| [*x, *y, *z])
        .collect()
}
