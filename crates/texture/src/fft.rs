//! The discrete Fourier transform of square pictures, by `rustfft` without instructions that only some machines have: every machine gives the
//! same bits.

use std::sync::Arc;

use rayon::prelude::*;
use rustfft::{Fft, FftPlannerScalar};

pub(crate) use rustfft::num_complex::Complex32 as Complex;

/// Rows or columns that one task transforms.
const BAND: usize = 16;

/// The least length of at least `least` without prime factors above 5: such lengths are fast.
pub(crate) fn fast_length(least: usize) -> usize {
    let is_smooth = |n: &usize| {
        let mut rest = *n;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    // A power of two is not far.
    (least.max(1)..).find(is_smooth).unwrap_or(least)
}

fn transposed(picture: &[Complex], side: usize) -> Vec<Complex> {
    let mut out = vec![Complex::default(); picture.len()];
    let bands = out.par_chunks_mut(side * BAND).enumerate();
    bands.for_each(|(band, rows)| {
        let first = band * BAND;
        for (k, row) in picture.chunks_exact(side).enumerate() {
            let columns = row[first..].iter().take(BAND);
            columns
                .enumerate()
                .for_each(|(r, x)| rows[r * side + k] = *x);
        }
    });
    out
}

fn transform_rows(rows: &mut [Complex], fft: &Arc<dyn Fft<f32>>) {
    let bands = rows.par_chunks_mut(fft.len() * BAND);
    bands.for_each(|band| fft.process(band));
}

/// Σ f(x, y) e^(−2πi (ux + vy) / side), with rows and columns exchanged. Rows from `filled` on are zero. O(side² log side).
pub(crate) fn transform(mut picture: Vec<Complex>, side: usize, filled: usize) -> Vec<Complex> {
    let fft = FftPlannerScalar::new().plan_fft_forward(side);
    transform_rows(&mut picture[..side * filled.min(side)], &fft);
    let mut picture = transposed(&picture, side);
    transform_rows(&mut picture, &fft);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sum_of_its_definition() {
        let side = 10;
        let value = |k: usize| match k < 60 {
            true => Complex::new((k * k % 11) as f32, (k * 7 % 5) as f32),
            false => Complex::default(),
        };
        let picture: Vec<Complex> = (0..100).map(value).collect();
        let fast = transform(picture.clone(), side, 6);
        for (u, v) in [(0, 0), (1, 0), (3, 5), (7, 2)] {
            let mut sum = [0.0f64; 2];
            for (k, x) in picture.iter().enumerate() {
                let angle =
                    -std::f64::consts::TAU * (u * (k % side) + v * (k / side)) as f64 / side as f64;
                sum[0] += f64::from(x.re) * angle.cos() - f64::from(x.im) * angle.sin();
                sum[1] += f64::from(x.re) * angle.sin() + f64::from(x.im) * angle.cos();
            }
            let got = fast[u * side + v];
            assert!(
                (sum[0] - f64::from(got.re)).abs() < 1e-2
                    && (sum[1] - f64::from(got.im)).abs() < 1e-2
            );
        }
    }

    #[test]
    fn fast_lengths_are_near() {
        for (least, length) in [(1, 1), (7, 8), (11, 12), (161, 162), (512, 512), (513, 540)] {
            assert_eq!(fast_length(least), length);
        }
    }
}
