//! A square of cloth of 51×51 vertices moved by XPBD in small steps (Macklin et al. 2016, 2019).
//!
//! Rest state: the unit square, vertex `(i, j)` at index `j * SIDE + i`, spacing 1/50. Units are metres and seconds, gravity is
//! along −z. Every vertex has mass 1, so stiffnesses are per mass: `bend` is B/ρ in m⁴/s². Bending is the thin-plate energy of
//! second differences along the four directions of the lattice (alike for a fold in any direction, since Σ cos⁴(θ + kπ/4) = 3/2), which on
//! inextensible cloth is quadratic (Bergou et al. 2006) and so costs one linear projection.
//! Stretch is hard, with tethers to the pins (Kim et al. 2012) so that weight does not lengthen the sheet between two sweeps.
//! One thread, fixed order, no transcendental functions in the loop: the same input gives the same bits.

use super::collide::{Collider, Contacts};
use super::field::{
    Field, Link, Row, Run, WIDTH, Weights, link_rows, slot, straighten_rows, tether_row,
};
use nalgebra::Vector3;

/// A point of the simulation, metres.
pub type Point = Vector3<f32>;

/// Vertices along a side of a sheet.
pub const SIDE: usize = 51;
/// Vertices of a sheet.
pub const VERTICES: usize = SIDE * SIDE;
/// Rest length of the edges along u and v.
pub const SPACING: f32 = 1.0 / (SIDE as f32 - 1.0);
/// Acceleration of gravity, along −z.
pub const GRAVITY: f32 = 9.81;

const DIAGONAL: f32 = SPACING * std::f32::consts::SQRT_2;
/// No vertex moves further than this in a step, so that layers cannot jump through each other.
const MAX_STEP: f32 = 0.2 * SPACING;

/// What the cloth is made of.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fabric {
    /// Bending stiffness per areal mass, m⁴/s²; `(bend / 9.81)^(1/3)` is the length at which folds appear.
    pub bend: f32,
    /// Stiffness of the diagonals per mass, 1/s².
    pub shear: f32,
    /// Least distance between two layers, metres; between 0.72 and 1 spacings nothing slips through a cell.
    pub thickness: f32,
    /// Coulomb friction of cloth on cloth and on obstacles.
    pub friction: f32,
    /// Drag of still air along the normal, 1/s.
    pub air: f32,
}

/// A vertex held in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pin {
    /// Index of the vertex.
    pub vertex: usize,
    /// Where it is held now.
    pub at: Point,
}

/// What acts on the sheet during one step.
#[derive(Debug, Clone, Copy)]
pub struct Forces {
    /// Velocity of the air, m/s.
    pub wind: Point,
    /// Velocity lost per second, 1/s, whatever its direction.
    pub damping: f32,
    /// Length of the step, seconds.
    pub step: f32,
}

/// The moving sheet.
#[derive(Debug, Clone)]
pub struct Cloth {
    now: Field,
    before: Field,
    velocity: Field,
    air: Field,
    turned: Field,
    weight: Weights,
    weight_turned: Weights,
    pins: Vec<Pin>,
    tethers: Vec<Vec<Run>>,
    fabric: Fabric,
    contacts: Contacts,
    steps: usize,
}

/// Which way a sweep goes over the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sweep {
    Up,
    Down,
}

impl Sweep {
    fn of(number: usize) -> Self {
        if number.is_multiple_of(2) {
            Self::Up
        } else {
            Self::Down
        }
    }
}

impl Cloth {
    /// A sheet at rest at `positions` (`VERTICES` long), held at `pins`.
    pub fn new(positions: &[Point], pins: Vec<Pin>, fabric: Fabric) -> Self {
        let now = Field::from_points(positions);
        let mut weight = vec![[0.0; WIDTH]; SIDE];
        for run in &mut weight {
            run[..SIDE].fill(1.0);
        }
        let mut weight_turned = weight.clone();
        for pin in &pins {
            let (i, j) = (pin.vertex % SIDE, pin.vertex / SIDE);
            weight[j][i] = 0.0;
            weight_turned[i][j] = 0.0;
        }
        Self {
            before: now.clone(),
            turned: now.clone(),
            velocity: Field::zeros(),
            air: Field::zeros(),
            contacts: Contacts::new(fabric.thickness),
            tethers: pins.iter().map(|pin| tether(pin.vertex)).collect(),
            steps: 0,
            now,
            weight,
            weight_turned,
            pins,
            fabric,
        }
    }

    /// Positions, row by row.
    pub fn positions(&self) -> Vec<Point> {
        self.now.points()
    }

    /// Moves pin number `index` to `at`; it takes effect in the next step.
    pub fn carry(&mut self, index: usize, at: Point) {
        self.pins[index].at = at;
    }

    /// One step of `forces.step` seconds among `obstacles`.
    pub fn step(&mut self, forces: &Forces, obstacles: &[Collider]) {
        if self.steps.is_multiple_of(8) {
            self.blow(forces.wind);
        }
        self.contacts
            .gather_when_due(&self.now, forces.step * self.fastest());
        self.predict(forces);
        let stiffness = self.fabric.bend / (1.5 * SPACING.powi(4)) * forces.step * forces.step;
        let bending = 1.0 / stiffness;
        stretch(&mut self.now.rows, &self.weight, Sweep::of(self.steps));
        self.now.transpose_into(&mut self.turned);
        stretch(
            &mut self.turned.rows,
            &self.weight_turned,
            Sweep::of(self.steps),
        );
        bend(&mut self.turned.rows, &self.weight_turned, bending);
        self.turned.transpose_into(&mut self.now);
        for (pin, reach) in self.pins.iter().zip(&self.tethers) {
            for ((row, weight), reach) in self.now.rows.iter_mut().zip(&self.weight).zip(reach) {
                tether_row(row, weight, &pin.at, reach);
            }
        }
        let shear = 1.0 / (self.fabric.shear * forces.step * forces.step);
        bend(&mut self.now.rows, &self.weight, bending);
        slant(&mut self.now.rows, &self.weight, shear, bending);
        self.contacts.separate(
            &mut self.now,
            &self.before,
            &self.weight,
            self.fabric.friction,
        );
        self.stretch_both(Sweep::of(self.steps + 1));
        self.push_out(obstacles);
        let rate = 1.0 / forces.step;
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

    /// Takes out what stretch is left, without gravity or inertia: `rounds` of projections of edges and contacts.
    pub fn relax(&mut self, rounds: usize, obstacles: &[Collider]) {
        for round in 0..rounds {
            if round % 4 == 0 {
                self.contacts.gather(&self.now);
            }
            self.before.rows.copy_from_slice(&self.now.rows);
            self.stretch_both(Sweep::Up);
            self.stretch_both(Sweep::Down);
            self.contacts
                .separate(&mut self.now, &self.before, &self.weight, 0.0);
            self.push_out(obstacles);
        }
        self.velocity = Field::zeros();
    }

    /// Root of the mean squared speed, m/s.
    pub fn speed(&self) -> f32 {
        let sum: f32 = (0..VERTICES)
            .map(|k| self.velocity.at(slot(k)).norm_squared())
            .sum();
        (sum / VERTICES as f32).sqrt()
    }

    /// Greatest speed along an axis, m/s.
    fn fastest(&self) -> f32 {
        self.velocity
            .rows
            .as_flattened()
            .as_flattened()
            .iter()
            .fold(0.0, |most, v| v.abs().max(most))
    }

    fn stretch_both(&mut self, sweep: Sweep) {
        stretch(&mut self.now.rows, &self.weight, sweep);
        self.now.transpose_into(&mut self.turned);
        stretch(&mut self.turned.rows, &self.weight_turned, sweep);
        self.turned.transpose_into(&mut self.now);
    }

    fn push_out(&mut self, obstacles: &[Collider]) {
        for obstacle in obstacles {
            obstacle.push_out(&mut self.now, &self.before, &self.weight, &self.fabric);
        }
    }

    fn predict(&mut self, forces: &Forces) {
        let dt = forces.step;
        let keep = 1.0 / (1.0 + forces.damping * dt);
        let pull = [0.0, 0.0, -GRAVITY];
        self.before.rows.copy_from_slice(&self.now.rows);
        for (j, row) in self.now.rows.iter_mut().enumerate() {
            let (velocity, air, weight) =
                (&self.velocity.rows[j], &self.air.rows[j], &self.weight[j]);
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
                let part = weight[i] * (MAX_STEP / far).min(1.0);
                for axis in 0..3 {
                    row[axis][i] += d[axis][i] * part;
                }
            }
        }
        for pin in &self.pins {
            self.now.set(slot(pin.vertex), &pin.at);
        }
    }

    /// Acceleration by the air at every vertex: drag along the normal only, as thin cloth feels it.
    fn blow(&mut self, wind: Point) {
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

/// Squared distances along the flat sheet from a vertex to all, a trifle generous: no vertex is further from a pin.
fn tether(vertex: usize) -> Vec<Run> {
    let (pi, pj) = ((vertex % SIDE) as f32, (vertex / SIDE) as f32);
    let reach2 = |i: usize, j: usize| {
        let (di, dj) = (i as f32 - pi, j as f32 - pj);
        (di * di + dj * dj) * (SPACING * SPACING * 1.002)
    };
    (0..SIDE)
        .map(|j| std::array::from_fn(|i| reach2(i, j)))
        .collect()
}

/// One sweep over the edges between rows; along a column each edge sees its neighbour's correction.
fn stretch(rows: &mut [Row], weight: &[Run], sweep: Sweep) {
    let link = Link {
        rest: SPACING,
        compliance: 0.0,
    };
    for line in 0..SIDE - 1 {
        let j = if sweep == Sweep::Up {
            line
        } else {
            SIDE - 2 - line
        };
        if let ([a, b], [wa, wb]) = (&mut rows[j..j + 2], &weight[j..j + 2]) {
            link_rows::<0, 0, WIDTH>(link, [a, b], [wa, wb]);
        }
    }
}

/// Bending across the rows.
fn bend(rows: &mut [Row], weight: &[Run], compliance: f32) {
    for j in 0..SIDE - 2 {
        if let ([a, b, c], [wa, wb, wc]) = (&mut rows[j..j + 3], &weight[j..j + 3]) {
            straighten_rows::<0, 0, WIDTH>(compliance, [a, b, c], [wa, wb, wc]);
        }
    }
}

/// Shear, and bending along both diagonals: a second difference there is twice h² times the derivative, so it weighs a quarter.
fn slant(rows: &mut [Row], weight: &[Run], shear: f32, bending: f32) {
    let link = Link {
        rest: DIAGONAL,
        compliance: shear,
    };
    let bending = 4.0 * bending;
    for j in 0..SIDE - 1 {
        if let ([a, b], [wa, wb]) = (&mut rows[j..j + 2], &weight[j..j + 2]) {
            link_rows::<0, 1, { SIDE - 1 }>(link, [a, b], [wa, wb]);
            link_rows::<1, 0, { SIDE - 1 }>(link, [a, b], [wa, wb]);
        }
        if j + 2 < SIDE
            && let ([a, b, c], [wa, wb, wc]) = (&mut rows[j..j + 3], &weight[j..j + 3])
        {
            straighten_rows::<0, 2, { SIDE - 2 }>(bending, [a, b, c], [wa, wb, wc]);
            straighten_rows::<2, 0, { SIDE - 2 }>(bending, [a, b, c], [wa, wb, wc]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat() -> Vec<Point> {
        (0..VERTICES)
            .map(|k| {
                Point::new(
                    (k % SIDE) as f32 * SPACING,
                    (k / SIDE) as f32 * SPACING,
                    0.0,
                )
            })
            .collect()
    }

    fn fabric() -> Fabric {
        Fabric {
            bend: 1.0e-4,
            shear: 1.0e5,
            thickness: 0.8 * SPACING,
            friction: 0.2,
            air: 1.0,
        }
    }

    fn still(damping: f32) -> Forces {
        Forces {
            wind: Point::zeros(),
            damping,
            step: 1.0e-3,
        }
    }

    #[test]
    fn a_free_sheet_falls_flat_as_a_stone_does() {
        let fabric = Fabric {
            air: 0.0,
            ..fabric()
        };
        let mut cloth = Cloth::new(&flat(), Vec::new(), fabric);
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
            .map(|vertex| Pin {
                vertex,
                at: flat()[vertex],
            })
            .collect();
        let mut cloth = Cloth::new(&flat(), pins, fabric());
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
        let floor = Collider::Floor { z: -0.02 };
        let mut cloth = Cloth::new(&flat(), Vec::new(), fabric());
        for _ in 0..300 {
            cloth.step(&still(5.0), &[floor]);
        }
        assert!(cloth.speed() < 0.01, "{}", cloth.speed());
        assert!(cloth.positions().iter().all(|x| x.z > -0.02));
    }
}
