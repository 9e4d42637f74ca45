//! Scanner noise: how much of it a mesh has, and the mesh without it.
//!
//! The noise level is the distance of vertices from a cubic fitted to the two rings around them: at that scale folds
//! are close to cubics, noise is not. Folds as narrow as a few edges are not close to cubics either, so what may be
//! noise must also be incoherent (`coherence`). Noise is removed by a smoothing spline over the mesh: positions minimise their
//! distance from the scan plus a bending energy whose weight grows with the noise level. This also evens out vertices
//! along the surface. There noise folds triangles over, and a chart would need the area of each folded triangle
//! twice.

mod coherence;
#[cfg(test)]
mod decimation;

use coherence::is_coherent;
use darn_budget::{Budget, Exhausted};
use nalgebra::{SMatrix, SVector};

use super::curvature::doubled_normal;
use super::index::HalfEdgeId;
use super::pairing::{Buckets, corners_by_vertex};
use super::{TriMesh, Vec3};
use crate::cholesky::{SolveError, Symmetric};

/// Noise level, in mean edges, below which a mesh counts as clean. Noise-free cloth reads 0.00 to 0.05; one sheet in
/// twenty, all of it crumpled, reads 0.1.
const CLEAN: f64 = 0.07;
/// Weight of the bending energy at a noise level of one mean edge; it grows with the square of the level, as the
/// energy of noise does.
const STIFFNESS: f64 = 40.0;
/// The same along a border, which may be ragged without noise.
const BORDER_STIFFNESS: f64 = 12.0;
/// About how many vertices the noise level is estimated from, evenly spread over the numbering.
const SAMPLES: usize = 1000;
/// About how many suffice to recognise a scan that is far from noisy, as most are.
const SCREENING_SAMPLES: usize = 150;
/// Mean of |x| below its lower quartile, x standard normal. Lower quartile: noise raises every vertex, creases only a
/// few.
const LOWER_QUARTER: f64 = 0.1580;
/// A vertex with more faces is a hub. Scanners make no hubs, so its position tells nothing about noise; and its row
/// of the bending energy has ½ k² entries for k neighbours, which would not fit into memory for half a million.
const MOST_FACES: usize = 64;
/// Nanoseconds of work a vertex, without the factor.
const VERTEX_WORK: u64 = 500;
/// Rings of vertices that a cubic is fitted to.
const RINGS: usize = 2;
/// Terms of a cubic in two variables.
const TERMS: usize = 10;

/// The mesh without its noise; `None` when its noise level is below that of clean cloth, or when what looks like noise
/// is coherent: narrow folds, creases between facets, and coarse triangles of smooth cloth are.
///
/// Only positions change: x minimises Σ |xᵥ − scannedᵥ|² + λ Σ |mean of v's neighbours − xᵥ|², where border vertices
/// have only their neighbours on the border, and hubs (more than 64 faces) have no second term. Works on any mesh;
/// one sparse factor.
///
/// # Errors
/// `Exhausted`.
pub fn denoise(mesh: &TriMesh, budget: &Budget) -> Result<Option<TriMesh>, Exhausted> {
    budget.spend(VERTEX_WORK * mesh.positions.len() as u64)?;
    let incidence = Incidence::of(mesh);
    if noise_level(mesh, &incidence, SCREENING_SAMPLES) < 0.5 * CLEAN {
        return Ok(None);
    }
    let level = noise_level(mesh, &incidence, SAMPLES);
    if !(level > CLEAN && level.is_finite()) || is_coherent(mesh, &incidence, level) {
        return Ok(None);
    }
    let mut energy = Symmetric::zero(mesh.positions.len());
    for v in 0..mesh.positions.len() {
        energy.add(v, v, 1.0);
        if incidence.is_hub(v as u32) {
            continue;
        }
        let (neighbours, stiffness) = incidence.neighbours(mesh, v as u32);
        let share = 1.0 / neighbours.len() as f64;
        let bend = neighbours.iter().map(|w| (*w as usize, share));
        let bend: Vec<_> = bend.chain([(v, -1.0)]).collect();
        if !neighbours.is_empty() {
            energy.add_square(&bend, stiffness * level * level);
        }
    }
    let mut smooth: Vec<[f64; 3]> = mesh.positions.iter().map(|p| (*p).into()).collect();
    match energy
        .factor(budget)
        .and_then(|factor| factor.solve(&mut smooth))
    {
        Ok(()) => Ok(Some(TriMesh {
            positions: smooth.into_iter().map(Vec3::from).collect(),
            faces: mesh.faces.clone(),
        })),
        Err(SolveError::NotPositive) => Ok(None),
        Err(SolveError::Exhausted(exhausted)) => Err(exhausted),
    }
}

/// The corners at every vertex, each as the half-edge that leaves it.
struct Incidence(Buckets<HalfEdgeId>);

impl Incidence {
    fn of(mesh: &TriMesh) -> Incidence {
        let (origins, vertices) = (mesh.faces.as_flattened(), mesh.positions.len());
        Incidence(corners_by_vertex(origins, vertices))
    }

    /// The faces at a vertex, ascending.
    fn faces_at(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let corners = self.0.get(vertex as usize).iter();
        corners.map(|corner| corner.face().0)
    }

    /// The other corners of the faces at a vertex, ascending: those joined by an inner edge come twice, by a border
    /// edge once.
    fn others(&self, mesh: &TriMesh, vertex: u32) -> Vec<u32> {
        let corners = self.faces_at(vertex).flat_map(|f| mesh.faces[f as usize]);
        let mut others: Vec<u32> = corners.filter(|w| *w != vertex).collect();
        others.sort_unstable();
        others
    }

    fn is_hub(&self, vertex: u32) -> bool {
        self.0.get(vertex as usize).len() > MOST_FACES
    }

    fn is_border(&self, mesh: &TriMesh, vertex: u32) -> bool {
        singles(&self.others(mesh, vertex)).next().is_some()
    }

    /// The neighbours whose mean a vertex is drawn to, ascending (on a border, those along the border), and the
    /// stiffness of that term.
    fn neighbours(&self, mesh: &TriMesh, vertex: u32) -> (Vec<u32>, f64) {
        let mut others = self.others(mesh, vertex);
        let border: Vec<u32> = singles(&others).collect();
        others.dedup();
        if border.is_empty() {
            (others, STIFFNESS)
        } else {
            (border, BORDER_STIFFNESS)
        }
    }

    /// The unit normal at a vertex, weighted by area.
    fn normal(&self, mesh: &TriMesh, vertex: u32) -> Option<Vec3> {
        let faces = self.faces_at(vertex);
        let sum: Vec3 = faces.map(|f| doubled_normal(mesh, f as usize)).sum();
        sum.try_normalize(0.0)
    }

    /// The vertices within `depth` edges of a vertex, without itself, ascending; those behind a hub are left out, or
    /// every neighbour of the hub would collect all others.
    fn rings(&self, mesh: &TriMesh, vertex: u32, depth: usize) -> Vec<u32> {
        let mut found = self.others(mesh, vertex);
        for _ in 1..depth {
            found.dedup();
            let near = found.iter().filter(|w| !self.is_hub(**w));
            let mut wider: Vec<u32> = near.flat_map(|w| self.others(mesh, *w)).collect();
            wider.append(&mut found);
            wider.sort_unstable();
            found = wider;
        }
        found.dedup();
        found.retain(|w| *w != vertex);
        found
    }

    /// About this many inner vertices that are no hubs, evenly spread over the numbering.
    fn samples(&self, mesh: &TriMesh, about: usize) -> impl Iterator<Item = u32> {
        let stride = (mesh.positions.len() / about).max(1);
        let all = (0..mesh.positions.len() as u32).step_by(stride);
        all.filter(|v| !self.is_hub(*v) && !self.is_border(mesh, *v))
    }
}

/// The items that a sorted list has exactly once.
fn singles(sorted: &[u32]) -> impl Iterator<Item = u32> {
    let alike = sorted.chunk_by(|a, b| a == b);
    alike.filter_map(|all| match all {
        [one] => Some(*one),
        _ => None,
    })
}

/// Standard deviation of the noise across the surface, in mean edges; 0 for a mesh without inner vertices.
fn noise_level(mesh: &TriMesh, incidence: &Incidence, samples: usize) -> f64 {
    level_over(mesh, incidence, samples, RINGS)
}

/// Standard deviation of the vertices' distances from cubics fitted to this many rings, in mean edges, as if it were
/// noise; 0 for a mesh without inner vertices.
fn level_over(mesh: &TriMesh, incidence: &Incidence, samples: usize, rings: usize) -> f64 {
    let mut distances: Vec<f64> = (incidence.samples(mesh, samples))
        .filter_map(|v| off_cubic(mesh, incidence, v, rings))
        .map(f64::abs)
        .collect();
    if distances.is_empty() {
        return 0.0;
    }
    let quarter = distances.len().div_ceil(4);
    distances.select_nth_unstable_by(quarter - 1, f64::total_cmp);
    let mean = distances[..quarter].iter().sum::<f64>() / quarter as f64;
    mean / LOWER_QUARTER / mean_edge(mesh).max(f64::MIN_POSITIVE)
}

/// How far the cubic fitted to the rings around an inner vertex passes above it along its normal, scene units, scaled
/// so that the standard deviation is that of one vertex's noise (the noise of the cubic is divided out). `None` where
/// the rings do not determine a cubic.
fn off_cubic(mesh: &TriMesh, incidence: &Incidence, vertex: u32, rings: usize) -> Option<f64> {
    let rings = incidence.rings(mesh, vertex, rings);
    if rings.len() <= TERMS {
        return None;
    }
    let centre = mesh.positions[vertex as usize];
    let place = |v: &u32| mesh.positions[*v as usize] - centre;
    let normal = incidence.normal(mesh, vertex)?;
    let mut axis = Vec3::zeros();
    axis[normal.iamin()] = 1.0;
    let across = normal.cross(&axis).normalize();
    let along = normal.cross(&across);
    let size = rings.iter().map(|v| place(v).norm()).fold(0.0, f64::max);
    let mut matrix = SMatrix::<f64, TERMS, TERMS>::identity() * 1e-9;
    let mut rhs = SVector::<f64, TERMS>::zeros();
    for p in rings.iter().map(|v| place(v) / size) {
        let (x, y, z) = (p.dot(&across), p.dot(&along), p.dot(&normal));
        let quadric = [1.0, x, y, x * x, x * y, y * y];
        let cubic = [x * x * x, x * x * y, x * y * y, y * y * y];
        let row = SVector::<f64, TERMS>::from_iterator(quadric.into_iter().chain(cubic));
        matrix += row * row.transpose();
        rhs += row * z;
    }
    let factor = matrix.cholesky()?;
    let mut at_centre = SVector::<f64, TERMS>::zeros();
    at_centre[0] = 1.0;
    // The variance of the cubic's value at the vertex, in units of one neighbour's variance.
    let error = factor.solve(&at_centre)[0];
    let off = factor.solve(&rhs)[0] * size / (1.0 + error).sqrt();
    off.is_finite().then_some(off)
}

/// Mean length of the faces' sides, scene units.
fn mean_edge(mesh: &TriMesh) -> f64 {
    let sides = (0..mesh.faces.len()).map(|f| {
        let [a, b, c] = mesh.triangle(f);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    });
    sides.sum::<f64>() / (3 * mesh.faces.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::shapes::{concat, holed_sheet, jitter, sheet};

    fn level(mesh: &TriMesh) -> f64 {
        noise_level(mesh, &Incidence::of(mesh), SAMPLES)
    }

    fn waves(u: f64, v: f64) -> Vec3 {
        Vec3::new(u, v, 0.05 * (9.0 * u).sin() * (5.0 * v).cos())
    }

    /// Root mean square distance from the waves, in edges of 1/n.
    fn distance(mesh: &TriMesh, n: usize) -> f64 {
        let squares = mesh
            .positions
            .iter()
            .map(|p| (p.z - waves(p.x, p.y).z).powi(2));
        (squares.sum::<f64>() / mesh.positions.len() as f64).sqrt() * n as f64
    }

    /// Faces that are turned away from the sheet's upper side.
    fn folded_over(mesh: &TriMesh) -> usize {
        let down = |f: &u32| doubled_normal(mesh, *f as usize).z < 0.0;
        (0..mesh.faces.len() as u32).filter(down).count()
    }

    /// A cone: vertex 0 at a height over the middle of a ring, joined to `spokes` vertices on it.
    fn cone(spokes: u32, height: f64) -> TriMesh {
        let on_ring = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(spokes);
            Vec3::new(angle.cos(), angle.sin(), 0.0) * 0.1
        };
        let tip = Vec3::new(0.0, 0.0, height);
        TriMesh {
            positions: std::iter::once(tip)
                .chain((0..spokes).map(on_ring))
                .collect(),
            faces: (0..spokes)
                .map(|k| [0, 1 + k, 1 + (k + 1) % spokes])
                .collect(),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn clean_cloth_is_not_changed(n in 24usize..40, fold in 0.0..12.0f64) {
            let folded = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.05 * (fold * (u + v)).sin()));
            prop_assert!(level(&folded) < 0.03, "{}", level(&folded));
            prop_assert_eq!(denoise(&folded, Budget::unlimited()), Ok(None));
        }

        #[test]
        fn narrow_folds_and_creases_are_no_noise(
            n in 28usize..40, edges in 3.5..9.0f64, slope in 0.3..1.2f64, turn in 0.3..1.2f64, seed: u64,
        ) {
            // Squares that lie askew to the folds, and vertices that do not lie on their creases.
            let step = 1.0 / n as f64;
            let across = |u: f64, v: f64| (u * turn.cos() + v * turn.sin()) / (edges * step);
            let wave = |x: f64| (std::f64::consts::TAU * x).sin() / std::f64::consts::TAU;
            let chisel = |x: f64| (x.rem_euclid(1.0) - 0.5).abs();
            let flat = jitter(&sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0)), 0.3 * step, seed);
            for fold in [&wave as &dyn Fn(f64) -> f64, &chisel] {
                let lift = |p: &Vec3| Vec3::new(p.x, p.y, slope * edges * step * fold(across(p.x, p.y)));
                let folded = TriMesh {
                    positions: flat.positions.iter().map(lift).collect(),
                    faces: flat.faces.clone(),
                };
                prop_assert_eq!(denoise(&folded, Budget::unlimited()), Ok(None));
            }
        }

        #[test]
        fn noise_is_measured_and_removed(n in 24usize..40, noise in 0.2..0.5f64, seed: u64) {
            // The sum of three uniform shifts is close to a normal one; the mean edge of the squares' halves is 1.14
            // of their side.
            let amount = noise / n as f64 / 3f64.sqrt();
            let clean = sheet(n, |_, _| true, waves);
            let noisy = (0..3).fold(clean, |mesh, turn| jitter(&mesh, amount, seed.wrapping_add(turn)));
            let true_level = noise / 3f64.sqrt() / 1.14;
            let measured = level(&noisy);
            prop_assert!((measured / true_level - 1.0).abs() < 0.4, "{measured} {true_level}");
            let smooth = denoise(&noisy, Budget::unlimited()).unwrap();
            prop_assert!(smooth.is_some());
            if let Some(smooth) = smooth {
                prop_assert_eq!(&smooth.faces, &noisy.faces);
                prop_assert!(distance(&smooth, n) < 0.85 * distance(&noisy, n), "{} {}", distance(&smooth, n), distance(&noisy, n));
                prop_assert!(folded_over(&smooth) * 4 <= folded_over(&noisy), "{} {}", folded_over(&smooth), folded_over(&noisy));
            }
        }
    }

    #[test]
    fn a_hub_stays_and_collects_no_rings() {
        let noisy = jitter(&sheet(24, |_, _| true, waves), 0.3 / 24.0, 7);
        let lift = |spokes: u32| {
            let smooth = denoise(&concat(&cone(spokes, 0.05), &noisy), Budget::unlimited())
                .unwrap()
                .expect("noise");
            smooth.positions[0].z
        };
        assert!(lift(64) < 0.045, "{}", lift(64));
        // The tip has no bending term of its own, and those of the ring, a border, do not contain it.
        assert!((lift(65) - 0.05).abs() < 1e-12, "{}", lift(65));
        let around_first = |spokes: u32| {
            let mesh = cone(spokes, 0.0);
            Incidence::of(&mesh).rings(&mesh, 1, 2)
        };
        assert_eq!(around_first(64).len(), 64, "all but itself");
        assert_eq!(around_first(65), [0, 2, 3, 64, 65]);
    }

    #[test]
    fn meshes_without_inner_vertices_have_no_noise_level() {
        assert_eq!(level(&TriMesh::default()), 0.0);
        assert_eq!(denoise(&TriMesh::default(), Budget::unlimited()), Ok(None));
        assert_eq!(level(&holed_sheet(1, 0.0)), 0.0);
    }
}
