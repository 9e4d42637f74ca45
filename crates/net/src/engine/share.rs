//! What a layer makes, cut into parts for threads: each part is one stretch of its map's memory.

use std::ops::Range;

use super::convolve::{Tiles, Work};
use super::map::{Map, Sink, Source};
use super::pack::Layer;
use super::simd::Target;

/// What follows a convolution.
pub enum Finish<'a> {
    /// Bias and ReLU.
    Relu,
    /// Bias and ReLU, and the largest of every 2×2 cells into another map.
    ReluPool(Sink<'a>),
    /// No bias; zero where the saved activation is zero (the adjoint of a ReLU).
    Gate(&'a Map),
    /// No bias, nothing.
    Plain,
}

/// Where a layer's result goes, and what is done to it on the way.
pub(super) struct Output<'a> {
    pub y: Sink<'a>,
    pub finish: Finish<'a>,
}

impl<'a> Output<'a> {
    /// What lies before a row of cells of a panel of the first image, and the rest.
    fn split(self, panel: usize, row: usize) -> [Output<'a>; 2] {
        let (low, high) = self.y.split(panel, row + 1);
        let (first, second) = match self.finish {
            Finish::Relu => (Finish::Relu, Finish::Relu),
            Finish::ReluPool(pooled) => {
                let (low, high) = pooled.split(panel, row / 2 + 1);
                (Finish::ReluPool(low), Finish::ReluPool(high))
            }
            Finish::Gate(saved) => (Finish::Gate(saved), Finish::Gate(saved)),
            Finish::Plain => (Finish::Plain, Finish::Plain),
        };
        [(low, first), (high, second)].map(|(y, finish)| Output { y, finish })
    }
}

/// A part of a layer's result.
#[derive(Clone)]
pub(super) struct Part {
    /// Tiles, counted through all images.
    pub tiles: Range<usize>,
    pub panels: Range<usize>,
}

impl Part {
    /// In two, the first `share` ÷ `of` of it: between panels, or between rows of `side` tiles where it is of one panel, so that either is
    /// one stretch of memory. None where there is nothing to cut.
    fn cut(&self, side: usize, [share, of]: [usize; 2]) -> Option<[Part; 2]> {
        let (mut low, mut high) = (self.clone(), self.clone());
        let (panels, rows) = (self.panels.len(), self.tiles.len() / side);
        if panels > 1 {
            low.panels.end = self.panels.start + (panels * share / of).max(1);
            high.panels.start = low.panels.end;
        } else if rows > 1 {
            low.tiles.end = self.tiles.start + (rows * share / of).max(1) * side;
            high.tiles.start = low.tiles.end;
        } else {
            return None;
        }
        Some([low, high])
    }
}

impl Layer {
    /// Convolves `images` images; a single one on as many threads as there are works.
    pub fn run(
        &self,
        (target, works): (Target, &mut [Work]),
        images: usize,
        x: Source,
        y: Sink,
        finish: Finish,
    ) {
        let tiles = Tiles::new(x.map.side / self.plan.step(), images);
        let all = Part {
            tiles: 0..tiles.total,
            panels: 0..self.to,
        };
        let works = if images == 1 { works } else { &mut works[..1] };
        self.share((target, works), (all, tiles), x, Output { y, finish });
    }

    /// Makes a part on as many threads as there are works.
    fn share(
        &self,
        (target, works): (Target, &mut [Work]),
        (part, tiles): (Part, Tiles),
        x: Source,
        output: Output,
    ) {
        let (half, of) = (works.len() / 2, works.len());
        let cut = if half > 0 {
            part.cut(tiles.side, [half, of])
        } else {
            None
        };
        match (cut, works) {
            (Some([low, high]), works) => {
                let row = high.tiles.start / tiles.side * self.plan.cells();
                let [before, after] = output.split(high.panels.start, row);
                let (few, others) = works.split_at_mut(half);
                rayon::join(
                    || self.share((target, few), (low, tiles), x, before),
                    || self.share((target, others), (high, tiles), x, after),
                );
            }
            (None, [work, ..]) => self.make((target, work), (part, tiles), x, output),
            (None, []) => {}
        }
    }
}
