//! Muon (Jordan et al. 2024): a kernel's step is the orthogonal matrix nearest to its averaged gradient, so that all directions of the kernel
//! learn equally fast. Here for kernels `[out, in, k, k]` as matrices `[out, in·k·k]`; what is no such matrix is left to AdamW.

use nalgebra::DMatrix;

/// Decay of the averaged gradient.
pub const MOMENTUM: f32 = 0.95;
/// Root mean square of a step's entries ÷ the learning rate: about that of AdamW, so that both take the same rates (Liu et al. 2025).
pub const STEP_SIZE: f32 = 0.2;
/// Iterations of Newton and Schulz.
const ITERATIONS: usize = 5;
/// Coefficients of the quintic that brings singular values to 0.7 … 1.2 in five iterations (Jordan et al. 2024).
const QUINTIC: [f32; 3] = [3.4445, -4.7750, 2.0315];

/// Whether Muon trains this tensor: kernels between the first and the last layer with more than one output.
pub fn trains(name: &str, shape: &[usize]) -> bool {
    let edge = name.starts_with("down.0.conv0.") || name.starts_with("last.");
    shape.len() == 4 && shape[0] > 1 && !edge
}

/// Moves `values`, a kernel of `outputs` rows, by one step of the learning rate `rate`. `momentum` is the averaged gradient, which the
/// `gradient` is added to.
pub fn step(values: &mut [f32], gradient: &[f32], momentum: &mut [f32], outputs: usize, rate: f32) {
    let mut ahead = Vec::with_capacity(values.len());
    for (mean, slope) in momentum.iter_mut().zip(gradient) {
        *mean = *mean * MOMENTUM + slope * (1.0 - MOMENTUM);
        // Nesterov: the average as it will be if the next gradient is like this one.
        ahead.push(*mean * MOMENTUM + slope * (1.0 - MOMENTUM));
    }
    let inputs = values.len() / outputs.max(1);
    let size = rate * STEP_SIZE * (outputs.max(inputs) as f32).sqrt();
    // Rows of `outputs` are columns here: the same matrix transposed, and so is its result.
    let change = orthogonal(DMatrix::from_vec(inputs, outputs, ahead));
    for (value, change) in values.iter_mut().zip(change.iter()) {
        *value -= size * change;
    }
}

/// A matrix with the singular vectors of `matrix` and singular values near 1; zero for zero.
pub fn orthogonal(matrix: DMatrix<f32>) -> DMatrix<f32> {
    let norm = matrix.norm();
    if norm.is_nan() || norm <= f32::MIN_POSITIVE {
        return matrix.map(|_| 0.0);
    }
    // The smaller Gram matrix is that of a wide one.
    let tall = matrix.nrows() > matrix.ncols();
    let mut x = match tall {
        true => matrix.transpose(),
        false => matrix,
    } / norm;
    let [a, b, c] = QUINTIC;
    for _ in 0..ITERATIONS {
        let gram = &x * x.transpose();
        let factor = &gram * b + &gram * &gram * c;
        x = &x * a + factor * &x;
    }
    match tall {
        true => x.transpose(),
        false => x,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A matrix of numbers in −1..1.
    fn matrices() -> impl Strategy<Value = DMatrix<f32>> {
        (2..12usize, 2..40usize).prop_flat_map(|(rows, columns)| {
            prop::collection::vec(-1.0..1.0f32, rows * columns)
                .prop_map(move |values| DMatrix::from_vec(rows, columns, values))
        })
    }

    proptest! {
        #[test]
        fn singular_values_come_near_one_and_vectors_stay(matrix in matrices()) {
            let svd = matrix.clone().svd(true, true);
            let (u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
            let values = u.transpose() * orthogonal(matrix) * v_t.transpose();
            for i in 0..values.nrows() {
                for j in 0..values.ncols() {
                    let off = values[(i, j)];
                    if i != j {
                        prop_assert!(off.abs() < 1e-3, "{off}");
                    } else if svd.singular_values[i] > 0.05 * svd.singular_values[0] {
                        prop_assert!((0.6..1.3).contains(&off), "{off}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_gradient_is_no_step() {
        let mut values = vec![1.0; 12];
        step(&mut values, &[0.0; 12], &mut [0.0; 12], 3, 0.1);
        assert_eq!(values, [1.0; 12]);
    }

    #[test]
    fn a_step_goes_down_its_gradient_by_its_size() {
        let gradient: Vec<f32> = (0..6 * 18).map(|k| ((k * k) as f32).sin()).collect();
        let (mut values, mut momentum) = (vec![0.0; 6 * 18], vec![0.0; 6 * 18]);
        step(&mut values, &gradient, &mut momentum, 6, 0.01);
        let slope: f32 = values.iter().zip(&gradient).map(|(x, by)| x * by).sum();
        let square = values.iter().map(|x| x * x).sum::<f32>() / values.len() as f32;
        assert!(slope < 0.0, "{slope}");
        assert!(
            (0.8..1.2).contains(&(square.sqrt() / (0.01 * STEP_SIZE))),
            "{square}"
        );
    }

    #[test]
    fn edges_vectors_and_single_rows_are_left_out() {
        assert!(trains("down.3.conv1.weight", &[128, 128, 3, 3]));
        assert!(!trains("down.0.conv0.weight", &[16, 4, 3, 3]));
        assert!(!trains("last.weight", &[3, 16, 1, 1]));
        assert!(!trains("up.0.gate.score.weight", &[1, 8, 1, 1]));
        assert!(!trains("down.3.norm1.scale", &[128]));
    }
}
