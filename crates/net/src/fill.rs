//! What the network sees in unknown cells: zeros (the paper), a membrane over the known cells, or a thin plate.
//!
//! The membrane is a push–pull pyramid with a few Jacobi sweeps per level. It is close to the harmonic fill, and differentiable in the
//! positions and in a soft mask. `engine::membrane` computes it; `darn-lab` has its definition in burn.

use serde::{Deserialize, Serialize};

use darn_geometry::mesh::Vec3;
use darn_geometry::smooth::{Smooth, smooth_all};

/// What the network sees in unknown cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// Zeros; the network predicts positions (the paper).
    Zeros,
    /// The membrane; the network predicts offsets from it.
    Membrane,
    /// A thin plate over the scan's known cells, plus the membrane of the anchors' distances from it; the network predicts offsets from
    /// the sum. On held-out sheets the plate is half as far from the truth as the membrane.
    #[default]
    Plate,
}

impl InputKind {
    /// Whether the network predicts offsets from what it sees, not positions.
    #[inline]
    pub fn answers_offsets(self) -> bool {
        self != InputKind::Zeros
    }
}

/// A grid's positions, with the unknown cells filled by a thin plate over the known ones; in the network's units, in any frame.
///
/// `None` when too few cells are known to determine a plate.
pub fn plate(positions: &[[f32; 3]], known: &[bool]) -> Option<Vec<[f32; 3]>> {
    plates(&[positions], known, 1)?.pop()
}

/// [`plate`] of several grids with the same known cells; takes little longer than one. Solved on every `step`-th cell and
/// interpolated, as by [`smooth_all`].
pub fn plates(grids: &[&[[f32; 3]]], known: &[bool], step: usize) -> Option<Vec<Vec<[f32; 3]>>> {
    let wide = |p: &[f32; 3]| Vec3::from(p.map(f64::from));
    let grids: Vec<Vec<Vec3>> = (grids.iter())
        .map(|grid| grid.iter().map(wide).collect())
        .collect();
    let grids: Vec<&[Vec3]> = grids.iter().map(Vec::as_slice).collect();
    let open: Vec<bool> = known.iter().map(|k| !k).collect();
    let filled = smooth_all(&grids, known, &open, Smooth::TautPlate, step)?;
    let narrow = |grid: &Vec<Vec3>| grid.iter().map(|p| p.cast::<f32>().into()).collect();
    Some(filled.iter().map(narrow).collect())
}

/// Sweeps at the levels of side 64, 32, 16, 8, 4, 2. On scarves with holes of 10 to 36 cells, the result is a quarter of a cell (RMS)
/// from the converged harmonic fill, which itself is 2 cells from the truth; with four sweeps each it is half a cell.
pub const SWEEPS: [usize; 6] = [8, 16, 16, 16, 8, 4];
/// A coarse cell counts as wholly known when one part in this many of it is known: one of its four cells at the finer level.
pub const SATURATION: f32 = 4.0;
/// Keeps the mean of a coarse cell finite when nothing in it is known.
pub const NOTHING: f32 = 1e-6;
