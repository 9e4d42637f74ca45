//! One simulated sheet: its mesh, and the measures by which sheets are kept or chosen.

use super::lattice::{SIDE, SPACING, Vec3f};
use darn_geometry::mesh::intersect::self_intersections;
use darn_geometry::mesh::{TriMesh, Vec3};

/// One sheet at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSheet {
    /// [`VERTICES`](super::lattice::VERTICES) positions, metres; vertex `(i, j)` at index `j * SIDE + i`.
    pub positions: Vec<[f32; 3]>,
}

impl SimulatedSheet {
    /// Root mean square of the angle between an edge and the next one along its row or column, radians.
    pub(super) fn roughness(&self) -> f32 {
        let at = |i: usize, j: usize| Vec3f::from(self.positions[j * SIDE + i]);
        let bend = |a: Vec3f, b: Vec3f, c: Vec3f| (b - a).angle(&(c - b));
        let mut squares = 0.0;
        for j in 0..SIDE {
            for i in 0..SIDE - 2 {
                squares += bend(at(i, j), at(i + 1, j), at(i + 2, j)).powi(2);
                squares += bend(at(j, i), at(j, i + 1), at(j, i + 2)).powi(2);
            }
        }
        (squares / (2 * SIDE * (SIDE - 2)) as f32).sqrt()
    }

    /// The sheet as 5,000 triangles; every cell is split along the diagonal from `(i, j)` to `(i + 1, j + 1)`.
    pub fn mesh(&self) -> TriMesh {
        let side = SIDE as u32;
        let mut faces = Vec::with_capacity(2 * (SIDE - 1) * (SIDE - 1));
        for j in 0..side - 1 {
            for i in 0..side - 1 {
                let k = j * side + i;
                faces.push([k, k + 1, k + side + 1]);
                faces.push([k, k + side + 1, k + side]);
            }
        }
        TriMesh {
            positions: self
                .positions
                .iter()
                .map(|p| Vec3::from(p.map(f64::from)))
                .collect(),
            faces,
        }
    }

    /// Whether two triangles without a common vertex intersect.
    pub(super) fn crosses_itself(&self) -> bool {
        let mesh = self.mesh();
        let apart = |&(f, g): &(u32, u32)| {
            let (f, g) = (mesh.faces[f as usize], mesh.faces[g as usize]);
            !f.iter().any(|v| g.contains(v))
        };
        self_intersections(&mesh).iter().any(apart)
    }
}

/// Root mean square of (length / rest length − 1) over the edges along u and v.
pub(super) fn strain(positions: &[Vec3f]) -> f64 {
    let edge = |a: usize, b: usize| {
        let strain = f64::from((positions[a] - positions[b]).norm() / SPACING) - 1.0;
        strain * strain
    };
    let mut sum = 0.0;
    for line in 0..SIDE {
        for k in 0..SIDE - 1 {
            sum += edge(line * SIDE + k, line * SIDE + k + 1)
                + edge(k * SIDE + line, (k + 1) * SIDE + line);
        }
    }
    (sum / (2 * SIDE * (SIDE - 1)) as f64).sqrt()
}
