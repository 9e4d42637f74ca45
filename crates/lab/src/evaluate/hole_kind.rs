//! The holes that are cut into scanned sheets for evaluation.

use std::f64::consts::PI;

use rand::Rng;
use serde::Serialize;

use crate::scarffolds::holed_scan::HoleShape;
use darn_geometry::mesh::Vec2;

/// Vertices along a side of a scanned sheet, as in the quality checks.
pub(super) const SCAN_SIDE: usize = 67;

/// The kinds of holes that are cut into scanned sheets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HoleKind {
    /// A disk.
    Circle,
    /// A ragged blob.
    Blob,
    /// A long tear.
    Slit,
}

impl HoleKind {
    /// All kinds.
    pub const ALL: [HoleKind; 3] = [HoleKind::Circle, HoleKind::Blob, HoleKind::Slit];

    /// A random hole of the sizes that the quality checks cut.
    pub(super) fn draw(self, rng: &mut impl Rng) -> HoleShape {
        let centre = Vec2::new(rng.random_range(0.38..0.62), rng.random_range(0.38..0.62));
        match self {
            HoleKind::Circle => HoleShape::Circle {
                centre,
                radius: rng.random_range(0.10..0.22),
            },
            HoleKind::Blob => HoleShape::Blob {
                centre,
                radius: rng.random_range(0.10..0.20),
            },
            HoleKind::Slit => HoleShape::Slit {
                centre,
                length: rng.random_range(0.18..0.28),
                width: rng.random_range(0.03..0.06),
                angle: rng.random_range(0.0..PI),
            },
        }
    }
}
