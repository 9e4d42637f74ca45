//! Activations: images of blocks of sixteen channels, each with a border of zeros one cell wide.

use super::simd::{Block, LANES};

/// Channels rounded up to whole panels.
pub fn panels(channels: usize) -> usize {
    channels.div_ceil(LANES)
}

/// `[image][panel][side + 2][side + 2]` blocks. The border is zero for good: nothing writes there.
#[derive(Debug, Default)]
pub struct Map {
    pub blocks: Vec<Block>,
    pub panels: usize,
    pub side: usize,
}

impl Map {
    /// Zeros.
    pub fn new(images: usize, panels: usize, side: usize) -> Map {
        Map {
            blocks: vec![Block::ZERO; images * panels * (side + 2) * (side + 2)],
            panels,
            side,
        }
    }

    /// Images there is room for.
    pub fn images(&self) -> usize {
        self.blocks.len() / (self.panels * self.stride() * self.stride()).max(1)
    }

    /// Blocks from a cell to the one below it.
    pub fn stride(&self) -> usize {
        self.side + 2
    }

    /// Index of a block; rows and columns count from the border, whose own are 0.
    #[inline(always)]
    pub fn index(&self, [image, panel]: [usize; 2], [row, column]: [usize; 2]) -> usize {
        let stride = self.stride();
        ((image * self.panels + panel) * stride + row) * stride + column
    }

    /// One row of cells without its border.
    #[inline(always)]
    pub fn row(&self, plane: [usize; 2], row: usize) -> &[Block] {
        let start = self.index(plane, [row + 1, 1]);
        &self.blocks[start..start + self.side]
    }

    /// One row of cells without its border.
    #[inline(always)]
    pub fn row_mut(&mut self, plane: [usize; 2], row: usize) -> &mut [Block] {
        let start = self.index(plane, [row + 1, 1]);
        let side = self.side;
        &mut self.blocks[start..start + side]
    }
}
