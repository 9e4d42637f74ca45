//! Noise of a scanner on cloth: how much there is, and the surface without it.
//!
//! The level is what vertices stand off from a quadric through the two rings around them; folds are quadrics at that scale, noise is not.
//! Noise is taken off by moving every vertex onto the quadric through the rings around it (moving least squares of degree 2; Levin 2004),
//! and then along the surface towards the middle of its neighbours: noise along the surface folds triangles over, and laid flat each of them
//! asks for its area twice.

use nalgebra::{SMatrix, SVector};

use super::topology::corners_by_vertex;
use super::{TriMesh, Vec3};

/// Vertices that the level is estimated from, about; evenly spread over the numbering.
const SAMPLES: usize = 1000;
/// As many show that a scan is far from noisy, as most are.
const GLANCE: usize = 150;
/// What a vertex stands off from the quadric through its two rings, in standard deviations of the noise: its own and the quadric's.
const OWN_AND_FIT: f64 = 1.2;
/// Mean of |x| below its median, of a standard normal variable. The lower half, for noise is everywhere, folds are not.
const LOWER_HALF: f64 = 0.3247;

/// How strongly noise is taken off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Level, in mean edges, below which a mesh counts as clean. Cloth without noise reads 0.01 to 0.07, the most crumpled 0.1 to 0.14.
    pub clean: f64,
    /// Rings of vertices around a vertex that its quadric goes through.
    pub rings: usize,
    /// Spread of the weights, in the largest distance: at no noise, and what a level of one edge adds. Wide ones cost folds.
    pub spread: [f64; 2],
    /// Rounds of moving along the surface, halfway to the neighbours' middle each.
    pub evening: usize,
}

impl Default for Filter {
    fn default() -> Self {
        Filter {
            clean: 0.12,
            rings: 2,
            spread: [0.15, 0.85],
            evening: 2,
        }
    }
}

/// The mesh with its noise taken off; `None` when there is none worth mentioning.
///
/// Same faces, same vertices, only their positions differ. Works on any mesh; O(vertices · rings²).
pub fn denoised(mesh: &TriMesh, filter: &Filter) -> Option<TriMesh> {
    let around = Around::of(mesh);
    if level(mesh, &around, GLANCE) < 0.5 * filter.clean {
        return None;
    }
    let level = level(mesh, &around, SAMPLES);
    (level > filter.clean && level.is_finite()).then(|| {
        let spread = filter.spread[0] + filter.spread[1] * level;
        let moved = (0..mesh.positions.len() as u32).map(|v| {
            let here = mesh.positions[v as usize];
            let wide = around.rings(mesh, v, filter.rings);
            let fit = fitted(mesh, &around, (v, &wide), |d| {
                (-0.5 * (d / spread).powi(2)).exp()
            });
            fit.map_or(here, |(normal, off)| here + normal * off)
        });
        let mut smooth = TriMesh {
            positions: moved.collect(),
            faces: mesh.faces.clone(),
        };
        for _ in 0..filter.evening {
            smooth.positions = evened(&smooth, &around);
        }
        smooth
    })
}

/// Inner vertices halfway along the surface to the middle of their neighbours.
fn evened(mesh: &TriMesh, around: &Around) -> Vec<Vec3> {
    let moved = |v: u32| {
        let here = mesh.positions[v as usize];
        let ring = around.rings(mesh, v, 1);
        if around.is_border(v, &ring) {
            return None;
        }
        let normal = around.normal(mesh, v)?;
        let others = ring.iter().filter(|w| **w != v);
        let sum: Vec3 = others.map(|w| mesh.positions[*w as usize]).sum();
        let d = sum / (ring.len() - 1) as f64 - here;
        Some(here + (d - normal * normal.dot(&d)) * 0.5)
    };
    (0u32..)
        .zip(&mesh.positions)
        .map(|(v, here)| moved(v).unwrap_or(*here))
        .collect()
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
    fn faces_at(&self, vertex: u32) -> impl ExactSizeIterator<Item = u32> {
        let v = vertex as usize;
        let corners = &self.corners[self.starts[v] as usize..self.starts[v + 1] as usize];
        corners.iter().map(|corner| corner / 3)
    }

    /// Whether a vertex with this ring, itself included, lies on a border: there is one neighbour more than there are faces.
    fn is_border(&self, vertex: u32, ring: &[u32]) -> bool {
        ring.len() != self.faces_at(vertex).len() + 1
    }

    /// The normal at a vertex, weighted by area.
    fn normal(&self, mesh: &TriMesh, vertex: u32) -> Option<Vec3> {
        let faces = self.faces_at(vertex);
        let sum: Vec3 = faces.map(|f| doubled_normal(mesh, f)).sum();
        sum.try_normalize(0.0)
    }

    /// The vertices within so many edges of a vertex, itself included, ascending.
    fn rings(&self, mesh: &TriMesh, vertex: u32, rings: usize) -> Vec<u32> {
        let mut found = vec![vertex];
        for _ in 0..rings {
            let faces = found.iter().flat_map(|&v| self.faces_at(v));
            let corners = faces.flat_map(|f| mesh.faces[f as usize]);
            let mut wider: Vec<u32> = corners.collect();
            wider.sort_unstable();
            wider.dedup();
            found = wider;
        }
        found
    }
}

/// Standard deviation of the noise across the surface, in mean edges; 0 for a mesh with no inner vertices.
fn level(mesh: &TriMesh, around: &Around, samples: usize) -> f64 {
    let stride = (mesh.positions.len() / samples).max(1);
    let mut off: Vec<f64> = (0..mesh.positions.len() as u32)
        .step_by(stride)
        .filter_map(|v| stand_off(mesh, around, v))
        .collect();
    if off.is_empty() {
        return 0.0;
    }
    let half = off.len().div_ceil(2);
    off.select_nth_unstable_by(half - 1, f64::total_cmp);
    let mean = off[..half].iter().sum::<f64>() / half as f64;
    mean / (LOWER_HALF * OWN_AND_FIT) / mean_edge(mesh).max(f64::MIN_POSITIVE)
}

/// How far an inner vertex lies from the quadric through the two rings around it, scene units; `None` at the border.
fn stand_off(mesh: &TriMesh, around: &Around, vertex: u32) -> Option<f64> {
    if around.is_border(vertex, &around.rings(mesh, vertex, 1)) {
        return None;
    }
    let mut rings = around.rings(mesh, vertex, 2);
    rings.retain(|&v| v != vertex);
    let (_, off) = fitted(mesh, around, (vertex, &rings), |_| 1.0)?;
    Some(off.abs())
}

/// The normal at a vertex, and how far along it the quadric passes that is fitted to some vertices around it, scene units. `weight` is
/// given distances relative to the farthest.
fn fitted(
    mesh: &TriMesh,
    around: &Around,
    (vertex, others): (u32, &[u32]),
    weight: impl Fn(f64) -> f64,
) -> Option<(Vec3, f64)> {
    let centre = mesh.positions[vertex as usize];
    let place = |v: &u32| mesh.positions[*v as usize] - centre;
    let normal = around.normal(mesh, vertex)?;
    let mut axis = Vec3::zeros();
    axis[normal.iamin()] = 1.0;
    let across = normal.cross(&axis).normalize();
    let along = normal.cross(&across);
    let size = others.iter().map(|v| place(v).norm()).fold(0.0, f64::max);
    let mut matrix = SMatrix::<f64, 6, 6>::identity() * 1e-9;
    let mut rhs = SVector::<f64, 6>::zeros();
    for p in others.iter().map(|v| place(v) / size) {
        let (x, y, z) = (p.dot(&across), p.dot(&along), p.dot(&normal));
        let row = SVector::<f64, 6>::from([1.0, x, y, x * x, x * y, y * y]);
        let weighted = row * weight(p.norm());
        matrix += weighted * row.transpose();
        rhs += weighted * z;
    }
    let off = matrix.cholesky()?.solve(&rhs)[0] * size;
    off.is_finite().then_some((normal, off))
}

fn doubled_normal(mesh: &TriMesh, face: u32) -> Vec3 {
    let [a, b, c] = mesh.triangle(face as usize);
    (b - a).cross(&(c - a))
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
    use crate::mesh::shapes::{holed_sheet, shaken, sheet};

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
        let down = |f: &u32| doubled_normal(mesh, *f).z < 0.0;
        (0..mesh.faces.len() as u32).filter(down).count()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn clean_cloth_is_left_alone(n in 24usize..40, fold in 0.0..12.0f64) {
            let folded = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.05 * (fold * (u + v)).sin()));
            prop_assert!(noise_level(&folded) < 0.03, "{}", noise_level(&folded));
            prop_assert_eq!(denoised(&folded, &Filter::default()), None);
        }

        #[test]
        fn noise_is_measured_and_taken_off(n in 24usize..40, noise in 0.2..0.5f64, seed: u64) {
            let noisy = shaken(&sheet(n, |_, _| true, waves), noise / n as f64, seed);
            // Even over ± noise; the mean edge of the squares' halves is 1.14 of their side.
            let true_level = noise / 3f64.sqrt() / 1.14;
            let level = noise_level(&noisy);
            prop_assert!((level / true_level - 1.0).abs() < 0.35, "{level} {true_level}");
            let smooth = denoised(&noisy, &Filter { clean: 0.05, ..Filter::default() });
            prop_assert!(smooth.is_some());
            if let Some(smooth) = smooth {
                prop_assert_eq!(&smooth.faces, &noisy.faces);
                prop_assert!(off(&smooth, n) < 0.85 * off(&noisy, n), "{} {}", off(&smooth, n), off(&noisy, n));
                prop_assert!(folded_over(&smooth) * 4 <= folded_over(&noisy), "{} {}", folded_over(&smooth), folded_over(&noisy));
            }
        }
    }

    #[test]
    fn meshes_without_inside_have_no_level() {
        assert_eq!(noise_level(&TriMesh::default()), 0.0);
        assert_eq!(denoised(&TriMesh::default(), &Filter::default()), None);
        assert_eq!(noise_level(&holed_sheet(1, 0.0)), 0.0);
    }
}
