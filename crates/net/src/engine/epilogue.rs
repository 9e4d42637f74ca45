//! Where a convolution's result goes, and what is done to it while it is still in registers.

use super::feature_map::{FeatureMap, MapViewMut};

/// What follows a convolution.
pub enum Epilogue<'a> {
    /// Adds the bias, then ReLU.
    Relu,
    /// As [`Epilogue::Relu`], and writes the largest of every 2×2 cells into another map.
    ReluMaxPool(MapViewMut<'a>),
    /// Adds no bias; zero where this activation, saved by the forward pass, is zero.
    ReluAdjoint(&'a FeatureMap),
    /// Adds no bias and does nothing.
    Plain,
}

/// Where a convolution writes its result, and what follows it.
pub struct ConvOutput<'a> {
    pub map: MapViewMut<'a>,
    pub epilogue: Epilogue<'a>,
}

impl<'a> ConvOutput<'a> {
    /// What lies before a row of cells of a channel block of the first image, and the rest.
    pub fn split(self, block: usize, row: usize) -> [ConvOutput<'a>; 2] {
        let (low, high) = self.map.split(block, row + 1);
        let (first, second) = match self.epilogue {
            Epilogue::Relu => (Epilogue::Relu, Epilogue::Relu),
            Epilogue::ReluMaxPool(pooled) => {
                let (low, high) = pooled.split(block, row / 2 + 1);
                (Epilogue::ReluMaxPool(low), Epilogue::ReluMaxPool(high))
            }
            Epilogue::ReluAdjoint(saved) => {
                (Epilogue::ReluAdjoint(saved), Epilogue::ReluAdjoint(saved))
            }
            Epilogue::Plain => (Epilogue::Plain, Epilogue::Plain),
        };
        [(low, first), (high, second)].map(|(map, epilogue)| ConvOutput { map, epilogue })
    }
}
