//! How far cloth reaches: a point of it is never farther from another, in space, than it is on the chart.
//! Wanted positions go to the nearest ones that keep to that, by Dykstra's projections (Boyle & Dykstra 1986).

use super::Firmness;
use darn_geometry::mesh::{Vec2, Vec3};

/// Share by which cloth gives way before it counts as out of reach: more than woven cloth likes, so that a hand on it is felt, and less than
/// what a patch allows an edge.
const GIVE: f64 = 0.22;
/// Most rim vertices that are looked at; their neighbours' bounds follow from theirs but for a share of an edge.
const MOST_OF_RIM: usize = 128;
/// Up to as many points every pair is kept within its length; beyond, each point and those placed just before it.
const ALL_PAIRS: usize = 48;
/// Points wanted farther from where they are than this many extents of the hole are looked for that far along the same line: from much
/// farther away the projections take hundreds of rounds, and the nearest point hardly differs.
const FAR: f64 = 1.5;
/// Most rounds of projections.
const ROUNDS: usize = 200;
/// Most projections of a call.
const PROJECTIONS: usize = 20_000_000;
/// A round that moves no point by more than this share of the chart's extent is the last.
const SETTLED: f64 = 1e-5;

/// The rim that holds the cloth, on the chart's plane and in space.
#[derive(Debug, Clone, PartialEq)]
pub struct Reach {
    rim: Vec<(Vec2, Vec3)>,
}

/// A point of the cloth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Where on the chart's plane, scene units.
    pub flat: Vec2,
    /// Where the cloth is now; always taken to be within reach.
    pub now: Vec3,
    /// Where it should be.
    pub wanted: Vec3,
    /// Whether other points make room for it.
    pub firmness: Firmness,
}

/// A convex set that positions must lie in.
enum Bound {
    /// Point `of` within a ball.
    Ball {
        of: usize,
        centre: Vec3,
        radius: f64,
        correction: Vec3,
    },
    /// Two points within a distance.
    Pair {
        of: [usize; 2],
        /// How the second and the first share the way.
        share: [f64; 2],
        length: f64,
        correction: [Vec3; 2],
    },
}

impl Reach {
    /// A rim's vertices in order.
    pub fn new(rim: impl ExactSizeIterator<Item = (Vec2, Vec3)>) -> Reach {
        let every = rim.len().div_ceil(MOST_OF_RIM).max(1);
        Reach {
            rim: rim.step_by(every).collect(),
        }
    }

    /// The positions nearest to the wanted ones, taken together, that cloth held at the rim can have.
    ///
    /// The bound is the straight distance on the chart. Where that line leaves hole and region the cloth's own way is longer, so such
    /// points are held a little shorter than they need be. Positions within reach come back as they are.
    pub fn nearest(&self, points: &[Point]) -> Vec<Vec3> {
        let mut bounds = self.bounds(points);
        let extent = self.extent();
        let start = |p: &Point| {
            let way = p.wanted - p.now;
            if way.norm() > FAR * extent {
                p.now + way.cap_magnitude(FAR * extent)
            } else {
                p.wanted
            }
        };
        let mut at: Vec<Vec3> = points.iter().map(start).collect();
        let rounds = ROUNDS.min(PROJECTIONS / bounds.len().max(1)).max(1);
        for _ in 0..rounds {
            let before = at.clone();
            for bound in &mut bounds {
                bound.project(&mut at);
            }
            let moved = at.iter().zip(&before).map(|(a, b)| (a - b).norm());
            if moved.fold(0.0, f64::max) <= SETTLED * extent {
                break;
            }
        }
        // What the rounds left over: straight back towards where the cloth is, which is within all balls, and they are convex.
        for bound in &bounds {
            if let Bound::Ball {
                of, centre, radius, ..
            } = bound
            {
                at[*of] = drawn_back(points[*of].now, at[*of], (*centre, *radius));
            }
        }
        at
    }

    fn bounds(&self, points: &[Point]) -> Vec<Bound> {
        let mut bounds = Vec::new();
        for (of, point) in points.iter().enumerate() {
            bounds.extend(self.rim.iter().map(|(flat, centre)| Bound::Ball {
                of,
                centre: *centre,
                radius: length(point.flat - flat, point.now - centre),
                correction: Vec3::zeros(),
            }));
            let first = if points.len() <= ALL_PAIRS {
                0
            } else {
                of.saturating_sub(ALL_PAIRS / 4)
            };
            for (other, fellow) in points.iter().enumerate().take(of).skip(first) {
                use Firmness::{Hard, Soft};
                let share = match (fellow.firmness, point.firmness) {
                    (Hard, Soft) => [0.0, 1.0],
                    (Soft, Hard) => [1.0, 0.0],
                    _ => [0.5, 0.5],
                };
                bounds.push(Bound::Pair {
                    of: [other, of],
                    share,
                    length: length(point.flat - fellow.flat, point.now - fellow.now),
                    correction: [Vec3::zeros(); 2],
                });
            }
        }
        bounds
    }

    fn extent(&self) -> f64 {
        let low = self
            .rim
            .iter()
            .fold(Vec2::repeat(f64::MAX), |m, r| m.inf(&r.0));
        let high = self
            .rim
            .iter()
            .fold(Vec2::repeat(f64::MIN), |m, r| m.sup(&r.0));
        (high - low).max().max(0.0)
    }
}

/// How long cloth between two points can be: as on the chart, or as it is now where the chart is shorter.
fn length(flat: Vec2, now: Vec3) -> f64 {
    (flat.norm() * (1.0 + GIVE)).max(now.norm())
}

impl Bound {
    fn project(&mut self, at: &mut [Vec3]) {
        match self {
            Bound::Ball {
                of,
                centre,
                radius,
                correction,
            } => {
                let asked = at[*of] + *correction;
                let out = asked - *centre;
                let far = out.norm();
                at[*of] = if far > *radius {
                    *centre + out * (*radius / far)
                } else {
                    asked
                };
                *correction = asked - at[*of];
            }
            Bound::Pair {
                of: [a, b],
                share,
                length,
                correction,
            } => {
                let asked = [at[*a] + correction[0], at[*b] + correction[1]];
                let between = asked[1] - asked[0];
                let far = between.norm();
                let excess = if far > *length {
                    between * (1.0 - *length / far)
                } else {
                    Vec3::zeros()
                };
                at[*a] = asked[0] + excess * share[0];
                at[*b] = asked[1] - excess * share[1];
                *correction = [asked[0] - at[*a], asked[1] - at[*b]];
            }
        }
    }
}

/// The point farthest along from `inside` to `to` that lies in a ball with `inside` in it.
fn drawn_back(inside: Vec3, to: Vec3, (centre, radius): (Vec3, f64)) -> Vec3 {
    if (to - centre).norm() <= radius {
        return to;
    }
    let (way, out) = (to - inside, inside - centre);
    let (a, b, c) = (
        way.norm_squared(),
        way.dot(&out),
        out.norm_squared() - radius * radius,
    );
    // |out + t way|² = radius²; c ≤ 0 but for rounding, so the larger root is in [0, 1].
    let t = (-b + (b * b - a * c).max(0.0).sqrt()) / a.max(f64::MIN_POSITIVE);
    inside + way * t.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A flat round hole of radius 1 whose rim has come together to radius `slack`.
    fn ring(slack: f64) -> Reach {
        let at = |k: usize| {
            let a = std::f64::consts::TAU * k as f64 / 64.0;
            Vec2::new(a.cos(), a.sin())
        };
        Reach::new((0..64).map(at).map(|p| {
            let q = p * slack;
            (p, Vec3::new(q.x, q.y, 0.0))
        }))
    }

    fn soft(flat: Vec2, now: Vec3, wanted: Vec3) -> Point {
        Point {
            flat,
            now,
            wanted,
            firmness: Firmness::Soft,
        }
    }

    #[test]
    fn the_middle_of_slack_cloth_rises_as_high_as_a_cone() {
        let point = soft(Vec2::zeros(), Vec3::zeros(), Vec3::new(0.0, 0.0, 50.0));
        let at = ring(0.8).nearest(&[point])[0];
        let height = ((1.0 + GIVE).powi(2) - 0.8f64.powi(2)).sqrt();
        assert!((at - Vec3::z() * height).norm() < 1e-2, "{at}");
    }

    proptest! {
        #[test]
        fn what_is_within_reach_stays_and_the_rest_comes_within(
            points in prop::collection::vec((prop::array::uniform2(-0.5..0.5f64), prop::array::uniform3(-3.0..3.0f64)), 1..12),
            slack in 0.5..1.0f64,
        ) {
            let reach = ring(slack);
            let points: Vec<Point> = points.into_iter().map(|(flat, wanted)| {
                let flat = Vec2::from(flat);
                soft(flat, Vec3::new(slack * flat.x, slack * flat.y, 0.0), Vec3::from(wanted))
            }).collect();
            let at = reach.nearest(&points);
            for (p, at) in points.iter().zip(&at) {
                for (flat, rim) in &reach.rim {
                    prop_assert!((at - rim).norm() <= length(p.flat - flat, p.now - rim) * (1.0 + 1e-9));
                }
            }
            let again: Vec<Point> = points.iter().zip(&at).map(|(p, at)| Point { wanted: *at, ..*p }).collect();
            for (once, twice) in at.iter().zip(reach.nearest(&again)) {
                prop_assert!((once - twice).norm() < 0.05, "{once} {twice}");
            }
            let still: Vec<Point> = points.iter().map(|p| Point { wanted: p.now, ..*p }).collect();
            for (p, at) in still.iter().zip(reach.nearest(&still)) {
                prop_assert_eq!(p.now, at);
            }
        }

        #[test]
        fn nearest_means_nearest(wanted in prop::array::uniform3(-3.0..3.0f64), slack in 0.5..1.0f64, other in prop::array::uniform3(-1.0..1.0f64)) {
            let reach = ring(slack);
            let point = soft(Vec2::new(0.2, 0.1), Vec3::new(0.2 * slack, 0.1 * slack, 0.0), Vec3::from(wanted));
            let at = reach.nearest(&[point])[0];
            let other = Vec3::from(other);
            let reachable = reach.rim.iter().all(|(flat, rim)| (other - rim).norm() <= length(point.flat - flat, point.now - rim));
    prop_assert!(!reachable || (other - point.wanted).norm() >= (at - point.wanted).norm() - 1e-2);
        }
    }
}
