//! From a region of cloth to its chart: unfolded face by face, relaxed by ARAP, and sampled on the grid.
//!
//! Stages: `transport` → `arap` → (only when faces flip) `tutte` → `arap`, `dirichlet` → `raster`. All ARAP stages
//! share one sparse factor. Charts that stretch too much or flip faces are refused with numbers.

mod arap;
mod chart;
mod dirichlet;
mod error;
mod raster;
mod rest_triangle;
mod transport;
mod tutte;
mod uv_square;

pub use chart::Chart;
pub use error::FlattenError;
pub(crate) use raster::cell_faces;
pub use raster::raster;
pub(crate) use rest_triangle::RestTriangle;
pub use uv_square::UvSquare;

use arap::ArapEnergy;
use chart::{Layout, flipped_faces, stretch};

use darn_budget::Budget;

use crate::mesh::Vec2;
use crate::mesh::region::Region;

/// What a chart may look like before it is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlattenLimits {
    /// Largest mean over edges of max(r, 1/r), r = flat length ÷ scene length.
    pub mean_stretch: f64,
}

impl Default for FlattenLimits {
    fn default() -> Self {
        FlattenLimits { mean_stretch: 1.35 }
    }
}

/// Most rounds of ARAP; the stop test usually ends them long before.
const ROUNDS: usize = 150;
/// Rounds of ARAP after which a hole's extent is right within a few per cent.
const EXTENT_ROUNDS: usize = 6;

/// Flattens a region by ARAP (Liu, Zhang, Xu, Gotsman, Gortler 2008) from the cloth unfolded face by face. Where that
/// flips faces, it starts again from Tutte's embedding (Tutte 1963); where that flips faces, too, it minimises the
/// symmetric Dirichlet energy (Rabinovich et al. 2017).
///
/// Nothing is pinned but the rigid motion. Holes are open: their shape in the plane follows from the cloth around them.
///
/// # Errors
/// `Singular` for degenerate triangles, `TooStretched` and `Flipped` when the surface is too far from developable; `Exhausted`.
///
/// ```
/// use darn_budget::Budget;
/// use darn_geometry::flatten::{FlattenLimits, flatten};
/// use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
/// use darn_geometry::mesh::region::{BoundedMesh, grow};
/// use darn_geometry::mesh::shapes::holed_sheet;
/// use darn_geometry::mesh::weld::weld;
///
/// // A flat sheet flattens to itself.
/// let welded = weld(&holed_sheet(16, 0.2));
/// let topology = welded.topology();
/// let loops = boundary_loops(&welded.mesh, &topology);
/// let hole = loops.iter().find(|l| l.kind == LoopKind::Hole).expect("the sheet has a hole");
/// let cloth = BoundedMesh { mesh: &welded.mesh, topology: &topology, loops: &loops };
/// let region = grow(&cloth, hole.id, 0.2, Budget::unlimited())?;
/// let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited())?;
/// assert!(chart.stretch_max - 1.0 < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn flatten(
    region: &Region,
    limits: &FlattenLimits,
    budget: &Budget,
) -> Result<Chart, FlattenError> {
    let all = ClothFaces {
        count: region.mesh.faces.len(),
        weight_of_others: 1.0,
    };
    flatten_cloth(region, all, limits, budget)
}

/// The faces of a region that are cloth, its first ones. The others hold places in its holes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClothFaces {
    /// How many there are.
    pub count: usize,
    /// How much the shapes of the others count, as a share.
    pub weight_of_others: f64,
}

/// Flattens a region of cloth and others, of which none is flipped; the stretch is that of the cloth.
///
/// # Errors
/// As [`flatten`].
pub(crate) fn flatten_cloth(
    region: &Region,
    cloth: ClothFaces,
    limits: &FlattenLimits,
    budget: &Budget,
) -> Result<Chart, FlattenError> {
    let mesh = &region.mesh;
    let mut rest = RestTriangle::of(mesh);
    for other in &mut rest[cloth.count..] {
        *other = other.weighing(cloth.weight_of_others);
    }
    let energy = ArapEnergy::new(mesh, &rest, budget)?;
    let start = energy.assemble(&transport::rotations(mesh, &rest))?;
    let mut layout = energy.minimise(start, ROUNDS)?;
    if flipped_faces(mesh, &layout.flat) > 0 {
        let start = tutte::embed(region, budget)?;
        layout = energy.minimise(start.clone(), ROUNDS)?;
        if flipped_faces(mesh, &layout.flat) > 0 {
            layout = dirichlet::minimise(mesh, &rest, &start, budget)?;
        }
    }
    let Layout { flat, rounds } = layout;
    let flipped = flipped_faces(mesh, &flat);
    if flipped > 0 {
        return Err(FlattenError::Flipped {
            flipped,
            faces: mesh.faces.len(),
        });
    }
    let stretch = stretch(mesh, &mesh.faces[..cloth.count], &flat);
    if stretch.mean > limits.mean_stretch {
        return Err(FlattenError::TooStretched {
            stretch: stretch.mean,
            limit: limits.mean_stretch,
        });
    }
    let frame = UvSquare::tightest(&flat);
    Ok(Chart {
        flat,
        frame,
        stretch_mean: stretch.mean,
        stretch_max: stretch.max,
        flipped,
        rounds,
    })
}

/// About how large a region's hole is when the cloth around it is laid flat, scene units: the larger side of the
/// hole's box in the uv square of a chart of six rounds.
///
/// A narrow region suffices, and costs a small part of a chart worth sampling.
///
/// # Errors
/// `Singular` for degenerate triangles; `Exhausted`.
pub fn hole_extent(region: &Region, budget: &Budget) -> Result<f64, FlattenError> {
    let mesh = &region.mesh;
    let rest = RestTriangle::of(mesh);
    let energy = ArapEnergy::new(mesh, &rest, budget)?;
    let start = energy.assemble(&transport::rotations(mesh, &rest))?;
    let flat = energy.minimise(start, EXTENT_ROUNDS)?.flat;
    let frame = UvSquare::tightest(&flat);
    let rim = region.rim.iter().map(|v| frame.uv(flat[*v as usize]));
    let nowhere = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
    let (low, high) = rim.fold(nowhere, |(low, high), uv| (low.inf(&uv), high.sup(&uv)));
    Ok((high - low).max() * frame.side)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{jitter, sheet};
    use crate::mesh::weld::weld;

    /// The region around the hole of a sheet laid out by `place`.
    fn region(n: usize, noise: f64, seed: u64, place: impl Fn(f64, f64) -> Vec3) -> Region {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
        let mesh = weld(&jitter(&sheet(n, keep, place), noise / n as f64, seed)).mesh;
        region_around_hole(&mesh, 0.25)
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
            let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited()).expect("a chart");
            prop_assert_eq!(chart.flipped, 0);
            // Chords of the roll are developable, too.
            prop_assert!(chart.stretch_max < 1.01, "{}", chart.stretch_max);
            // The extent of the hole on the unrolled sheet, for every rotation of the square.
            let unrolled = |p: Vec3| Vec2::new(p.x.atan2(p.z).rem_euclid(std::f64::consts::TAU) / bend, p.y);
            let rim: Vec<Vec2> = (region.rim.iter()).map(|v| unrolled(region.mesh.positions[*v as usize])).collect();
            let sides: Vec<f64> = (0..90).map(|degrees| larger_side(&rim, f64::from(degrees).to_radians())).collect();
            let (least, most) = sides.iter().fold((f64::INFINITY, 0.0f64), |(a, b), s| (a.min(*s), b.max(*s)));
            let extent = hole_extent(&region, Budget::unlimited()).expect("an extent");
            prop_assert!((0.98 * least..1.02 * most).contains(&extent), "{extent} not in {least}..{most}");
        }

        #[test]
        fn it_does_not_matter_where_arap_starts(n in 12usize..32, noise in 0.0..0.25f64, seed: u64) {
            let region = region(n, noise, seed, |u, v| Vec3::new(u, v, 0.08 * (7.0 * u).sin() * (5.0 * v).cos()));
            let mesh = &region.mesh;
            let rest = RestTriangle::of(mesh);
            let energy = ArapEnergy::new(mesh, &rest, Budget::unlimited()).expect("a factor");
            let unfolded = energy.assemble(&transport::rotations(mesh, &rest)).expect("a layout");
            let tutte = tutte::embed(&region, Budget::unlimited()).expect("a layout");
            let [a, b] = [unfolded, tutte].map(|start| energy.minimise(start, ROUNDS).expect("a chart").flat);
            let (a, b) = (stretch(mesh, &mesh.faces, &a).mean - 1.0, stretch(mesh, &mesh.faces, &b).mean - 1.0);
            // Rough cloth has minima beside each other: 2.4 % apart in one of thousands of cases, 7.2 % once.
            prop_assert!((a - b).abs() < 0.08 * b + 1e-6, "{a} {b}");
        }
    }
}
