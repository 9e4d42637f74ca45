//! From a region of cloth to its chart: Tutte's embedding as a flip-free start, ARAP on top, the grid read off the result.
//! Stages: `tutte` → `arap` → (only when faces flip) `dirichlet` → `raster`; all share the sparse factor in `cholesky`.
//! No holes are filled here and no file formats known; what is uncertain is reported as numbers or refused with them.

mod arap;
pub(crate) mod cholesky;
mod dirichlet;
mod frame;
mod raster;
mod tutte;

pub use frame::Frame;
pub use raster::raster;

use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2};

/// What a chart may look like before it is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest mean over edges of max(r, 1/r), r the stretch of an edge by the chart.
    pub mean_stretch: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { mean_stretch: 1.35 }
    }
}

/// Why a region could not be flattened.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FlattenError {
    /// The sparse system of a stage had no positive definite factor: the region's triangles are degenerate.
    #[error(
        "the {stage} system of a region of {vertices} vertices cannot be solved; its triangles are degenerate"
    )]
    Singular {
        /// Which stage's system.
        stage: &'static str,
        /// Vertices of the region.
        vertices: usize,
    },
    /// The chart stretches the cloth beyond the limit.
    #[error(
        "mean stretch {stretch:.2} exceeds {limit:.2}; the surface around the hole is not cloth-like"
    )]
    TooStretched {
        /// Mean over edges of max(r, 1/r).
        stretch: f64,
        /// The limit it exceeds.
        limit: f64,
    },
    /// Faces stay flipped even with the flip-free energy.
    #[error(
        "{flipped} of {faces} faces flip in the chart; the surface around the hole is not cloth-like"
    )]
    Flipped {
        /// Faces that are upside down.
        flipped: usize,
        /// Faces of the region.
        faces: usize,
    },
}

/// Region vertices laid out in the plane, as nearly isometric as the cloth allows.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// One point per region vertex, scene units; faces are counter-clockwise.
    pub flat: Vec<Vec2>,
    /// The unit square of uv in the plane of `flat`.
    pub frame: Frame,
    /// Mean over edges of max(r, 1/r), r = flat length ÷ scene length.
    pub stretch_mean: f64,
    /// Maximum of the same.
    pub stretch_max: f64,
    /// Faces whose flat area is not positive.
    pub flipped: usize,
    /// Rounds of local and global steps.
    pub rounds: usize,
}

impl Chart {
    /// The uv of a region vertex.
    pub fn uv(&self, vertex: u32) -> Vec2 {
        self.frame.uv(self.flat[vertex as usize])
    }
}

/// Flattens a region: Tutte start, ARAP (Liu et al. 2008; paper eq. 1), symmetric Dirichlet energy where ARAP flips faces.
///
/// Nothing is pinned but the rigid motion. Holes are open: their shape in the plane follows from the cloth around them.
///
/// # Errors
/// `Singular` for degenerate triangles, `TooStretched` and `Flipped` when the surface is too far from developable.
pub fn flatten(region: &Region, limits: &Limits) -> Result<Chart, FlattenError> {
    let mesh = &region.mesh;
    let rest = RestTriangle::of(mesh);
    let loops: Vec<&[u32]> = std::iter::once(&region.rim)
        .chain(&region.holes)
        .map(Vec::as_slice)
        .collect();
    let start = tutte::embed(mesh, &region.outer, &loops)?;
    let (mut flat, mut rounds) = arap::minimise(mesh, &rest, &start)?;
    if flipped(mesh, &flat) > 0 {
        (flat, rounds) = dirichlet::minimise(mesh, &rest, &start)?;
    }
    let flips = flipped(mesh, &flat);
    if flips > 0 {
        return Err(FlattenError::Flipped {
            flipped: flips,
            faces: mesh.faces.len(),
        });
    }
    let (stretch_mean, stretch_max) = stretch(mesh, &flat);
    if stretch_mean > limits.mean_stretch {
        return Err(FlattenError::TooStretched {
            stretch: stretch_mean,
            limit: limits.mean_stretch,
        });
    }
    let frame = Frame::tightest(&flat);
    Ok(Chart {
        flat,
        frame,
        stretch_mean,
        stretch_max,
        flipped: flips,
        rounds,
    })
}

/// Faces whose area in the plane is not positive.
fn flipped(mesh: &TriMesh, flat: &[Vec2]) -> usize {
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

/// Mean and maximum of max(r, 1/r) over all face edges, r = flat length ÷ scene length.
fn stretch(mesh: &TriMesh, flat: &[Vec2]) -> (f64, f64) {
    let (mut sum, mut most, mut count) = (0.0, 1.0f64, 0usize);
    for face in &mesh.faces {
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
    (sum / count.max(1) as f64, most)
}

/// A face laid isometrically into the plane, first corner at the origin, first edge along x.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestTriangle {
    /// Corners in the plane.
    pub corners: [Vec2; 3],
    /// Cotangent of the angle opposite the edge from corner k to corner k + 1; bounded for slivers.
    pub cotangent: [f64; 3],
    /// Area; at least a small share of the squared longest edge.
    pub area: f64,
}

impl RestTriangle {
    /// Slivers count as triangles of this height ÷ longest edge: their true cotangents would drown all others.
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
        }
    }

    /// Gradients gₖ of the three hat functions: the Jacobian of a map with corner values uₖ is Σ uₖ gₖᵀ.
    pub fn gradients(&self) -> [Vec2; 3] {
        [0, 1, 2].map(|k: usize| {
            let e = self.corners[(k + 2) % 3] - self.corners[(k + 1) % 3];
            Vec2::new(-e.y, e.x) / (2.0 * self.area)
        })
    }
}
