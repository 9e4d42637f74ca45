//! Pulls on a planned patch: where they take hold, and how far the cloth follows.

use super::{PatchPlan, grid};
use crate::cholesky::NotPositive;
use crate::flatten::Chart;
use crate::mesh::{Vec2, Vec3};
use crate::patch::cloth::{Elastics, Fabric};
use crate::patch::locate;
use crate::patch::pull::{Grip, Pull, Pulls};

/// Radius of a finger, in cells: on less it draws pimples, which reach their stretch sooner and lie farther from the target.
const FINGER: f64 = 3.0;
/// A user's wishes may stretch an edge this much, ...
const STRETCH: f64 = 1.25;
/// ... or this much more than it is stretched without them.
const MORE: f64 = 1.05;
/// How often pulls go less far before they are given up.
const EASINGS: usize = 8;
/// Most rounds of strain limiting under one length of pulls.
const ROUNDS: usize = 60;

/// The largest stretch that wishes may leave an edge with, given the largest one without them.
pub fn bearable(before: f64) -> f64 {
    STRETCH.max(MORE * before)
}

impl PatchPlan {
    /// Draws the cloth, at rest where it lies, to where the pulls want it, as far as its strain allows; the rounds.
    pub(super) fn pull(
        &self,
        fabric: &Fabric,
        positions: &mut [Vec3],
        grips: &[Grip],
        elastics: &Elastics,
    ) -> Result<usize, NotPositive> {
        let mut ready = Pulls::new(fabric, positions, grips)?;
        if ready.is_empty() {
            return Ok(0);
        }
        let unpulled = positions.to_vec();
        let before = self.stretch(&unpulled);
        let bound = bearable(before);
        let drawn = fabric.at_rest(positions);
        self.lift(positions, grips)?;
        // Cloth that is pulled creeps on for long, by less than can be seen.
        let elastics = &Elastics {
            rounds: ROUNDS.min(elastics.rounds),
            ..*elastics
        };
        let mut rounds = 0;
        for _ in 0..=EASINGS {
            rounds += fabric.settle(&drawn, positions, elastics, &ready)?.rounds;
            let stretch = self.stretch(positions);
            if stretch <= bound {
                return Ok(rounds);
            }
            // Stretch grows about as the way does, and a little less than what fits is soon found.
            ready.ease((0.98 * (bound - before) / (stretch - before)).min(0.9));
        }
        positions.copy_from_slice(&unpulled);
        Ok(rounds)
    }

    /// Where the pulls take hold.
    pub(super) fn grips(&self, pulls: &[Pull], chart: &Chart) -> Vec<Grip> {
        let radius = FINGER * chart.frame.side / grid::SIDE as f64;
        let grip = |pull: &Pull| {
            let (face, weights) = locate(&self.tiled.points, &self.tiled.faces, pull.at)?;
            let face = self.tiled.faces[face];
            let corners = std::array::from_fn(|k| (self.hem.place(face[k]) as usize, weights[k]));
            let shift = self.shift.as_ref().map_or(Vec3::zeros(), |shift| {
                let each = face.iter().zip(&weights);
                each.map(|(v, w)| shift[*v as usize] * *w).sum()
            });
            Some(Grip {
                corners,
                finger: self.finger(pull.at, radius, &corners),
                radius,
                to: pull.to - shift,
                hold: pull.hold,
            })
        };
        pulls.iter().filter_map(grip).collect()
    }

    /// The inner vertices that a finger on the cloth touches, with their shares of its force: most in its middle.
    fn finger(&self, at: Vec2, radius: f64, corners: &[(usize, f64); 3]) -> Vec<(usize, f64)> {
        let inner = &self.tiled.points[self.rim.len()..];
        let mut touched: Vec<(usize, f64)> = (inner.iter().enumerate())
            .map(|(v, p)| (v, 1.0 - (p - at).norm_squared() / (radius * radius)))
            .filter(|(_, depth)| *depth > 0.0)
            .map(|(v, depth)| (v, depth * depth))
            .collect();
        // A finger between the vertices of coarse cloth pushes its triangle alone.
        if touched.len() < corners.len() {
            touched = corners.to_vec();
            touched.retain(|(v, _)| *v < inner.len());
        }
        let sum: f64 = touched.iter().map(|(_, share)| share).sum();
        touched.iter_mut().for_each(|(_, share)| *share /= sum);
        touched
    }

    /// Moves the cloth so that the pulls are met, by the smoothest displacement that is zero at the rim (biharmonic): strain limiting
    /// starts from a fold, not from a spike.
    fn lift(&self, positions: &mut [Vec3], grips: &[Grip]) -> Result<(), NotPositive> {
        let free = self.tiled.points.len() - self.rim.len();
        let mut bumps = Vec::with_capacity(grips.len());
        for grip in grips {
            let mut bump = vec![[0.0]; free];
            for (v, w) in grip.corners.iter().filter(|(v, _)| *v < free) {
                bump[*v][0] += w;
            }
            self.seam.solve(&mut bump)?;
            self.seam.solve(&mut bump)?;
            bumps.push(bump);
        }
        let count = grips.len();
        let at = |grip: &Grip, bump: &[[f64; 1]]| -> f64 {
            let own = grip.corners.iter().filter(|(v, _)| *v < free);
            own.map(|(v, w)| bump[*v][0] * w).sum()
        };
        let mut gram = nalgebra::DMatrix::from_fn(count, count, |i, j| at(&grips[i], &bumps[j]));
        // Pulls on one triangle that disagree are met on average.
        let slack = 1e-6 * gram.trace() / count as f64 + f64::MIN_POSITIVE;
        (0..count).for_each(|k| gram[(k, k)] += slack);
        let mut gaps = nalgebra::DMatrix::zeros(count, 3);
        for (k, grip) in grips.iter().enumerate() {
            gaps.set_row(k, &(grip.to - grip.place(positions)).transpose());
        }
        gram.cholesky().ok_or(NotPositive)?.solve_mut(&mut gaps);
        for (k, bump) in bumps.iter().enumerate() {
            let gap = Vec3::new(gaps[(k, 0)], gaps[(k, 1)], gaps[(k, 2)]);
            (positions.iter_mut().zip(bump)).for_each(|(p, b)| *p += gap * b[0]);
        }
        Ok(())
    }

    /// Largest ratio of an edge with a free end to its length in the chart.
    fn stretch(&self, positions: &[Vec3]) -> f64 {
        let free = self.tiled.points.len() - self.rim.len();
        let sheet = self.hem.sheet();
        let edges = (sheet.faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .map(|(a, b)| (a as usize, b as usize))
            .filter(|(a, b)| *a.min(b) < free);
        let ratio = |(a, b): (usize, usize)| {
            (positions[a] - positions[b]).norm_squared()
                / (sheet.rest[a] - sheet.rest[b])
                    .norm_squared()
                    .max(f64::MIN_POSITIVE)
        };
        edges.map(ratio).fold(0.0, f64::max).sqrt()
    }
}
