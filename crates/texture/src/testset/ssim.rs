//! Structural similarity of two pictures (Wang et al. 2004).

/// How far a window reaches from its middle: windows of 7 × 7.
const REACH: i64 = 3;
/// (0.01 · 100)² and (0.03 · 100)²: lightness goes from 0 to 100.
const STABILISERS: [f64; 2] = [1.0, 9.0];

/// The lightness (CIE L*, 0 to 100) of two pictures of one size, row by row.
#[derive(Debug, Clone, Copy)]
pub struct LightPair<'a> {
    /// Columns of the pictures.
    pub width: usize,
    /// What was made.
    pub made: &'a [f64],
    /// What is true.
    pub truth: &'a [f64],
}

impl LightPair<'_> {
    /// Similarity of the windows around a pixel, −1 to 1; 1 where they are equal. Windows end at the pictures' borders.
    pub fn ssim(&self, at: usize) -> f64 {
        let (mut n, mut a, mut b, mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for k in window(self.width, self.truth.len(), at, REACH) {
            let (x, y) = (self.made[k], self.truth[k]);
            n += 1.0;
            a += x;
            b += y;
            aa += x * x;
            bb += y * y;
            ab += x * y;
        }
        let (a, b) = (a / n, b / n);
        let (va, vb, cov) = (aa / n - a * a, bb / n - b * b, ab / n - a * b);
        let [c1, c2] = STABILISERS;
        (2.0 * a * b + c1) * (2.0 * cov + c2) / ((a * a + b * b + c1) * (va + vb + c2))
    }
}

/// The pixels at most `reach` columns and rows from pixel `at` of a picture of `count` pixels.
pub(super) fn window(
    width: usize,
    count: usize,
    at: usize,
    reach: i64,
) -> impl Iterator<Item = usize> {
    let (columns, rows) = (width as i64, (count / width) as i64);
    let (c, r) = ((at % width) as i64, (at / width) as i64);
    (r - reach..=r + reach)
        .flat_map(move |y| (c - reach..=c + reach).map(move |x| (x, y)))
        .filter(move |(x, y)| *x >= 0 && *y >= 0 && *x < columns && *y < rows)
        .map(move |(x, y)| (y * columns + x) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chessboard of fields of one pixel around a middle lightness.
    fn board(middle: f64, contrast: f64) -> Vec<f64> {
        (0..13 * 11)
            .map(|at| match (at % 13 + at / 13) % 2 {
                0 => middle + contrast,
                _ => middle - contrast,
            })
            .collect()
    }

    fn similarity(made: &[f64], truth: &[f64], at: usize) -> f64 {
        let width = 13;
        LightPair { width, made, truth }.ssim(at)
    }

    #[test]
    fn even_pictures_differ_by_their_lightness_alone() {
        let (a, b) = (board(40.0, 0.0), board(60.0, 0.0));
        let wanted = (2.0 * 40.0 * 60.0 + 1.0) / (40.0 * 40.0 + 60.0 * 60.0 + 1.0);
        for at in [0, 12, 70, 142] {
            assert!((similarity(&a, &b, at) - wanted).abs() < 1e-12);
            assert!((similarity(&a, &a, at) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_dark_instead_of_light_is_opposite() {
        let (truth, inverse) = (board(50.0, 20.0), board(50.0, -20.0));
        // A whole window has 25 pixels of one kind and 24 of the other: means 50 ± 20/49, variances 400 (1 − 1/49²).
        let (step, variance) = (20.0f64 / 49.0, 400.0 * (1.0 - 1.0 / 2401.0));
        let means = (2.0 * (2500.0 - step * step) + 1.0) / (2.0 * (2500.0 + step * step) + 1.0);
        let wanted = means * (9.0 - 2.0 * variance) / (9.0 + 2.0 * variance);
        let found = similarity(&inverse, &truth, 5 * 13 + 6);
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    }
}
