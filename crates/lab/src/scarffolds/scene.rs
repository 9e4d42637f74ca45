//! Random scenes: the material of a sheet, where its pinned vertices are moved, what it falls on; and its simulation from start to rest.
//!
//! The targets of pinned vertices are never further apart than the flat sheet allows. Pins move along straight lines from the flat start to
//! their targets. Distances are convex along these lines, so the cloth allows every moment of the motion.

use super::fabric::FabricParameters;
use super::lattice::{SIDE, SPACING, VERTICES, Vec3f};
use super::obstacle::Obstacle;
use super::solver::{ClothSolver, GRAVITY, PinnedVertex, StepConditions};
use nalgebra::{Rotation3, Unit};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// How the sheet is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneKind {
    /// All four corners moved to random targets: the paper's scene.
    FourCorners,
    /// Three corners moved, one free.
    ThreeCorners,
    /// Two corners moved, two free.
    TwoCorners,
    /// A curtain: one edge held at several points that move towards each other.
    Curtain,
    /// Two opposite edges held at their ends and middles, and turned against each other about the line between them.
    Twisted,
    /// One to three random vertices moved.
    Points,
    /// Fallen on a sphere, a bar, a block or the floor.
    Draped,
}

/// Parameters of one sheet, as written into the manifest.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Scene {
    /// How the sheet is held.
    pub kind: SceneKind,
    /// Its material.
    pub fabric: FabricParameters,
    /// Indices of the pinned vertices.
    pub pins: Vec<usize>,
    /// Where they end, metres; one for each pin.
    pub targets: Vec<[f32; 3]>,
    /// What it falls on.
    pub obstacles: Vec<Obstacle>,
    /// How long the pins move, seconds.
    pub carry: f32,
    /// Velocity of the gusts while the pins move, m/s.
    pub wind: [f32; 3],
    /// Damping while the pins move, 1/s.
    pub damping: f32,
    /// Height of the unevenness of the start, metres.
    pub unevenness: f32,
}

/// Length of a step while the sheet moves, seconds.
const STEP: f32 = 1.0e-3;
/// Longest time after the motion of the pins for the sheet to come to rest, seconds.
const SETTLE: f32 = 2.5;
/// A sheet below this speed is at rest, m/s.
const REST: f32 = 0.008;

impl Scene {
    /// Draws a scene.
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        let kind = match rng.random_range(0..100) {
            0..54 => SceneKind::FourCorners,
            54..64 => SceneKind::ThreeCorners,
            64..72 => SceneKind::TwoCorners,
            72..79 => SceneKind::Curtain,
            79..85 => SceneKind::Twisted,
            85..89 => SceneKind::Points,
            _ => SceneKind::Draped,
        };
        let fold = log_uniform(rng, 0.003, 0.028);
        let fabric = FabricParameters {
            bend: GRAVITY * fold * fold * fold,
            shear: log_uniform(rng, 1.0e3, 2.0e5),
            thickness: SPACING * rng.random_range(0.74..0.9),
            friction: rng.random_range(0.05..0.5),
            air: rng.random_range(0.3..2.0),
        };
        let pins = draw_pins(kind, rng);
        let targets = match kind {
            SceneKind::Curtain => gathered(&pins, rng),
            SceneKind::Twisted => twisted(&pins, rng),
            _ => scattered(&pins, rng),
        };
        let gust = rng.random_range(0.0f32..1.0).powi(2) * 3.0;
        Self {
            kind,
            fabric,
            pins,
            targets: targets.into_iter().map(Into::into).collect(),
            obstacles: if kind == SceneKind::Draped {
                draw_obstacles(rng)
            } else {
                Vec::new()
            },
            carry: rng.random_range(0.8..1.8),
            wind: (direction(rng) * gust).into(),
            damping: rng.random_range(0.3..2.0),
            unevenness: log_uniform(rng, 3.0e-4, 6.0e-3),
        }
    }

    /// Simulates until the sheet is at rest: `VERTICES` positions, metres. `rng` draws the unevenness of the start.
    pub(super) fn simulate(&self, rng: &mut ChaCha8Rng) -> Vec<Vec3f> {
        let start = uneven(self.unevenness, rng);
        let pins: Vec<PinnedVertex> = self
            .pins
            .iter()
            .map(|&vertex| PinnedVertex {
                vertex,
                at: start[vertex],
            })
            .collect();
        let from: Vec<Vec3f> = pins.iter().map(|pin| pin.at).collect();
        let mut cloth = ClothSolver::new(&start, pins, self.fabric);
        let carry_steps = (self.carry / STEP) as usize;
        for step in 0..carry_steps {
            let t = (step + 1) as f32 / carry_steps as f32;
            for (k, (a, b)) in from.iter().zip(&self.targets).enumerate() {
                cloth.move_pin(k, a + (Vec3f::from(*b) - a) * t);
            }
            let gust = 4.0 * t * (1.0 - t) * (1.0 + (9.0 * t).sin());
            let wind = Vec3f::from(self.wind) * gust;
            cloth.step(
                &StepConditions {
                    wind,
                    damping: self.damping,
                    step: STEP,
                },
                &self.obstacles,
            );
        }
        let settle_steps = (SETTLE / STEP) as usize;
        for step in 0..settle_steps {
            let t = step as f32 / settle_steps as f32;
            let damping = self.damping + 10.0 * t;
            cloth.step(
                &StepConditions {
                    wind: Vec3f::zeros(),
                    damping,
                    step: STEP,
                },
                &self.obstacles,
            );
            if step % 50 == 49 && cloth.speed() < REST {
                break;
            }
        }
        for _ in 0..250 {
            cloth.step(
                &StepConditions {
                    wind: Vec3f::zeros(),
                    damping: 40.0,
                    step: 0.5 * STEP,
                },
                &self.obstacles,
            );
        }
        cloth.relax(24, &self.obstacles);
        cloth.positions()
    }
}

/// Position of vertex `k` on the flat sheet, which is centred at the origin.
fn flat(k: usize) -> Vec3f {
    Vec3f::new(
        (k % SIDE) as f32 * SPACING - 0.5,
        (k / SIDE) as f32 * SPACING - 0.5,
        0.0,
    )
}

fn log_uniform(rng: &mut ChaCha8Rng, low: f32, high: f32) -> f32 {
    (rng.random_range(low.ln()..high.ln())).exp()
}

fn direction(rng: &mut ChaCha8Rng) -> Vec3f {
    loop {
        let p = Vec3f::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let n = p.norm();
        if n > 0.1 && n < 1.0 {
            return p / n;
        }
    }
}

/// The flat sheet with a few smooth waves and a little noise of total height about `height`.
fn uneven(height: f32, rng: &mut ChaCha8Rng) -> Vec<Vec3f> {
    let waves: Vec<[f32; 4]> = (0..4)
        .map(|_| {
            let turn = rng.random_range(0.0..std::f32::consts::TAU);
            let pace = rng.random_range(4.0..30.0);
            [
                pace * turn.cos(),
                pace * turn.sin(),
                rng.random_range(0.0..std::f32::consts::TAU),
                rng.random_range(0.2..0.6),
            ]
        })
        .collect();
    (0..VERTICES)
        .map(|k| {
            let mut p = flat(k);
            let wave: f32 = waves
                .iter()
                .map(|w| w[3] * (w[0] * p.x + w[1] * p.y + w[2]).sin())
                .sum();
            p.z = height * (wave + rng.random_range(-0.2..0.2));
            p
        })
        .collect()
}

fn draw_pins(kind: SceneKind, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let corners = [0, SIDE - 1, VERTICES - 1, VERTICES - SIDE];
    let turn = rng.random_range(0..4);
    let corner = |n: usize| corners[(n + turn) % 4];
    match kind {
        SceneKind::FourCorners => corners.to_vec(),
        SceneKind::ThreeCorners => vec![corner(0), corner(1), corner(2)],
        SceneKind::TwoCorners => vec![corner(0), corner(1 + usize::from(rng.random_bool(0.4)))],
        SceneKind::Curtain => {
            let hooks = rng.random_range(3..10);
            (0..hooks)
                .map(|n| (n * (SIDE - 1) + (hooks - 1) / 2) / (hooks - 1))
                .collect()
        }
        SceneKind::Twisted => (0..3)
            .map(|n| n * (SIDE - 1) / 2)
            .flat_map(|i| [i, VERTICES - SIDE + i])
            .collect(),
        SceneKind::Points => {
            let mut pins: Vec<usize> = (0..rng.random_range(1..4))
                .map(|_| rng.random_range(0..VERTICES))
                .collect();
            pins.sort_unstable();
            pins.dedup();
            pins
        }
        SceneKind::Draped if rng.random_bool(0.25) => vec![corner(0)],
        SceneKind::Draped => Vec::new(),
    }
}

/// Targets around the shrunken and rotated flat positions of the pins, no two further apart than the cloth allows.
fn scattered(pins: &[usize], rng: &mut ChaCha8Rng) -> Vec<Vec3f> {
    let shrink = rng.random_range(0.0..0.9);
    let mut spread = rng.random_range(0.1..0.75);
    let tilt = rng.random_range(0.0..std::f32::consts::FRAC_PI_2);
    let turn = rng.random_range(0.0..std::f32::consts::TAU);
    let axis = Unit::new_normalize(Vec3f::new(turn.cos(), turn.sin(), 0.0));
    let rotation = Rotation3::from_axis_angle(&axis, tilt);
    loop {
        let targets: Vec<Vec3f> = pins
            .iter()
            .map(|&k| {
                rotation * flat(k) * shrink
                    + Vec3f::from_fn(|_, _| rng.random_range(-spread..spread))
            })
            .collect();
        if allowed(pins, &targets) {
            return targets;
        }
        spread *= 0.98;
    }
}

/// Targets of the hooks of a curtain: closer together than at rest, and off the line.
fn gathered(pins: &[usize], rng: &mut ChaCha8Rng) -> Vec<Vec3f> {
    let width = rng.random_range(0.3..0.9);
    let gap = 0.97 / (pins.len() - 1) as f32;
    let depth = (gap * gap * (1.0 - width * width)).sqrt() * 0.5;
    let slope = rng.random_range(-0.15..0.15);
    pins.iter()
        .map(|&k| {
            let x = (k % SIDE) as f32 * SPACING - 0.5;
            Vec3f::new(
                width * 0.97 * x,
                rng.random_range(-depth..depth),
                0.3 + slope * width * x,
            )
        })
        .collect()
}

/// Targets of two edges that are moved together, gathered, and turned against each other about the line between them.
fn twisted(pins: &[usize], rng: &mut ChaCha8Rng) -> Vec<Vec3f> {
    let angle = rng.random_range(0.3..1.6f32);
    let mut near = rng.random_range(0.4..0.9f32);
    let gather = rng.random_range(0.3..0.9f32);
    let lean = Rotation3::from_axis_angle(
        &Unit::new_normalize(Vec3f::new(1.0, 0.3, 0.0)),
        rng.random_range(0.0..std::f32::consts::FRAC_PI_2),
    );
    loop {
        let targets: Vec<Vec3f> = pins
            .iter()
            .map(|&k| {
                let p = flat(k);
                let turn = Rotation3::from_axis_angle(&Vec3f::y_axis(), angle * p.y.signum());
                lean * (turn * Vec3f::new(gather * p.x, 0.0, 0.0)
                    + Vec3f::new(0.0, near * p.y, 0.0))
            })
            .collect();
        if allowed(pins, &targets) {
            return targets;
        }
        near *= 0.95;
    }
}

/// Whether no two targets are further apart than the flat sheet allows.
fn allowed(pins: &[usize], targets: &[Vec3f]) -> bool {
    (0..pins.len()).all(|a| {
        (0..a).all(|b| {
            (targets[a] - targets[b]).norm() <= 0.97 * (flat(pins[a]) - flat(pins[b])).norm()
        })
    })
}

fn draw_obstacles(rng: &mut ChaCha8Rng) -> Vec<Obstacle> {
    let mut spot = |top: f32| {
        [
            rng.random_range(-0.2..0.2),
            rng.random_range(-0.2..0.2),
            -0.03 - top,
        ]
    };
    let places = [spot(0.0), spot(0.0)];
    let floor = Obstacle::Floor {
        z: rng.random_range(-0.8..-0.1),
    };
    let below = |p: [f32; 3], top: f32| [p[0], p[1], p[2] - top];
    let sphere = |rng: &mut ChaCha8Rng, place: [f32; 3]| {
        let radius = rng.random_range(0.08..0.4);
        Obstacle::Sphere {
            center: below(place, radius),
            radius,
        }
    };
    match rng.random_range(0..5) {
        0 => vec![sphere(rng, places[0]), floor],
        1 => vec![sphere(rng, places[0]), sphere(rng, places[1]), floor],
        2 | 3 => {
            let radius = rng.random_range(0.03..0.3);
            let turn = rng.random_range(0.0..std::f32::consts::TAU);
            vec![
                Obstacle::Bar {
                    center: below(places[0], radius),
                    along: [turn.cos(), turn.sin()],
                    radius,
                },
                floor,
            ]
        }
        _ => {
            let half = [
                rng.random_range(0.08..0.35),
                rng.random_range(0.08..0.35),
                0.5,
            ];
            let radius = rng.random_range(0.01..0.08);
            vec![
                Obstacle::Block {
                    center: below(places[0], 0.5 + radius),
                    half,
                    radius,
                },
                floor,
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;

    proptest! {
        #[test]
        fn targets_are_never_further_apart_than_the_cloth_allows(seed: u64) {
            let scene = Scene::draw(&mut ChaCha8Rng::seed_from_u64(seed));
            prop_assert_eq!(scene.pins.len(), scene.targets.len());
            for (a, p) in scene.pins.iter().zip(&scene.targets) {
                for (b, q) in scene.pins.iter().zip(&scene.targets) {
                    let apart = (Vec3f::from(*p) - Vec3f::from(*q)).norm();
                    prop_assert!(apart <= (flat(*a) - flat(*b)).norm() + 1e-5);
                }
            }
        }
    }
}
