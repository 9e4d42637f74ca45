//! Noise of a scanner on cloth: how much there is, and the surface without it.
//!
//! The level is what vertices stand off from a cubic through the two rings around them; folds are cubics at that scale, noise is not.
//! Noise is taken off by a smoothing spline over the mesh: every vertex gives way to the bending energy of all of them, the more the
//! noisier the scan is. That evens vertices along the surface, too, where noise folds triangles over: laid flat, each of those would ask
//! for its area twice.

use nalgebra::{SMatrix, SVector};

use super::curvature::doubled_normal;
use super::topology::corners_by_vertex;
use super::{TriMesh, Vec3};
use crate::cholesky::Symmetric;

/// Level, in mean edges, below which a mesh counts as clean. Cloth without noise reads 0.00 to 0.05, one in twenty, all crumpled, 0.1.
const CLEAN: f64 = 0.07;
/// Weight of the bending energy at a level of one edge; it grows with the level's square, as the noise's own energy does.
const STIFFNESS: f64 = 40.0;
/// The same along a border: a ragged one is no noise.
const BORDER_STIFFNESS: f64 = 12.0;
/// Vertices that the level is estimated from, about; evenly spread over the numbering.
const SAMPLES: usize = 1000;
/// As many show that a scan is far from noisy, as most are.
const GLANCE: usize = 150;
/// Mean of |x| below its lower quartile, of a standard normal variable. The lower quarter, for noise is everywhere, crumple is not.
const LOWER_QUARTER: f64 = 0.1580;
/// Faces at a vertex; one with more is a hub. A hub is no scanner's cloth, so its place says nothing of noise, and the square of its
/// bending row has half the square of its neighbours in entries: of half a million they would not fit into memory.
const MOST_FACES: usize = 64;
/// Terms of a cubic in two variables.
const TERMS: usize = 10;

/// The mesh with its noise taken off; `None` when there is none worth mentioning.
///
/// Same faces, same vertices, only their positions differ: x minimises Σ |xᵥ − scannedᵥ|² + λ Σ |mean of v's neighbours − xᵥ|², along the
/// border with neighbours there alone, hubs left out. Works on any mesh; one sparse factor.
pub fn denoised(mesh: &TriMesh) -> Option<TriMesh> {
    let around = Around::of(mesh);
    if level(mesh, &around, GLANCE) < 0.5 * CLEAN {
        return None;
    }
    let level = level(mesh, &around, SAMPLES);
    if !(level > CLEAN && level.is_finite()) {
        return None;
    }
    let mut energy = Symmetric::zero(mesh.positions.len());
    for v in 0..mesh.positions.len() {
        energy.add(v, v, 1.0);
        if around.is_hub(v as u32) {
            continue;
        }
        let (neighbours, stiffness) = around.neighbours(mesh, v as u32);
        let share = 1.0 / neighbours.len() as f64;
        let bend = neighbours.iter().map(|w| (*w as usize, share));
        let bend: Vec<_> = bend.chain([(v, -1.0)]).collect();
        if !neighbours.is_empty() {
            energy.add_square(&bend, stiffness * level * level);
        }
    }
    let mut smooth: Vec<[f64; 3]> = mesh.positions.iter().map(|p| (*p).into()).collect();
    energy.factor().ok()?.solve(&mut smooth).ok()?;
    Some(TriMesh {
        positions: smooth.into_iter().map(Vec3::from).collect(),
        faces: mesh.faces.clone(),
    })
}

/// The corners at every vertex; a corner's face is a third of its number.
struct Around {
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl Around {
    fn of(mesh: &TriMesh) -> Around {
        let (starts, corners) = corners_by_vertex(mesh.faces.as_flattened(), mesh.positions.len());
        Around { starts, corners }
    }

    /// The faces at a vertex, ascending.
    fn faces_at(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let v = vertex as usize;
        let corners = &self.corners[self.starts[v] as usize..self.starts[v + 1] as usize];
        corners.iter().map(|corner| corner / 3)
    }

    /// The other corners of the faces at a vertex, ascending: twice those inside, once those that follow on a border.
    fn others(&self, mesh: &TriMesh, vertex: u32) -> Vec<u32> {
        let corners = self.faces_at(vertex).flat_map(|f| mesh.faces[f as usize]);
        let mut others: Vec<u32> = corners.filter(|w| *w != vertex).collect();
        others.sort_unstable();
        others
    }

    fn is_hub(&self, vertex: u32) -> bool {
        let v = vertex as usize;
        (self.starts[v + 1] - self.starts[v]) as usize > MOST_FACES
    }

    fn is_border(&self, mesh: &TriMesh, vertex: u32) -> bool {
        once(&self.others(mesh, vertex)).next().is_some()
    }

    /// A vertex's neighbours, ascending, of one on a border those on the border; and how stiffly it keeps to their middle.
    fn neighbours(&self, mesh: &TriMesh, vertex: u32) -> (Vec<u32>, f64) {
        let mut others = self.others(mesh, vertex);
        let border: Vec<u32> = once(&others).collect();
        others.dedup();
        if border.is_empty() {
            (others, STIFFNESS)
        } else {
            (border, BORDER_STIFFNESS)
        }
    }

    /// The normal at a vertex, weighted by area.
    fn normal(&self, mesh: &TriMesh, vertex: u32) -> Option<Vec3> {
        let faces = self.faces_at(vertex);
        let sum: Vec3 = faces.map(|f| doubled_normal(mesh, f as usize)).sum();
        sum.try_normalize(0.0)
    }

    /// The vertices within two edges of a vertex, without itself, ascending. Not those beyond a hub: all round it would gather them.
    fn two_rings(&self, mesh: &TriMesh, vertex: u32) -> Vec<u32> {
        let ring = self.others(mesh, vertex);
        let near = ring.iter().filter(|w| !self.is_hub(**w));
        let mut found: Vec<u32> = near.flat_map(|w| self.others(mesh, *w)).collect();
        found.extend(ring);
        found.sort_unstable();
        found.dedup();
        found.retain(|w| *w != vertex);
        found
    }
}

/// What is in a sorted list once.
fn once(sorted: &[u32]) -> impl Iterator<Item = u32> {
    let alike = sorted.chunk_by(|a, b| a == b);
    alike.filter_map(|all| match all {
        [one] => Some(*one),
        _ => None,
    })
}

/// Standard deviation of the noise across the surface, in mean edges; 0 for a mesh with no inner vertices.
fn level(mesh: &TriMesh, around: &Around, samples: usize) -> f64 {
    let stride = (mesh.positions.len() / samples).max(1);
    let mut off: Vec<f64> = (0..mesh.positions.len() as u32)
        .step_by(stride)
        .filter(|v| !around.is_hub(*v) && !around.is_border(mesh, *v))
        .filter_map(|v| stand_off(mesh, around, v))
        .collect();
    if off.is_empty() {
        return 0.0;
    }
    let quarter = off.len().div_ceil(4);
    off.select_nth_unstable_by(quarter - 1, f64::total_cmp);
    let mean = off[..quarter].iter().sum::<f64>() / quarter as f64;
    mean / LOWER_QUARTER / mean_edge(mesh).max(f64::MIN_POSITIVE)
}

/// How far an inner vertex lies from the cubic fitted to the two rings around it, scene units, in standard deviations of one vertex: the
/// cubic's own error there is taken off. `None` where the rings do not determine a cubic.
fn stand_off(mesh: &TriMesh, around: &Around, vertex: u32) -> Option<f64> {
    let rings = around.two_rings(mesh, vertex);
    if rings.len() <= TERMS {
        return None;
    }
    let centre = mesh.positions[vertex as usize];
    let place = |v: &u32| mesh.positions[*v as usize] - centre;
    let normal = around.normal(mesh, vertex)?;
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
    // The variance of the cubic's value at the vertex, in that of one neighbour.
    let error = factor.solve(&at_centre)[0];
    let off = factor.solve(&rhs)[0] * size / (1.0 + error).sqrt();
    off.is_finite().then_some(off.abs())
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
    use crate::mesh::shapes::{holed_sheet, shaken, sheet, together};

    fn noise_level(mesh: &TriMesh) -> f64 {
        level(mesh, &Around::of(mesh), SAMPLES)
    }

    fn waves(u: f64, v: f64) -> Vec3 {
        Vec3::new(u, v, 0.05 * (9.0 * u).sin() * (5.0 * v).cos())
    }

    /// Root mean square distance from the waves, in edges of 1/n.
    fn off(mesh: &TriMesh, n: usize) -> f64 {
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

    /// Vertex 0 at a height over the middle of a ring, joined to so many vertices on it.
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
        fn clean_cloth_is_left_alone(n in 24usize..40, fold in 0.0..12.0f64) {
            let folded = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.05 * (fold * (u + v)).sin()));
            prop_assert!(noise_level(&folded) < 0.03, "{}", noise_level(&folded));
            prop_assert_eq!(denoised(&folded), None);
        }

        #[test]
        fn noise_is_measured_and_taken_off(n in 24usize..40, noise in 0.2..0.5f64, seed: u64) {
            // Even noise three times over is near enough to normal, with the variance of once; the mean edge of the squares' halves is 1.14 of
            // their side.
            let amount = noise / n as f64 / 3f64.sqrt();
            let clean = sheet(n, |_, _| true, waves);
            let noisy = (0..3).fold(clean, |mesh, turn| shaken(&mesh, amount, seed.wrapping_add(turn)));
            let true_level = noise / 3f64.sqrt() / 1.14;
            let level = noise_level(&noisy);
            prop_assert!((level / true_level - 1.0).abs() < 0.4, "{level} {true_level}");
            let smooth = denoised(&noisy);
            prop_assert!(smooth.is_some());
            if let Some(smooth) = smooth {
                prop_assert_eq!(&smooth.faces, &noisy.faces);
                prop_assert!(off(&smooth, n) < 0.85 * off(&noisy, n), "{} {}", off(&smooth, n), off(&noisy, n));
                prop_assert!(folded_over(&smooth) * 4 <= folded_over(&noisy), "{} {}", folded_over(&smooth), folded_over(&noisy));
            }
        }
    }

    #[test]
    fn a_hub_stays_and_gathers_no_rings() {
        let noisy = shaken(&sheet(24, |_, _| true, waves), 0.3 / 24.0, 7);
        let lift = |spokes: u32| {
            let smooth = denoised(&together(&cone(spokes, 0.05), &noisy)).expect("noise");
            smooth.positions[0].z
        };
        assert!(lift(64) < 0.045, "{}", lift(64));
        // The ring is a border, which bends along itself: nothing is left that draws at the tip.
        assert!((lift(65) - 0.05).abs() < 1e-12, "{}", lift(65));
        let around_first = |spokes: u32| {
            let mesh = cone(spokes, 0.0);
            Around::of(&mesh).two_rings(&mesh, 1)
        };
        assert_eq!(around_first(64).len(), 64, "all but itself");
        assert_eq!(around_first(65), [0, 2, 3, 64, 65]);
    }

    #[test]
    fn meshes_without_inside_have_no_level() {
        assert_eq!(noise_level(&TriMesh::default()), 0.0);
        assert_eq!(denoised(&TriMesh::default()), None);
        assert_eq!(noise_level(&holed_sheet(1, 0.0)), 0.0);
    }
}
