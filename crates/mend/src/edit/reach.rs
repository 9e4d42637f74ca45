//! How far cloth reaches: the distance of two of its points in space is at most their distance on the chart, and a
//! little more. Targets move to the nearest positions that obey this, by Dykstra's projections (Boyle & Dykstra 1986).

use super::point::PlacedPoint;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::Firmness;

/// Share by which cloth may be longer than on the chart before a target counts as out of reach: more than woven cloth
/// gives, so that an edit has an effect, and less than the stretch that a patch allows an edge.
const GIVE: f64 = 0.22;
/// Most rim vertices that are used; the limits of the vertices between them differ by less than an edge.
const MAX_RIM: usize = 128;
/// Up to this many points every pair is kept within its length; of more points each is paired with those placed just
/// before it.
const ALL_PAIRS: usize = 48;
/// Targets farther from the cloth than this many extents of the hole are moved to that distance along the same line:
/// from much farther away the projections take hundreds of rounds, and the nearest point hardly differs.
const FAR: f64 = 1.5;
/// Most rounds of projections.
const MAX_ROUNDS: usize = 200;
/// Most projections of a call.
const MAX_PROJECTIONS: usize = 20_000_000;
/// The rounds end with one that moves no point by more than this share of the chart's extent.
const TOLERANCE: f64 = 1e-5;

/// The rim that holds the cloth of a hole, thinned to at most 128 vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct ReachLimit {
    rim: Vec<RimPoint>,
}

/// A vertex of a hole's rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimPoint {
    /// In the chart's plane, scene units.
    pub flat: Vec2,
    /// In scene space.
    pub position: Vec3,
}

/// A ball in scene space.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: Vec3,
    radius: f64,
}

/// A convex set that the positions must lie in, and Dykstra's correction for it.
enum Bound {
    /// Point `of` lies in a ball.
    Ball {
        of: usize,
        ball: Ball,
        correction: Vec3,
    },
    /// Two points keep within a length.
    Pair {
        of: [usize; 2],
        /// Which share of a projection each of them moves.
        share: [f64; 2],
        length: f64,
        correction: [Vec3; 2],
    },
}

impl ReachLimit {
    /// The limit of a rim's vertices, given in order.
    pub fn new(rim: impl ExactSizeIterator<Item = RimPoint>) -> ReachLimit {
        let every = rim.len().div_ceil(MAX_RIM).max(1);
        ReachLimit {
            rim: rim.step_by(every).collect(),
        }
    }

    /// The positions nearest to the points' targets, taken together, that cloth held at the rim can have; one for each
    /// point.
    ///
    /// The limit is the straight distance on the chart. Where that line leaves hole and region the cloth's own way is
    /// longer, and the limit is a little too strict. Targets within reach come back as they are.
    pub fn nearest(&self, points: &[PlacedPoint]) -> Vec<Vec3> {
        let mut bounds = self.bounds(points);
        let extent = self.extent();
        let start = |p: &PlacedPoint| {
            let way = p.target - p.origin;
            if way.norm() > FAR * extent {
                p.origin + way.cap_magnitude(FAR * extent)
            } else {
                p.target
            }
        };
        let mut at: Vec<Vec3> = points.iter().map(start).collect();
        let rounds = (MAX_ROUNDS.min(MAX_PROJECTIONS / bounds.len().max(1))).max(1);
        for _ in 0..rounds {
            let before = at.clone();
            for bound in &mut bounds {
                bound.project(&mut at);
            }
            let moved = at.iter().zip(&before).map(|(a, b)| (a - b).norm());
            if moved.fold(0.0, f64::max) <= TOLERANCE * extent {
                break;
            }
        }
        // What the rounds left outside a ball moves straight towards the unedited cloth, which lies in all balls; they
        // are convex.
        for bound in &bounds {
            if let Bound::Ball { of, ball, .. } = bound {
                at[*of] = ball.clipped(points[*of].origin, at[*of]);
            }
        }
        at
    }

    fn bounds(&self, points: &[PlacedPoint]) -> Vec<Bound> {
        let mut bounds = Vec::new();
        for (of, point) in points.iter().enumerate() {
            bounds.extend(self.rim.iter().map(|rim| Bound::Ball {
                of,
                ball: Ball {
                    centre: rim.position,
                    radius: length(point.flat - rim.flat, point.origin - rim.position),
                },
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
                    length: length(point.flat - fellow.flat, point.origin - fellow.origin),
                    correction: [Vec3::zeros(); 2],
                });
            }
        }
        bounds
    }

    /// Larger side of the rim's box in the chart's plane, scene units.
    fn extent(&self) -> f64 {
        let low = self
            .rim
            .iter()
            .fold(Vec2::repeat(f64::MAX), |m, r| m.inf(&r.flat));
        let high = self
            .rim
            .iter()
            .fold(Vec2::repeat(f64::MIN), |m, r| m.sup(&r.flat));
        (high - low).max().max(0.0)
    }
}

/// The longest distance between two points in space, from their difference on the chart and on the unedited cloth: the
/// distance on the chart and what cloth gives, or the present distance where that is longer.
fn length(flat: Vec2, present: Vec3) -> f64 {
    (flat.norm() * (1.0 + GIVE)).max(present.norm())
}

impl Bound {
    /// Moves the positions to the nearest ones in the set, after undoing the last projection onto it.
    fn project(&mut self, at: &mut [Vec3]) {
        match self {
            Bound::Ball {
                of,
                ball: Ball { centre, radius },
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

impl Ball {
    /// The point farthest along the line from `inside`, which lies in the ball, to `to` that still lies in it.
    fn clipped(&self, inside: Vec3, to: Vec3) -> Vec3 {
        let Ball { centre, radius } = *self;
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A round hole of radius 1 on the chart whose rim lies on a circle of radius `slack` in space.
    fn ring(slack: f64) -> ReachLimit {
        let at = |k: usize| {
            let a = std::f64::consts::TAU * k as f64 / 64.0;
            Vec2::new(a.cos(), a.sin())
        };
        ReachLimit::new((0..64).map(at).map(|flat| {
            let q = flat * slack;
            RimPoint {
                flat,
                position: Vec3::new(q.x, q.y, 0.0),
            }
        }))
    }

    fn soft(flat: Vec2, origin: Vec3, target: Vec3) -> PlacedPoint {
        PlacedPoint {
            uv: flat,
            flat,
            origin,
            target,
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
        fn targets_within_reach_stay_and_the_others_come_within_reach(
            points in prop::collection::vec((prop::array::uniform2(-0.5..0.5f64), prop::array::uniform3(-3.0..3.0f64)), 1..12),
            slack in 0.5..1.0f64,
        ) {
            let reach = ring(slack);
            let points: Vec<PlacedPoint> = points.into_iter().map(|(flat, target)| {
                let flat = Vec2::from(flat);
                soft(flat, Vec3::new(slack * flat.x, slack * flat.y, 0.0), Vec3::from(target))
            }).collect();
            let at = reach.nearest(&points);
            for (p, at) in points.iter().zip(&at) {
                for rim in &reach.rim {
                    let most = length(p.flat - rim.flat, p.origin - rim.position);
                    prop_assert!((at - rim.position).norm() <= most * (1.0 + 1e-9));
                }
            }
            let again: Vec<PlacedPoint> = points.iter().zip(&at).map(|(p, at)| PlacedPoint { target: *at, ..*p }).collect();
            for (once, twice) in at.iter().zip(reach.nearest(&again)) {
                prop_assert!((once - twice).norm() < 0.05, "{once} {twice}");
            }
            let still: Vec<PlacedPoint> = points.iter().map(|p| PlacedPoint { target: p.origin, ..*p }).collect();
            for (p, at) in still.iter().zip(reach.nearest(&still)) {
                prop_assert_eq!(p.origin, at);
            }
        }

        #[test]
        fn no_reachable_position_is_nearer_to_the_target(target in prop::array::uniform3(-3.0..3.0f64), slack in 0.5..1.0f64, other in prop::array::uniform3(-1.0..1.0f64)) {
            let reach = ring(slack);
            let point = soft(Vec2::new(0.2, 0.1), Vec3::new(0.2 * slack, 0.1 * slack, 0.0), Vec3::from(target));
            let at = reach.nearest(&[point])[0];
            let other = Vec3::from(other);
            let reachable = reach.rim.iter().all(|rim| {
                (other - rim.position).norm() <= length(point.flat - rim.flat, point.origin - rim.position)
            });
            prop_assert!(!reachable || (other - point.target).norm() >= (at - point.target).norm() - 1e-2);
        }
    }
}
