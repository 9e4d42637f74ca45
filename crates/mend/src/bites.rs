//! Bites and rips at the cloth's own edge: short stretches of a boundary loop that lead into the cloth, between hems
//! that continue each other; and torn corners, between hems that meet as those of the piece's other corners do.

use std::ops::Range;

use darn_budget::{Budget, Exhausted, Steps};

use darn_geometry::mesh::loops::BoundaryLoop;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use nalgebra::Rotation2;

use crate::flat_line::FlatLine;
use crate::torn_corners::torn_corners;

/// Fewest vertices of a loop that is looked at.
const LEAST_VERTICES: usize = 16;
/// Longest stretch of a bite, as a share of its loop.
const LONGEST: f64 = 0.55;
/// Least ratio of a bite's stretch to its mouth.
const LEAST_DETOUR: f64 = 1.2;
/// Least depth of a bite, in mean edges of its loop.
pub const LEAST_DEPTH: f64 = 3.0;
/// A bite ends where its line is less than this many times as long as the hem across it would be: more than a smooth hem's waves make it, so that a wavy
/// hem is no part of it.
const DETOUR: f64 = 1.15;
/// How the hems beside a bite may run: less hem has to be straighter.
const HEMS: [HemRule; 4] = [
    HemRule::straight(1.0, 0.45),
    HemRule::straight(0.3, 0.2),
    HemRule::straight(0.15, 0.1),
    // A round opening's edge. Its own arcs lead into the cloth as well: one that is 1.4 times as long as its chord leaves it by 0.4 rad more than
    // the edge would turn over the chord.
    HemRule {
        reach: 0.3,
        angle: 0.2,
        least_detour: 1.4,
        turns: true,
    },
];
/// How much a hem may turn from the middle of a mouth to the middle of the hem, radians.
const MOST_TURN: f64 = 0.6;
/// The least of a hem that is looked at, as a share of the loop.
pub const LEAST_HEM: f64 = 0.03;
/// Nanoseconds of work a pair of points.
pub const PAIR_WORK: u64 = 150;
/// Nanoseconds of work an edge of a loop.
const EDGE_WORK: u64 = 200;

/// A stretch of a boundary loop that leads into the cloth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bite {
    /// Where it starts, as an index into the loop's vertices.
    pub from: usize,
    /// Where it ends; before `from` when it runs over the loop's first vertex.
    pub to: usize,
    /// Its length, scene units.
    pub length: f64,
    /// Distance of its ends on the cloth laid flat, scene units.
    pub mouth: f64,
    /// How far it leads into the cloth laid flat, scene units; from the corner, where one is torn off.
    pub depth: f64,
    /// Where a torn corner was: where the hems on both sides meet; `None` where they continue each other.
    pub corner: Option<Vec3>,
}

impl Bite {
    /// Whether two bites of a loop of so many vertices have a stretch of it in common.
    pub fn overlaps(&self, other: &Bite, vertices: usize) -> bool {
        let within = |bite: &Bite, vertex: usize| {
            let ahead = |to: usize| (to + vertices - bite.from) % vertices;
            ahead(vertex) <= ahead(bite.to)
        };
        within(self, other.from) || within(self, other.to) || within(other, self.from)
    }
}

/// The bites and torn corners of a boundary loop, in its order; they do not overlap. The loop is looked at as it lies when the cloth along
/// it is laid flat: edges keep their lengths, and the direction turns at each vertex by its geodesic curvature, so that
/// folds do not count.
///
/// # Errors
/// `Exhausted`.
pub fn bites(
    mesh: &TriMesh,
    topology: &Topology,
    rim: &BoundaryLoop,
    budget: &Budget,
) -> Result<Vec<Bite>, Exhausted> {
    if rim.vertices.len() < LEAST_VERTICES {
        return Ok(Vec::new());
    }
    budget.spend(EDGE_WORK * rim.vertices.len() as u64)?;
    let mut steps = Steps::of(budget);
    let line = FlatLine::of(mesh, topology, rim);
    let mut found: Vec<Bite> = Vec::new();
    for from in 0..line.samples.len() {
        for ahead in 2..line.samples.len() {
            steps.take(PAIR_WORK)?;
            let stretch = from..from + ahead;
            if line.length_of(&stretch) > LONGEST * line.length {
                break;
            }
            found.extend(line.bite(&stretch));
        }
    }
    // First the one that is longest beyond its mouth: others that overlap it start within the bite, or have some of the hem, too.
    let rank = |bite: &Bite| bite.length - DETOUR * bite.mouth;
    found.sort_by(|a, b| rank(b).total_cmp(&rank(a)).then(a.from.cmp(&b.from)));
    found.extend(torn_corners(&line, mesh, rim, &mut steps)?);
    let mut apart: Vec<Bite> = Vec::new();
    for bite in found {
        steps.take(PAIR_WORK * (1 + apart.len() as u64))?;
        if apart
            .iter()
            .all(|other| !bite.overlaps(other, line.vertices))
        {
            apart.push(bite);
        }
    }
    apart.sort_by_key(|bite| bite.from);
    Ok(apart)
}

/// How the hems on both sides of a bite may run.
struct HemRule {
    /// How far they are looked at, in lengths of the mouth.
    reach: f64,
    /// The largest angle between each and the direction in which it should run, radians.
    angle: f64,
    /// Least ratio of the bite's stretch to its mouth.
    least_detour: f64,
    /// Whether the hem should turn across the mouth as it does along itself; otherwise it should run as the mouth does.
    turns: bool,
}

impl HemRule {
    const fn straight(reach: f64, angle: f64) -> HemRule {
        HemRule {
            reach,
            angle,
            least_detour: LEAST_DETOUR,
            turns: false,
        }
    }
}

impl FlatLine {
    /// The bite that a stretch from one sample to another is, if it is one.
    fn bite(&self, stretch: &Range<usize>) -> Option<Bite> {
        let (from, to) = (self.sample(stretch.start), self.sample(stretch.end));
        let length = self.length_of(stretch);
        let (a, b) = (self.places[from].0, self.places[to].0);
        let chord = b - a;
        let mouth = chord.norm();
        if length < LEAST_DETOUR * mouth || mouth < 1e-9 * self.length {
            return None;
        }
        let along = chord / mouth;
        let is_between_hems = HEMS.iter().any(|rule| {
            if length < rule.least_detour * mouth {
                return false;
            }
            let reach = (rule.reach * mouth).max(LEAST_HEM * self.length);
            let turn = if rule.turns {
                // From the middle of the mouth to the middle of the hem.
                self.turning_beside(from, to, 2.0 * reach) * 0.5 * (mouth + reach)
            } else {
                0.0
            };
            if turn.abs() > MOST_TURN {
                return false;
            }
            let runs = |hem: Option<Vec2>, turn: f64| {
                let expected = Rotation2::new(turn) * along;
                hem.is_some_and(|hem| expected.dot(&hem) > rule.angle.cos())
            };
            runs(self.hem(from, -reach), -turn) && runs(self.hem(to, reach), turn)
        });
        if !is_between_hems {
            return None;
        }
        // The cloth lies on the left.
        let height = |s: usize| along.perp(&(self.places[self.sample(s)].0 - a));
        let heights = || stretch.clone().map(height);
        let depth = heights().fold(0.0, f64::max);
        let least = heights().fold(0.0, f64::min);
        let is_deep = depth >= LEAST_DEPTH * self.edge && -least <= 0.1 * depth;
        is_deep.then_some(Bite {
            from: from % self.vertices,
            to: to % self.vertices,
            length,
            mouth,
            depth,
            corner: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
    use darn_geometry::mesh::shapes::{sheet, tube};
    use darn_geometry::mesh::weld::weld;

    fn found(keep: impl Fn(f64, f64) -> bool, fold: f64) -> Vec<(Bite, Vec3, Vec3)> {
        let place = |u: f64, v: f64| Vec3::new(u, v, fold * (40.0 * u).sin());
        let mesh = weld(&sheet(60, keep, place)).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        let outer = loops
            .iter()
            .find(|l| l.kind == LoopKind::Outer)
            .expect("an outer boundary");
        let bites = bites(&mesh, &topology, outer, Budget::unlimited()).unwrap();
        let at = |k: usize| mesh.positions[outer.vertices[k].index()];
        bites
            .into_iter()
            .map(|b| (b, at(b.from), at(b.to)))
            .collect()
    }

    #[test]
    fn a_bite_and_a_rip_are_found_between_their_corners() {
        let round = |u: f64, v: f64| (u - 0.5).hypot(v) > 0.13;
        let rip = |u: f64, v: f64| (u - 0.4).abs() > 0.02 || v > 0.4;
        let both = |u: f64, v: f64| round(u, v) && ((v - 0.7).abs() > 0.02 || u < 0.7);
        for fold in [0.0, 0.03] {
            for (k, bites) in [found(round, fold), found(rip, fold), found(both, fold)]
                .iter()
                .enumerate()
            {
                assert_eq!(bites.len(), [1, 1, 2][k], "{k} {fold}: {bites:?}");
                for (bite, from, to) in bites {
                    let at_edge = |p: &Vec3| p.x.min(p.y).min(1.0 - p.x) < 1e-6;
                    assert!(
                        at_edge(from) && at_edge(to),
                        "{k} {fold}: {bite:?} {from} {to}"
                    );
                    assert!(bite.depth > 0.1, "{k} {fold}: {bite:?}");
                }
            }
        }
    }

    #[test]
    fn wide_bites_and_deep_ragged_rips_are_found() {
        let wide = |width: f64, depth: f64| {
            move |u: f64, v: f64| ((u - 0.5) / (0.5 * width)).hypot(v / depth) > 1.0
        };
        let saw = |depth: f64| {
            move |u: f64, v: f64| {
                let tooth = 0.02 * f64::from((v * 60.0) as u32 / 2 % 3);
                (u - 0.5 - tooth).abs() > 0.03 || v > depth
            }
        };
        for bites in [
            found(wide(0.5, 0.2), 0.0),
            found(wide(0.7, 0.3), 0.0),
            found(saw(0.6), 0.0),
            found(saw(0.8), 0.02),
        ] {
            let [(bite, from, to)] = &bites[..] else {
                panic!("{bites:?}");
            };
            assert!(
                bite.depth > 0.15 && from.y < 1e-6 && to.y < 1e-6,
                "{bites:?}"
            );
        }
    }

    /// Bites of the loops of a ball with a mouth at either pole, each this wide from it, radians; the mouth at the lower one may be torn. Beside each
    /// bite, how far its ends lie above the lower mouth and from each other.
    fn of_bag(
        mouth: f64,
        flat: f64,
        keep: impl Fn(f64, f64) -> bool,
    ) -> Vec<Vec<(Bite, [f64; 3])>> {
        let mut soup = tube(72, keep);
        for p in &mut soup.positions {
            let polar = mouth + (PI - 2.0 * mouth) * p.z / 4.0;
            *p = Vec3::new(p.x * polar.sin(), flat * p.y * polar.sin(), -polar.cos());
        }
        let mesh = weld(&soup).mesh;
        let topology = Topology::new(&mesh);
        let mut loops = boundary_loops(&mesh, &topology);
        loops.sort_by(|a, b| a.centroid.z.total_cmp(&b.centroid.z));
        let bites = |l: &BoundaryLoop| {
            let at = |k: usize| mesh.positions[l.vertices[k].index()];
            let above = |k: usize| at(k).z + mouth.cos();
            let found = bites(&mesh, &topology, l, Budget::unlimited()).unwrap();
            let ends = |b: Bite| {
                (
                    b,
                    [above(b.from), above(b.to), (at(b.to) - at(b.from)).norm()],
                )
            };
            found.into_iter().map(ends).collect()
        };
        loops.iter().map(bites).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_rip_of_a_round_opening_is_found_and_its_own_arcs_are_none(
            mouth in 0.55..1.1f64, flat in 0.75..1.0f64, depth in 0.3..0.4f64, width in 1.0..3.5f64, at in 0.0..1.0f64,
        ) {
            let away = move |u: f64| 72.0 * (u - at).abs().min(1.0 - (u - at).abs());
            let ripped = of_bag(mouth, flat, |u, v| away(u) > width || v > depth * (1.0 - away(u) / width / 2.0));
            prop_assert_eq!(ripped.iter().map(Vec::len).collect::<Vec<_>>(), [1, 0], "{:?}", ripped);
            let (bite, [from, to, wide]) = ripped[0][0];
            let edge = TAU * mouth.sin() / 72.0;
            prop_assert!(from.max(to) < 1e-6 && wide < (2.0 * width + 4.0) * edge, "{:?} {} {} {}", bite, from, to, wide);
            let whole = of_bag(mouth, flat, |_, _| true);
            prop_assert_eq!(whole.iter().map(Vec::len).collect::<Vec<_>>(), [0, 0], "{:?}", whole);
        }
    }

    #[test]
    fn whole_cloth_and_cloth_cut_to_a_shape_has_none() {
        assert!(found(|_, _| true, 0.0).is_empty());
        assert!(found(|_, _| true, 0.04).is_empty());
        // Scallops and a frayed hem.
        let scallop = |u: f64, v: f64| v > 0.06 - 0.05 * (31.4 * u).cos();
        assert!(found(scallop, 0.0).is_empty());
        let frayed = |u: f64, v: f64| {
            v > 0.04 || ((u * 60.0) as u32 * 7919 + (v * 60.0) as u32 * 104_729) % 5 < 3
        };
        assert!(found(frayed, 0.0).is_empty());
        // An L: a concave corner, the hems at a right angle.
        assert!(found(|u, v| u < 0.5 || v < 0.5, 0.0).is_empty());
        // A round piece.
        assert!(found(|u, v| (u - 0.5).hypot(v - 0.5) < 0.45, 0.0).is_empty());
    }
}
