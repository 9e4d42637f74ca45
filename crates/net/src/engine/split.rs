//! Splits the result of a convolution into parts for threads; each part is contiguous in its map's memory.

use super::convolve::{ConvBuffers, ConvWork};
use super::epilogue::ConvOutput;
use super::feature_map::MapView;
use super::pack::PackedConv;
use super::simd::TargetIsa;
use super::tiles::{OutputPart, Tiles};

/// How the convolutions of one pass are computed.
pub struct ConvExec<'a> {
    pub target: TargetIsa,
    /// Images of the pass.
    pub images: usize,
    /// One per thread.
    pub buffers: &'a mut [ConvBuffers],
}

impl ConvExec<'_> {
    /// The buffers to use: a single image is split among all threads, more images are computed on this one.
    pub fn active(&mut self) -> &mut [ConvBuffers] {
        match self.images {
            1 => self.buffers,
            _ => &mut self.buffers[..1],
        }
    }
}

impl PackedConv {
    /// Convolves the images of a pass.
    pub fn run<'a>(&self, exec: &mut ConvExec, x: MapView<'a>, output: ConvOutput<'a>) {
        let tiles = Tiles::all(x.map.side / self.algorithm.step(), exec.images);
        let part = OutputPart {
            tiles,
            blocks: 0..self.out_blocks,
        };
        let target = exec.target;
        self.run_split(target, exec.active(), ConvWork { part, x, output });
    }

    /// Makes a part on as many threads as there are buffers.
    fn run_split(&self, target: TargetIsa, buffers: &mut [ConvBuffers], work: ConvWork) {
        let (half, of) = (buffers.len() / 2, buffers.len());
        let cut = if half > 0 {
            work.part.cut(half, of)
        } else {
            None
        };
        match (cut, buffers) {
            (Some([low, high]), buffers) => {
                let row = high.tiles.first / high.tiles.side * self.algorithm.tile_side();
                let [before, after] = work.output.split(high.blocks.start, row);
                let x = work.x;
                let part = |part, output| ConvWork { part, x, output };
                let (low, high) = (part(low, before), part(high, after));
                let (few, others) = buffers.split_at_mut(half);
                rayon::join(
                    || self.run_split(target, few, low),
                    || self.run_split(target, others, high),
                );
            }
            (None, [buffers, ..]) => self.run_part(target, buffers, work),
            (None, []) => {}
        }
    }
}
