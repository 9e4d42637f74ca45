//! The architecture of a network, and the constants of its input and output.

use serde::{Deserialize, Serialize};

use crate::fill::InputKind;
use crate::frame::FrameKind;

/// Factor of positions before the first layer; a sheet of width 1 then spans a few units.
pub const INPUT_SCALE: f32 = 4.0;
/// The network's units per unit of the last layer's output: four cells.
pub const OUTPUT_SCALE: f32 = 1.0 / 16.0;
/// Levels below the finest; the grid's side is divisible by 2 to this power.
pub const DOWN: usize = 4;

/// The architecture of a network; part of its weights file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnetConfig {
    /// Channels w of the finest level; the five levels have w, 2w, 4w, 8w and 16w.
    pub width: usize,
    /// What the network sees in unknown cells.
    pub input: InputKind,
    /// The frame that positions are turned to.
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
