//! The shape without strain that the energy compares with: triangles in the plane of the chart.

use nalgebra::Matrix2;

use crate::mesh::Vec2;

/// Triangles at rest in the plane of the chart; the first `free` vertices may move, the others are held.
#[derive(Debug, Clone, Copy)]
pub(super) struct RestMesh<'a> {
    /// Vertex positions, scene units.
    pub points: &'a [Vec2],
    /// Counter-clockwise triangles.
    pub faces: &'a [[u32; 3]],
    /// How many vertices, the first ones, may move.
    pub free: usize,
    /// How far the first triangles are stretched from the chart at rest; the others have the chart's lengths.
    pub stretches: &'a [Matrix2<f64>],
}

impl RestMesh<'_> {
    /// Mean edge length over all sides of all triangles, scene units.
    pub fn mean_edge(&self) -> f64 {
        let edges = (self.faces.iter()).flat_map(|f| {
            (0..3)
                .map(|k| (self.points[f[(k + 1) % 3] as usize] - self.points[f[k] as usize]).norm())
        });
        edges.sum::<f64>() / (3 * self.faces.len()).max(1) as f64
    }
}
