//! Bites and rips at the cloth's own edge: short stretches of a boundary loop that lead into the cloth, between hems
//! that continue each other.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use darn_budget::{Budget, Exhausted, Steps};

use darn_geometry::mesh::curvature::inner_angle;
use darn_geometry::mesh::loops::BoundaryLoop;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2};

/// Points that a loop is looked at in, at most: a bite is wider than two of their distances.
const SAMPLES: usize = 512;
/// Fewest vertices of a loop that is looked at.
const LEAST_VERTICES: usize = 16;
/// Longest stretch of a bite, as a share of its loop.
const LONGEST: f64 = 0.55;
/// Least ratio of a bite's stretch to its mouth.
const LEAST_DETOUR: f64 = 1.2;
/// Least depth of a bite, in mean edges of its loop.
const LEAST_DEPTH: f64 = 3.0;
/// How far the hem is looked at on each side of a bite, in lengths of its mouth, and the largest angle between it and the mouth, radians: less hem
/// has to be straighter.
const HEMS: [(f64, f64); 2] = [(1.0, 0.45), (0.3, 0.2)];
/// The least that it is looked at, as a share of the loop.
const LEAST_HEM: f64 = 0.03;
/// Largest ratio of length to chord of the hem on each side.
const LARGEST_WAVE: f64 = 1.1;
/// Nanoseconds of work a pair of points.
const PAIR_WORK: u64 = 150;
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
    /// How far it leads into the cloth laid flat, scene units.
    pub depth: f64,
}

/// The bites of a boundary loop, in its order; they do not overlap. The loop is looked at as it lies when the cloth along
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
    // The tightest first: others that overlap it have some of the hem, too.
    let detour = |bite: &Bite| bite.length / bite.mouth.max(f64::MIN_POSITIVE);
    found.sort_by(|a, b| detour(b).total_cmp(&detour(a)).then(a.from.cmp(&b.from)));
    let mut apart: Vec<Bite> = Vec::new();
    for bite in found {
        steps.take(PAIR_WORK * (1 + apart.len() as u64))?;
        if apart.iter().all(|other| !line.overlap(&bite, other)) {
            apart.push(bite);
        }
    }
    apart.sort_by_key(|bite| bite.from);
    Ok(apart)
}

/// A loop laid flat, twice around, so that a stretch may run over its first vertex.
struct FlatLine {
    /// The loop's length.
    length: f64,
    /// Its mean edge.
    edge: f64,
    /// How many vertices it has.
    vertices: usize,
    /// Per vertex, twice around and once more: its place, and the length up to it.
    places: Vec<(Vec2, f64)>,
    /// Vertices at about equal distances, once around.
    samples: Vec<usize>,
}

impl FlatLine {
    fn of(mesh: &TriMesh, topology: &Topology, rim: &BoundaryLoop) -> FlatLine {
        let n = rim.vertices.len();
        let at = |k: usize| mesh.positions[rim.vertices[k % n].index()];
        let turns: Vec<f64> = (rim.vertices.iter())
            .map(|v| PI - inner_angle(mesh, topology, *v))
            .collect();
        let (mut place, mut passed, mut heading) = (Vec2::zeros(), 0.0, 0.0_f64);
        let mut places = Vec::with_capacity(2 * n + 1);
        for k in 0..=2 * n {
            places.push((place, passed));
            heading = (heading + turns[k % n]) % TAU;
            let edge = (at(k + 1) - at(k)).norm();
            place += Vec2::new(heading.cos(), heading.sin()) * edge;
            passed += edge;
        }
        let length = places[n].1;
        let count = n.min(SAMPLES);
        let mut samples: Vec<usize> = (0..count)
            .map(|s| {
                let wanted = length * s as f64 / count as f64;
                places
                    .partition_point(|(_, passed)| *passed < wanted)
                    .min(n - 1)
            })
            .collect();
        samples.dedup();
        FlatLine {
            length,
            edge: length / n as f64,
            vertices: n,
            places,
            samples,
        }
    }

    /// The vertex of a sample, twice around.
    fn sample(&self, s: usize) -> usize {
        let count = self.samples.len();
        self.samples[s % count] + (s / count) * self.vertices
    }

    /// The length from one sample to another.
    fn length_of(&self, stretch: &Range<usize>) -> f64 {
        self.places[self.sample(stretch.end)].1 - self.places[self.sample(stretch.start)].1
    }

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
        let is_between_hems = HEMS.iter().any(|(share, turn)| {
            let reach = (share * mouth).max(LEAST_HEM * self.length);
            let straight = |hem: Option<Vec2>| hem.is_some_and(|hem| along.dot(&hem) > turn.cos());
            straight(self.hem(from, -reach)) && straight(self.hem(to, reach))
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
        })
    }

    /// The direction of the hem over this length after a vertex, before it where the length is negative; `None` where
    /// the hem is not smooth.
    fn hem(&self, vertex: usize, reach: f64) -> Option<Vec2> {
        // In the first round there is no hem before the first vertex, in the second none after the last.
        let vertex = match reach < 0.0 && vertex < self.vertices {
            true => vertex + self.vertices,
            false => vertex % self.vertices,
        };
        let (place, passed) = self.places[vertex];
        let end = self.places.partition_point(|(_, p)| *p < passed + reach);
        let (other, at) = *self.places.get(end)?;
        let line = (other - place) * reach.signum();
        let (chord, length) = (line.norm(), (at - passed).abs());
        (chord > 0.0 && length < LARGEST_WAVE * chord).then(|| line / chord)
    }

    /// Whether two bites have a stretch of the loop in common.
    fn overlap(&self, a: &Bite, b: &Bite) -> bool {
        let within = |bite: &Bite, vertex: usize| {
            let ahead = |to: usize| (to + self.vertices - bite.from) % self.vertices;
            ahead(vertex) <= ahead(bite.to)
        };
        within(a, b.from) || within(a, b.to) || within(b, a.from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::Vec3;
    use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
    use darn_geometry::mesh::shapes::sheet;
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
                    let at_edge = |p: &Vec3| p.x.min(p.y).min(1.0 - p.x) < 0.05;
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
            found(saw(0.6), 0.0),
            found(saw(0.8), 0.02),
        ] {
            let [(bite, from, to)] = &bites[..] else {
                panic!("{bites:?}");
            };
            assert!(
                bite.depth > 0.15 && from.y < 0.05 && to.y < 0.05,
                "{bites:?}"
            );
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
