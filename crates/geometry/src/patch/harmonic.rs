//! Harmonic extension over a triangulated patch: values held at some vertices, as smooth as can be (Dirichlet energy) at all others.

use crate::cholesky::{Factor, NotPositive, Symmetric};
use crate::flatten::RestTriangle;
use crate::mesh::Vec2;

/// The factored Laplacian of a patch for one set of held vertices.
pub(super) struct Extension {
    factor: Option<Factor>,
    /// Per vertex: its unknown, or `Held` with its place among the held ones.
    role: Vec<Role>,
    /// Weights between an unknown and a held vertex: (unknown, held, weight).
    pulls: Vec<(usize, usize, f64)>,
    free: usize,
}

#[derive(Clone, Copy)]
enum Role {
    Free(usize),
    Held(usize),
}

/// Cotangent weights below this share of 1 are raised to it, so that every extension obeys the maximum principle.
const LEAST_WEIGHT: f64 = 1e-3;

impl Extension {
    /// Prepares extensions from `held` (at least one vertex, each once) over connected faces.
    ///
    /// # Errors
    /// `NotPositive` when some vertex has no connection to a held one.
    pub fn new(flat: &[Vec2], faces: &[[u32; 3]], held: &[u32]) -> Result<Extension, NotPositive> {
        let mut role = vec![Role::Free(0); flat.len()];
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
        let mut pulls = Vec::new();
        for face in faces {
            let rest = RestTriangle::from_corners(face.map(|v| flat[v as usize]));
            for k in 0..3 {
                let weight = (0.5 * rest.cotangent[k]).max(LEAST_WEIGHT);
                match (role[face[k] as usize], role[face[(k + 1) % 3] as usize]) {
                    (Role::Free(a), Role::Free(b)) => matrix.add_spring(a, b, weight),
                    (Role::Free(a), Role::Held(b)) | (Role::Held(b), Role::Free(a)) => {
                        matrix.add(a, a, weight);
                        pulls.push((a, b, weight));
                    }
                    (Role::Held(_), Role::Held(_)) => {}
                }
            }
        }
        let factor = if free > 0 {
            Some(matrix.factor()?)
        } else {
            None
        };
        Ok(Extension {
            factor,
            role,
            pulls,
            free,
        })
    }

    /// Solves with the Laplacian of the free vertices, in place: the smallest Dirichlet energy under a load.
    ///
    /// # Errors
    /// `NotPositive` when the result is not finite.
    pub fn solve<const K: usize>(&self, load: &mut [[f64; K]]) -> Result<(), NotPositive> {
        self.factor
            .as_ref()
            .map_or(Ok(()), |factor| factor.solve(load))
    }

    /// Bytes held, about.
    pub fn bytes(&self) -> usize {
        // The factor of a planar Laplacian has some 20 entries a row, with their row numbers.
        size_of_val(&self.role[..]) + size_of_val(&self.pulls[..]) + self.free * (20 * 12 + 8)
    }

    /// Extends one row of values per held vertex to all vertices.
    ///
    /// # Errors
    /// `NotPositive` when the result is not finite.
    pub fn extend<const K: usize>(&self, held: &[[f64; K]]) -> Result<Vec<[f64; K]>, NotPositive> {
        let mut x = vec![[0.0; K]; self.free];
        for (a, b, weight) in &self.pulls {
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
        let extended = Extension::new(&flat, &faces, &held)
            .unwrap()
            .extend(&values)
            .unwrap();
        for (p, x) in flat.iter().zip(&extended) {
            assert!((x[0] - f(p)[0]).abs() < 0.02);
        }
    }
}
