//! Triangle meshes as plain arrays: welding, topology, boundary loops, regions, self-intersection, curvature.
//!
//! Small free functions on [`TriMesh`], one idea a file, in scene units and f64. This module knows no charts and no
//! grids.
//!
//! From a triangle soup to a hole's surroundings: [`weld::weld`] → [`topology::Topology`] → [`loops::boundary_loops`]
//! → [`region::grow`].

pub mod blocks;
mod border;
pub(crate) mod bounds;
pub mod curvature;
pub mod cut;
pub mod defects;
pub mod denoise;
mod geodesic;
mod growth;
pub mod index;
pub mod intersect;
pub mod island;
mod joints;
pub mod layers;
pub mod loops;
pub mod membranes;
pub mod nearest;
pub mod openings;
#[cfg(test)]
mod openings_tests;
mod pairing;
mod piece;
pub mod region;
mod repair;
mod rim_shape;
pub mod shapes;
pub mod skins;
pub mod sound_hole;
mod sparse;
pub mod spikes;
pub mod topology;
mod tube_cut;
pub mod turning;
pub mod weld;
#[cfg(test)]
mod weld_tests;

pub use bounds::diagonal;

use std::collections::HashMap;

/// A point or direction in the plane of a chart.
pub type Vec2 = nalgebra::Vector2<f64>;
/// A point or direction in scene space.
pub type Vec3 = nalgebra::Vector3<f64>;

/// An indexed triangle mesh; faces are counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions, scene space.
    pub positions: Vec<Vec3>,
    /// Vertex indices of every triangle; each is below `positions.len()`.
    pub faces: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The three corner positions of a face.
    ///
    /// # Panics
    /// When `face` or one of its vertices does not exist.
    #[inline]
    pub fn triangle(&self, face: usize) -> [Vec3; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// The given faces as a mesh, with the vertices they use, in the order of first use.
    pub fn part(&self, faces: impl IntoIterator<Item = [u32; 3]>) -> TriMesh {
        let mut index = HashMap::new();
        let mut part = TriMesh::default();
        for face in faces {
            part.faces.push(face.map(|v| {
                *index.entry(v).or_insert_with(|| {
                    part.positions.push(self.positions[v as usize]);
                    part.positions.len() as u32 - 1
                })
            }));
        }
        part
    }

    /// The interior angle at `corner` (0..3) of a face, radians in `[0, π]`; 0 for a corner with a zero-length side.
    pub fn corner_angle(&self, face: usize, corner: usize) -> f64 {
        corner_angle(self.triangle(face), corner)
    }
}

/// The interior angle at `corner` (0..3) of a triangle, radians in `[0, π]`; 0 for a corner with a zero-length side.
fn corner_angle(triangle: [Vec3; 3], corner: usize) -> f64 {
    let at = triangle[corner];
    let (a, b) = (
        triangle[(corner + 1) % 3] - at,
        triangle[(corner + 2) % 3] - at,
    );
    let unit = unit_for(a.amax().max(b.amax()));
    let (a, b) = (a / unit, b / unit);
    a.cross(&b).norm().atan2(a.dot(&b))
}

/// A unit for lengths of this size, so that their products neither overflow nor underflow: 1 for all sizes but
/// extreme ones.
fn unit_for(size: f64) -> f64 {
    if size == 0.0 || (1e-100..1e100).contains(&size) {
        1.0
    } else {
        size
    }
}
