//! As-rigid-as-possible parametrization (Liu, Zhang, Xu, Gotsman, Gortler 2008): local and global steps alternate.
//!
//! Near an isometry a plain round halves every error, of low or high frequency. Anderson acceleration, guarded by the
//! energy (Peng, Deng, Zhang, Geng, Qin, Liu 2018), needs a quarter of the rounds.

use std::collections::VecDeque;

use darn_budget::Budget;
use nalgebra::{DMatrix, DVector};

use super::chart::Layout;
use super::error::FlattenError;
use super::rest_triangle::RestTriangle;
use crate::cholesky::{Factor, SolveError, Symmetric};
use crate::mesh::{TriMesh, Vec2};

/// Rounds end when one lowers the energy by less than this share.
const GAIN: f64 = 1e-4;
/// How many earlier rounds a step is extrapolated from.
const WINDOW: usize = 5;

/// ½ Σ_f Σ_{e∈f} cot θₑ ‖e_uv − R_f e‖² of a mesh, its global step factored.
pub(super) struct ArapEnergy<'a> {
    mesh: &'a TriMesh,
    springs: Vec<FaceSprings>,
    factor: Factor,
    budget: &'a Budget<'a>,
}

/// A face at rest: its edges from corner k to k + 1 and the cotangents of the angles opposite them.
struct FaceSprings {
    edges: [Vec2; 3],
    cotangents: [f64; 3],
    /// ½ Σ cot θₑ ‖e‖².
    constant: f64,
}

impl<'a> ArapEnergy<'a> {
    /// Factors the global step of a connected mesh.
    ///
    /// # Errors
    /// `Singular` for degenerate triangles; `Exhausted`.
    pub fn new(
        mesh: &'a TriMesh,
        rest: &[RestTriangle],
        budget: &'a Budget<'a>,
    ) -> Result<Self, FlattenError> {
        let mut matrix = Symmetric::zero(mesh.positions.len());
        for (face, triangle) in mesh.faces.iter().zip(rest) {
            for k in 0..3 {
                let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
                matrix.add_spring(a, b, triangle.weight * triangle.cotangent[k]);
            }
        }
        // The energy does not see translations: hold the first vertex where it is.
        matrix.add(0, 0, 1.0);
        let factor = matrix.factor(budget).map_err(|e| unsolved(e, mesh))?;
        let springs = rest.iter().map(FaceSprings::of).collect();
        Ok(ArapEnergy {
            mesh,
            springs,
            factor,
            budget,
        })
    }

    /// Minimises from a layout, in at most `max_rounds` rounds; may flip faces.
    ///
    /// # Errors
    /// `Singular` when a step is not finite; `Exhausted`.
    pub fn minimise(&self, start: Vec<Vec2>, max_rounds: usize) -> Result<Layout, FlattenError> {
        let mut history = AndersonHistory::default();
        let mut flat = start;
        // The plain step that `flat` was extrapolated from: the fallback when the energy did not decrease.
        let mut plain: Option<Vec<Vec2>> = None;
        let (mut before, mut rounds) = (f64::INFINITY, 0);
        while rounds < max_rounds {
            rounds += 1;
            self.budget.spend(self.round_work())?;
            let (mut energy, mut forces) = self.local(&flat);
            if (energy.is_nan() || energy >= before)
                && let Some(back) = plain.take()
            {
                flat = back;
                history = AndersonHistory::default();
                (energy, forces) = self.local(&flat);
            }
            let step = self.global(forces)?;
            if before - energy <= GAIN * before.min(f64::MAX) {
                flat = step;
                break;
            }
            before = energy;
            flat = history.extrapolated(&flat, &step);
            plain = Some(step);
        }
        Ok(Layout { flat, rounds })
    }

    /// The layout whose edges are closest (least squares) to those of the rest triangles, each triangle rotated by
    /// its unit vector.
    ///
    /// # Errors
    /// `Singular` when it is not finite.
    pub fn assemble(&self, rotations: &[Vec2]) -> Result<Vec<Vec2>, FlattenError> {
        let mut forces = vec![[0.0; 2]; self.mesh.positions.len()];
        for ((face, springs), rotation) in self.mesh.faces.iter().zip(&self.springs).zip(rotations)
        {
            springs.add_forces(face, rotation, &mut forces);
        }
        self.global(forces)
    }

    /// Work of a round, nanoseconds.
    fn round_work(&self) -> u64 {
        FACE_WORK * self.springs.len() as u64 + self.factor.solve_work(2)
    }

    /// The energy of a layout and the right-hand side for its best rotations.
    fn local(&self, flat: &[Vec2]) -> (f64, Vec<[f64; 2]>) {
        let mut energy = 0.0;
        let mut forces = vec![[0.0; 2]; flat.len()];
        forces[0] = flat[0].into();
        for (face, springs) in self.mesh.faces.iter().zip(&self.springs) {
            let corners = face.map(|v| flat[v as usize]);
            // The best rotation is the angle of Σ cot θₑ e eᵤᵥᵀ, as a complex number; it lowers the energy by the
            // norm of that sum.
            let (mut turned, mut stretched) = (Vec2::zeros(), 0.0);
            for k in 0..3 {
                let (e, image) = (springs.edges[k], corners[(k + 1) % 3] - corners[k]);
                turned += Vec2::new(e.dot(&image), e.perp(&image)) * springs.cotangents[k];
                stretched += springs.cotangents[k] * image.norm_squared();
            }
            let norm = turned.norm();
            energy += springs.constant + 0.5 * stretched - norm;
            let rotation = if norm > 0.0 { turned / norm } else { Vec2::x() };
            springs.add_forces(face, &rotation, &mut forces);
        }
        (energy, forces)
    }

    /// Solves for the layout that is in equilibrium with the forces.
    fn global(&self, mut forces: Vec<[f64; 2]>) -> Result<Vec<Vec2>, FlattenError> {
        let solved = self.factor.solve(&mut forces);
        solved.map_err(|e| unsolved(e, self.mesh))?;
        Ok(forces.into_iter().map(Vec2::from).collect())
    }
}

fn unsolved(error: SolveError, mesh: &TriMesh) -> FlattenError {
    FlattenError::unsolved(error, "ARAP", mesh.positions.len())
}

/// Nanoseconds of work a face in a round, without the solution of the global step.
const FACE_WORK: u64 = 60;

impl FaceSprings {
    fn of(triangle: &RestTriangle) -> FaceSprings {
        let edges = [0, 1, 2].map(|k| triangle.corners[(k + 1) % 3] - triangle.corners[k]);
        let cotangents = triangle.cotangent.map(|c| triangle.weight * c);
        let constant = (0..3)
            .map(|k| 0.5 * cotangents[k] * edges[k].norm_squared())
            .sum();
        FaceSprings {
            edges,
            cotangents,
            constant,
        }
    }

    /// Adds the pull of the edges, rotated by a unit vector, to the forces at the corners.
    fn add_forces(&self, face: &[u32; 3], turn: &Vec2, forces: &mut [[f64; 2]]) {
        let pull = [0, 1, 2].map(|k: usize| {
            let e = self.edges[k] * self.cotangents[k];
            Vec2::new(turn.x * e.x - turn.y * e.y, turn.y * e.x + turn.x * e.y)
        });
        for k in 0..3 {
            let force = &mut forces[face[k] as usize];
            let sum = pull[(k + 2) % 3] - pull[k];
            force[0] += sum.x;
            force[1] += sum.y;
        }
    }
}

/// A plain step of one round and its residual (step minus start), or the differences of both between two rounds.
struct Round {
    residual: Vec<Vec2>,
    step: Vec<Vec2>,
}

/// The earlier rounds that Anderson acceleration uses.
#[derive(Default)]
struct AndersonHistory {
    last: Option<Round>,
    /// Differences of consecutive rounds.
    changes: VecDeque<Round>,
}

impl AndersonHistory {
    /// The point extrapolated from the plain `step` at `flat` and the rounds before.
    fn extrapolated(&mut self, flat: &[Vec2], step: &[Vec2]) -> Vec<Vec2> {
        let residual = difference(step, flat);
        if let Some(last) = self.last.take() {
            if self.changes.len() == WINDOW {
                self.changes.pop_front();
            }
            self.changes.push_back(Round {
                residual: difference(&residual, &last.residual),
                step: difference(step, &last.step),
            });
        }
        let count = self.changes.len();
        let dots = |i: usize, j: usize| dot(&self.changes[i].residual, &self.changes[j].residual);
        let mut normal = DMatrix::zeros(count, count);
        for (i, j) in (0..count).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            normal[(i, j)] = dots(i, j);
            normal[(j, i)] = normal[(i, j)];
        }
        // A small ridge term: near the end the changes are almost parallel.
        for i in 0..count {
            normal[(i, i)] *= 1.0 + 1e-10;
        }
        let rhs = DVector::from_fn(count, |i, _| dot(&self.changes[i].residual, &residual));
        let mut next = step.to_vec();
        if let Some(factor) = normal.cholesky() {
            let shares = factor.solve(&rhs);
            for (change, share) in self.changes.iter().zip(shares.iter()) {
                for (p, c) in next.iter_mut().zip(&change.step) {
                    *p -= c * *share;
                }
            }
        }
        self.last = Some(Round {
            residual,
            step: step.to_vec(),
        });
        next
    }
}

fn difference(a: &[Vec2], b: &[Vec2]) -> Vec<Vec2> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[Vec2], b: &[Vec2]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
