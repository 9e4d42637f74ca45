//! What a network is built from, and the constants of its input and output.

use serde::{Deserialize, Serialize};

use crate::fill::InputKind;
use crate::frame::FrameKind;

/// Positions are multiplied by this before the first layer, so that a sheet of width 1 spans a few units.
pub const INPUT_SCALE: f32 = 4.0;
/// One unit of the last layer's output, in the network's units: four cells.
pub const OUTPUT_SCALE: f32 = 1.0 / 16.0;
/// Steps down from the first scale; the grid's side is divisible by 2 to this power.
pub const DOWN: usize = 4;

/// What a network is built from; part of its weights file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnetConfig {
    /// Channels at the first scale; the five scales have w, 2w, 4w, 8w and 16w.
    pub width: usize,
    /// What the network sees in unknown cells.
    pub input: InputKind,
    /// The frame that positions are given in.
    pub frame: FrameKind,
}

impl Default for UnetConfig {
    fn default() -> Self {
        UnetConfig {
            width: 16,
            input: InputKind::Plate,
            frame: FrameKind::Canonical,
        }
    }
}
