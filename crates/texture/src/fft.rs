//! The discrete Fourier transform of square pictures whose side is a power of two.

use rayon::prelude::*;

/// A complex number as real and imaginary part.
pub(crate) type Complex = [f32; 2];

/// Powers of the root of unity for one length.
struct Twiddles(Vec<Complex>);

impl Twiddles {
    fn new(length: usize) -> Twiddles {
        let power = |k: usize| {
            let angle = -std::f64::consts::TAU * k as f64 / length as f64;
            [angle.cos() as f32, angle.sin() as f32]
        };
        Twiddles((0..length / 2).map(power).collect())
    }
}

fn times(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Transforms one row in place (radix 2, decimation in time).
fn transform_row(row: &mut [Complex], twiddles: &Twiddles) {
    let length = row.len();
    let mut reversed = 0;
    for k in 1..length {
        let mut bit = length >> 1;
        while reversed & bit != 0 {
            reversed ^= bit;
            bit >>= 1;
        }
        reversed |= bit;
        if k < reversed {
            row.swap(k, reversed);
        }
    }
    let mut half = 1;
    while half < length {
        let stride = length / (2 * half);
        for block in row.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let odd = times(*b, twiddles.0[k * stride]);
                *b = [a[0] - odd[0], a[1] - odd[1]];
                *a = [a[0] + odd[0], a[1] + odd[1]];
            }
        }
        half *= 2;
    }
}

fn transposed(picture: &[Complex], side: usize) -> Vec<Complex> {
    let mut out = vec![[0.0; 2]; picture.len()];
    out.par_chunks_mut(side * 8)
        .enumerate()
        .for_each(|(band, rows)| {
            for (r, row) in rows.chunks_mut(side).enumerate() {
                let column = band * 8 + r;
                (row.iter_mut().enumerate()).for_each(|(k, x)| *x = picture[k * side + column]);
            }
        });
    out
}

/// Σ f(x, y) e^(−2πi (ux + vy) / side), with rows and columns exchanged. O(side² log side).
pub(crate) fn transform(mut picture: Vec<Complex>, side: usize) -> Vec<Complex> {
    let twiddles = Twiddles::new(side);
    let rows = |picture: &mut [Complex]| {
        picture
            .par_chunks_mut(side)
            .for_each(|row| transform_row(row, &twiddles));
    };
    rows(&mut picture);
    let mut picture = transposed(&picture, side);
    rows(&mut picture);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sum_of_its_definition() {
        let side = 8;
        let picture: Vec<Complex> = (0..64)
            .map(|k| [(k * k % 11) as f32, (k * 7 % 5) as f32])
            .collect();
        let fast = transform(picture.clone(), side);
        for (u, v) in [(0, 0), (1, 0), (3, 5), (7, 2)] {
            let mut sum = [0.0f64; 2];
            for (k, x) in picture.iter().enumerate() {
                let angle =
                    -std::f64::consts::TAU * (u * (k % side) + v * (k / side)) as f64 / side as f64;
                sum[0] += f64::from(x[0]) * angle.cos() - f64::from(x[1]) * angle.sin();
                sum[1] += f64::from(x[0]) * angle.sin() + f64::from(x[1]) * angle.cos();
            }
            let got = fast[u * side + v];
            assert!(
                (sum[0] - f64::from(got[0])).abs() < 1e-2
                    && (sum[1] - f64::from(got[1])).abs() < 1e-2
            );
        }
    }
}
