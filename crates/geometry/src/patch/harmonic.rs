//! Harmonic extension over a triangulated patch: values are given at some vertices and have the least Dirichlet energy
//! at all others.

use darn_budget::Budget;

use crate::cholesky::{Factor, SolveError, Symmetric};
use crate::flatten::RestTriangle;
use crate::mesh::{TriMesh, Vec2};

/// The factored cotangent Laplacian of a patch for one set of held vertices.
pub(super) struct HarmonicExtension {
    factor: Option<Factor>,
    /// Per vertex.
    role: Vec<Role>,
    /// Edges between a free and a held vertex: (index among the free, index among the held, weight).
    couplings: Vec<(usize, usize, f64)>,
    /// How many vertices are free.
    free: usize,
}

/// Whether a vertex is free or held, and its index among those.
#[derive(Clone, Copy)]
enum Role {
    Free(usize),
    Held(usize),
}

/// Least weight of an edge. Smaller and negative cotangent weights are raised to it, so that the maximum principle
/// holds.
const LEAST_WEIGHT: f64 = 1e-3;

impl HarmonicExtension {
    /// Prepares extensions from the vertices `held` (at least one, each once) over connected faces with vertices at
    /// `flat`.
    ///
    /// # Errors
    /// `NotPositive` when some vertex has no connection to a held one; `Exhausted`.
    pub fn new(
        flat: &[Vec2],
        faces: &[[u32; 3]],
        held: &[u32],
        budget: &Budget,
    ) -> Result<HarmonicExtension, SolveError> {
        let rest = |f: &[u32; 3]| RestTriangle::from_corners(f.map(|v| flat[v as usize]));
        let rest: Vec<RestTriangle> = faces.iter().map(rest).collect();
        Self::over(&rest, faces, flat.len(), held, budget)
    }

    /// The same over a surface in space.
    ///
    /// # Errors
    /// As [`HarmonicExtension::new`].
    pub fn on_surface(
        surface: &TriMesh,
        held: &[u32],
        budget: &Budget,
    ) -> Result<HarmonicExtension, SolveError> {
        let count = surface.positions.len();
        Self::over(
            &RestTriangle::of(surface),
            &surface.faces,
            count,
            held,
            budget,
        )
    }

    /// The same over faces of these shapes.
    fn over(
        rest: &[RestTriangle],
        faces: &[[u32; 3]],
        vertices: usize,
        held: &[u32],
        budget: &Budget,
    ) -> Result<HarmonicExtension, SolveError> {
        let mut role = vec![Role::Free(0); vertices];
        held.iter()
            .enumerate()
            .for_each(|(k, v)| role[*v as usize] = Role::Held(k));
        let mut free = 0;
        for r in &mut role {
            if let Role::Free(index) = r {
                *index = free;
                free += 1;
            }
        }
        let mut matrix = Symmetric::zero(free);
        let mut couplings = Vec::new();
        for (face, rest) in faces.iter().zip(rest) {
            for k in 0..3 {
                let weight = (0.5 * rest.cotangent[k]).max(LEAST_WEIGHT);
                match (role[face[k] as usize], role[face[(k + 1) % 3] as usize]) {
                    (Role::Free(a), Role::Free(b)) => matrix.add_spring(a, b, weight),
                    (Role::Free(a), Role::Held(b)) | (Role::Held(b), Role::Free(a)) => {
                        matrix.add(a, a, weight);
                        couplings.push((a, b, weight));
                    }
                    (Role::Held(_), Role::Held(_)) => {}
                }
            }
        }
        let factor = if free > 0 {
            Some(matrix.factor(budget)?)
        } else {
            None
        };
        Ok(HarmonicExtension {
            factor,
            role,
            couplings,
            free,
        })
    }

    /// Solves with the Laplacian of the free vertices, in place: one row of loads per free vertex becomes its solution,
    /// zero at held ones.
    ///
    /// # Errors
    /// `NotPositive` when the result is not finite.
    pub fn solve<const K: usize>(&self, load: &mut [[f64; K]]) -> Result<(), SolveError> {
        self.factor
            .as_ref()
            .map_or(Ok(()), |factor| factor.solve(load))
    }

    /// About the nanoseconds that [`HarmonicExtension::solve`] takes for one column.
    pub fn solve_work(&self) -> u64 {
        self.factor.as_ref().map_or(0, |f| f.solve_work(1))
    }

    /// Bytes of memory held, about.
    pub fn bytes(&self) -> usize {
        // The factor of a planar Laplacian has some 20 entries a row, with their row numbers.
        size_of_val(&self.role[..]) + size_of_val(&self.couplings[..]) + self.free * (20 * 12 + 8)
    }

    /// Extends K values per held vertex to all vertices.
    ///
    /// # Errors
    /// `NotPositive` when the result is not finite.
    pub fn extend<const K: usize>(&self, held: &[[f64; K]]) -> Result<Vec<[f64; K]>, SolveError> {
        let mut x = vec![[0.0; K]; self.free];
        for (a, b, weight) in &self.couplings {
            (0..K).for_each(|k| x[*a][k] += weight * held[*b][k]);
        }
        if let Some(factor) = &self.factor {
            factor.solve(&mut x)?;
        }
        let value = |r: &Role| match r {
            Role::Free(a) => x[*a],
            Role::Held(b) => held[*b],
        };
        Ok(self.role.iter().map(value).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_function_extends_to_itself() {
        let n = 6;
        let flat: Vec<Vec2> = (0..n * n)
            .map(|k| Vec2::new((k % n) as f64, (k / n) as f64))
            .collect();
        let faces: Vec<[u32; 3]> = (0..n - 1)
            .flat_map(|j| (0..n - 1).map(move |i| (j * n + i) as u32))
            .flat_map(|a| {
                [
                    [a, a + 1, a + 1 + n as u32],
                    [a, a + 1 + n as u32, a + n as u32],
                ]
            })
            .collect();
        let border = |p: &Vec2| p.min() == 0.0 || p.max() == (n - 1) as f64;
        let held: Vec<u32> = (0..flat.len() as u32)
            .filter(|v| border(&flat[*v as usize]))
            .collect();
        let f = |p: &Vec2| [2.0 * p.x - p.y + 1.0];
        let values: Vec<[f64; 1]> = held.iter().map(|v| f(&flat[*v as usize])).collect();
        let extended = HarmonicExtension::new(&flat, &faces, &held, Budget::unlimited())
            .unwrap()
            .extend(&values)
            .unwrap();
        for (p, x) in flat.iter().zip(&extended) {
            assert!((x[0] - f(p)[0]).abs() < 0.02);
        }
    }
}
