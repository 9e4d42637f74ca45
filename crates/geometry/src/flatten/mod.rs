//! From a region of cloth to its chart: unfolded face by face, relaxed by ARAP, the grid read off the result.
//! Stages: `transport` → `arap` → (only when faces flip) `tutte` → `arap`, `dirichlet` → `raster`; all share one sparse factor.
//! No holes are filled here and no file formats known; what is uncertain is reported as numbers or refused with them.

mod arap;
mod dirichlet;
mod frame;
mod raster;
mod transport;
mod tutte;

pub use frame::UvSquare;
pub use raster::raster;

use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2};

/// What a chart may look like before it is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlattenLimits {
    /// Largest mean over edges of max(r, 1/r), r the stretch of an edge by the chart.
    pub mean_stretch: f64,
}

impl Default for FlattenLimits {
    fn default() -> Self {
        FlattenLimits { mean_stretch: 1.35 }
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
    pub frame: UvSquare,
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

/// Flattens a region by ARAP (Liu et al. 2008; paper eq. 1) from the cloth unfolded face by face; where that flips faces, from Tutte's
/// embedding; where that does, too, by the symmetric Dirichlet energy.
///
/// Nothing is pinned but the rigid motion. Holes are open: their shape in the plane follows from the cloth around them.
///
/// # Errors
/// `Singular` for degenerate triangles, `TooStretched` and `Flipped` when the surface is too far from developable.
pub fn flatten(region: &Region, limits: &FlattenLimits) -> Result<Chart, FlattenError> {
    let mesh = &region.mesh;
    let rest = RestTriangle::of(mesh);
    let loops: Vec<&[u32]> = std::iter::once(&region.rim)
        .chain(&region.holes)
        .map(Vec::as_slice)
        .collect();
    let energy = arap::Energy::of(mesh, &rest)?;
    let start = energy.assemble(&transport::rotations(mesh, &rest))?;
    let (mut flat, mut rounds) = energy.minimise(start, arap::ROUNDS)?;
    if flipped(mesh, &flat) > 0 {
        let start = tutte::embed(mesh, &region.outer, &loops)?;
        (flat, rounds) = energy.minimise(start.clone(), arap::ROUNDS)?;
        if flipped(mesh, &flat) > 0 {
            (flat, rounds) = dirichlet::minimise(mesh, &rest, &start)?;
        }
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
    let frame = UvSquare::tightest(&flat);
    Ok(Chart {
        flat,
        frame,
        stretch_mean,
        stretch_max,
        flipped: flips,
        rounds,
    })
}

/// Rounds of ARAP that bring a hole's extent within a few per cent.
const GLANCE: usize = 6;

/// About how large a region's hole is when the cloth around it is laid flat: the larger side of its box in the frame of a hasty chart,
/// scene units. A narrow region will do, and costs a small part of a chart worth sampling.
///
/// # Errors
/// `Singular` for degenerate triangles.
pub fn hole_extent(region: &Region) -> Result<f64, FlattenError> {
    let mesh = &region.mesh;
    let rest = RestTriangle::of(mesh);
    let energy = arap::Energy::of(mesh, &rest)?;
    let start = energy.assemble(&transport::rotations(mesh, &rest))?;
    let (flat, _) = energy.minimise(start, GLANCE)?;
    let frame = UvSquare::tightest(&flat);
    let rim = region.rim.iter().map(|v| frame.uv(flat[*v as usize]));
    let nowhere = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
    let (low, high) = rim.fold(nowhere, |(low, high), uv| (low.inf(&uv), high.sup(&uv)));
    Ok((high - low).max() * frame.side)
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::region::grow;
    use crate::mesh::shapes::{shaken, sheet};
    use crate::mesh::weld::weld;

    /// The region round the hole of a sheet laid out by `place`.
    fn region(n: usize, noise: f64, seed: u64, place: impl Fn(f64, f64) -> Vec3) -> Region {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
        let welded = weld(&shaken(&sheet(n, keep, place), noise / n as f64, seed));
        let topology = welded.topology();
        let loops = boundary_loops(&welded.mesh, &topology);
        let hole = loops.iter().position(|l| l.kind == LoopKind::Hole);
        grow(&welded.mesh, &topology, &loops, hole.expect("a hole"), 0.25).expect("a region")
    }

    fn rolled(bend: f64) -> impl Fn(f64, f64) -> Vec3 {
        move |u, v| Vec3::new((bend * u).sin() / bend, v, (bend * u).cos() / bend)
    }

    /// The larger side of the points' box, its sides turned by an angle.
    fn larger_side(points: &[Vec2], angle: f64) -> f64 {
        let along = |axis: Vec2| {
            let places = points.iter().map(|p| p.dot(&axis));
            let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            });
            high - low
        };
        let axis = Vec2::new(angle.cos(), angle.sin());
        along(axis).max(along(Vec2::new(-axis.y, axis.x)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn rolled_cloth_flattens_to_itself(n in 12usize..32, bend in 0.1..6.0f64) {
            let region = region(n, 0.0, 0, rolled(bend));
            let chart = flatten(&region, &FlattenLimits::default()).expect("a chart");
            prop_assert_eq!(chart.flipped, 0);
            // Chords of the roll are developable, too.
            prop_assert!(chart.stretch_max < 1.01, "{}", chart.stretch_max);
            // What the hole measures on the unrolled sheet, whichever way the frame is turned.
            let unrolled = |p: Vec3| Vec2::new(p.x.atan2(p.z).rem_euclid(std::f64::consts::TAU) / bend, p.y);
            let rim: Vec<Vec2> = (region.rim.iter()).map(|v| unrolled(region.mesh.positions[*v as usize])).collect();
            let sides: Vec<f64> = (0..90).map(|degrees| larger_side(&rim, f64::from(degrees).to_radians())).collect();
            let (least, most) = sides.iter().fold((f64::INFINITY, 0.0f64), |(a, b), s| (a.min(*s), b.max(*s)));
            let extent = hole_extent(&region).expect("an extent");
            prop_assert!((0.98 * least..1.02 * most).contains(&extent), "{extent} not in {least}..{most}");
        }

        #[test]
        fn it_does_not_matter_where_arap_starts(n in 12usize..32, noise in 0.0..0.25f64, seed: u64) {
            let region = region(n, noise, seed, |u, v| Vec3::new(u, v, 0.08 * (7.0 * u).sin() * (5.0 * v).cos()));
            let mesh = &region.mesh;
            let rest = RestTriangle::of(mesh);
            let energy = arap::Energy::of(mesh, &rest).expect("a factor");
            let unfolded = energy.assemble(&transport::rotations(mesh, &rest)).expect("a layout");
            let tutte = tutte::embed(mesh, &region.outer, &[&region.rim]).expect("a layout");
            let [a, b] = [unfolded, tutte].map(|start| energy.minimise(start, arap::ROUNDS).expect("a chart").0);
            let (a, b) = (stretch(mesh, &a).0 - 1.0, stretch(mesh, &b).0 - 1.0);
            prop_assert!((a - b).abs() < 0.02 * b + 1e-6, "{a} {b}");
        }
    }
}
