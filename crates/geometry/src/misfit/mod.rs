//! Pieces of cloth at a rim that do not fit the chart around a hole: flaps that stand out of the cloth, and lips that
//! overlap. A patch of cloth cannot join them; without them it can. And loose pieces in a hole, which may fit.

mod flaps;
mod island;
mod overlap;
mod smooth_sheet;
mod standing;

pub use flaps::flaps;
pub use island::{FilledChart, place_island};
pub use overlap::overlapping_lip;
pub use standing::{lies_flat, standing_pieces, stands_out};
