//! Reading an image at any place: wrap, filter, decoding.

use crate::input::{SourceImage, Wrap};

/// Samples along one axis of a texel's footprint at most.
const MOST_TAPS: f64 = 8.0;
/// Source texels in a step up to which the image is interpolated instead of averaged.
const MAGNIFIED: f64 = 1.3;

/// An image with what is needed to read it.
pub(crate) struct Sampler<'a> {
    image: SourceImage<'a>,
    wrap: [Wrap; 2],
    /// Decoded red, green and blue, and alpha, for every byte.
    decode: [&'static [f32; 256]; 2],
}

/// A parallelogram in an image that one texel of a raster covers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Footprint {
    sides: [[f64; 2]; 2],
    /// Samples along each side.
    taps: [usize; 2],
}

impl Footprint {
    /// From its sides, in texels of the image.
    pub(crate) fn new(sides: [[f64; 2]; 2]) -> Footprint {
        let taps = sides.map(|v| {
            let length = v[0].hypot(v[1]);
            if length <= MAGNIFIED {
                1
            } else {
                length.min(MOST_TAPS).ceil() as usize
            }
        });
        Footprint { sides, taps }
    }
}

/// The whole number below, as `f64::floor` without a call into the C library.
fn below(x: f64) -> i64 {
    // Beyond this no image can tell places apart, and sums stay in range.
    let x = x.clamp(-1e15, 1e15);
    let whole = x as i64;
    whole - i64::from(x < whole as f64)
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(image: SourceImage<'a>, wrap: [Wrap; 2], srgb: bool) -> Sampler<'a> {
        let tables = crate::srgb::decoders();
        let colour = if srgb { &tables.srgb } else { &tables.linear };
        let decode = [colour, &tables.linear];
        Sampler {
            image,
            wrap,
            decode,
        }
    }

    /// Width and height.
    pub(crate) fn size(&self) -> [f64; 2] {
        [f64::from(self.image.width), f64::from(self.image.height)]
    }

    /// The mean of the image over a footprint around `at`, in texels.
    ///
    /// Where a side is longer than a texel, samples along it are averaged; otherwise the image is interpolated by Catmull–Rom splines, kept
    /// within the range of the four nearest texels.
    pub(crate) fn read(&self, at: [f64; 2], footprint: &Footprint) -> [f32; 4] {
        let Footprint {
            sides: [across, down],
            taps: [columns, rows],
        } = *footprint;
        if columns * rows == 1 {
            return self.cubic(at);
        }
        let mut sum = [0.0f32; 4];
        for r in 0..rows {
            for c in 0..columns {
                let s = (c as f64 + 0.5) / columns as f64 - 0.5;
                let t = (r as f64 + 0.5) / rows as f64 - 0.5;
                let p = [0, 1].map(|k: usize| at[k] + s * across[k] + t * down[k]);
                let sample = self.linear(p);
                (0..4).for_each(|k| sum[k] += sample[k]);
            }
        }
        sum.map(|x| x / (columns * rows) as f32)
    }

    fn linear(&self, p: [f64; 2]) -> [f32; 4] {
        let base = p.map(|x| below(x - 0.5));
        let [s, t] = [0, 1].map(|k: usize| (p[k] - 0.5 - base[k] as f64) as f32);
        let xs = [0, 1].map(|d| self.column(base[0] + d));
        let ys = [0, 1].map(|d| self.row(base[1] + d));
        let mut sum = [0.0; 4];
        for (y, v) in ys.into_iter().zip([1.0 - t, t]) {
            for (x, u) in xs.into_iter().zip([1.0 - s, s]) {
                let texel = self.texel(x, y);
                (0..4).for_each(|k| sum[k] += u * v * texel[k]);
            }
        }
        sum
    }

    fn cubic(&self, p: [f64; 2]) -> [f32; 4] {
        let base = p.map(|x| below(x - 0.5));
        let [u, v] = [0, 1].map(|k: usize| catmull_rom((p[k] - 0.5 - base[k] as f64) as f32));
        let (left, top) = (base[0] - 1, base[1] - 1);
        let (width, height) = (i64::from(self.image.width), i64::from(self.image.height));
        // Wrapping costs more than the sum; most places are not at the image's border.
        let inside = left >= 0 && top >= 0 && left + 4 <= width && top + 4 <= height;
        let row = |j: usize| -> [[u8; 4]; 4] {
            if inside {
                let at = (top as usize + j) * width as usize + left as usize;
                if let Some(row) = self.image.texels[at..].first_chunk() {
                    return *row;
                }
            }
            let y = self.row(top + j as i64);
            std::array::from_fn(|k| {
                let x = self.column(left + k as i64);
                self.image.texels[y * width as usize + x]
            })
        };
        let mut sum = [0.0f32; 4];
        let (mut least, mut most) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        for (j, weight) in v.into_iter().enumerate() {
            let texels = row(j).map(|t| self.decoded(t));
            for k in 0..4 {
                let across = u[0] * texels[0][k]
                    + u[1] * texels[1][k]
                    + u[2] * texels[2][k]
                    + u[3] * texels[3][k];
                sum[k] += weight * across;
            }
            if j == 1 || j == 2 {
                for k in 0..4 {
                    least[k] = least[k].min(texels[1][k].min(texels[2][k]));
                    most[k] = most[k].max(texels[1][k].max(texels[2][k]));
                }
            }
        }
        std::array::from_fn(|k| sum[k].max(least[k]).min(most[k]))
    }

    fn column(&self, x: i64) -> usize {
        wrapped(x, i64::from(self.image.width), self.wrap[0])
    }

    fn row(&self, y: i64) -> usize {
        wrapped(y, i64::from(self.image.height), self.wrap[1])
    }

    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        self.decoded(self.image.texels[y * self.image.width as usize + x])
    }

    #[inline]
    fn decoded(&self, [r, g, b, a]: [u8; 4]) -> [f32; 4] {
        let [colour, alpha] = self.decode;
        [
            colour[r as usize],
            colour[g as usize],
            colour[b as usize],
            alpha[a as usize],
        ]
    }
}

fn wrapped(x: i64, size: i64, wrap: Wrap) -> usize {
    let inside = match wrap {
        Wrap::Repeat => x.rem_euclid(size),
        Wrap::Mirror => {
            let x = x.rem_euclid(2 * size);
            x.min(2 * size - 1 - x)
        }
        Wrap::Clamp => x.clamp(0, size - 1),
    };
    inside as usize
}

/// The weights of four samples around a place between the second (0) and the third (1).
pub(crate) fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_repeats_mirrors_and_clamps() {
        let row = |wrap| (-3..6).map(|x| wrapped(x, 3, wrap)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(row(Wrap::Mirror), [2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 1, 2, 2, 2, 2]);
    }

    #[test]
    fn the_middle_of_a_texel_reads_the_texel_and_a_footprint_its_mean() {
        let texels: Vec<[u8; 4]> = (0..64).map(|k| [(k * 37 % 256) as u8, 5, 9, 255]).collect();
        let image = SourceImage {
            width: 8,
            height: 8,
            texels: &texels,
        };
        let sampler = Sampler::new(image, [Wrap::Repeat; 2], false);
        let one = sampler.read([3.5, 2.5], &Footprint::new([[1.0, 0.0], [0.0, 1.0]]));
        assert!((one[0] * 255.0 - f32::from(texels[19][0])).abs() < 1e-3);
        let mean: f32 = texels.iter().map(|t| f32::from(t[0])).sum::<f32>() / 64.0;
        let all = sampler.read([4.0, 4.0], &Footprint::new([[8.0, 0.0], [0.0, 8.0]]));
        assert!((all[0] * 255.0 - mean).abs() < 1e-2, "{all:?} {mean}");
    }
}
