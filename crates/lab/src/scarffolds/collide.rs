//! What keeps the simulated cloth out of itself and out of obstacles.
//!
//! Layers: every vertex is a ball; balls of vertices that are not neighbours keep the fabric's thickness apart. With a thickness
//! above the circumradius of half a cell (0.71 spacings) a vertex cannot pass through the middle of a cell. Pairs are gathered
//! once in a few steps with a margin; ties are broken by index, so the order of corrections is fixed.

use super::cloth::{Fabric, Point, SIDE, SPACING, VERTICES};
use super::field::{Field, WIDTH, Weights, slot};

/// Near pairs of vertices, kept between two gatherings.
#[derive(Debug, Clone)]
pub struct Contacts {
    thickness: f32,
    /// Slots of the two vertices.
    pairs: Vec<(u32, u32)>,
    head: Vec<u32>,
    next: Vec<u32>,
    /// How far vertices may still come closer before pairs are missed, metres.
    slack: f32,
}

const BUCKETS: usize = 8192;
const NONE: u32 = u32::MAX;
/// Pairs are gathered up to this much beyond the thickness, metres.
const SLACK: f32 = 0.8 * SPACING;

impl Contacts {
    /// No contacts yet, for layers of `thickness` metres.
    pub fn new(thickness: f32) -> Self {
        Self {
            thickness,
            pairs: Vec::new(),
            head: vec![NONE; BUCKETS],
            next: vec![NONE; VERTICES],
            slack: 0.0,
        }
    }

    /// Gathers when vertices that moved at most `moved` along an axis since the last call may have used up the slack.
    pub fn gather_when_due(&mut self, positions: &Field, moved: f32) {
        self.slack -= 2.0 * moved;
        if self.slack <= 0.0 {
            self.gather(positions);
        }
    }

    /// Lists the pairs that may touch before the next gathering.
    pub fn gather(&mut self, positions: &Field) {
        let reach = self.thickness + SLACK;
        let scale = 1.0 / reach;
        let cell = |p: &Point| [p.x, p.y, p.z].map(|x| (x * scale).floor() as i32);
        self.slack = SLACK;
        self.pairs.clear();
        self.head.fill(NONE);
        let points = positions.points();
        for (k, p) in points.iter().enumerate() {
            let c = cell(p);
            let mut seen = [NONE; 27];
            let mut count = 0;
            for n in 0..27 {
                let b = bucket([c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1]);
                let mut other = self.head[b];
                if other == NONE || seen[..count].contains(&(b as u32)) {
                    continue; // two cells in one bucket: its list is read once
                }
                seen[count] = b as u32;
                count += 1;
                while other != NONE {
                    let o = other as usize;
                    if (points[o] - p).norm_squared() < reach * reach && !neighbours(o, k) {
                        self.pairs.push((slot(o) as u32, slot(k) as u32));
                    }
                    other = self.next[o];
                }
            }
            let own = bucket(c);
            self.next[k] = self.head[own];
            self.head[own] = k as u32;
        }
    }

    /// Pushes pairs that are too near apart and slows their sliding. `before` are the positions at the start of the step.
    pub fn separate(&self, positions: &mut Field, before: &Field, weight: &Weights, friction: f32) {
        let least = self.thickness * self.thickness;
        for &(a, b) in &self.pairs {
            let (a, b) = (a as usize, b as usize);
            let (pa, pb) = (positions.at(a), positions.at(b));
            let d = pb - pa;
            let near2 = d.norm_squared();
            if near2 >= least || near2 < 1.0e-14 {
                continue;
            }
            let (wa, wb) = (weigh(weight, a), weigh(weight, b));
            let near = near2.sqrt();
            let depth = self.thickness - near;
            let normal = d * (1.0 / near);
            let slide = (pb - before.at(b)) - (pa - before.at(a));
            let slide = slide - normal * normal.dot(&slide);
            let push = (normal * depth - slide * grip(&slide, friction * depth))
                * (1.0 / (wa + wb).max(1.0e-6));
            positions.set(a, &(pa - push * wa));
            positions.set(b, &(pb + push * wb));
        }
    }
}

/// The share of a slide that friction takes back, when it may take back `most` metres.
fn grip(slide: &Point, most: f32) -> f32 {
    let far = slide.norm_squared().sqrt();
    if far > 1.0e-9 {
        (most / far).min(1.0)
    } else {
        0.0
    }
}

/// The weight of the vertex in a slot of a field.
fn weigh(weight: &Weights, slot: usize) -> f32 {
    weight[slot / (3 * WIDTH)][slot % WIDTH]
}

fn bucket([x, y, z]: [i32; 3]) -> usize {
    let h = (x as u32).wrapping_mul(73_856_093)
        ^ (y as u32).wrapping_mul(19_349_663)
        ^ (z as u32).wrapping_mul(83_492_791);
    (h ^ (h >> 13)) as usize % BUCKETS
}

fn neighbours(a: usize, b: usize) -> bool {
    let near = |p: usize, q: usize| p.abs_diff(q) <= 1;
    near(a % SIDE, b % SIDE) && near(a / SIDE, b / SIDE)
}

/// A fixed obstacle.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Collider {
    /// A ball.
    Sphere {
        /// Its middle.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// An endless horizontal round bar.
    Bar {
        /// A point of its axis.
        center: [f32; 3],
        /// Unit direction of its axis in the xy plane.
        along: [f32; 2],
        /// Its radius.
        radius: f32,
    },
    /// An upright box with round edges: a table or a chest.
    Block {
        /// Its middle.
        center: [f32; 3],
        /// Half its sides, before rounding.
        half: [f32; 3],
        /// Radius of its edges, added all around.
        radius: f32,
    },
    /// The half space below a height.
    Floor {
        /// Its height.
        z: f32,
    },
}

impl Collider {
    /// Signed distance of a point from the surface, and the unit direction out of it.
    pub fn distance(&self, p: &Point) -> (f32, Point) {
        let from = |d: Point, radius: f32| {
            let length = d.norm_squared().sqrt();
            let out = if length > 1e-9 {
                d * (1.0 / length)
            } else {
                Point::z()
            };
            (length - radius, out)
        };
        match *self {
            Self::Sphere { center, radius } => from(p - Point::from(center), radius),
            Self::Bar {
                center,
                along,
                radius,
            } => {
                let axis = Point::new(along[0], along[1], 0.0);
                let d = p - Point::from(center);
                from(d - axis * axis.dot(&d), radius)
            }
            Self::Block {
                center,
                half,
                radius,
            } => {
                let d = p - Point::from(center);
                let over = d.abs() - Point::from(half);
                if over.max() > 0.0 {
                    let outside = over
                        .map(|o| o.max(0.0))
                        .zip_map(&d, |o, s| if s < 0.0 { -o } else { o });
                    from(outside, radius)
                } else {
                    let axis = over.imax();
                    let mut out = Point::zeros();
                    out[axis] = if d[axis] < 0.0 { -1.0 } else { 1.0 };
                    (over[axis] - radius, out)
                }
            }
            Self::Floor { z } => (p.z - z, Point::z()),
        }
    }

    /// Moves vertices out of the obstacle, half a thickness above its skin, with friction.
    pub fn push_out(
        &self,
        positions: &mut Field,
        before: &Field,
        weight: &Weights,
        fabric: &Fabric,
    ) {
        for k in 0..VERTICES {
            let slot = slot(k);
            let x = positions.at(slot);
            let (distance, out) = self.distance(&x);
            let depth = 0.5 * fabric.thickness - distance;
            if depth > 0.0 && weigh(weight, slot) > 0.0 {
                let slide = x - before.at(slot);
                let slide = slide - out * out.dot(&slide);
                positions.set(
                    slot,
                    &(x + out * depth - slide * grip(&slide, fabric.friction * depth)),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn point(range: f32) -> impl Strategy<Value = Point> {
        proptest::array::uniform3(-range..range).prop_map(Point::from)
    }

    fn obstacle() -> impl Strategy<Value = Collider> {
        (
            proptest::array::uniform3(-0.5f32..0.5),
            0.05f32..0.5,
            0.0f32..6.2,
            0usize..4,
        )
            .prop_map(|(center, radius, turn, kind)| match kind {
                0 => Collider::Sphere { center, radius },
                1 => Collider::Bar {
                    center,
                    along: [turn.cos(), turn.sin()],
                    radius,
                },
                2 => Collider::Block {
                    center,
                    half: [0.2, 0.3, radius],
                    radius: 0.05,
                },
                _ => Collider::Floor { z: center[2] },
            })
    }

    proptest! {
        #[test]
        fn going_the_distance_outwards_ends_on_the_skin(obstacle in obstacle(), p in point(1.0)) {
            let (distance, out) = obstacle.distance(&p);
            prop_assert!((out.norm() - 1.0).abs() < 1e-4);
            prop_assert!(obstacle.distance(&(p - out * distance)).0.abs() < 1e-4);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn gathering_finds_every_near_pair_once(points in proptest::collection::vec(point(0.15), VERTICES)) {
            let mut contacts = Contacts::new(0.8 * SPACING);
            contacts.gather(&Field::from_points(&points));
            let found: BTreeSet<(u32, u32)> = contacts.pairs.iter().copied().collect();
            prop_assert_eq!(found.len(), contacts.pairs.len());
            let reach = 0.8 * SPACING * 0.999;
            for b in (0..VERTICES).step_by(17) {
                for a in 0..b {
                    let near = (points[a] - points[b]).norm() < reach && !neighbours(a, b);
                    prop_assert!(!near || found.contains(&(slot(a) as u32, slot(b) as u32)));
                }
            }
        }
    }
}
