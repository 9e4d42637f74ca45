//! Triangles at rest: what a chart should keep of every face.

use crate::mesh::{TriMesh, Vec2};

/// A face laid isometrically into the plane, first corner at the origin, first edge along x; scene units.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestTriangle {
    /// Corners in the plane.
    pub corners: [Vec2; 3],
    /// Cotangent of the angle opposite the edge from corner k to corner k + 1; bounded for slivers.
    pub cotangent: [f64; 3],
    /// Area; at least a small share of the squared longest edge.
    pub area: f64,
    /// How much its shape counts beside those of others.
    pub weight: f64,
}

impl RestTriangle {
    /// Least height ÷ longest edge. Flatter faces count as triangles of this ratio: their true cotangents would
    /// outweigh all others.
    const FLATTEST: f64 = 1e-3;

    /// Rest triangles of all faces of a mesh.
    pub fn of(mesh: &TriMesh) -> Vec<RestTriangle> {
        let lay = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|v| mesh.positions[v as usize]);
            let (ab, ac) = (b - a, c - a);
            let length = ab.norm().max(f64::MIN_POSITIVE);
            let x = ac.dot(&ab) / length;
            let longest = length.max(ac.norm()).max((c - b).norm());
            let y = (ac.norm_squared() - x * x)
                .max(0.0)
                .sqrt()
                .max(Self::FLATTEST * longest);
            Self::from_corners([Vec2::zeros(), Vec2::new(length, 0.0), Vec2::new(x, y)])
        };
        mesh.faces.iter().map(lay).collect()
    }

    /// The rest triangle with the given counter-clockwise corners.
    pub fn from_corners(corners: [Vec2; 3]) -> RestTriangle {
        let doubled = (corners[1] - corners[0])
            .perp(&(corners[2] - corners[0]))
            .max(f64::MIN_POSITIVE);
        let cotangent = [0, 1, 2].map(|k: usize| {
            let (a, b, opposite) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            (a - opposite).dot(&(b - opposite)) / doubled
        });
        RestTriangle {
            corners,
            cotangent,
            area: 0.5 * doubled,
            weight: 1.0,
        }
    }

    /// The same triangle, whose shape counts this much.
    pub fn weighing(self, weight: f64) -> RestTriangle {
        RestTriangle { weight, ..self }
    }

    /// Gradients gₖ of the three hat functions (linear, 1 at corner k and 0 at the others): the Jacobian of a map
    /// with corner values uₖ is Σ uₖ gₖᵀ.
    pub fn gradients(&self) -> [Vec2; 3] {
        [0, 1, 2].map(|k: usize| {
            let e = self.corners[(k + 2) % 3] - self.corners[(k + 1) % 3];
            Vec2::new(-e.y, e.x) / (2.0 * self.area)
        })
    }
}
