//! Pulls as bounded forces on the strain energy.
//!
//! The force of a pull acts on all free vertices in a disk around its point: a force on one triangle alone would raise
//! a spike. It has an upper bound, so that no target, however far, tears the cloth. Each pull adds one row to the
//! energy's matrix. The Cholesky factor stays as it is, the rows enter by the Woodbury identity: with B the rows of the
//! points, C the rows of the forces and Z = A⁻¹Cᵀ, the forces λ for the targets t solve (B Z + W⁻¹) λ = t − B A⁻¹r.

use darn_budget::Budget;
use nalgebra::{DMatrix, Dyn, LU};

use super::energy::StrainEnergy;
use super::pull::Firmness;
use crate::cholesky::SolveError;
use crate::mesh::Vec3;

/// One pull in terms of the energy's free vertices.
pub(super) struct AnchorForce {
    /// Free vertices of the triangle that holds the point, with their barycentric weights.
    pub corners: Vec<(usize, f64)>,
    /// Free vertices that the force acts on, with their shares of it; the shares add up to one.
    pub shares: Vec<(usize, f64)>,
    /// Part of the point's position that `corners` contribute without the force, scene space.
    pub start: Vec3,
    /// What they have to contribute for the point to lie at its target, scene space.
    pub end: Vec3,
    /// From the point without the force to its target, scene units.
    pub gap: Vec3,
    /// How firmly the point is held.
    pub firmness: Firmness,
    /// Largest force.
    pub limit: f64,
}

/// A pull acts when the free corners of its triangle have more than this weight.
const LEAST_WEIGHT: f64 = 0.1;
/// Calls of [`AnchorForces::relax`] that leave hard pulls as they are while there are soft ones.
const SOFT_FIRST: usize = 3;

impl AnchorForce {
    /// Whether free vertices can move the point: one beside the rim moves only if the nearest free vertex moves very
    /// far.
    fn acts(&self) -> bool {
        let weight: f64 = self.corners.iter().map(|(_, w)| w).sum();
        weight > LEAST_WEIGHT
    }
}

/// About the nanoseconds that assembling and factoring a dense system of pulls takes.
pub(super) fn gram_work(pulls: usize) -> u64 {
    let pulls = pulls as u64;
    10 * pulls.pow(2) + pulls.pow(3) / 3
}

/// All forces on one energy, ready to be added to its solutions.
pub(super) struct AnchorForces<'a> {
    forces: Vec<&'a AnchorForce>,
    /// Per force: the share of the way from `start` to `end` that the point is to go.
    progress: Vec<f64>,
    /// A⁻¹Cᵀ: one column of free vertices per force.
    response: Vec<Vec<f64>>,
    /// B Z + W⁻¹, factored.
    gram: LU<f64, Dyn, Dyn>,
    /// How often [`AnchorForces::relax`] was called.
    relaxations: usize,
}

impl<'a> AnchorForces<'a> {
    /// Prepares the forces that can act on the energy's free vertices; `None` when there are none.
    ///
    /// # Errors
    /// `NotPositive` when the energy's matrix cannot be solved; `Exhausted`.
    pub fn new(
        energy: &StrainEnergy,
        forces: &'a [AnchorForce],
        budget: &Budget,
    ) -> Result<Option<AnchorForces<'a>>, SolveError> {
        let forces: Vec<&AnchorForce> = forces.iter().filter(|force| force.acts()).collect();
        if forces.is_empty() {
            return Ok(None);
        }
        let mut response = Vec::with_capacity(forces.len());
        for force in &forces {
            budget.spend(energy.solve_work())?;
            let mut column = vec![[0.0]; energy.free()];
            force.shares.iter().for_each(|(v, w)| column[*v][0] += w);
            energy.solve(&mut column)?;
            response.push(column.into_iter().flatten().collect::<Vec<f64>>());
        }
        budget.spend_at_once(gram_work(forces.len()))?;
        let mut gram = DMatrix::from_fn(forces.len(), forces.len(), |i, j| {
            forces[i]
                .corners
                .iter()
                .map(|(v, w)| w * response[j][*v])
                .sum::<f64>()
        });
        let slack = 1e-9 * gram.trace();
        for (k, force) in forces.iter().enumerate() {
            gram[(k, k)] += force.firmness.compliance() + slack;
        }
        Ok(Some(AnchorForces {
            progress: vec![1.0; forces.len()],
            gram: gram.lu(),
            forces,
            response,
            relaxations: 0,
        }))
    }

    /// About the nanoseconds that [`AnchorForces::add_to`] takes.
    pub fn work(&self) -> u64 {
        let (count, free) = (self.forces.len(), self.response.first().map_or(0, Vec::len));
        (count * (3 * free + 6 * count)) as u64
    }

    /// Lets the points go only `share` as far as before. Soft pulls are relaxed first: beside hard ones, the first
    /// `SOFT_FIRST` calls relax soft pulls only, the last of them entirely, so that a strained soft pull never releases
    /// a hard one.
    pub fn relax(&mut self, share: f64) {
        self.relaxations += 1;
        let is_soft = |force: &AnchorForce| force.firmness == Firmness::Soft;
        let soft_count = self.forces.iter().filter(|f| is_soft(f)).count();
        let mixed = soft_count > 0 && soft_count < self.forces.len();
        let (soft, hard) = match self.relaxations {
            n if !mixed || n > SOFT_FIRST => (share, share),
            SOFT_FIRST => (0.0, 1.0),
            _ => (share, 1.0),
        };
        for (progress, force) in self.progress.iter_mut().zip(&self.forces) {
            *progress *= if is_soft(force) { soft } else { hard };
        }
    }

    /// Adds the effect of the forces to a solution without them; every force is cut to its limit.
    pub fn add_to(&self, solution: &mut [[f64; 3]]) {
        let mut forces = DMatrix::zeros(self.forces.len(), 3);
        for (k, force) in self.forces.iter().enumerate() {
            let point: Vec3 = force
                .corners
                .iter()
                .map(|(v, w)| Vec3::from(solution[*v]) * *w)
                .sum();
            let goal = force.start.lerp(&force.end, self.progress[k]);
            forces.set_row(k, &(goal - point).transpose());
        }
        if !self.gram.solve_mut(&mut forces) {
            return;
        }
        for (k, column) in self.response.iter().enumerate() {
            let force = Vec3::new(forces[(k, 0)], forces[(k, 1)], forces[(k, 2)])
                .cap_magnitude(self.forces[k].limit);
            for (x, z) in solution.iter_mut().zip(column) {
                (0..3).for_each(|d| x[d] += force[d] * z);
            }
        }
    }
}
