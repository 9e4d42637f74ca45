//! A user's anchors: points of the patch that are drawn to places in space, as forces on the cloth's energy.
//!
//! A pull is met by the point it names, by barycentric weights, and acts like a finger on all vertices near it: a force on one triangle
//! alone would draw a thread out of the cloth. Its force is bounded by what cloth bears, so that no target, however far, tears it. Pulls
//! change the energy's matrix by one row each; the factor stays and the rows enter by the Woodbury identity: with B the points' rows,
//! C the forces' and Z = A⁻¹Cᵀ, the forces λ of targets t solve (B Z + W⁻¹) λ = t − B A⁻¹r.

use nalgebra::{DMatrix, Dyn, LU};

use crate::cholesky::NotPositive;
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
    pub hold: Firmness,
}

/// How firmly a pull is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Firmness {
    /// Like a finger: gives way when the cloth resists.
    Soft,
    /// As near as the strain limit allows.
    Hard,
}

impl Firmness {
    /// Displacement per force that remains, in lengths of the energy's (dimensionless) springs.
    fn compliance(self) -> f64 {
        match self {
            Firmness::Soft => 0.05,
            Firmness::Hard => 0.0,
        }
    }

    /// Largest force, in fingers: strain 1 of a strip as wide as this.
    fn strength(self) -> f64 {
        match self {
            Firmness::Soft => 1.0,
            Firmness::Hard => 4.0,
        }
    }
}

/// A pull in terms of the free vertices.
struct Row {
    /// The point: Σ weight · position.
    terms: Vec<(usize, f64)>,
    /// How its force is shared out; the shares add up to one.
    force: Vec<(usize, f64)>,
    /// The free vertices' part of where the point lies unpulled, and where it is to go.
    way: [Vec3; 2],
    /// Share of its way that the point is to go.
    share: f64,
    hold: Firmness,
    /// Largest force.
    strength: f64,
}

/// Where a pull takes hold: patch vertices with their weights.
pub(super) struct Grip {
    /// Corners in the order of the fabric's vertices, with their barycentric weights.
    pub corners: [(usize, f64); 3],
    /// Free vertices that its force acts on, with their shares.
    pub finger: Vec<(usize, f64)>,
    /// Radius of the finger, scene units.
    pub radius: f64,
    /// The place it is drawn to.
    pub to: Vec3,
    /// How firmly.
    pub hold: Firmness,
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
    /// A⁻¹Cᵀ, one column of free vertices per pull.
    response: Vec<Vec<f64>>,
    gram: Option<LU<f64, Dyn, Dyn>>,
    /// How often they were eased.
    easings: usize,
}

impl Pulls {
    /// No pulls: `correct` changes nothing.
    pub fn none() -> Pulls {
        Pulls {
            rows: Vec::new(),
            response: Vec::new(),
            gram: None,
            easings: 0,
        }
    }

    /// Pulls on a fabric that lies at `positions`; those that hold on to no free vertex are left out.
    ///
    /// # Errors
    /// `NotPositive` when the fabric's matrix cannot be solved.
    pub fn new(fabric: &Fabric, positions: &[Vec3], grips: &[Grip]) -> Result<Pulls, NotPositive> {
        let rows: Vec<Row> = grips
            .iter()
            .filter_map(|g| Row::of(g, fabric.free(), positions))
            .collect();
        if rows.is_empty() {
            return Ok(Pulls::none());
        }
        let mut response = Vec::with_capacity(rows.len());
        for row in &rows {
            let mut column = vec![[0.0]; fabric.free()];
            row.force.iter().for_each(|(v, w)| column[*v][0] += w);
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
        Ok(Pulls {
            gram: Some(gram.lu()),
            rows,
            response,
            easings: 0,
        })
    }

    /// Whether there is nothing to pull at.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Takes the points only this share as far as before. Where some are hard the soft ones give way alone, for a while, and at last
    /// altogether: a strained pull at the rim is no reason to let go of one that must be met.
    pub fn ease(&mut self, share: f64) {
        self.easings += 1;
        let is_soft = |row: &Row| row.hold == Firmness::Soft;
        let mixed = self.rows.iter().any(is_soft) && !self.rows.iter().all(is_soft);
        let (soft, hard) = match self.easings {
            n if !mixed || n > SOFT_ALONE => (share, share),
            SOFT_ALONE => (0.0, 1.0),
            _ => (share, 1.0),
        };
        for row in &mut self.rows {
            row.share *= if is_soft(row) { soft } else { hard };
        }
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
            let goal = row.way[0].lerp(&row.way[1], row.share);
            forces.set_row(k, &(goal - place).transpose());
        }
        if !gram.solve_mut(&mut forces) {
            return;
        }
        for (k, column) in self.response.iter().enumerate() {
            let force = Vec3::new(forces[(k, 0)], forces[(k, 1)], forces[(k, 2)])
                .cap_magnitude(self.rows[k].strength);
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
        let place =
            |of: &[(usize, f64)]| -> Vec3 { of.iter().map(|(v, w)| positions[*v] * *w).sum() };
        let way = [place(&terms), grip.to - place(&held)];
        // A point next to the rim can only be moved by throwing the nearest free vertex far: it stays with the rim.
        let share: f64 = terms.iter().map(|(_, w)| w).sum();
        (share > LEAST_SHARE).then_some(Row {
            terms,
            force: grip.finger.clone(),
            way,
            share: 1.0,
            hold: grip.hold,
            strength: grip.hold.strength() * grip.radius,
        })
    }
}

/// Easings in which soft pulls give way alone.
const SOFT_ALONE: usize = 3;
/// Least weight of a pull's free corners.
const LEAST_SHARE: f64 = 0.1;
