//! A flip-free layout: the symmetric Dirichlet energy, minimised by reweighted ARAP steps (SLIM; Rabinovich, Poranne,
//! Panozzo, Sorkine-Hornung 2017).

use darn_budget::Budget;
use nalgebra::Matrix2;

use super::chart::Layout;
use super::error::FlattenError;
use super::rest_triangle::RestTriangle;
use crate::cholesky::Symmetric;
use crate::mesh::{TriMesh, Vec2};

/// Most steps; each factors a system twice the size of ARAP's.
const STEPS: usize = 40;
/// Steps end when one lowers the energy by less than this share.
const GAIN: f64 = 1e-4;
/// Share of the way to the first flip that a step may go.
const SAFE: f64 = 0.8;
/// Weight of the distance from the point before the step, per coordinate; keeps the system definite.
const PROXIMAL: f64 = 1e-6;
/// Nanoseconds of work a face in a step, without its factor.
const FACE_WORK: u64 = 2000;

/// Minimises Σ_f A_f (‖J‖² + ‖J⁻¹‖²) from a start without flips; never flips a face.
///
/// # Errors
/// `Singular` when a step's system has no solution; `Exhausted`.
pub(super) fn minimise(
    mesh: &TriMesh,
    rest: &[RestTriangle],
    start: &[Vec2],
    budget: &Budget,
) -> Result<Layout, FlattenError> {
    let gradients: Vec<[Vec2; 3]> = rest.iter().map(RestTriangle::gradients).collect();
    let problem = DirichletEnergy {
        mesh,
        rest,
        gradients,
    };
    let mut flat = start.to_vec();
    let mut energy = problem.energy(&flat);
    let mut steps = 0;
    while steps < STEPS {
        steps += 1;
        budget.spend(FACE_WORK * rest.len() as u64)?;
        let goal = problem.step(&flat, budget)?;
        let direction: Vec<Vec2> = goal.iter().zip(&flat).map(|(g, p)| g - p).collect();
        let mut length = (SAFE * problem.first_flip(&flat, &direction)).min(1.0);
        let before = energy;
        for _ in 0..20 {
            let tried: Vec<Vec2> = flat
                .iter()
                .zip(&direction)
                .map(|(p, d)| p + d * length)
                .collect();
            let reached = problem.energy(&tried);
            if reached < energy {
                (flat, energy) = (tried, reached);
                break;
            }
            length *= 0.5;
        }
        if before - energy <= GAIN * before {
            break;
        }
    }
    Ok(Layout {
        flat,
        rounds: steps,
    })
}

/// The energy of layouts of a mesh.
struct DirichletEnergy<'a> {
    mesh: &'a TriMesh,
    rest: &'a [RestTriangle],
    gradients: Vec<[Vec2; 3]>,
}

impl DirichletEnergy<'_> {
    /// Jacobian of the map from the rest triangle of face `f` to the layout.
    fn jacobian(&self, f: usize, flat: &[Vec2]) -> Matrix2<f64> {
        let corners = self.mesh.faces[f].map(|v| flat[v as usize]);
        (0..3)
            .map(|k| corners[k] * self.gradients[f][k].transpose())
            .sum()
    }

    fn weight(&self, f: usize) -> f64 {
        self.rest[f].weight * self.rest[f].area
    }

    /// The energy of a layout; infinite when a face is flipped.
    fn energy(&self, flat: &[Vec2]) -> f64 {
        let of = |f: usize| {
            let j = self.jacobian(f, flat);
            let det = j.determinant();
            if det <= 0.0 {
                return f64::INFINITY;
            }
            let square = j.norm_squared();
            self.weight(f) * (square + square / (det * det))
        };
        (0..self.rest.len()).map(of).sum()
    }

    /// The minimiser of the quadratic proxy Σ A ‖W (J − R)‖² around `flat`.
    fn step(&self, flat: &[Vec2], budget: &Budget) -> Result<Vec<Vec2>, FlattenError> {
        const STAGE: &str = "symmetric Dirichlet";
        let singular = || FlattenError::Singular {
            stage: STAGE,
            vertices: flat.len(),
        };
        let mut matrix = Symmetric::zero(2 * flat.len());
        let mut rhs = vec![[0.0]; 2 * flat.len()];
        for (f, face) in self.mesh.faces.iter().enumerate() {
            let Proxy { weight, rotation } = proxy(&self.jacobian(f, flat)).ok_or_else(singular)?;
            let goal = weight * rotation;
            for r in 0..2 {
                for c in 0..2 {
                    let row: [(usize, f64); 6] = std::array::from_fn(|n| {
                        let (k, d) = (n / 2, n % 2);
                        (
                            2 * face[k] as usize + d,
                            weight[(r, d)] * self.gradients[f][k][c],
                        )
                    });
                    matrix.add_square(&row, self.weight(f));
                    row.iter().for_each(|(i, coefficient)| {
                        rhs[*i][0] += self.weight(f) * coefficient * goal[(r, c)]
                    });
                }
            }
        }
        for (v, p) in flat.iter().enumerate() {
            for d in 0..2 {
                matrix.add(2 * v + d, 2 * v + d, PROXIMAL);
                rhs[2 * v + d][0] += PROXIMAL * p[d];
            }
        }
        matrix
            .factor(budget)
            .and_then(|factor| factor.solve(&mut rhs))
            .map_err(|e| FlattenError::unsolved(e, STAGE, flat.len()))?;
        Ok((0..flat.len())
            .map(|v| Vec2::new(rhs[2 * v][0], rhs[2 * v + 1][0]))
            .collect())
    }

    /// The smallest positive step along `direction` at which a face loses its area.
    fn first_flip(&self, flat: &[Vec2], direction: &[Vec2]) -> f64 {
        let of = |face: &[u32; 3]| {
            let [p, q, r] = face.map(|v| flat[v as usize]);
            let [dp, dq, dr] = face.map(|v| direction[v as usize]);
            let (e, f, de, df) = (q - p, r - p, dq - dp, dr - dp);
            smallest_positive_root(de.perp(&df), de.perp(&f) + e.perp(&df), e.perp(&f))
        };
        self.mesh.faces.iter().map(of).fold(f64::INFINITY, f64::min)
    }
}

/// The quadratic proxy ‖W (J − R)‖² of a face's energy.
struct Proxy {
    /// W.
    weight: Matrix2<f64>,
    /// R.
    rotation: Matrix2<f64>,
}

/// The proxy at J = U diag(σ) Vᵀ: W = U diag(√((σ − σ⁻³)/(σ − 1))) Uᵀ, R = U Vᵀ. `None` when J has no decomposition.
fn proxy(j: &Matrix2<f64>) -> Option<Proxy> {
    let svd = j.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    let weight = svd.singular_values.map(|s| {
        let s = s.max(1e-8);
        if (s - 1.0).abs() < 1e-6 {
            2.0
        } else {
            ((s - s.powi(-3)) / (s - 1.0)).sqrt()
        }
    });
    Some(Proxy {
        weight: u * Matrix2::from_diagonal(&weight) * u.transpose(),
        rotation: u * vt,
    })
}

/// The smallest positive root of a t² + b t + c, infinite if there is none.
fn smallest_positive_root(a: f64, b: f64, c: f64) -> f64 {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // The numerically stable pair of roots: no cancellation between b and the square root.
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let positive = |t: f64| if t > 0.0 { t } else { f64::INFINITY };
    positive(q / a).min(positive(c / q))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_without_cancellation() {
        assert!((smallest_positive_root(1.0, -3.0, 2.0) - 1.0).abs() < 1e-12);
        assert!((smallest_positive_root(0.0, -2.0, 1.0) - 0.5).abs() < 1e-12);
        assert_eq!(smallest_positive_root(1.0, 3.0, 2.0), f64::INFINITY);
    }

    #[test]
    fn a_squashed_square_is_relaxed_to_its_rest_shape() {
        let positions = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let mesh = TriMesh {
            positions: positions
                .iter()
                .map(|p| crate::mesh::Vec3::new(p.0, p.1, 0.0))
                .collect(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
        };
        let start: Vec<Vec2> = positions
            .iter()
            .map(|p| Vec2::new(3.0 * p.0, 0.2 * p.1 + 0.5 * p.0))
            .collect();
        let flat = minimise(&mesh, &RestTriangle::of(&mesh), &start, Budget::unlimited())
            .unwrap()
            .flat;
        for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0)] {
            assert!(((flat[a] - flat[b]).norm() - 1.0).abs() < 0.01);
        }
    }
}
