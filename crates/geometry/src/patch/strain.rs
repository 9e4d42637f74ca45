//! Strain limiting: local and global steps that bring the patch back to the chart's lengths while the rim and the scan
//! around it are held.
//!
//! Projective dynamics (Bouaziz et al. 2014, "Projective dynamics: fusing constraint projections for fast simulation")
//! with one sparse factor. The local step takes every triangle to its nearest deformation within the strain limit, the
//! global step solves for positions.

use darn_budget::Budget;

use super::anderson::AndersonMixing;
use super::energy::{StrainEnergy, StrainOptions, StrainTarget};
use super::forces::AnchorForces;
use crate::cholesky::SolveError;
use crate::mesh::Vec3;

/// An energy to minimise, and how far.
#[derive(Clone, Copy)]
pub(super) struct Minimisation<'a> {
    /// The energy.
    pub energy: &'a StrainEnergy,
    /// What its terms aim at.
    pub target: &'a StrainTarget,
    /// Forces beside it.
    pub forces: Option<&'a AnchorForces<'a>>,
    /// When the rounds end.
    pub options: StrainOptions,
    /// What the rounds may cost.
    pub budget: &'a Budget<'a>,
}

impl Minimisation<'_> {
    /// Moves the free vertices, the first of `positions`, towards the least energy; returns the rounds it took.
    ///
    /// # Errors
    /// `NotPositive` when a step is not finite; `Exhausted`.
    pub fn run(&self, positions: &mut [Vec3]) -> Result<usize, SolveError> {
        let Minimisation {
            energy,
            target,
            forces,
            options,
            budget,
        } = *self;
        if energy.free() == 0 {
            return Ok(0);
        }
        let round_work = energy.round_work() + forces.map_or(0, AnchorForces::work);
        let mut mixing = AndersonMixing::new(3 * energy.free());
        let mut step = target.constant().to_vec();
        let mut rounds = 0;
        while rounds < options.max_rounds {
            step.copy_from_slice(target.constant());
            energy.add_strain(&mut step, positions, target, options.max_strain);
            energy.solve(&mut step)?;
            if let Some(forces) = forces {
                forces.add_to(&mut step);
            }
            rounds += 1;
            budget.spend(round_work)?;
            let moved = mixing.advance(positions, &step) / energy.mean_edge();
            if moved < options.tolerance {
                break;
            }
        }
        Ok(rounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Vec2;
    use crate::patch::rest::RestMesh;

    /// A flat lattice of 2·n² triangles with unit edges; its border comes last so that it is held.
    fn lattice(n: usize) -> (Vec<Vec2>, Vec<[u32; 3]>, usize) {
        let inner = |i: usize, j: usize| i > 0 && j > 0 && i < n && j < n;
        let cells = || (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let order: Vec<(usize, usize)> = cells()
            .filter(|(i, j)| inner(*i, *j))
            .chain(cells().filter(|(i, j)| !inner(*i, *j)))
            .collect();
        let at = |i, j| order.iter().position(|c| *c == (i, j)).unwrap() as u32;
        let faces = (0..n)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let rest = order
            .iter()
            .map(|(i, j)| Vec2::new(*i as f64, *j as f64))
            .collect();
        (rest, faces, (n - 1) * (n - 1))
    }

    /// Limits the strain of a mesh whose target is where it lies.
    fn minimise(rest: &RestMesh, positions: &mut [Vec3], options: StrainOptions) {
        let energy = StrainEnergy::new(rest, &options, Budget::unlimited()).unwrap();
        let target = energy.target_near(positions, &options);
        let minimisation = Minimisation {
            energy: &energy,
            target: &target,
            forces: None,
            options,
            budget: Budget::unlimited(),
        };
        minimisation.run(positions).unwrap();
    }

    #[test]
    fn a_sagging_sheet_returns_to_its_lengths() {
        let (rest, faces, free) = lattice(8);
        let mut positions: Vec<Vec3> = rest.iter().map(|p| Vec3::new(p.x, p.y, 0.0)).collect();
        for p in &mut positions[..free] {
            p.z = -2.0;
            p.x += 0.4;
        }
        let options = StrainOptions {
            tether_length: 1e4,
            rest_curvature: 0.0,
            ..StrainOptions::default()
        };
        let rest_mesh = RestMesh {
            points: &rest,
            faces: &faces,
            free,
            stretches: &[],
        };
        minimise(&rest_mesh, &mut positions, options);
        for face in &faces {
            for k in 0..3 {
                let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
                let r = (positions[a] - positions[b]).norm() / (rest[a] - rest[b]).norm();
                assert!((r - 1.0).abs() < 0.05, "{r}");
            }
        }
    }

    #[test]
    fn a_sheet_at_rest_stays_in_place() {
        let (rest, faces, free) = lattice(6);
        let mut positions: Vec<Vec3> = rest.iter().map(|p| Vec3::new(p.x, 2.0, p.y)).collect();
        let before = positions.clone();
        let options = StrainOptions::default();
        let rest_mesh = RestMesh {
            points: &rest,
            faces: &faces,
            free,
            stretches: &[],
        };
        minimise(&rest_mesh, &mut positions, options);
        for (p, q) in positions.iter().zip(&before) {
            assert!((p - q).norm() < 1e-9);
        }
    }
}
