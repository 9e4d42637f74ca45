//! XPBD cloth (Macklin et al. 2016, 2019): a square of 51×51 vertices, moved in small steps.
//!
//! Rest state: the unit square of [`super::lattice`]. Units are metres and seconds, gravity is along −z. Bending is the thin-plate energy
//! of second differences along the four directions of the lattice, which treats folds of all directions alike (Σ cos⁴(θ + kπ/4) = 3/2). On
//! inextensible cloth it is quadratic (Bergou et al. 2006), so it costs one linear projection. Stretch is hard. Tethers to the pinned
//! vertices (Kim et al. 2012) keep the weight from lengthening the sheet between two sweeps. One thread, a fixed order and no
//! transcendental functions in the loop: the same input gives the same bits.

use super::contacts::SelfContacts;
use super::fabric::FabricParameters;
use super::field::{
    AxisRow, DistanceConstraint, FieldRow, InverseMasses, VertexField, WIDTH, WeightedRow,
    link_rows, slot, straighten_rows, tether_row,
};
use super::lattice::{SIDE, SPACING, VERTICES, Vec3f};
use super::obstacle::Obstacle;

/// Acceleration of gravity, along −z.
pub(super) const GRAVITY: f32 = 9.81;

const DIAGONAL: f32 = SPACING * std::f32::consts::SQRT_2;
/// No vertex moves further than this in a step, so that layers cannot jump through each other.
const MAX_STEP: f32 = 0.2 * SPACING;

/// A vertex held in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PinnedVertex {
    /// Index of the vertex.
    pub(super) vertex: usize,
    /// Where it is held now.
    pub(super) at: Vec3f,
}

/// Air, damping and length of one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepConditions {
    /// Velocity of the air, m/s.
    pub(super) wind: Vec3f,
    /// Velocity lost per second in all directions, 1/s.
    pub(super) damping: f32,
    /// Length of the step, seconds.
    pub(super) step: f32,
}

/// A sheet in motion.
#[derive(Debug, Clone)]
pub(super) struct ClothSolver {
    now: VertexField,
    /// Positions at the start of the step.
    before: VertexField,
    velocity: VertexField,
    /// Acceleration by the air, m/s².
    air: VertexField,
    /// Buffer for the transposed positions.
    transposed: VertexField,
    masses: InverseMasses,
    masses_transposed: InverseMasses,
    pins: Vec<PinnedVertex>,
    /// By pin: the squared rest distances to all vertices.
    tethers: Vec<Vec<AxisRow>>,
    fabric: FabricParameters,
    contacts: SelfContacts,
    steps: usize,
}

/// The order in which a sweep visits the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sweep {
    Up,
    Down,
}

impl Sweep {
    /// The order of sweep `number`; it alternates.
    fn of(number: usize) -> Self {
        if number.is_multiple_of(2) {
            Self::Up
        } else {
            Self::Down
        }
    }
}

impl ClothSolver {
    /// A sheet at rest at `positions` (`VERTICES` long), held at `pins`.
    pub(super) fn new(
        positions: &[Vec3f],
        pins: Vec<PinnedVertex>,
        fabric: FabricParameters,
    ) -> Self {
        let now = VertexField::from_points(positions);
        let mut masses = vec![[0.0; WIDTH]; SIDE];
        for row in &mut masses {
            row[..SIDE].fill(1.0);
        }
        let mut masses_transposed = masses.clone();
        for pin in &pins {
            let (i, j) = (pin.vertex % SIDE, pin.vertex / SIDE);
            masses[j][i] = 0.0;
            masses_transposed[i][j] = 0.0;
        }
        Self {
            before: now.clone(),
            transposed: now.clone(),
            velocity: VertexField::zeros(),
            air: VertexField::zeros(),
            contacts: SelfContacts::new(fabric.thickness),
            tethers: pins.iter().map(|pin| tether(pin.vertex)).collect(),
            steps: 0,
            now,
            masses,
            masses_transposed,
            pins,
            fabric,
        }
    }

    /// Positions, row by row.
    pub(super) fn positions(&self) -> Vec<Vec3f> {
        self.now.points()
    }

    /// Moves pin number `index` to `at`; it takes effect in the next step.
    pub(super) fn move_pin(&mut self, index: usize, at: Vec3f) {
        self.pins[index].at = at;
    }

    /// One step of `conditions.step` seconds among `obstacles`.
    pub(super) fn step(&mut self, conditions: &StepConditions, obstacles: &[Obstacle]) {
        if self.steps.is_multiple_of(8) {
            self.update_air(conditions.wind);
        }
        self.contacts
            .search_when_due(&self.now, conditions.step * self.fastest());
        self.predict(conditions);
        let stiffness =
            self.fabric.bend / (1.5 * SPACING.powi(4)) * conditions.step * conditions.step;
        let bending = 1.0 / stiffness;
        stretch(&mut self.now.rows, &self.masses, Sweep::of(self.steps));
        self.now.transpose_into(&mut self.transposed);
        stretch(
            &mut self.transposed.rows,
            &self.masses_transposed,
            Sweep::of(self.steps),
        );
        bend(&mut self.transposed.rows, &self.masses_transposed, bending);
        self.transposed.transpose_into(&mut self.now);
        for (pin, reach) in self.pins.iter().zip(&self.tethers) {
            for ((row, masses), reach) in self.now.rows.iter_mut().zip(&self.masses).zip(reach) {
                tether_row(row, masses, &pin.at, reach);
            }
        }
        let shear = 1.0 / (self.fabric.shear * conditions.step * conditions.step);
        bend(&mut self.now.rows, &self.masses, bending);
        project_diagonals(&mut self.now.rows, &self.masses, shear, bending);
        self.contacts.separate(
            &mut self.now,
            &self.before,
            &self.masses,
            self.fabric.friction,
        );
        self.project_stretch(Sweep::of(self.steps + 1));
        self.push_out(obstacles);
        let rate = 1.0 / conditions.step;
        let moved = self
            .now
            .rows
            .as_flattened()
            .as_flattened()
            .iter()
            .zip(self.before.rows.as_flattened().as_flattened());
        for (v, (x, x0)) in self
            .velocity
            .rows
            .as_flattened_mut()
            .as_flattened_mut()
            .iter_mut()
            .zip(moved)
        {
            *v = (x - x0) * rate;
        }
        self.steps += 1;
    }

    /// Removes the remaining stretch by `rounds` projections of edges and contacts, without gravity and inertia.
    pub(super) fn relax(&mut self, rounds: usize, obstacles: &[Obstacle]) {
        for round in 0..rounds {
            if round % 4 == 0 {
                self.contacts.search(&self.now);
            }
            self.before.rows.copy_from_slice(&self.now.rows);
            self.project_stretch(Sweep::Up);
            self.project_stretch(Sweep::Down);
            self.contacts
                .separate(&mut self.now, &self.before, &self.masses, 0.0);
            self.push_out(obstacles);
        }
        self.velocity = VertexField::zeros();
    }

    /// Root of the mean squared speed, m/s.
    pub(super) fn speed(&self) -> f32 {
        let sum: f32 = (0..VERTICES)
            .map(|k| self.velocity.at(slot(k)).norm_squared())
            .sum();
        (sum / VERTICES as f32).sqrt()
    }

    /// Greatest speed of a vertex along one axis, m/s.
    fn fastest(&self) -> f32 {
        self.velocity
            .rows
            .as_flattened()
            .as_flattened()
            .iter()
            .fold(0.0, |most, v| v.abs().max(most))
    }

    fn project_stretch(&mut self, sweep: Sweep) {
        stretch(&mut self.now.rows, &self.masses, sweep);
        self.now.transpose_into(&mut self.transposed);
        stretch(&mut self.transposed.rows, &self.masses_transposed, sweep);
        self.transposed.transpose_into(&mut self.now);
    }

    fn push_out(&mut self, obstacles: &[Obstacle]) {
        for obstacle in obstacles {
            obstacle.push_out(&mut self.now, &self.before, &self.masses, &self.fabric);
        }
    }

    fn predict(&mut self, conditions: &StepConditions) {
        let dt = conditions.step;
        let keep = 1.0 / (1.0 + conditions.damping * dt);
        let pull = [0.0, 0.0, -GRAVITY];
        self.before.rows.copy_from_slice(&self.now.rows);
        for (j, row) in self.now.rows.iter_mut().enumerate() {
            let (velocity, air, masses) =
                (&self.velocity.rows[j], &self.air.rows[j], &self.masses[j]);
            let mut d = [[0.0; WIDTH]; 3];
            for axis in 0..3 {
                for i in 0..WIDTH {
                    d[axis][i] = (velocity[axis][i] + (pull[axis] + air[axis][i]) * dt) * keep * dt;
                }
            }
            for i in 0..WIDTH {
                let far = (d[0][i] * d[0][i] + d[1][i] * d[1][i] + d[2][i] * d[2][i])
                    .max(1.0e-14)
                    .sqrt();
                let part = masses[i] * (MAX_STEP / far).min(1.0);
                for axis in 0..3 {
                    row[axis][i] += d[axis][i] * part;
                }
            }
        }
        for pin in &self.pins {
            self.now.set(slot(pin.vertex), &pin.at);
        }
    }

    /// Updates the acceleration by the air at every vertex: drag along the normal only.
    fn update_air(&mut self, wind: Vec3f) {
        for j in 0..SIDE {
            let (below, above) = (j.saturating_sub(1) * SIDE, (j + 1).min(SIDE - 1) * SIDE);
            for i in 0..SIDE {
                let row = j * SIDE;
                let du = self.now.at(slot(row + (i + 1).min(SIDE - 1)))
                    - self.now.at(slot(row + i.saturating_sub(1)));
                let dv = self.now.at(slot(above + i)) - self.now.at(slot(below + i));
                let n = du.cross(&dv);
                let against = (wind - self.velocity.at(slot(row + i))).dot(&n);
                let push = n * (self.fabric.air * against / n.norm_squared().max(1.0e-12));
                self.air.set(slot(row + i), &push);
            }
        }
    }
}

/// Squared distances along the flat sheet from a vertex to all others, enlarged by 0.2 %: no vertex is further from a pin.
fn tether(vertex: usize) -> Vec<AxisRow> {
    let (pi, pj) = ((vertex % SIDE) as f32, (vertex / SIDE) as f32);
    let reach2 = |i: usize, j: usize| {
        let (di, dj) = (i as f32 - pi, j as f32 - pj);
        (di * di + dj * dj) * (SPACING * SPACING * 1.002)
    };
    (0..SIDE)
        .map(|j| std::array::from_fn(|i| reach2(i, j)))
        .collect()
}

/// `N` adjacent rows from row `first` on.
#[inline(always)]
fn adjacent<'a, const N: usize>(
    rows: &'a mut [FieldRow],
    masses: &'a [AxisRow],
    first: usize,
) -> Option<[WeightedRow<'a>; N]> {
    let rows: &mut [FieldRow; N] = rows.get_mut(first..first + N)?.try_into().ok()?;
    let masses: &[AxisRow; N] = masses.get(first..first + N)?.try_into().ok()?;
    let mut number = 0;
    Some(rows.each_mut().map(|row| {
        let masses = &masses[number];
        number += 1;
        WeightedRow { row, masses }
    }))
}

/// One sweep over the edges between rows; along a column each edge uses the correction of the edge before it.
fn stretch(rows: &mut [FieldRow], masses: &[AxisRow], sweep: Sweep) {
    let edge = DistanceConstraint {
        rest: SPACING,
        compliance: 0.0,
    };
    for line in 0..SIDE - 1 {
        let j = if sweep == Sweep::Up {
            line
        } else {
            SIDE - 2 - line
        };
        if let Some([a, b]) = adjacent(rows, masses, j) {
            link_rows::<0, 0, WIDTH>(edge, a, b);
        }
    }
}

/// Bending across the rows.
fn bend(rows: &mut [FieldRow], masses: &[AxisRow], compliance: f32) {
    for j in 0..SIDE - 2 {
        if let Some([a, b, c]) = adjacent(rows, masses, j) {
            straighten_rows::<0, 0, WIDTH>(compliance, a, b, c);
        }
    }
}

/// Shear, and bending along both diagonals. A second difference along a diagonal is 2h² times the derivative, so it counts a quarter.
fn project_diagonals(rows: &mut [FieldRow], masses: &[AxisRow], shear: f32, bending: f32) {
    let diagonal = DistanceConstraint {
        rest: DIAGONAL,
        compliance: shear,
    };
    let bending = 4.0 * bending;
    for j in 0..SIDE - 1 {
        if let Some([a, b]) = adjacent(rows, masses, j) {
            link_rows::<0, 1, { SIDE - 1 }>(diagonal, a, b);
        }
        if let Some([a, b]) = adjacent(rows, masses, j) {
            link_rows::<1, 0, { SIDE - 1 }>(diagonal, a, b);
        }
        if let Some([a, b, c]) = adjacent(rows, masses, j) {
            straighten_rows::<0, 2, { SIDE - 2 }>(bending, a, b, c);
        }
        if let Some([a, b, c]) = adjacent(rows, masses, j) {
            straighten_rows::<2, 0, { SIDE - 2 }>(bending, a, b, c);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat() -> Vec<Vec3f> {
        (0..VERTICES)
            .map(|k| {
                Vec3f::new(
                    (k % SIDE) as f32 * SPACING,
                    (k / SIDE) as f32 * SPACING,
                    0.0,
                )
            })
            .collect()
    }

    fn fabric() -> FabricParameters {
        FabricParameters {
            bend: 1.0e-4,
            shear: 1.0e5,
            thickness: 0.8 * SPACING,
            friction: 0.2,
            air: 1.0,
        }
    }

    fn still(damping: f32) -> StepConditions {
        StepConditions {
            wind: Vec3f::zeros(),
            damping,
            step: 1.0e-3,
        }
    }

    #[test]
    fn a_free_sheet_without_air_falls_flat_at_g() {
        let fabric = FabricParameters {
            air: 0.0,
            ..fabric()
        };
        let mut cloth = ClothSolver::new(&flat(), Vec::new(), fabric);
        for _ in 0..100 {
            cloth.step(&still(0.0), &[]);
        }
        for (x, x0) in cloth.positions().iter().zip(flat()) {
            assert!((x.z + 0.5 * GRAVITY * 0.01).abs() < 1.0e-3);
            assert!((x - x0).xy().norm() < 1.0e-4);
        }
    }

    #[test]
    fn a_hanging_sheet_is_held_and_not_longer_than_at_rest() {
        let pins = (0..SIDE)
            .map(|vertex| PinnedVertex {
                vertex,
                at: flat()[vertex],
            })
            .collect();
        let mut cloth = ClothSolver::new(&flat(), pins, fabric());
        for _ in 0..600 {
            cloth.step(&still(3.0), &[]);
        }
        for (x, x0) in cloth.positions().iter().zip(flat()).take(SIDE) {
            assert_eq!(*x, x0);
        }
        let reach = cloth
            .positions()
            .iter()
            .map(|x| x.yz().norm())
            .fold(0.0, f32::max);
        assert!(reach < 1.005, "{reach}");
    }

    #[test]
    fn a_sheet_comes_to_rest_on_the_floor() {
        let floor = Obstacle::Floor { z: -0.02 };
        let mut cloth = ClothSolver::new(&flat(), Vec::new(), fabric());
        for _ in 0..300 {
            cloth.step(&still(5.0), &[floor]);
        }
        assert!(cloth.speed() < 0.01, "{}", cloth.speed());
        assert!(cloth.positions().iter().all(|x| x.z > -0.02));
    }
}
