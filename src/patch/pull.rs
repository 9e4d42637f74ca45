//! A user's anchors: points of the patch that are drawn to places in space, as forces on the cloth's energy.
//!
//! A pull acts on the corners of the triangle that holds its point, by their barycentric weights. Its force is bounded by what cloth
//! bears, so that no target, however far, tears it. Pulls change the energy's matrix by one row each; the factor stays and the rows
//! enter by the Woodbury identity: with Z = A⁻¹Bᵀ and G = BZ, the forces λ of targets t solve (G + W⁻¹) λ = t − B A⁻¹r.

use nalgebra::{Cholesky, DMatrix, Dyn};

use crate::flatten::cholesky::NotPositive;
use crate::mesh::{Vec2, Vec3};

use super::cloth::Fabric;

/// A user's anchor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pull {
    /// Which point of the cloth: in the chart's plane, inside the hole, scene units.
    pub at: Vec2,
    /// Where it should lie, scene space.
    pub to: Vec3,
    /// How firmly.
    pub hold: Hold,
}

/// How firmly a pull is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// Like a finger: gives way when the cloth resists.
    Soft,
    /// As near as the strain limit allows.
    Hard,
}

impl Hold {
    /// Displacement per force that remains, in lengths of the energy's (dimensionless) springs.
    fn compliance(self) -> f64 {
        match self {
            Hold::Soft => 0.05,
            Hold::Hard => 0.0,
        }
    }

    /// Largest force, in mean edges: strain 1 of a strip as wide as this.
    fn strength(self) -> f64 {
        match self {
            Hold::Soft => 2.0,
            Hold::Hard => 8.0,
        }
    }
}

/// A pull in terms of the free vertices: Σ weight · position = goal.
struct Row {
    terms: Vec<(usize, f64)>,
    goal: Vec3,
    hold: Hold,
}

/// Where a pull takes hold: patch vertices with their weights.
pub(super) struct Grip {
    /// Corners in the order of the fabric's vertices, with their barycentric weights.
    pub corners: [(usize, f64); 3],
    /// The place it is drawn to.
    pub to: Vec3,
    /// How firmly.
    pub hold: Hold,
}

impl Grip {
    /// Where the held point lies.
    pub fn place(&self, positions: &[Vec3]) -> Vec3 {
        self.corners.iter().map(|(v, w)| positions[*v] * *w).sum()
    }
}

/// Pulls made ready for a fabric.
pub(super) struct Pulls {
    rows: Vec<Row>,
    /// A⁻¹Bᵀ, one column of free vertices per pull.
    response: Vec<Vec<f64>>,
    gram: Option<Cholesky<f64, Dyn>>,
    /// Largest force per pull.
    strength: Vec<f64>,
}

impl Pulls {
    /// No pulls: `correct` changes nothing.
    pub fn none() -> Pulls {
        Pulls {
            rows: Vec::new(),
            response: Vec::new(),
            gram: None,
            strength: Vec::new(),
        }
    }

    /// Pulls on a fabric whose held vertices lie at `positions`; those that hold on to no free vertex are left out.
    ///
    /// # Errors
    /// `NotPositive` when the fabric's matrix cannot be solved.
    pub fn new(fabric: &Fabric, positions: &[Vec3], grips: &[Grip]) -> Result<Pulls, NotPositive> {
        let rows: Vec<Row> = grips
            .iter()
            .filter_map(|g| Row::of(g, fabric.free(), positions))
            .collect();
        let mut response = Vec::with_capacity(rows.len());
        for row in &rows {
            let mut column = vec![[0.0]; fabric.free()];
            row.terms.iter().for_each(|(v, w)| column[*v][0] += w);
            fabric.solve(&mut column)?;
            response.push(column.into_iter().flatten().collect::<Vec<f64>>());
        }
        let mut gram = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            rows[i]
                .terms
                .iter()
                .map(|(v, w)| w * response[j][*v])
                .sum::<f64>()
        });
        let slack = 1e-9 * gram.trace();
        for (k, row) in rows.iter().enumerate() {
            gram[(k, k)] += row.hold.compliance() + slack;
        }
        let strength = rows
            .iter()
            .map(|row| row.hold.strength() * fabric.edge)
            .collect();
        Ok(Pulls {
            gram: Some(gram.cholesky().ok_or(NotPositive)?),
            rows,
            response,
            strength,
        })
    }

    /// Halves the largest forces.
    pub fn ease(&mut self) {
        self.strength.iter_mut().for_each(|s| *s *= 0.5);
    }

    /// Adds to a solution without pulls what their forces, as far as they are borne, do to it.
    pub fn correct(&self, solution: &mut [[f64; 3]]) {
        let Some(gram) = &self.gram else {
            return;
        };
        let mut forces = DMatrix::zeros(self.rows.len(), 3);
        for (k, row) in self.rows.iter().enumerate() {
            let place: Vec3 = row
                .terms
                .iter()
                .map(|(v, w)| Vec3::from(solution[*v]) * *w)
                .sum();
            forces.set_row(k, &(row.goal - place).transpose());
        }
        gram.solve_mut(&mut forces);
        for (k, column) in self.response.iter().enumerate() {
            let force = Vec3::new(forces[(k, 0)], forces[(k, 1)], forces[(k, 2)])
                .cap_magnitude(self.strength[k]);
            for (x, z) in solution.iter_mut().zip(column) {
                (0..3).for_each(|d| x[d] += force[d] * z);
            }
        }
    }
}

impl Row {
    fn of(grip: &Grip, free: usize, positions: &[Vec3]) -> Option<Row> {
        let (terms, held): (Vec<_>, Vec<_>) =
            grip.corners.iter().copied().partition(|(v, _)| *v < free);
        let held: Vec3 = held.iter().map(|(v, w)| positions[*v] * *w).sum();
        // A point next to the rim can only be moved by throwing the nearest free vertex far: it stays with the rim.
        let share: f64 = terms.iter().map(|(_, w)| w).sum();
        (share > LEAST_SHARE).then_some(Row {
            terms,
            goal: grip.to - held,
            hold: grip.hold,
        })
    }
}

/// Least weight of a pull's free corners.
const LEAST_SHARE: f64 = 0.1;
