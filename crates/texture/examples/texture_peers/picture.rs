//! Pictures with holes.

use darn_texture::testset::ClothRaster;

/// Red, green and blue from 0 to 1.
pub type Colour = [f32; 3];

/// A picture with a hole. Texels that are neither known nor in the hole do not count.
#[derive(Clone)]
pub struct Picture {
    pub width: usize,
    pub colours: Vec<Colour>,
    pub known: Vec<bool>,
    pub hole: Vec<bool>,
}

/// A deterministic sequence of numbers (xorshift).
pub struct Random(pub u64);

impl Random {
    /// A number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end.max(1)
    }
}

/// Squared distance of two colours.
pub fn distance(a: Colour, b: Colour) -> f32 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

impl Picture {
    pub fn new(raster: &ClothRaster) -> Picture {
        let known: Vec<bool> = (raster.known.iter().zip(&raster.hole))
            .map(|(known, hole)| *known && !*hole)
            .collect();
        Picture {
            width: raster.width,
            colours: (raster.texels.iter())
                .map(|t| [0, 1, 2].map(|k: usize| f32::from(t[k]) / 255.0))
                .collect(),
            known,
            hole: raster.hole.clone(),
        }
    }

    pub fn height(&self) -> usize {
        self.hole.len() / self.width
    }

    pub fn texels(&self) -> Vec<[u8; 4]> {
        let byte = |x: f32| (255.0 * x.clamp(0.0, 1.0) + 0.5) as u8;
        (self.colours.iter())
            .map(|[r, g, b]| [byte(*r), byte(*g), byte(*b), 255])
            .collect()
    }

    /// Whether each texel is the middle of a square, `reach` texels to each side, that `holds` everywhere.
    pub fn squares(&self, reach: usize, holds: impl Fn(usize) -> bool) -> Vec<bool> {
        let (width, height) = (self.width, self.height());
        let across = width + 1;
        let mut table = vec![0u32; across * (height + 1)];
        for at in 0..self.hole.len() {
            let (x, y) = (at % width, at / width);
            table[(y + 1) * across + x + 1] =
                u32::from(holds(at)) + table[y * across + x + 1] + table[(y + 1) * across + x]
                    - table[y * across + x];
        }
        (0..self.hole.len())
            .map(|at| {
                let (x, y) = (at % width, at / width);
                if x < reach || y < reach || x + reach >= width || y + reach >= height {
                    return false;
                }
                let corner = |x: usize, y: usize| table[y * across + x];
                let sum = corner(x + reach + 1, y + reach + 1) + corner(x - reach, y - reach)
                    - corner(x - reach, y + reach + 1)
                    - corner(x + reach + 1, y - reach);
                sum as usize == (2 * reach + 1) * (2 * reach + 1)
            })
            .collect()
    }

    /// Half of the size. A texel is in the hole when any of its four is.
    pub fn halved(&self) -> Picture {
        let (width, height) = (self.width.div_ceil(2), self.height().div_ceil(2));
        let mut half = Picture {
            width,
            colours: vec![[0.0; 3]; width * height],
            known: vec![false; width * height],
            hole: vec![false; width * height],
        };
        let mut counts = vec![0.0f32; width * height];
        for at in 0..self.hole.len() {
            let cell = at / self.width / 2 * width + at % self.width / 2;
            half.hole[cell] |= self.hole[at];
            if self.known[at] {
                counts[cell] += 1.0;
                (0..3).for_each(|k| half.colours[cell][k] += self.colours[at][k]);
            }
        }
        for (cell, count) in counts.iter().enumerate() {
            half.known[cell] = *count > 0.0 && !half.hole[cell];
            half.colours[cell] = half.colours[cell].map(|x| x / count.max(1.0));
        }
        half
    }
}
