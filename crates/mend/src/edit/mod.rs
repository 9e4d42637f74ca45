//! Editing: gestures become points of the cloth with targets, targets are brought within reach, and an anchor search
//! finds a target's cell.
//!
//! `cells` are the grid cells of a hole, `point` a point of the cloth with its target; `gesture` turns gestures into
//! points, `displacement` spreads their movement over the hole, `reach` limits the targets, `search` is the anchor
//! search and `map` its picture. This module knows no scan, no patch and no network: the cloth is a function from the
//! chart to space, the network a trait that answers losses.

mod cells;
mod displacement;
mod gesture;
pub mod map;
mod point;
mod reach;
mod search;

pub use cells::{CellMove, HoleCells, nearest_cell};
pub use gesture::PlacedPoints;
pub use point::{ClothSurface, PlacedPoint};
pub use reach::{ReachLimit, RimPoint};
pub use search::{
    CellLoss, LossField, PathCell, SearchOptions, SearchOutcome, descend, search_every_cell, seeds,
};
