//! Pulls on a planned patch: where their forces act, and how far the patch follows them.

use super::PatchPlan;
use darn_budget::{Budget, Exhausted};

use crate::cholesky::SolveError;
use crate::flatten::Chart;
use crate::grid;
use crate::mesh::{Vec2, Vec3};
use crate::patch::energy::StrainOptions;
use crate::patch::forces::{AnchorForce, AnchorForces, gram_work};
use crate::patch::locate;
use crate::patch::pull::Pull;
use crate::patch::strain::Minimisation;

/// Radius of the disk that a pull acts on, in grid cells. A smaller disk raises a spike, which reaches the stretch
/// limit sooner and stays farther from the target.
const CONTACT_RADIUS: f64 = 3.0;
/// Pulls may stretch an edge this much, length ÷ length in the chart, ...
const STRETCH: f64 = 1.25;
/// ... or this many times as much as the edge stretched most without them.
const MORE: f64 = 1.05;
/// How often forces are relaxed before they are given up.
const RELAXATIONS: usize = 8;
/// Most rounds of strain limiting between two relaxations.
const ROUNDS: usize = 60;
/// Nanoseconds of work a face in the search for a pull's place.
const FACE_WORK: u64 = 5;

/// The largest stretch that pulls may leave an edge with, given the largest one without them; both are length ÷ length
/// in the chart.
pub fn stretch_limit(before: f64) -> f64 {
    STRETCH.max(MORE * before)
}

impl PatchPlan {
    /// Moves the free vertices of a patch at rest, which a minimisation without forces left at `positions`, so that the
    /// forces meet their targets, as far as the stretch limit allows; returns the rounds of strain limiting. They start `near` where that is known.
    pub(super) fn apply_forces(
        &self,
        at_rest: &Minimisation,
        positions: &mut [Vec3],
        forces: &[AnchorForce],
        near: Option<Vec<Vec3>>,
    ) -> Result<usize, SolveError> {
        let Minimisation {
            energy,
            options,
            budget,
            ..
        } = *at_rest;
        let Some(mut ready) = AnchorForces::new(energy, forces, budget)? else {
            return Ok(0);
        };
        let start = positions.to_vec();
        let before = self.stretch(&start);
        let limit = stretch_limit(before);
        let target = energy.target_at(positions);
        match near {
            Some(near) => positions.copy_from_slice(&near),
            None => self.lift(positions, forces, budget)?,
        }
        // Later rounds still move vertices, but by less than is visible.
        let options = StrainOptions {
            max_rounds: ROUNDS.min(options.max_rounds),
            ..options
        };
        let mut rounds = 0;
        for _ in 0..=RELAXATIONS {
            let minimisation = Minimisation {
                target: &target,
                forces: Some(&ready),
                options,
                ..*at_rest
            };
            rounds += minimisation.run(positions)?;
            let stretch = self.stretch(positions);
            if stretch <= limit {
                return Ok(rounds);
            }
            // Stretch grows about in proportion to progress; the factor 0.98 ends the search after fewer relaxations.
            ready.relax((0.98 * (limit - before) / (stretch - before)).min(0.9));
        }
        positions.copy_from_slice(&start);
        Ok(rounds)
    }

    /// The pulls as forces on a patch at `positions` (in the order of [`RimJoin`](crate::patch::rim_join::RimJoin)); a
    /// pull beside the hole gives none.
    ///
    /// # Errors
    /// `Exhausted`.
    pub(super) fn forces(
        &self,
        pulls: &[Pull],
        chart: &Chart,
        positions: &[Vec3],
        budget: &Budget,
    ) -> Result<Vec<AnchorForce>, Exhausted> {
        let radius = CONTACT_RADIUS * chart.frame.side / grid::SIDE as f64;
        let force = |pull: &Pull| {
            let triangulation = &self.triangulation;
            let (face, weights) = locate(&triangulation.points, &triangulation.faces, pull.at)?;
            let face = triangulation.faces[face];
            let corners: [(usize, f64); 3] =
                std::array::from_fn(|k| (self.join.vertex(face[k]) as usize, weights[k]));
            let shift = self.shift.as_ref().map_or(Vec3::zeros(), |shift| {
                let each = face.iter().zip(&weights);
                each.map(|(v, w)| shift[*v as usize] * *w).sum()
            });
            let target = pull.to - shift;
            let weighted = |corners: &[(usize, f64)]| -> Vec3 {
                corners.iter().map(|(v, w)| positions[*v] * *w).sum()
            };
            let (free, held): (Vec<_>, Vec<_>) =
                corners.into_iter().partition(|(v, _)| *v < self.free());
            Some(AnchorForce {
                shares: self.shares(pull.at, radius, &corners),
                start: weighted(&free),
                end: target - weighted(&held),
                gap: target - weighted(&corners),
                corners: free,
                firmness: pull.firmness,
                limit: pull.firmness.strength() * radius,
            })
        };
        let mut forces = Vec::new();
        for pull in pulls {
            budget.spend(FACE_WORK * self.triangulation.faces.len() as u64)?;
            forces.extend(force(pull));
        }
        Ok(forces)
    }

    /// The inner vertices within `radius` of a point in the plane, with their shares of its force, largest in the
    /// middle.
    fn shares(&self, at: Vec2, radius: f64, corners: &[(usize, f64); 3]) -> Vec<(usize, f64)> {
        let inner = &self.triangulation.points[self.rim.len()..];
        let mut shares: Vec<(usize, f64)> = (inner.iter().enumerate())
            .map(|(v, p)| (v, 1.0 - (p - at).norm_squared() / (radius * radius)))
            .filter(|(_, depth)| *depth > 0.0)
            .map(|(v, depth)| (v, depth * depth))
            .collect();
        // With few vertices in the disk, the patch is coarse: the force acts on the point's triangle alone.
        if shares.len() < corners.len() {
            shares = corners.to_vec();
            shares.retain(|(v, _)| *v < inner.len());
        }
        let sum: f64 = shares.iter().map(|(_, share)| share).sum();
        shares.iter_mut().for_each(|(_, share)| *share /= sum);
        shares
    }

    /// Moves the patch so that its points meet their targets, by the smoothest displacement that is zero at the rim
    /// (biharmonic). Strain limiting then starts from a smooth bump and not from a spike.
    fn lift(
        &self,
        positions: &mut [Vec3],
        forces: &[AnchorForce],
        budget: &Budget,
    ) -> Result<(), SolveError> {
        let mut bumps = Vec::with_capacity(forces.len());
        for force in forces {
            budget.spend(2 * self.rim_extension.solve_work())?;
            let mut bump = vec![[0.0]; self.free()];
            for (v, w) in &force.corners {
                bump[*v][0] += w;
            }
            self.rim_extension.solve(&mut bump)?;
            self.rim_extension.solve(&mut bump)?;
            bumps.push(bump);
        }
        let count = forces.len();
        budget.spend_at_once(gram_work(count))?;
        let at = |force: &AnchorForce, bump: &[[f64; 1]]| -> f64 {
            force.corners.iter().map(|(v, w)| bump[*v][0] * w).sum()
        };
        let mut gram = nalgebra::DMatrix::from_fn(count, count, |i, j| at(&forces[i], &bumps[j]));
        // With slack, pulls with different targets in one triangle are met on average.
        let slack = 1e-6 * gram.trace() / count as f64 + f64::MIN_POSITIVE;
        (0..count).for_each(|k| gram[(k, k)] += slack);
        let mut gaps = nalgebra::DMatrix::zeros(count, 3);
        for (k, force) in forces.iter().enumerate() {
            gaps.set_row(k, &force.gap.transpose());
        }
        gram.cholesky()
            .ok_or(SolveError::NotPositive)?
            .solve_mut(&mut gaps);
        for (k, bump) in bumps.iter().enumerate() {
            let gap = Vec3::new(gaps[(k, 0)], gaps[(k, 1)], gaps[(k, 2)]);
            (positions.iter_mut().zip(bump)).for_each(|(p, b)| *p += gap * b[0]);
        }
        Ok(())
    }

    /// Largest length ÷ length in the chart over the edges with a free end.
    fn stretch(&self, positions: &[Vec3]) -> f64 {
        let rest = self.join.rest();
        let edges = (rest.faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .map(|(a, b)| (a as usize, b as usize))
            .filter(|(a, b)| *a.min(b) < rest.free);
        let ratio = |(a, b): (usize, usize)| {
            (positions[a] - positions[b]).norm_squared()
                / (rest.points[a] - rest.points[b])
                    .norm_squared()
                    .max(f64::MIN_POSITIVE)
        };
        edges.map(ratio).fold(0.0, f64::max).sqrt()
    }
}
