//! The membrane that fills unknown cells of the network's input, as products with constant matrices: differentiable in the positions and in
//! a soft mask. This is the definition; that of `darn_net::engine` is tested against it.

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

use darn_geometry::grid::SIDE;
use darn_net::fill::{NOTHING, SATURATION, SWEEPS};

/// The base plus the membrane of the known positions' offsets from it; without a base the membrane of the positions. Shapes as in
/// `membrane`.
pub fn fill_over_base<B: Backend>(
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
/// `positions [batch, channels, 64, 64]`, `known [batch, 1, 64, 64]` in 0..=1 `-> [batch, channels, 64, 64]`. A known cell keeps its position, a
/// partly known cell keeps its share of it. A grid without known cells becomes zero.
pub fn membrane<B: Backend>(positions: Tensor<B, 4>, known: Tensor<B, 4>) -> Tensor<B, 4> {
    let device = positions.device();
    let [_, channels, ..] = positions.dims();
    // Repeated and not broadcast: the backends are fast with equal shapes.
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
        // Where the share is not negligible, the weight is bounded away from zero.
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
    // The pyramid has at least the finest level, so this is never zeros.
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

/// Mean of the four neighbours of every cell; a missing neighbour at the border is replaced by the cell itself.
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
