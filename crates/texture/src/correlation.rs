//! How well the known cloth agrees with itself, moved by any offset.

use rayon::prelude::*;

use crate::features::Feature;
use crate::fft::{Complex, fast_length, transform};

/// Share of the known texels that must meet known texels for an offset to be judged.
const LEAST_OVERLAP: f32 = 0.04;

/// Mean squared differences of the known cloth with itself at offsets that are multiples of `scale` texels.
pub(crate) struct SelfDifference {
    /// Texels of the raster in a step of an offset.
    pub scale: usize,
    /// Steps to the farthest offset on either side, columns and rows.
    pub reach: [i32; 2],
    /// Columns of the reduced raster.
    pub columns: usize,
    /// The mean features of the reduced raster's cells; `None` where less than half is known.
    pub cells: Vec<Option<Feature>>,
    /// Mean squared distance of the known features to their mean.
    pub variance: f32,
    side: usize,
    sums: Vec<Complex>,
    least: f32,
}

impl SelfDifference {
    /// How much smaller the sum of squared differences is at an offset than at those around it, two steps away.
    pub(crate) fn depth(&self, dx: i32, dy: i32) -> f32 {
        let Some(own) = self.at(dx, dy) else {
            return 0.0;
        };
        let around = [
            [2, 0],
            [-2, 0],
            [0, 2],
            [0, -2],
            [2, 2],
            [-2, 2],
            [2, -2],
            [-2, -2],
        ];
        let others = around
            .into_iter()
            .filter_map(|[x, y]| self.at(dx + x, dy + y));
        let (sum, count) = others.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0f32));
        let overlap = self.sums[self.index(dx, dy)].re;
        (sum / count.max(1.0) - own).max(0.0) * overlap
    }

    /// The offset with the least difference within so many steps of one.
    pub(crate) fn least_around(&self, [dx, dy]: [i32; 2], reach: i32) -> [i32; 2] {
        let all = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| [dx + x, dy + y]));
        let known = all.filter_map(|by| Some((self.at(by[0], by[1])?, by)));
        known
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map_or([dx, dy], |(_, by)| by)
    }

    fn index(&self, dx: i32, dy: i32) -> usize {
        let wrap = |d: i32| d.rem_euclid(self.side as i32) as usize;
        wrap(dy) * self.side + wrap(dx)
    }

    /// The mean squared difference at an offset; `None` where too little cloth meets itself.
    pub(crate) fn at(&self, dx: i32, dy: i32) -> Option<f32> {
        if dx.abs() > self.reach[0] || dy.abs() > self.reach[1] {
            return None;
        }
        let Complex { re: count, im: sum } = self.sums[self.index(dx, dy)];
        (count >= self.least).then(|| (sum / count).max(0.0))
    }
}

/// Σ m(p) m(p + o) |F(p) − F(p + o)|² and Σ m(p) m(p + o) for all offsets o by four Fourier transforms, on the raster reduced to at most `most`
/// texels a side.
pub(crate) fn self_difference(
    features: &[Feature],
    known: &[bool],
    width: usize,
    most: usize,
) -> SelfDifference {
    let height = known.len() / width;
    let scale = width.max(height).div_ceil(most);
    let (columns, rows) = (width.div_ceil(scale), height.div_ceil(scale));
    let side = fast_length(2 * columns.max(rows));
    let (mean, variance) = spread(features, known);
    let cell = |at: usize| -> Option<Feature> {
        let (column, row) = (at % columns, at / columns);
        let (mut sum, mut count) = ([0.0f32; 4], 0);
        for y in row * scale..((row + 1) * scale).min(height) {
            for x in column * scale..((column + 1) * scale).min(width) {
                let at = y * width + x;
                if known[at] {
                    count += 1;
                    (0..4).for_each(|k| sum[k] += features[at][k]);
                }
            }
        }
        (2 * count >= scale * scale).then(|| sum.map(|x| x / count as f32))
    };
    let cells: Vec<Option<Feature>> = (0..columns * rows).into_par_iter().map(cell).collect();
    let empty = vec![Complex::default(); side * side];
    let mut pictures = [empty.clone(), empty.clone(), empty];
    let mut total = 0.0f32;
    for (k, cell) in cells.iter().enumerate() {
        let Some(cell) = cell else { continue };
        // Without the mean, which would only cost precision.
        let f: Feature = std::array::from_fn(|k| cell[k] - mean[k]);
        let at = k / columns * side + k % columns;
        pictures[0][at] = Complex::new(1.0, f.iter().map(|x| x * x).sum());
        pictures[1][at] = Complex::new(f[0], f[1]);
        pictures[2][at] = Complex::new(f[2], f[3]);
        total += 1.0;
    }
    let [mask, first, second] = pictures.map(|picture| transform(picture, side, rows));
    let opposite = |k: usize| {
        let back = |k: usize| (side - k) % side;
        back(k / side) * side + back(k % side)
    };
    let power = |z: &[Complex], k: usize, o: usize| 0.5 * (z[k].norm_sqr() + z[o].norm_sqr());
    // The spectra of mask m and energy e from that of m + i e; the correlations of real pictures that are added to their mirror images have
    // real spectra, so one transform inverts two.
    let spectrum: Vec<Complex> = (0..side * side)
        .into_par_iter()
        .map(|k| {
            let o = opposite(k);
            let m = 0.5 * (mask[k] + mask[o].conj());
            let e = Complex::new(
                0.5 * (mask[k].im + mask[o].im),
                0.5 * (mask[o].re - mask[k].re),
            );
            let both = 2.0 * (m.re * e.re + m.im * e.im);
            let itself = power(&first, k, o) + power(&second, k, o);
            Complex::new(m.norm_sqr(), both - 2.0 * itself)
        })
        .collect();
    let scale_back = 1.0 / (side * side) as f32;
    let mut sums = transform(spectrum, side, side);
    sums.iter_mut().for_each(|s| *s *= scale_back);
    SelfDifference {
        scale,
        reach: [columns as i32 - 1, rows as i32 - 1],
        columns,
        cells,
        variance,
        side,
        sums,
        least: (LEAST_OVERLAP * total).max(16.0),
    }
}

/// The mean of the known features, and their mean squared distance to it.
fn spread(features: &[Feature], known: &[bool]) -> (Feature, f32) {
    let (mut sum, mut squares, mut count) = ([0.0f64; 4], 0.0f64, 0.0f64);
    for (feature, _) in features.iter().zip(known).filter(|(_, known)| **known) {
        for (sum, x) in sum.iter_mut().zip(feature) {
            *sum += f64::from(*x);
            squares += f64::from(*x) * f64::from(*x);
        }
        count += 1.0;
    }
    let mean = sum.map(|x| x / f64::max(count, 1.0));
    let variance = squares / f64::max(count, 1.0) - mean.iter().map(|x| x * x).sum::<f64>();
    (mean.map(|x| x as f32), variance.max(0.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_mean_of_its_definition() {
        let (width, height) = (20, 13);
        let known: Vec<bool> = (0..width * height).map(|k| k % 7 != 3).collect();
        let value = |k: usize, c: usize| {
            if known[k] {
                ((k * (c + 3) * 31) % 17) as f32 / 17.0
            } else {
                0.0
            }
        };
        let features: Vec<Feature> = (0..known.len())
            .map(|k| std::array::from_fn(|c| value(k, c)))
            .collect();
        let fast = self_difference(&features, &known, width, 256);
        for (dx, dy) in [(1, 0), (0, 2), (-5, 3), (7, -4)] {
            let (mut sum, mut count) = (0.0, 0.0);
            for y in 0..height as i32 {
                for x in 0..width as i32 {
                    let (u, v) = (x + dx, y + dy);
                    if u < 0 || v < 0 || u >= width as i32 || v >= height as i32 {
                        continue;
                    }
                    let (p, q) = (
                        y as usize * width + x as usize,
                        v as usize * width + u as usize,
                    );
                    if known[p] && known[q] {
                        count += 1.0;
                        sum += crate::features::distance(features[p], features[q]);
                    }
                }
            }
            let got = fast.at(dx, dy).unwrap();
            assert!((got - sum / count).abs() < 1e-3, "{got} {}", sum / count);
        }
    }
}
