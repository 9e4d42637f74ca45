//! What the network sees in unknown cells: nothing (the paper), a smooth membrane stretched over the known ones, or a thin plate.
//! The membrane is a push–pull pyramid with a few Jacobi sweeps a level: close to the harmonic fill, and differentiable in the
//! positions and in a soft mask, because it is made of products with constant matrices only.

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

use crate::grid::SIDE;
use crate::mesh::Vec3;
use crate::smooth::{Smooth, smooth_all};

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
pub(super) const SWEEPS: [usize; 6] = [8, 16, 16, 16, 8, 4];
/// A coarse cell counts as known when this share of it is; a quarter means one cell of the finer level.
pub(super) const SATURATION: f32 = 4.0;
/// Guards the mean of a coarse cell that holds nothing known.
pub(super) const NOTHING: f32 = 1e-6;

/// A base, where there is one, and over it the membrane of how far known positions are from it; shapes as of [`membrane`].
pub fn over<B: Backend>(
    base: Option<Tensor<B, 4>>,
    positions: Tensor<B, 4>,
    known: Tensor<B, 4>,
) -> Tensor<B, 4> {
    match base {
        Some(base) => membrane(positions - base.clone(), known) + base,
        None => membrane(positions, known),
    }
}

/// Fills unknown cells smoothly from the known ones.
///
/// `positions [batch, channels, 64, 64]`, `known [batch, 1, 64, 64]` in 0..=1 `-> [batch, channels, 64, 64]`; known cells are kept as far as they are
/// known. A grid without any known cell becomes zero.
pub fn membrane<B: Backend>(positions: Tensor<B, 4>, known: Tensor<B, 4>) -> Tensor<B, 4> {
    let device = positions.device();
    let [_, channels, ..] = positions.dims();
    // Repeated rather than broadcast: the backends multiply equal shapes fast.
    let known = known.repeat_dim(1, channels);
    let mut levels = vec![(positions * known.clone(), known)];
    let mut side = SIDE;
    while side > 1 {
        if let Some((values, weight)) = levels.last().cloned() {
            let halve = halving::<B>(side, &device);
            levels.push((both(&halve, values), both(&halve, weight)));
        }
        side /= 2;
    }
    let mut filled: Option<Tensor<B, 4>> = None;
    for (level, (values, weight)) in levels.into_iter().enumerate().rev() {
        let side = SIDE >> level;
        let share = if level == 0 {
            weight.clone()
        } else {
            (weight.clone() * SATURATION).clamp_max(1.0)
        };
        // Divide only where there is something: weight is bounded below where the share matters.
        let given = values / (weight + NOTHING) * share.clone();
        let open = share.neg() + 1.0;
        filled = Some(match filled {
            None => given,
            Some(coarse) => {
                let coarse = both(&doubling::<B>(side / 2, &device), coarse);
                let mean = averaging::<B>(side, &device);
                let mut u = given.clone() + coarse * open.clone();
                for _ in 0..SWEEPS.get(level).copied().unwrap_or(0) {
                    u = given.clone() + neighbours(&mean, u) * open.clone();
                }
                u
            }
        });
    }
    // The loop ran at least once: the pyramid has the finest level.
    filled.unwrap_or_else(|| Tensor::zeros([1, 1, SIDE, SIDE], &device))
}

/// `matrix · x · matrixᵀ` on every plane: `[m, n]`, `[batch, channels, n, n] -> [batch, channels, m, m]`.
fn both<B: Backend>(matrix: &Tensor<B, 2>, x: Tensor<B, 4>) -> Tensor<B, 4> {
    let [batch, channels, n, _] = x.dims();
    let [m, _] = matrix.dims();
    let rows = x
        .reshape([batch * channels * n, n])
        .matmul(matrix.clone().transpose());
    let rows = rows.reshape([batch * channels, n, m]);
    let left = matrix
        .clone()
        .unsqueeze::<3>()
        .expand([batch * channels, m, n]);
    left.matmul(rows).reshape([batch, channels, m, m])
}

/// Mean of the four neighbours of every cell, the border's missing ones replaced by the cell itself.
fn neighbours<B: Backend>(mean: &Tensor<B, 2>, x: Tensor<B, 4>) -> Tensor<B, 4> {
    let [batch, channels, n, _] = x.dims();
    let across = x
        .clone()
        .reshape([batch * channels * n, n])
        .matmul(mean.clone())
        .reshape([batch, channels, n, n]);
    let left = mean
        .clone()
        .unsqueeze::<3>()
        .expand([batch * channels, n, n]);
    let along = left
        .matmul(x.reshape([batch * channels, n, n]))
        .reshape([batch, channels, n, n]);
    across + along
}

/// Averages pairs: `[n/2, n]`.
fn halving<B: Backend>(n: usize, device: &B::Device) -> Tensor<B, 2> {
    matrix(
        n / 2,
        n,
        |row, column| if column / 2 == row { 0.5 } else { 0.0 },
        device,
    )
}

/// Linear interpolation from `n` cell centres to `2n`: `[2n, n]`.
fn doubling<B: Backend>(n: usize, device: &B::Device) -> Tensor<B, 2> {
    let weight = |row: usize, column: usize| {
        let at = ((row as f32 + 0.5) / 2.0 - 0.5).clamp(0.0, (n - 1) as f32);
        (1.0 - (at - column as f32).abs()).max(0.0)
    };
    matrix(2 * n, n, weight, device)
}

/// A quarter of each neighbour along one axis, symmetric: `[n, n]`.
fn averaging<B: Backend>(n: usize, device: &B::Device) -> Tensor<B, 2> {
    let weight = |row: usize, column: usize| {
        let beyond = usize::from(row == 0) + usize::from(row + 1 == n);
        match row.abs_diff(column) {
            0 => 0.25 * beyond as f32,
            1 => 0.25,
            _ => 0.0,
        }
    };
    matrix(n, n, weight, device)
}

fn matrix<B: Backend>(
    rows: usize,
    columns: usize,
    entry: impl Fn(usize, usize) -> f32,
    device: &B::Device,
) -> Tensor<B, 2> {
    let entries = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(r, c)| entry(r, c))
        .collect();
    Tensor::from_data(TensorData::new(entries, [rows, columns]), device)
}
