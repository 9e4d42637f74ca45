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

    /// All panels, to be read.
    pub fn all(&self) -> Source<'_> {
        self.from(0)
    }

    /// The panels from `first` on, to be read.
    pub fn from(&self, first: usize) -> Source<'_> {
        Source { map: self, first }
    }

    /// All panels, to be written.
    pub fn whole(&mut self) -> Sink<'_> {
        self.upper(0)
    }

    /// The panels from `first` on, to be written.
    pub fn upper(&mut self, first: usize) -> Sink<'_> {
        Sink {
            panels: self.panels,
            stride: self.stride(),
            blocks: &mut self.blocks,
            begin: 0,
            first,
        }
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

/// The panels of a map from `first` on.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    pub map: &'a Map,
    pub first: usize,
}

/// The panels of a map from `first` on, or a stretch of them: parts of one map can be written by several threads.
pub struct Sink<'a> {
    panels: usize,
    pub stride: usize,
    /// The map's blocks from `begin` on.
    pub blocks: &'a mut [Block],
    begin: usize,
    first: usize,
}

impl<'a> Sink<'a> {
    /// Index in `blocks` of a cell of the panel so many after the first; as [`Map::index`].
    #[inline(always)]
    pub fn index(&self, [image, panel]: [usize; 2], [row, column]: [usize; 2]) -> usize {
        let plane = image * self.panels + self.first + panel;
        (plane * self.stride + row) * self.stride + column - self.begin
    }

    /// What lies before a row of a panel of the first image, and the rest.
    pub fn split(self, panel: usize, row: usize) -> (Sink<'a>, Sink<'a>) {
        let at = self.index([0, panel], [row, 0]);
        let (before, after) = self.blocks.split_at_mut(at);
        let part = |blocks, begin| Sink {
            blocks,
            begin,
            ..self
        };
        (part(before, self.begin), part(after, self.begin + at))
    }
}
