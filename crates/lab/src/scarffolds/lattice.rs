//! The lattice of 51×51 vertices that all simulated cloth has: the unit square, vertex `(i, j)` at index `j * SIDE + i`, i along u.

use nalgebra::Vector3;

/// Three numbers of a vertex: a position in metres, a velocity in m/s or a direction.
pub type Vec3f = Vector3<f32>;

/// Vertices along a side of a sheet.
pub const SIDE: usize = 51;
/// Vertices of a sheet.
pub const VERTICES: usize = SIDE * SIDE;
/// Rest length of the edges along u and v, metres.
pub const SPACING: f32 = 1.0 / (SIDE as f32 - 1.0);
