//! Feature maps: square images of channel blocks, with a border of zeros one cell wide.
//!
//! A channel block is sixteen consecutive channels; one cell of it is a [`Block`].

use super::simd::{Block, LANES};
use darn_geometry::grid::SIDE;

/// Channel blocks that so many channels take.
pub fn channel_blocks(channels: usize) -> usize {
    channels.div_ceil(LANES)
}

/// Cells along a side of the maps of a level; level 0 is the finest.
pub fn level_side(level: usize) -> usize {
    SIDE >> level
}

/// One channel block of one image.
#[derive(Debug, Clone, Copy)]
pub struct MapPlane {
    pub image: usize,
    pub block: usize,
}

/// `[image][channel block][side + 2][side + 2]` blocks. The border stays zero: nothing writes there.
#[derive(Debug, Default)]
pub struct FeatureMap {
    pub cells: Vec<Block>,
    pub channel_blocks: usize,
    pub side: usize,
}

impl FeatureMap {
    /// A map of zeros.
    pub fn new(images: usize, channel_blocks: usize, side: usize) -> FeatureMap {
        FeatureMap {
            cells: vec![Block::ZERO; images * channel_blocks * (side + 2) * (side + 2)],
            channel_blocks,
            side,
        }
    }

    /// Images that the map can hold.
    pub fn images(&self) -> usize {
        self.cells.len() / (self.channel_blocks * self.stride() * self.stride()).max(1)
    }

    /// Distance in `cells` from a cell to the one below it.
    pub fn stride(&self) -> usize {
        self.side + 2
    }

    /// Index in `cells`; row 0 and column 0 are the border.
    #[inline(always)]
    pub fn index(&self, plane: MapPlane, row: usize, column: usize) -> usize {
        let stride = self.stride();
        ((plane.image * self.channel_blocks + plane.block) * stride + row) * stride + column
    }

    /// All channel blocks, for reading.
    pub fn view(&self) -> MapView<'_> {
        self.view_from(0)
    }

    /// The channel blocks from `first` on, for reading.
    pub fn view_from(&self, first: usize) -> MapView<'_> {
        MapView { map: self, first }
    }

    /// All channel blocks, for writing.
    pub fn view_mut(&mut self) -> MapViewMut<'_> {
        self.view_mut_from(0)
    }

    /// The channel blocks from `first` on, for writing.
    pub fn view_mut_from(&mut self, first: usize) -> MapViewMut<'_> {
        MapViewMut {
            channel_blocks: self.channel_blocks,
            stride: self.stride(),
            cells: &mut self.cells,
            begin: 0,
            first,
        }
    }

    /// One row of cells without the border; row 0 is the first inside it.
    #[inline(always)]
    pub fn row(&self, plane: MapPlane, row: usize) -> &[Block] {
        let start = self.index(plane, row + 1, 1);
        &self.cells[start..start + self.side]
    }

    /// One row of cells without the border; row 0 is the first inside it.
    #[inline(always)]
    pub fn row_mut(&mut self, plane: MapPlane, row: usize) -> &mut [Block] {
        let start = self.index(plane, row + 1, 1);
        let side = self.side;
        &mut self.cells[start..start + side]
    }
}

/// The channel blocks of a map from `first` on, for reading.
#[derive(Clone, Copy)]
pub struct MapView<'a> {
    pub map: &'a FeatureMap,
    pub first: usize,
}

/// The channel blocks of a map from `first` on, or one contiguous piece of them, for writing; threads write disjoint pieces of one map.
pub struct MapViewMut<'a> {
    channel_blocks: usize,
    pub stride: usize,
    /// The map's cells from `begin` on.
    pub cells: &'a mut [Block],
    begin: usize,
    first: usize,
}

impl<'a> MapViewMut<'a> {
    /// As [`FeatureMap::index`], with channel blocks counted from the view's first.
    #[inline(always)]
    pub fn index(&self, plane: MapPlane, row: usize, column: usize) -> usize {
        let MapPlane { image, block } = plane;
        let plane = image * self.channel_blocks + self.first + block;
        (plane * self.stride + row) * self.stride + column - self.begin
    }

    /// The cells before a row of a channel block of the first image, and the rest.
    pub fn split(self, block: usize, row: usize) -> (MapViewMut<'a>, MapViewMut<'a>) {
        let at = self.index(MapPlane { image: 0, block }, row, 0);
        let (before, after) = self.cells.split_at_mut(at);
        let part = |cells, begin| MapViewMut {
            cells,
            begin,
            ..self
        };
        (part(before, self.begin), part(after, self.begin + at))
    }
}
