//! 3×3 convolutions, sixteen tiles at a time: forward transform, products, inverse transform and epilogue.

use std::ops::Range;

use super::epilogue::{ConvOutput, Epilogue};
use super::feature_map::{MapPlane, MapView};
use super::pack::{ConvAlgorithm, PackedConv};
use super::simd::{Block, Kernel, LANES, Simd, TargetIsa};
use super::tiles::{OutputPart, TilePlace, Tiles};
use super::winograd::{TileTransform, Upsample, UpsampleAdjoint, WinogradF2, WinogradF4};

/// Tiles that are computed together.
pub const TILES: usize = 16;
/// Blocks from one frequency's products to the next's. One more than needed, so that they do not share cache sets.
pub const PRODUCT_STRIDE: usize = TILES + 1;
/// Blocks that weights are prefetched ahead: each is read once per round of tiles, and most are not in the cache.
const AHEAD: usize = 32;
/// The most channel blocks of output that are multiplied together, where there are few tiles.
const GROUP: usize = 4;

/// One thread's buffers for the transforms of one round of tiles.
#[derive(Debug, Default)]
pub struct ConvBuffers {
    /// Transformed input: `[frequency][channel block][tile]`, and one unused block between frequencies.
    pub input: Vec<Block>,
    /// Products: `[channel block][frequency][tile]`, and one unused block between frequencies.
    pub products: Vec<Block>,
}

impl ConvBuffers {
    /// Buffers for any of the convolutions, and for 1×1 convolutions of as many channels.
    pub fn new<'a>(convs: impl Iterator<Item = &'a PackedConv>) -> ConvBuffers {
        let (mut input, mut products) = (0, 0);
        for conv in convs {
            let frequencies = conv.algorithm.frequencies();
            input = input.max(frequencies * input_stride(conv.in_blocks));
            let blocks = (GROUP * frequencies)
                .max(conv.in_blocks)
                .max(conv.out_blocks);
            products = products.max(blocks * PRODUCT_STRIDE);
        }
        ConvBuffers {
            input: vec![Block::ZERO; input],
            products: vec![Block::ZERO; products],
        }
    }
}

/// Blocks from one frequency of the transformed input to the next.
fn input_stride(channel_blocks: usize) -> usize {
    channel_blocks * TILES + 1
}

/// A part of a convolution's result to be made.
pub struct ConvWork<'a> {
    pub part: OutputPart,
    pub x: MapView<'a>,
    pub output: ConvOutput<'a>,
}

impl PackedConv {
    /// Makes a part of the result on this thread.
    pub fn run_part(&self, target: TargetIsa, buffers: &mut ConvBuffers, work: ConvWork) {
        let ConvWork {
            part: OutputPart { tiles, blocks },
            x,
            mut output,
        } = work;
        let frequencies = self.algorithm.frequencies();
        let end = tiles.first + tiles.count;
        for first in (tiles.first..end).step_by(TILES) {
            let round = Tiles {
                side: tiles.side,
                first,
                count: TILES.min(end - first),
            };
            target.run(ForwardTransform {
                conv: self,
                tiles: round,
                x,
                to: &mut buffers.input,
            });
            // Few tiles do not fill the registers; several channel blocks do.
            let group = match round.count {
                0..=4 => GROUP,
                5..=8 => 2,
                _ => 1,
            };
            for block in blocks.clone().step_by(group) {
                let blocks = block..(block + group).min(blocks.end);
                target.run(Multiply {
                    input: &buffers.input,
                    depth: self.in_blocks,
                    weights: self.weights(blocks.clone()),
                    frequencies,
                    count: round.count,
                    products: &mut buffers.products,
                });
                target.run(InverseTransform {
                    conv: self,
                    tiles: round,
                    blocks,
                    products: &buffers.products,
                    output: &mut output,
                });
            }
        }
    }
}

/// Tiles to frequencies.
struct ForwardTransform<'a> {
    conv: &'a PackedConv,
    tiles: Tiles,
    x: MapView<'a>,
    to: &'a mut [Block],
}

impl Kernel for ForwardTransform<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        match self.conv.algorithm {
            ConvAlgorithm::WinogradF4 => self.tiles::<S, WinogradF4, 6, 6, 4>(s),
            ConvAlgorithm::WinogradF2 => self.tiles::<S, WinogradF2, 4, 4, 2>(s),
            ConvAlgorithm::Upsample => self.tiles::<S, Upsample, 3, 3, 2>(s),
            ConvAlgorithm::UpsampleAdjoint => self.tiles::<S, UpsampleAdjoint, 4, 3, 1>(s),
        }
    }
}

impl ForwardTransform<'_> {
    #[inline(always)]
    fn tiles<S: Simd, T, const I: usize, const F: usize, const O: usize>(self, s: S)
    where
        T: TileTransform<I, F, O>,
    {
        let (map, stride) = (self.x.map, self.x.map.stride());
        let apart = input_stride(self.conv.in_blocks);
        for tile in 0..self.tiles.count {
            let TilePlace { image, row, column } = self.tiles.place(tile);
            for block in 0..self.conv.in_blocks {
                let plane = MapPlane {
                    image,
                    block: self.x.first + block,
                };
                let start = map.index(plane, row * T::STEP, column * T::STEP);
                let mut rows = [&[Block::ZERO; I]; I];
                for (r, row) in rows.iter_mut().enumerate() {
                    *row = chunk(&map.cells, start + r * stride);
                }
                let mut half = [[s.splat(0.0); I]; F];
                for c in 0..I {
                    let mut cells = [s.splat(0.0); I];
                    for (cell, row) in cells.iter_mut().zip(rows) {
                        *cell = s.load(&row[c]);
                    }
                    let cells = T::forward(s, cells);
                    for f in 0..F {
                        half[f][c] = cells[f];
                    }
                }
                let mut to = self.to[block * TILES + tile..].chunks_mut(apart);
                for cells in half {
                    for x in T::forward(s, cells) {
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

/// Frequencies of the input times those of the weights, summed over the channels of the input.
pub struct Multiply<'a> {
    /// See [`ConvBuffers::input`].
    pub input: &'a [Block],
    /// Channel blocks of the input.
    pub depth: usize,
    /// `[channel block of the output][frequency][channel of the input]`.
    pub weights: &'a [Block],
    pub frequencies: usize,
    /// Tiles in use; the products of the others have no meaning.
    pub count: usize,
    /// See [`ConvBuffers::products`].
    pub products: &'a mut [Block],
}

impl Kernel for Multiply<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let channels = self.depth * LANES;
        let apart = input_stride(self.depth);
        let blocks = self.weights.len() / (self.frequencies * channels);
        for f in 0..self.frequencies {
            let input = &self.input[f * apart..][..self.depth * TILES];
            let weights = |block: usize| {
                &self.weights[(block * self.frequencies + f) * channels..][..channels]
            };
            let mut products = Products {
                blocks: self.products,
                first: f * PRODUCT_STRIDE,
                apart: self.frequencies * PRODUCT_STRIDE,
            };
            if S::ROWS >= 16 && self.count <= 4 && blocks == 4 {
                let weights = [weights(0), weights(1), weights(2), weights(3)];
                product::<S, 4, 4>(s, input, weights, 0, &mut products);
            } else if S::ROWS >= 16 && self.count <= 8 && blocks == 2 {
                product::<S, 8, 2>(s, input, [weights(0), weights(1)], 0, &mut products);
            } else {
                for block in 0..blocks {
                    rows(s, input, weights(block), self.count, &mut products);
                    products.first += products.apart;
                }
            }
        }
    }
}

/// Where the products of one frequency go.
struct Products<'a> {
    blocks: &'a mut [Block],
    /// Index of the first channel block's products.
    first: usize,
    /// Blocks from one channel block's products to the next's.
    apart: usize,
}

/// Multiplies all tiles of one frequency and channel block, as many at a time as the registers hold.
#[inline(always)]
fn rows<S: Simd>(s: S, input: &[Block], weights: &[Block], count: usize, products: &mut Products) {
    let mut row = 0;
    while row < count {
        let left = count - row;
        if S::ROWS >= 16 && left > 8 {
            product::<S, 16, 1>(s, input, [weights], row, products);
            row += 16;
        } else if S::ROWS >= 16 && left > 4 {
            product::<S, 8, 1>(s, input, [weights], row, products);
            row += 8;
        } else if S::ROWS >= 6 && S::ROWS < 16 && left > 4 {
            product::<S, 6, 1>(s, input, [weights], row, products);
            row += 6;
        } else if S::ROWS >= 4 {
            product::<S, 4, 1>(s, input, [weights], row, products);
            row += 4;
        } else {
            product::<S, 2, 1>(s, input, [weights], row, products);
            row += 2;
        }
    }
}

/// Multiplies the `M` tiles from `row` on by `N` channel blocks of weights, summed in registers over all channels.
#[inline(always)]
fn product<S: Simd, const M: usize, const N: usize>(
    s: S,
    input: &[Block],
    weights: [&[Block]; N],
    row: usize,
    products: &mut Products,
) {
    let mut sums = [[s.splat(0.0); M]; N];
    for (block, tiles) in input.as_chunks::<TILES>().0.iter().enumerate() {
        let Some(tiles) = tiles[row..].first_chunk::<M>() else {
            return;
        };
        let mut blocks = [&[Block::ZERO; LANES]; N];
        for n in 0..N {
            blocks[n] = &weights[n].as_chunks::<LANES>().0[block];
        }
        #[allow(clippy::needless_range_loop)] // one k indexes all channel blocks and tiles
        for k in 0..LANES {
            let mut w = [s.splat(0.0); N];
            for n in 0..N {
                w[n] = s.load(&blocks[n][k]);
                s.prefetch(&blocks[n][k], AHEAD);
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

/// Products to cells of the result.
struct InverseTransform<'a, 'b> {
    conv: &'a PackedConv,
    tiles: Tiles,
    /// Channel blocks of the output.
    blocks: Range<usize>,
    products: &'a [Block],
    output: &'a mut ConvOutput<'b>,
}

impl Kernel for InverseTransform<'_, '_> {
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        match self.conv.algorithm {
            ConvAlgorithm::WinogradF4 => self.tiles::<S, WinogradF4, 6, 6, 4>(s),
            ConvAlgorithm::WinogradF2 => self.tiles::<S, WinogradF2, 4, 4, 2>(s),
            ConvAlgorithm::Upsample => self.tiles::<S, Upsample, 3, 3, 2>(s),
            ConvAlgorithm::UpsampleAdjoint => self.tiles::<S, UpsampleAdjoint, 4, 3, 1>(s),
        }
    }
}

impl InverseTransform<'_, '_> {
    #[inline(always)]
    fn tiles<S: Simd, T, const I: usize, const F: usize, const O: usize>(self, s: S)
    where
        T: TileTransform<I, F, O>,
    {
        for (n, block) in self.blocks.enumerate() {
            let products = &self.products[n * F * F * PRODUCT_STRIDE..][..F * F * PRODUCT_STRIDE];
            let bias = s.load(&self.conv.bias[block]);
            for tile in 0..self.tiles.count {
                // This length lets the compiler drop the bounds checks below.
                let products = &products[tile..][..(F * F - 1) * PRODUCT_STRIDE + 1];
                let mut half = [[s.splat(0.0); F]; O];
                for g in 0..F {
                    let mut frequencies = [s.splat(0.0); F];
                    for (f, x) in frequencies.iter_mut().enumerate() {
                        *x = s.load(&products[(f * F + g) * PRODUCT_STRIDE]);
                    }
                    let cells = T::inverse(s, frequencies);
                    for o in 0..O {
                        half[o][g] = cells[o];
                    }
                }
                let TilePlace { image, row, column } = self.tiles.place(tile);
                let ConvOutput { map, epilogue } = &mut *self.output;
                let (plane, stride) = (MapPlane { image, block }, map.stride);
                let start = map.index(plane, row * O + 1, column * O + 1);
                let mut cells = [[s.splat(0.0); O]; O];
                for o in 0..O {
                    cells[o] = T::inverse(s, half[o]);
                }
                match epilogue {
                    Epilogue::Relu | Epilogue::ReluMaxPool(_) => {
                        for cell in cells.iter_mut().flatten() {
                            *cell = s.max(s.add(*cell, bias), s.splat(0.0));
                        }
                    }
                    Epilogue::ReluAdjoint(saved) => {
                        let start = saved.index(plane, row * O + 1, column * O + 1);
                        for (r, cells) in cells.iter_mut().enumerate() {
                            let saved: &[Block; O] = chunk(&saved.cells, start + r * stride);
                            for (cell, by) in cells.iter_mut().zip(saved) {
                                *cell = s.where_positive(*cell, s.load(by));
                            }
                        }
                    }
                    Epilogue::Plain => {}
                }
                for (r, cells) in cells.iter().enumerate() {
                    let to = &mut map.cells[start + r * stride..][..O];
                    for (cell, to) in cells.iter().zip(to) {
                        s.store(*cell, to);
                    }
                }
                if let Epilogue::ReluMaxPool(pooled) = epilogue {
                    let start = pooled.index(plane, row * O / 2 + 1, column * O / 2 + 1);
                    let stride = pooled.stride;
                    for r in 0..O / 2 {
                        for c in 0..O / 2 {
                            let upper = s.max(cells[2 * r][2 * c], cells[2 * r][2 * c + 1]);
                            let lower = s.max(cells[2 * r + 1][2 * c], cells[2 * r + 1][2 * c + 1]);
                            let to = &mut pooled.cells[start + r * stride + c];
                            s.store(s.max(upper, lower), to);
                        }
                    }
                }
            }
        }
    }
}
