//! 3×3 convolutions, sixteen tiles at a time: transform in, multiply, transform back, and what follows a convolution while its result
//! is still in registers.

use std::ops::Range;

use super::map::Source;
use super::pack::{Layer, Plan};
use super::scheme::{Down, Four, Scheme, Two, Up};
use super::share::{Finish, Output, Part};
use super::simd::{Block, Kernel, LANES, Simd, Target};

/// Tiles that go through together.
pub const TILES: usize = 16;
/// Blocks from one frequency's products to the next's: one more than needed, so that they do not fall on the same cache sets.
const PRODUCT_STRIDE: usize = TILES + 1;
/// Blocks of weights asked for in advance: they are read once a round and come from far.
const AHEAD: usize = 32;
/// Panels of output multiplied together where there are few tiles, at most.
const GROUP: usize = 4;

/// Room for the transforms of one round of tiles.
#[derive(Debug, Default)]
pub struct Work {
    /// Transformed input: `[frequency][panel][tile]`, and one block of distance between frequencies.
    pub input: Vec<Block>,
    /// Products: `[panel][frequency][tile]`, one block between frequencies.
    pub products: Vec<Block>,
}

impl Work {
    /// Room for these numbers of blocks.
    pub fn new(input: usize, products: usize) -> Work {
        Work {
            input: vec![Block::ZERO; input],
            products: vec![Block::ZERO; products],
        }
    }

    /// Room for any of the layers, and for 1×1 convolutions of as many channels.
    pub fn of<'a>(layers: impl Iterator<Item = &'a Layer>) -> Work {
        let (mut input, mut products) = (0, 0);
        for layer in layers {
            let frequencies = layer.plan.frequencies();
            input = input.max(frequencies * input_stride(layer.from));
            let panels = (GROUP * frequencies).max(layer.from).max(layer.to);
            products = products.max(panels * PRODUCT_STRIDE);
        }
        Work::new(input, products)
    }
}

/// Blocks from one frequency of the transformed input to the next.
fn input_stride(panels: usize) -> usize {
    panels * TILES + 1
}

impl Layer {
    /// Makes a part of the result on this thread.
    pub(super) fn make(
        &self,
        (target, work): (Target, &mut Work),
        (part, tiles): (Part, Tiles),
        x: Source,
        mut output: Output,
    ) {
        let frequencies = self.plan.frequencies();
        for first in part.tiles.clone().step_by(TILES) {
            let round = Tiles {
                first,
                count: TILES.min(part.tiles.end - first),
                ..tiles
            };
            target.run(Enter {
                layer: self,
                tiles: round,
                x: &x,
                to: &mut work.input,
            });
            // Few tiles do not fill the registers: more panels do.
            let group = match round.count {
                0..=4 => GROUP,
                5..=8 => 2,
                _ => 1,
            };
            for panel in part.panels.clone().step_by(group) {
                let panels = panel..(panel + group).min(part.panels.end);
                target.run(Multiply {
                    input: &work.input,
                    depth: self.from,
                    weights: self.panels(panels.clone()),
                    frequencies,
                    count: round.count,
                    products: &mut work.products,
                });
                target.run(Leave {
                    layer: self,
                    tiles: round,
                    panels,
                    products: &work.products,
                    output: &mut output,
                });
            }
        }
    }
}

/// A run of tiles of a batch of square images.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    /// Tiles along a side.
    pub side: usize,
    /// Tiles of all images.
    pub total: usize,
    first: usize,
    count: usize,
}

impl Tiles {
    pub fn new(side: usize, images: usize) -> Tiles {
        Tiles {
            side,
            total: images * side * side,
            first: 0,
            count: 0,
        }
    }

    /// Image, row and column of a tile.
    #[inline(always)]
    fn place(&self, tile: usize) -> [usize; 3] {
        let tile = self.first + tile;
        let (image, inside) = (
            tile / (self.side * self.side),
            tile % (self.side * self.side),
        );
        [image, inside / self.side, inside % self.side]
    }
}

/// Tiles to frequencies.
struct Enter<'a, 'b> {
    layer: &'a Layer,
    tiles: Tiles,
    x: &'a Source<'b>,
    to: &'a mut [Block],
}

impl Kernel for Enter<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        match self.layer.plan {
            Plan::Four => self.tiles::<S, Four, 6, 6, 4>(s),
            Plan::Two => self.tiles::<S, Two, 4, 4, 2>(s),
            Plan::Up => self.tiles::<S, Up, 3, 3, 2>(s),
            Plan::Down => self.tiles::<S, Down, 4, 3, 1>(s),
        }
    }
}

impl Enter<'_, '_> {
    #[inline(always)]
    fn tiles<S: Simd, T, const I: usize, const F: usize, const O: usize>(self, s: S)
    where
        T: Scheme<I, F, O>,
    {
        let (map, stride) = (self.x.map, self.x.map.stride());
        let apart = input_stride(self.layer.from);
        for tile in 0..self.tiles.count {
            let [image, row, column] = self.tiles.place(tile);
            for panel in 0..self.layer.from {
                let start = map.index(
                    [image, self.x.first + panel],
                    [row * T::STEP, column * T::STEP],
                );
                let mut rows = [&[Block::ZERO; I]; I];
                for (r, row) in rows.iter_mut().enumerate() {
                    *row = chunk(&map.blocks, start + r * stride);
                }
                let mut half = [[s.splat(0.0); I]; F];
                for c in 0..I {
                    let mut cells = [s.splat(0.0); I];
                    for (cell, row) in cells.iter_mut().zip(rows) {
                        *cell = s.load(&row[c]);
                    }
                    let cells = T::enter(s, cells);
                    for f in 0..F {
                        half[f][c] = cells[f];
                    }
                }
                let mut to = self.to[panel * TILES + tile..].chunks_mut(apart);
                for cells in half {
                    for x in T::enter(s, cells) {
                        if let Some([to, ..]) = to.next() {
                            s.store(x, to);
                        }
                    }
                }
            }
        }
    }
}

/// `N` blocks from `start` on.
#[inline(always)]
fn chunk<const N: usize>(blocks: &[Block], start: usize) -> &[Block; N] {
    let chunk = blocks[start..].first_chunk();
    chunk.unwrap_or(const { &[Block::ZERO; N] })
}

/// Frequencies times weights.
pub struct Multiply<'a> {
    /// As [`Work`]'s.
    pub input: &'a [Block],
    /// Panels of input.
    pub depth: usize,
    /// `[panel][frequency][channel of input]`.
    pub weights: &'a [Block],
    pub frequencies: usize,
    /// Tiles in use; the others' products have no meaning.
    pub count: usize,
    /// As [`Work`]'s.
    pub products: &'a mut [Block],
}

impl Kernel for Multiply<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let channels = self.depth * LANES;
        let apart = input_stride(self.depth);
        let panels = self.weights.len() / (self.frequencies * channels);
        for f in 0..self.frequencies {
            let input = &self.input[f * apart..][..self.depth * TILES];
            let weights = |panel: usize| {
                &self.weights[(panel * self.frequencies + f) * channels..][..channels]
            };
            let mut products = Products {
                blocks: self.products,
                first: f * PRODUCT_STRIDE,
                apart: self.frequencies * PRODUCT_STRIDE,
            };
            if S::ROWS >= 16 && self.count <= 4 && panels == 4 {
                let weights = [weights(0), weights(1), weights(2), weights(3)];
                product::<S, 4, 4>(s, input, weights, (0, &mut products));
            } else if S::ROWS >= 16 && self.count <= 8 && panels == 2 {
                product::<S, 8, 2>(s, input, [weights(0), weights(1)], (0, &mut products));
            } else {
                for panel in 0..panels {
                    rows(s, input, weights(panel), self.count, &mut products);
                    products.first += products.apart;
                }
            }
        }
    }
}

/// Where products go: a frequency's in the first of some panels.
struct Products<'a> {
    blocks: &'a mut [Block],
    first: usize,
    apart: usize,
}

/// All tiles of one frequency and panel, as many rows at a time as the registers hold.
#[inline(always)]
fn rows<S: Simd>(s: S, input: &[Block], weights: &[Block], count: usize, products: &mut Products) {
    let mut row = 0;
    while row < count {
        let left = count - row;
        if S::ROWS >= 16 && left > 8 {
            product::<S, 16, 1>(s, input, [weights], (row, products));
            row += 16;
        } else if S::ROWS >= 16 && left > 4 {
            product::<S, 8, 1>(s, input, [weights], (row, products));
            row += 8;
        } else if S::ROWS >= 6 && S::ROWS < 16 && left > 4 {
            product::<S, 6, 1>(s, input, [weights], (row, products));
            row += 6;
        } else if S::ROWS >= 4 {
            product::<S, 4, 1>(s, input, [weights], (row, products));
            row += 4;
        } else {
            product::<S, 2, 1>(s, input, [weights], (row, products));
            row += 2;
        }
    }
}

/// `M` rows of input times `N` panels of weights, summed in registers over all channels.
#[inline(always)]
fn product<S: Simd, const M: usize, const N: usize>(
    s: S,
    input: &[Block],
    weights: [&[Block]; N],
    (row, products): (usize, &mut Products),
) {
    let mut sums = [[s.splat(0.0); M]; N];
    for (panel, tiles) in input.as_chunks::<TILES>().0.iter().enumerate() {
        let Some(tiles) = tiles[row..].first_chunk::<M>() else {
            return;
        };
        let mut panels = [&[Block::ZERO; LANES]; N];
        for n in 0..N {
            panels[n] = &weights[n].as_chunks::<LANES>().0[panel];
        }
        #[allow(clippy::needless_range_loop)] // one k, all panels and tiles: said with indices
        for k in 0..LANES {
            let mut w = [s.splat(0.0); N];
            for n in 0..N {
                w[n] = s.load(&panels[n][k]);
                s.prefetch(&panels[n][k], AHEAD);
            }
            for m in 0..M {
                let x = s.splat(tiles[m].0[k]);
                for n in 0..N {
                    sums[n][m] = s.mul_add(x, w[n], sums[n][m]);
                }
            }
        }
    }
    for (n, sums) in sums.into_iter().enumerate() {
        let start = products.first + n * products.apart + row;
        if let Some(to) = products.blocks[start..].first_chunk_mut::<M>() {
            for (to, sum) in to.iter_mut().zip(sums) {
                s.store(sum, to);
            }
        }
    }
}

/// Frequencies to cells.
struct Leave<'a, 'b> {
    layer: &'a Layer,
    tiles: Tiles,
    panels: Range<usize>,
    products: &'a [Block],
    output: &'a mut Output<'b>,
}

impl Kernel for Leave<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        match self.layer.plan {
            Plan::Four => self.tiles::<S, Four, 6, 6, 4>(s),
            Plan::Two => self.tiles::<S, Two, 4, 4, 2>(s),
            Plan::Up => self.tiles::<S, Up, 3, 3, 2>(s),
            Plan::Down => self.tiles::<S, Down, 4, 3, 1>(s),
        }
    }
}

impl Leave<'_, '_> {
    #[inline(always)]
    fn tiles<S: Simd, T, const I: usize, const F: usize, const O: usize>(self, s: S)
    where
        T: Scheme<I, F, O>,
    {
        for (n, panel) in self.panels.enumerate() {
            let products = &self.products[n * F * F * PRODUCT_STRIDE..][..F * F * PRODUCT_STRIDE];
            let bias = s.load(&self.layer.bias[panel]);
            for tile in 0..self.tiles.count {
                // Its length lets the compiler see that all indices below are inside.
                let products = &products[tile..][..(F * F - 1) * PRODUCT_STRIDE + 1];
                let mut half = [[s.splat(0.0); F]; O];
                for g in 0..F {
                    let mut frequencies = [s.splat(0.0); F];
                    for (f, x) in frequencies.iter_mut().enumerate() {
                        *x = s.load(&products[(f * F + g) * PRODUCT_STRIDE]);
                    }
                    let cells = T::leave(s, frequencies);
                    for o in 0..O {
                        half[o][g] = cells[o];
                    }
                }
                let [image, row, column] = self.tiles.place(tile);
                let Output { y, finish } = &mut *self.output;
                let stride = y.stride;
                let start = y.index([image, panel], [row * O + 1, column * O + 1]);
                let mut cells = [[s.splat(0.0); O]; O];
                for o in 0..O {
                    cells[o] = T::leave(s, half[o]);
                }
                match finish {
                    Finish::Relu | Finish::ReluPool(_) => {
                        for cell in cells.iter_mut().flatten() {
                            *cell = s.max(s.add(*cell, bias), s.splat(0.0));
                        }
                    }
                    Finish::Gate(saved) => {
                        let start = saved.index([image, panel], [row * O + 1, column * O + 1]);
                        for (r, cells) in cells.iter_mut().enumerate() {
                            let saved: &[Block; O] = chunk(&saved.blocks, start + r * stride);
                            for (cell, by) in cells.iter_mut().zip(saved) {
                                *cell = s.gate(*cell, s.load(by));
                            }
                        }
                    }
                    Finish::Plain => {}
                }
                for (r, cells) in cells.iter().enumerate() {
                    let to = &mut y.blocks[start + r * stride..][..O];
                    for (cell, to) in cells.iter().zip(to) {
                        s.store(*cell, to);
                    }
                }
                if let Finish::ReluPool(pooled) = finish {
                    let corner = [row * O / 2 + 1, column * O / 2 + 1];
                    let start = pooled.index([image, panel], corner);
                    let stride = pooled.stride;
                    for r in 0..O / 2 {
                        for c in 0..O / 2 {
                            let upper = s.max(cells[2 * r][2 * c], cells[2 * r][2 * c + 1]);
                            let lower = s.max(cells[2 * r + 1][2 * c], cells[2 * r + 1][2 * c + 1]);
                            let to = &mut pooled.blocks[start + r * stride + c];
                            s.store(s.max(upper, lower), to);
                        }
                    }
                }
            }
        }
    }
}
