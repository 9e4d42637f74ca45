//! Grids as planes (all x, then all y, then all z), the form of the network's input.

use darn_geometry::grid::{CELLS, NormalGrid};

use crate::config::UnetConfig;
use crate::engine::EngineInput;
use crate::fill::{InputKind, plate};
use crate::frame::NetworkFrame;

/// The planes of some grids, in the network's units and frame.
#[derive(Debug, Clone)]
pub struct GridPlanes {
    /// `[n, 3, 64, 64]`.
    pub positions: Vec<f32>,
    /// `[n, 1, 64, 64]` in 0..=1.
    pub known: Vec<f32>,
    /// The plate, `[n, 3, 64, 64]`, if the network sees one.
    pub base: Option<Vec<f32>>,
    /// The up direction, `[n, 3]`, if the network is given it.
    pub up: Option<Vec<f32>>,
}

impl GridPlanes {
    /// The planes of grids for a network of this architecture, each turned to its frame.
    pub(crate) fn new(
        config: &UnetConfig,
        grids: &[NormalGrid],
        frames: &[NetworkFrame],
    ) -> GridPlanes {
        let entered = |cells: &[[f32; 3]], frame: &NetworkFrame| -> Vec<[f32; 3]> {
            cells.iter().map(|p| frame.enter(*p)).collect()
        };
        let each = || grids.iter().zip(frames);
        let positions: Vec<_> = each().map(|(g, f)| entered(&g.positions, f)).collect();
        let base: Option<Vec<_>> = each()
            .map(|(g, f)| Some(entered(&base_of(config, g)?, f)))
            .collect();
        let known = grids.iter().flat_map(|grid| grid.known.iter().copied());
        let up = frames.iter().map(|frame| up_of(config, frame));
        let up: Option<Vec<[f32; 3]>> = up.collect();
        GridPlanes {
            positions: planes(&positions),
            known: known.collect(),
            base: base.map(|base| planes(&base)),
            up: up.map(|up| up.as_flattened().to_vec()),
        }
    }

    /// The planes as slices for the engine.
    pub fn as_input(&self) -> EngineInput<'_> {
        EngineInput {
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

/// The plate under a grid's anchors, in the grid's space: the grid's own, else made of its known cells. `None` for networks that see none.
pub(crate) fn base_of(config: &UnetConfig, grid: &NormalGrid) -> Option<Vec<[f32; 3]>> {
    let seen = config.input == InputKind::Plate;
    let made = || {
        let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
        // A grid with too few known cells for a plate gets zeros; the network then sees a membrane alone.
        let plate = plate(&grid.positions, &known);
        plate.unwrap_or_else(|| vec![[0.0; 3]; CELLS])
    };
    seen.then(|| grid.base.clone().unwrap_or_else(made))
}

/// The up direction in a frame, for networks that are given it.
pub(crate) fn up_of(config: &UnetConfig, frame: &NetworkFrame) -> Option<[f32; 3]> {
    config.frame.told_up().then(|| frame.up())
}
