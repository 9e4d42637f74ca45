//! Tiles of a batch of square images, and parts of a convolution's result.

use std::ops::Range;

/// A run of tiles, counted through all images row by row.
#[derive(Clone, Copy)]
pub struct Tiles {
    /// Tiles along a side of an image.
    pub side: usize,
    /// The first tile of the run.
    pub first: usize,
    /// Tiles of the run.
    pub count: usize,
}

/// Where a tile lies, in tiles.
pub struct TilePlace {
    pub image: usize,
    pub row: usize,
    pub column: usize,
}

impl Tiles {
    /// All tiles of some images with so many tiles along a side.
    pub fn all(side: usize, images: usize) -> Tiles {
        Tiles {
            side,
            first: 0,
            count: images * side * side,
        }
    }

    /// The place of a tile of the run.
    #[inline(always)]
    pub fn place(&self, tile: usize) -> TilePlace {
        let tile = self.first + tile;
        let area = self.side * self.side;
        let (image, inside) = (tile / area, tile % area);
        TilePlace {
            image,
            row: inside / self.side,
            column: inside % self.side,
        }
    }
}

/// A part of a convolution's result.
#[derive(Clone)]
pub struct OutputPart {
    pub tiles: Tiles,
    /// Channel blocks.
    pub blocks: Range<usize>,
}

impl OutputPart {
    /// Cuts the part in two, of which the first has about `share` ÷ `of`; `None` where it is too small.
    ///
    /// It cuts between channel blocks, or between rows of tiles where there is only one channel block, so that each part is contiguous in
    /// the memory of a single image.
    pub fn cut(&self, share: usize, of: usize) -> Option<[OutputPart; 2]> {
        let (mut low, mut high) = (self.clone(), self.clone());
        let (blocks, rows) = (self.blocks.len(), self.tiles.count / self.tiles.side);
        if blocks > 1 {
            low.blocks.end = self.blocks.start + (blocks * share / of).max(1);
            high.blocks.start = low.blocks.end;
        } else if rows > 1 {
            low.tiles.count = (rows * share / of).max(1) * self.tiles.side;
            high.tiles.first += low.tiles.count;
            high.tiles.count -= low.tiles.count;
        } else {
            return None;
        }
        Some([low, high])
    }
}
