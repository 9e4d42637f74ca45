//! What the network sees in unknown cells: zeros (the paper), a smooth membrane over the known cells, or a thin plate.
//!
//! The membrane is a push–pull pyramid with a few Jacobi sweeps per level: close to the harmonic fill, and differentiable in the
//! positions and in a soft mask. The engine computes it in `engine::membrane`; the definition in burn is in `darn-lab`.

use serde::{Deserialize, Serialize};

use darn_geometry::mesh::Vec3;
use darn_geometry::smooth::{Smooth, smooth_all};

/// What unknown cells hold when the network sees them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// Zeros, and the network answers with positions (the paper).
    Zeros,
    /// The membrane, and the network answers with what to add to it.
    Membrane,
    /// A thin plate over what the scan knows, with anchors laid over it by the membrane of their distance from it; the network answers
    /// with what to add. On held-out sheets the plate is half as far from the truth as the membrane.
    #[default]
    Plate,
}

/// The fill of [`InputKind::Plate`] in every cell that is not known, known cells as they are; the network's units in any frame.
///
/// `None` when too few cells are known to determine it.
pub fn plate(positions: &[[f32; 3]], known: &[bool]) -> Option<Vec<[f32; 3]>> {
    plates(&[positions], known)?.pop()
}

/// [`plate`] of several grids of which the same cells are known, for little more than the work of one.
pub fn plates(grids: &[&[[f32; 3]]], known: &[bool]) -> Option<Vec<Vec<[f32; 3]>>> {
    let wide = |p: &[f32; 3]| Vec3::from(p.map(f64::from));
    let grids: Vec<Vec<Vec3>> = (grids.iter())
        .map(|grid| grid.iter().map(wide).collect())
        .collect();
    let grids: Vec<&[Vec3]> = grids.iter().map(Vec::as_slice).collect();
    let open: Vec<bool> = known.iter().map(|k| !k).collect();
    let filled = smooth_all(&grids, known, &open, Smooth::TautPlate)?;
    let narrow = |grid: &Vec<Vec3>| grid.iter().map(|p| p.cast::<f32>().into()).collect();
    Some(filled.iter().map(narrow).collect())
}

/// Sweeps at the levels of side 64, 32, 16, 8, 4, 2. On scarves with holes of 10 to 36 cells these leave a quarter of a cell (RMS)
/// to the converged harmonic fill, which itself is 2 cells from the truth; four each leave half a cell.
pub const SWEEPS: [usize; 6] = [8, 16, 16, 16, 8, 4];
/// A coarse cell counts as known when this share of it is; a quarter means one cell of the finer level.
pub const SATURATION: f32 = 4.0;
/// Guards the mean of a coarse cell that holds nothing known.
pub const NOTHING: f32 = 1e-6;
