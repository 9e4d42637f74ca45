//! XPBD cloth (Macklin et al. 2016, 2019) on a triangle mesh whose rest shape is given by the lengths of its edges.
//!
//! An edge resists being lengthened by a hard constraint (by a spring for knitted cloth) and being shortened by a softer spring: a mesh
//! whose edges are all hard cannot bend, since it has as many edges as its vertices have coordinates. Bending is the thin-plate energy of
//! two faces that share an edge (Bergou et al. 2006), flat at rest, across seams too. Units are metres and seconds, gravity is along −z. One
//! thread, a fixed order and no transcendental functions in the loop: the same input gives the same bits.

use super::body::PosedCapsule;
use super::contacts::MeshContacts;
use crate::scarffolds::lattice::Vec3f;
use std::collections::BTreeMap;

/// Acceleration of gravity, m/s².
const GRAVITY: f32 = 9.81;
/// No vertex moves further than this in a step, in thicknesses, so that layers cannot jump through each other.
const MAX_STEP: f32 = 0.25;

/// The material of a garment; stiffnesses are per areal mass.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GarmentFabric {
    /// Bending stiffness, m⁴/s².
    pub bend: f32,
    /// Stiffness of an edge against being shortened, 1/s².
    pub compress: f32,
    /// Stiffness of an edge against being lengthened, 1/s²; `None` for woven cloth, which does not lengthen.
    pub knit: Option<f32>,
    /// Coulomb friction of cloth on cloth and on the body.
    pub friction: f32,
}

/// Two neighbouring vertices and their distance at rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct RestEdge {
    pub(super) ends: [u32; 2],
    pub(super) rest: f32,
}

/// Four vertices of two faces that share an edge; the sum of the weighted positions is zero where the faces lie in one plane.
#[derive(Debug, Clone, Copy)]
struct Hinge {
    vertices: [u32; 4],
    weights: [f32; 4],
    /// Compliance of a unit of bending stiffness.
    compliance: f32,
}

/// The rest shape of a garment.
#[derive(Debug, Clone)]
pub(super) struct RestShape {
    pub(super) edges: Vec<RestEdge>,
    hinges: Vec<Hinge>,
    /// Area around each vertex ÷ the mean.
    masses: Vec<f32>,
}

/// What a step needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<'a> {
    /// Its length, seconds.
    pub(super) time: f32,
    /// Velocity lost per second, 1/s.
    pub(super) damping: f32,
    /// Share of gravity that acts.
    pub(super) weight: f32,
    pub(super) body: &'a [PosedCapsule],
}

/// A garment in motion.
#[derive(Debug, Clone)]
pub(super) struct Cloth {
    pub(super) now: Vec<Vec3f>,
    before: Vec<Vec3f>,
    velocity: Vec<Vec3f>,
    inverse_masses: Vec<f32>,
    rest: RestShape,
    fabric: GarmentFabric,
    contacts: MeshContacts,
    thickness: f32,
    steps: usize,
}

impl RestShape {
    /// The rest shape of faces whose edges have these lengths: `lengths[f][k]` is that of the edge from corner `k` to `k + 1`. An edge with
    /// two lengths (a seam of two curves) gets their mean. Edges are in the order of `height`, of the mean of their ends, from the top.
    pub(super) fn new(faces: &[[u32; 3]], lengths: &[[f64; 3]], height: &[f64]) -> Self {
        let mut found: BTreeMap<[u32; 2], Vec<(usize, usize)>> = BTreeMap::new();
        for (f, face) in faces.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                found.entry([a.min(b), a.max(b)]).or_default().push((f, k));
            }
        }
        let mean = |sides: &[(usize, usize)]| {
            sides.iter().map(|(f, k)| lengths[*f][*k]).sum::<f64>() / sides.len() as f64
        };
        let rest: BTreeMap<[u32; 2], f64> =
            found.iter().map(|(ends, s)| (*ends, mean(s))).collect();
        let length = |a: u32, b: u32| rest[&[a.min(b), a.max(b)]];
        let mut areas = vec![0.0; height.len()];
        for face in faces {
            let [a, b, c] = *face;
            let third = area([length(a, b), length(b, c), length(c, a)]) / 3.0;
            face.iter().for_each(|v| areas[*v as usize] += third);
        }
        let usual = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        let mut edges: Vec<RestEdge> = (rest.iter())
            .map(|(ends, rest)| RestEdge {
                ends: *ends,
                rest: *rest as f32,
            })
            .collect();
        let of = |e: &RestEdge| height[e.ends[0] as usize] + height[e.ends[1] as usize];
        edges.sort_by(|a, b| of(b).total_cmp(&of(a)).then(a.ends.cmp(&b.ends)));
        let hinge = |(ends, sides): (&[u32; 2], &Vec<(usize, usize)>)| {
            let [(f, k), (g, l)] = <[(usize, usize); 2]>::try_from(sides.as_slice()).ok()?;
            let (c, d) = (faces[f][(k + 2) % 3], faces[g][(l + 2) % 3]);
            Some(Hinge::new([ends[0], ends[1], c, d], &length, usual))
        };
        Self {
            hinges: found.iter().filter_map(hinge).collect(),
            masses: areas.iter().map(|a| (a / usual) as f32).collect(),
            edges,
        }
    }
}

impl Hinge {
    /// The hinge about the edge from the first to the second vertex. `usual` is the area that belongs to a vertex of mass 1.
    fn new(vertices: [u32; 4], length: &dyn Fn(u32, u32) -> f64, usual: f64) -> Self {
        let [a, b, c, d] = vertices;
        let base = length(a, b);
        // A third corner above the edge: its distance from the edge's start along the edge, and from the edge.
        let foot = |p: u32| {
            let (to_a, to_b) = (length(a, p), length(b, p));
            let along = (to_a * to_a - to_b * to_b + base * base) / (2.0 * base);
            let off = (to_a * to_a - along * along)
                .max(0.0)
                .sqrt()
                .max(1e-3 * base);
            (along / base, off)
        };
        let ((s, h), (t, k)) = (foot(c), foot(d));
        // Slopes away from the edge on both sides; their sum, over the edge's length, is the bend.
        let weights = [
            -(1.0 - s) / h - (1.0 - t) / k,
            -s / h - t / k,
            1.0 / h,
            1.0 / k,
        ];
        let area = 0.5 * base * (h + k);
        // Energy ½ · 3 B (base ÷ area) · base · |Σ|² (Bergou et al. 2006), per areal mass.
        let stiffness = 3.0 * base * base / area;
        Self {
            vertices,
            weights: weights.map(|w| w as f32),
            compliance: (usual / stiffness) as f32,
        }
    }
}

/// Area of a triangle by its sides.
pub(super) fn area([a, b, c]: [f64; 3]) -> f64 {
    let half = 0.5 * (a + b + c);
    (half * (half - a) * (half - b) * (half - c))
        .max(0.0)
        .sqrt()
}

impl Cloth {
    /// A garment at rest at `positions`. The vertices in `held` have no freedom; [`Cloth::hold`] moves them.
    pub(super) fn new(
        positions: Vec<Vec3f>,
        rest: RestShape,
        held: &[u32],
        fabric: GarmentFabric,
        thickness: f32,
    ) -> Self {
        let mut inverse_masses: Vec<f32> = rest.masses.iter().map(|m| 1.0 / m.max(0.1)).collect();
        held.iter().for_each(|v| inverse_masses[*v as usize] = 0.0);
        let edges: Vec<[u32; 2]> = rest.edges.iter().map(|e| e.ends).collect();
        Self {
            before: positions.clone(),
            velocity: vec![Vec3f::zeros(); positions.len()],
            contacts: MeshContacts::new(positions.len(), &edges, thickness),
            now: positions,
            inverse_masses,
            rest,
            fabric,
            thickness,
            steps: 0,
        }
    }

    /// Moves a held vertex.
    pub(super) fn hold(&mut self, vertex: u32, at: Vec3f) {
        self.now[vertex as usize] = at;
    }

    /// One step.
    pub(super) fn step(&mut self, step: &Step) {
        let dt = step.time;
        self.contacts
            .search_when_due(&self.now, dt * self.fastest());
        self.predict(step);
        let rate2 = 1.0 / (dt * dt);
        self.stretch(rate2);
        self.bend(rate2);
        let friction = self.fabric.friction;
        self.contacts
            .separate(&mut self.now, &self.before, &self.inverse_masses, friction);
        self.steps += 1;
        self.stretch(rate2);
        self.push_out(step.body);
        for ((v, x), x0) in self.velocity.iter_mut().zip(&self.now).zip(&self.before) {
            *v = (x - x0) / dt;
        }
    }

    /// Removes what stretch is left by `rounds` projections of edges and contacts, without gravity and inertia.
    pub(super) fn relax(&mut self, rounds: usize, time: f32, body: &[PosedCapsule]) {
        for round in 0..rounds {
            if round % 4 == 0 {
                self.contacts.search(&self.now);
            }
            self.before.copy_from_slice(&self.now);
            self.stretch(1.0 / (time * time));
            self.steps += 1;
            self.stretch(1.0 / (time * time));
            self.contacts
                .separate(&mut self.now, &self.before, &self.inverse_masses, 0.0);
            self.push_out(body);
        }
        self.velocity.fill(Vec3f::zeros());
    }

    /// Root mean square of (length ÷ rest length − 1).
    pub(super) fn strain(&self) -> f64 {
        let of = |e: &RestEdge| {
            let [a, b] = e.ends.map(|v| self.now[v as usize]);
            f64::from((a - b).norm() / e.rest) - 1.0
        };
        let sum: f64 = self.rest.edges.iter().map(|e| of(e) * of(e)).sum();
        (sum / self.rest.edges.len().max(1) as f64).sqrt()
    }

    /// Greatest speed of a vertex, m/s.
    fn fastest(&self) -> f32 {
        let most = |most: f32, v: &Vec3f| v.norm_squared().max(most);
        self.velocity.iter().fold(0.0, most).sqrt()
    }

    fn predict(&mut self, step: &Step) {
        let keep = 1.0 / (1.0 + step.damping * step.time);
        let most = MAX_STEP * self.thickness;
        let pull = Vec3f::new(0.0, 0.0, -GRAVITY * step.weight * step.time);
        for (v, x) in self.now.iter_mut().enumerate() {
            self.before[v] = *x;
            if self.inverse_masses[v] == 0.0 {
                continue; // `hold` has moved it.
            }
            let move_ = (self.velocity[v] + pull) * (keep * step.time);
            let far = move_.norm().max(1.0e-12);
            *x += move_ * (most / far).min(1.0);
        }
    }

    /// One sweep over the edges, downwards and upwards in turn; along the cloth each edge uses the correction of the edge before it.
    fn stretch(&mut self, rate2: f32) {
        let compress = rate2 / self.fabric.compress;
        let lengthen = self.fabric.knit.map_or(0.0, |knit| rate2 / knit);
        let (now, masses) = (&mut self.now, &self.inverse_masses);
        let mut project = |e: &RestEdge| {
            let [a, b] = e.ends.map(|v| v as usize);
            let sum = masses[a] + masses[b];
            let d = now[b] - now[a];
            let length = d.norm();
            if sum == 0.0 || length < 1.0e-9 {
                return;
            }
            let over = length - e.rest;
            let soft = if over > 0.0 { lengthen } else { compress };
            let push = d * (over / (length * (sum + soft)));
            now[a] += push * masses[a];
            now[b] -= push * masses[b];
        };
        if self.steps.is_multiple_of(2) {
            self.rest.edges.iter().for_each(&mut project);
        } else {
            self.rest.edges.iter().rev().for_each(&mut project);
        }
    }

    fn bend(&mut self, rate2: f32) {
        let softness = rate2 / self.fabric.bend;
        for hinge in &self.rest.hinges {
            let vertices = hinge.vertices.map(|v| v as usize);
            let mut sum = Vec3f::zeros();
            let mut mobility = hinge.compliance * softness;
            for (v, w) in vertices.iter().zip(hinge.weights) {
                sum += self.now[*v] * w;
                mobility += self.inverse_masses[*v] * w * w;
            }
            let push = sum / mobility;
            for (v, w) in vertices.iter().zip(hinge.weights) {
                self.now[*v] -= push * (w * self.inverse_masses[*v]);
            }
        }
    }

    fn push_out(&mut self, body: &[PosedCapsule]) {
        let (margin, friction) = (0.5 * self.thickness, self.fabric.friction);
        for (v, x) in self.now.iter_mut().enumerate() {
            if self.inverse_masses[v] > 0.0 {
                for capsule in body {
                    capsule.push_out(x, &self.before[v], margin, friction);
                }
            }
        }
    }
}
