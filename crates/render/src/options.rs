//! What a picture shows: its size, the camera and the edges.

use darn_geometry::mesh::Vec3;

/// The longest side of a picture, in pixels.
pub const MAX_SIDE: u32 = 8192;

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureOptions {
    /// Width and height in pixels; clamped to 1 ..= [`MAX_SIDE`].
    pub size: [u32; 2],
    /// From where the camera looks.
    pub direction: CameraDirection,
    /// How much of the mesh is in the picture.
    pub framing: Framing,
    /// Which edges are drawn.
    pub lines: EdgeLines,
}

impl Default for PictureOptions {
    fn default() -> Self {
        Self {
            size: [1200, 900],
            direction: CameraDirection::Auto,
            framing: Framing::Whole,
            lines: EdgeLines::Rims,
        }
    }
}

/// From where the camera looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CameraDirection {
    /// At the broad side of the cloth, slightly oblique so that folds show.
    Auto,
    /// Two angles: at azimuth 0 the camera looks from +z, at 90 from +x; at elevation 90 it looks straight down.
    Angles {
        /// Angle about +y, degrees.
        azimuth: f64,
        /// Angle above the horizon, degrees.
        elevation: f64,
    },
}

/// How much of the mesh is in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Framing {
    /// All of it.
    Whole,
    /// A ball, for example around a hole; [`CameraDirection::Auto`] then faces the cloth inside the ball.
    Focus {
        /// Centre of the ball, scene space.
        centre: Vec3,
        /// Radius of the ball, scene units; must be positive.
        radius: f64,
    },
}

/// Which edges are drawn over the shading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeLines {
    /// Boundary edges only: the rims of holes and the outer boundary.
    Rims,
    /// Every edge.
    Wireframe,
}

/// Width and height in pixels, neither 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelSize {
    pub width: usize,
    pub height: usize,
}
