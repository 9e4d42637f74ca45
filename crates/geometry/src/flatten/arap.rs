//! As-rigid-as-possible parametrization (Liu, Zhang, Xu, Gotsman, Gortler 2008; paper eq. 1), local and global steps by turns.
//!
//! Near an isometry a plain round halves every error, low or high; Anderson acceleration with energy as its guard (Peng, Deng, Zhang,
//! Geng, Qin, Liu 2018) needs a quarter of the rounds.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::{FlattenError, RestTriangle};
use crate::cholesky::{Factor, Symmetric};
use crate::mesh::{TriMesh, Vec2};

/// Most rounds of local and global steps; the stop test usually ends them long before.
pub const ROUNDS: usize = 150;
/// Rounds end when one lowers the energy by less than this share.
const GAIN: f64 = 1e-4;
/// Earlier rounds that a step is extrapolated from.
const WINDOW: usize = 5;

/// ½ Σ_f Σ_{e∈f} cot θₑ ‖e_uv − R_f e‖² of a mesh, its global step factored.
pub struct Energy<'a> {
    mesh: &'a TriMesh,
    springs: Vec<Springs>,
    factor: Factor,
}

/// A face at rest: its edges from corner k to k + 1 and their cotangents.
struct Springs {
    edges: [Vec2; 3],
    cotangents: [f64; 3],
    /// ½ Σ cot θₑ ‖e‖².
    constant: f64,
}

impl<'a> Energy<'a> {
    /// Factors the global step of a connected mesh.
    ///
    /// # Errors
    /// `Singular` for degenerate triangles.
    pub fn of(mesh: &'a TriMesh, rest: &[RestTriangle]) -> Result<Self, FlattenError> {
        let mut matrix = Symmetric::zero(mesh.positions.len());
        for (face, triangle) in mesh.faces.iter().zip(rest) {
            for k in 0..3 {
                let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
                matrix.add_spring(a, b, triangle.cotangent[k]);
            }
        }
        // The energy does not see translations: hold the first vertex where it is.
        matrix.add(0, 0, 1.0);
        let factor = matrix.factor().map_err(|_| singular(mesh))?;
        let springs = rest.iter().map(Springs::of).collect();
        Ok(Energy {
            mesh,
            springs,
            factor,
        })
    }

    /// Minimises from a layout in at most so many rounds; may flip faces. Returns the rounds, too.
    ///
    /// # Errors
    /// `Singular` when a step is not finite.
    pub fn minimise(
        &self,
        start: Vec<Vec2>,
        most: usize,
    ) -> Result<(Vec<Vec2>, usize), FlattenError> {
        let mut history = History::default();
        let mut flat = start;
        // The plain step that led near `flat`: the way back when extrapolation went astray.
        let mut plain: Option<Vec<Vec2>> = None;
        let (mut before, mut rounds) = (f64::INFINITY, 0);
        while rounds < most {
            rounds += 1;
            let (mut energy, mut forces) = self.local(&flat);
            if (energy.is_nan() || energy >= before)
                && let Some(back) = plain.take()
            {
                flat = back;
                history = History::default();
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
        Ok((flat, rounds))
    }

    /// The layout whose edges are the rest triangles' turned by the given unit vectors, as nearly as can be.
    ///
    /// # Errors
    /// `Singular` when it is not finite.
    pub fn assemble(&self, rotations: &[Vec2]) -> Result<Vec<Vec2>, FlattenError> {
        let mut forces = vec![[0.0; 2]; self.mesh.positions.len()];
        for ((face, springs), rotation) in self.mesh.faces.iter().zip(&self.springs).zip(rotations)
        {
            springs.push(face, rotation, &mut forces);
        }
        self.global(forces)
    }

    /// The energy of a layout and the right-hand side for its best rotations.
    fn local(&self, flat: &[Vec2]) -> (f64, Vec<[f64; 2]>) {
        let mut energy = 0.0;
        let mut forces = vec![[0.0; 2]; flat.len()];
        forces[0] = flat[0].into();
        for (face, springs) in self.mesh.faces.iter().zip(&self.springs) {
            let corners = face.map(|v| flat[v as usize]);
            // The best rotation is the angle of Σ cot θₑ e eᵤᵥᵀ; its norm is what it gains.
            let (mut turned, mut stretched) = (Vec2::zeros(), 0.0);
            for k in 0..3 {
                let (e, image) = (springs.edges[k], corners[(k + 1) % 3] - corners[k]);
                turned += Vec2::new(e.dot(&image), e.perp(&image)) * springs.cotangents[k];
                stretched += springs.cotangents[k] * image.norm_squared();
            }
            let norm = turned.norm();
            energy += springs.constant + 0.5 * stretched - norm;
            let rotation = if norm > 0.0 { turned / norm } else { Vec2::x() };
            springs.push(face, &rotation, &mut forces);
        }
        (energy, forces)
    }

    fn global(&self, mut forces: Vec<[f64; 2]>) -> Result<Vec<Vec2>, FlattenError> {
        let solved = self.factor.solve(&mut forces);
        solved.map_err(|_| singular(self.mesh))?;
        Ok(forces.into_iter().map(Vec2::from).collect())
    }
}

fn singular(mesh: &TriMesh) -> FlattenError {
    FlattenError::Singular {
        stage: "ARAP",
        vertices: mesh.positions.len(),
    }
}

impl Springs {
    fn of(triangle: &RestTriangle) -> Springs {
        let edges = [0, 1, 2].map(|k| triangle.corners[(k + 1) % 3] - triangle.corners[k]);
        let cotangents = triangle.cotangent;
        let constant = (0..3)
            .map(|k| 0.5 * cotangents[k] * edges[k].norm_squared())
            .sum();
        Springs {
            edges,
            cotangents,
            constant,
        }
    }

    /// Adds the pull of the edges, turned by a unit vector, to the corners' forces.
    fn push(&self, face: &[u32; 3], turn: &Vec2, forces: &mut [[f64; 2]]) {
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

/// What Anderson acceleration remembers: differences of residuals and of plain steps from round to round.
#[derive(Default)]
struct History {
    last: Option<(Vec<Vec2>, Vec<Vec2>)>,
    changes: VecDeque<(Vec<Vec2>, Vec<Vec2>)>,
}

impl History {
    /// The point extrapolated from the plain `step` at `flat` and the rounds before.
    fn extrapolated(&mut self, flat: &[Vec2], step: &[Vec2]) -> Vec<Vec2> {
        let residual = difference(step, flat);
        if let Some((step_before, residual_before)) = self.last.take() {
            if self.changes.len() == WINDOW {
                self.changes.pop_front();
            }
            self.changes.push_back((
                difference(&residual, &residual_before),
                difference(step, &step_before),
            ));
        }
        let count = self.changes.len();
        let dots = |i: usize, j: usize| dot(&self.changes[i].0, &self.changes[j].0);
        let mut normal = DMatrix::zeros(count, count);
        for (i, j) in (0..count).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            normal[(i, j)] = dots(i, j);
            normal[(j, i)] = normal[(i, j)];
        }
        // A touch of ridge: near the end the changes are all but parallel.
        for i in 0..count {
            normal[(i, i)] *= 1.0 + 1e-10;
        }
        let rhs = DVector::from_fn(count, |i, _| dot(&self.changes[i].0, &residual));
        let mut next = step.to_vec();
        if let Some(factor) = normal.cholesky() {
            let shares = factor.solve(&rhs);
            for ((_, change), share) in self.changes.iter().zip(shares.iter()) {
                for (p, c) in next.iter_mut().zip(change) {
                    *p -= c * *share;
                }
            }
        }
        self.last = Some((step.to_vec(), residual));
        next
    }
}

fn difference(a: &[Vec2], b: &[Vec2]) -> Vec<Vec2> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[Vec2], b: &[Vec2]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
