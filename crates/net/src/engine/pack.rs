//! Fused weights laid out for the kernels: transformed to the frequencies of their algorithm, in the order in which the products read them.

use std::ops::Range;

use super::feature_map::channel_blocks;
use super::fuse::FusedConv;
use super::simd::{Block, LANES};
use super::winograd::{TileTransform, Upsample, UpsampleAdjoint, WinogradF2, WinogradF4};

/// The algorithm of a 3×3 convolution; see [`super::winograd`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConvAlgorithm {
    WinogradF4,
    WinogradF2,
    Upsample,
    UpsampleAdjoint,
}

impl ConvAlgorithm {
    /// The faster one for images of this side.
    pub fn for_side(side: usize) -> ConvAlgorithm {
        if side >= 16 {
            ConvAlgorithm::WinogradF4
        } else {
            ConvAlgorithm::WinogradF2
        }
    }

    /// Input cells from a tile to the next.
    pub fn step(self) -> usize {
        match self {
            ConvAlgorithm::WinogradF4 => WinogradF4::STEP,
            ConvAlgorithm::WinogradF2 => WinogradF2::STEP,
            ConvAlgorithm::Upsample => Upsample::STEP,
            ConvAlgorithm::UpsampleAdjoint => UpsampleAdjoint::STEP,
        }
    }

    /// Output cells along a tile's side.
    pub fn tile_side(self) -> usize {
        match self {
            ConvAlgorithm::WinogradF4 => 4,
            ConvAlgorithm::WinogradF2 | ConvAlgorithm::Upsample => 2,
            ConvAlgorithm::UpsampleAdjoint => 1,
        }
    }

    /// Products for one tile.
    pub fn frequencies(self) -> usize {
        match self {
            ConvAlgorithm::WinogradF4 => 36,
            ConvAlgorithm::WinogradF2 => 16,
            ConvAlgorithm::Upsample | ConvAlgorithm::UpsampleAdjoint => 9,
        }
    }
}

/// Where channels lie in channel blocks: in runs of so many channels, each of which begins a channel block.
#[derive(Debug, Clone, Copy)]
pub struct ChannelRuns(pub usize);

impl ChannelRuns {
    /// The lane of a channel, counted through all channel blocks.
    pub fn slot(self, channel: usize) -> usize {
        channel / self.0 * channel_blocks(self.0) * LANES + channel % self.0
    }

    /// Channel blocks that so many channels take.
    pub fn blocks(self, channels: usize) -> usize {
        channels.div_ceil(self.0) * channel_blocks(self.0)
    }
}

/// Where the channels of a convolution lie.
#[derive(Debug, Clone, Copy)]
pub struct ConvLayout {
    pub input: ChannelRuns,
    pub output: ChannelRuns,
}

/// The layout of a convolution with runs of these lengths.
pub fn layout(input: usize, output: usize) -> ConvLayout {
    ConvLayout {
        input: ChannelRuns(input),
        output: ChannelRuns(output),
    }
}

/// A 3×3 convolution, laid out for the kernels.
#[derive(Debug, Clone)]
pub struct PackedConv {
    pub algorithm: ConvAlgorithm,
    /// Channel blocks of the input.
    pub in_blocks: usize,
    /// Channel blocks of the output.
    pub out_blocks: usize,
    /// By channel block of the output.
    pub bias: Vec<Block>,
    /// `[channel block of the output][frequency][channel of the input]`; each block holds 16 output channels.
    weights: Vec<Block>,
}

impl PackedConv {
    /// Transforms and lays out a fused 3×3 convolution.
    pub fn pack(algorithm: ConvAlgorithm, conv: &FusedConv, layout: ConvLayout) -> PackedConv {
        let ConvLayout { input, output } = layout;
        let (in_blocks, out_blocks) = (
            input.blocks(conv.in_channels),
            output.blocks(conv.out_channels),
        );
        let frequencies = algorithm.frequencies();
        let channels = in_blocks * LANES;
        let mut weights = vec![Block::ZERO; out_blocks * frequencies * channels];
        for n in 0..conv.out_channels {
            let (block, lane) = (output.slot(n) / LANES, output.slot(n) % LANES);
            for k in 0..conv.in_channels {
                let slot = input.slot(k);
                let kernel = &conv.kernel[(n * conv.in_channels + k) * 9..][..9];
                let mut put = |f: usize, w: f64| {
                    weights[(block * frequencies + f) * channels + slot].0[lane] = w as f32;
                };
                match algorithm {
                    ConvAlgorithm::WinogradF4 => {
                        transform::<WinogradF4, 6, 6, 4>(kernel, &mut put);
                    }
                    ConvAlgorithm::WinogradF2 => {
                        transform::<WinogradF2, 4, 4, 2>(kernel, &mut put);
                    }
                    ConvAlgorithm::Upsample => transform::<Upsample, 3, 3, 2>(kernel, &mut put),
                    ConvAlgorithm::UpsampleAdjoint => {
                        transform::<UpsampleAdjoint, 4, 3, 1>(kernel, &mut put);
                    }
                }
            }
        }
        PackedConv {
            algorithm,
            in_blocks,
            out_blocks,
            bias: pack_vector(&conv.bias, output),
            weights,
        }
    }

    /// The weights of some channel blocks of the output.
    pub fn weights(&self, blocks: Range<usize>) -> &[Block] {
        let one = self.algorithm.frequencies() * self.in_blocks * LANES;
        &self.weights[blocks.start * one..blocks.end * one]
    }
}

/// Gives `put` a kernel's frequencies along both axes, by index.
fn transform<T, const I: usize, const F: usize, const O: usize>(
    kernel: &[f32],
    put: &mut impl FnMut(usize, f64),
) where
    T: TileTransform<I, F, O>,
{
    let row = |r: usize| T::kernel([0, 1, 2].map(|c| f64::from(kernel[3 * r + c])));
    let rows = [row(0), row(1), row(2)];
    for g in 0..F {
        let column = T::kernel(rows.map(|row| row[g]));
        for (f, w) in column.into_iter().enumerate() {
            put(f * F + g, w);
        }
    }
}

/// A 1×1 convolution's weights, laid out for the kernels: `[channel block of the output][channel of the input]`.
pub fn pack_matrix(conv: &FusedConv, layout: ConvLayout) -> Vec<Block> {
    let ConvLayout { input, output } = layout;
    let channels = input.blocks(conv.in_channels) * LANES;
    let mut weights = vec![Block::ZERO; output.blocks(conv.out_channels) * channels];
    for n in 0..conv.out_channels {
        for k in 0..conv.in_channels {
            let (block, lane) = (output.slot(n) / LANES, output.slot(n) % LANES);
            weights[block * channels + input.slot(k)].0[lane] =
                conv.kernel[n * conv.in_channels + k];
        }
    }
    weights
}

/// Values of channels by channel block; lanes without a channel are zero.
pub fn pack_vector(values: &[f32], runs: ChannelRuns) -> Vec<Block> {
    let mut blocks = vec![Block::ZERO; runs.blocks(values.len())];
    for (channel, x) in values.iter().enumerate() {
        let slot = runs.slot(channel);
        blocks[slot / LANES].0[slot % LANES] = *x;
    }
    blocks
}
