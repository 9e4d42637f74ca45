//! A region's layout in the plane, and how good it is.

use super::uv_square::UvSquare;
use crate::mesh::{TriMesh, Vec2};

/// The vertices of a region laid out in the plane, as close to isometric as the cloth allows.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// One point per region vertex, scene units; faces are counter-clockwise.
    pub flat: Vec<Vec2>,
    /// The unit square of uv in the plane of `flat`.
    pub frame: UvSquare,
    /// Mean over edges of max(r, 1/r), r = flat length ÷ scene length.
    pub stretch_mean: f64,
    /// Maximum over edges of max(r, 1/r).
    pub stretch_max: f64,
    /// Faces whose flat area is not positive; [`flatten`](super::flatten) refuses charts that have any.
    pub flipped: usize,
    /// Rounds of local and global steps (ARAP), or steps (symmetric Dirichlet).
    pub rounds: usize,
}

impl Chart {
    /// The uv of a region vertex.
    #[inline]
    pub fn uv(&self, vertex: u32) -> Vec2 {
        self.frame.uv(self.flat[vertex as usize])
    }
}

/// A layout that a minimiser found.
pub(super) struct Layout {
    /// One point per vertex, scene units.
    pub flat: Vec<Vec2>,
    /// Rounds or steps it took.
    pub rounds: usize,
}

/// Faces whose area in the plane is not positive.
pub(super) fn flipped_faces(mesh: &TriMesh, flat: &[Vec2]) -> usize {
    mesh.faces
        .iter()
        .filter(|f| doubled_area(f, flat) <= 0.0)
        .count()
}

/// Twice the signed area of a face in the plane.
fn doubled_area(face: &[u32; 3], flat: &[Vec2]) -> f64 {
    let [a, b, c] = face.map(|v| flat[v as usize]);
    (b - a).perp(&(c - a))
}

/// How much a layout changes the lengths of edges: max(r, 1/r), r = flat length ÷ scene length; an edge counts once
/// for each of its faces.
pub(super) struct Stretch {
    /// Mean over edges.
    pub mean: f64,
    /// Maximum over edges.
    pub max: f64,
}

/// The stretch of some faces of a mesh in a layout of all its vertices.
pub(super) fn stretch(mesh: &TriMesh, faces: &[[u32; 3]], flat: &[Vec2]) -> Stretch {
    let (mut sum, mut most, mut count) = (0.0, 1.0f64, 0usize);
    for face in faces {
        for k in 0..3 {
            let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
            let length = (mesh.positions[a] - mesh.positions[b]).norm();
            let r = (flat[a] - flat[b]).norm() / length.max(f64::MIN_POSITIVE);
            let r = r.max(1.0 / r.max(f64::MIN_POSITIVE));
            sum += r;
            most = most.max(r);
            count += 1;
        }
    }
    Stretch {
        mean: sum / count.max(1) as f64,
        max: most,
    }
}
