//! Collisions after strain limiting: a patch that cuts itself or the scan around it is pushed apart.
//!
//! Two surfaces that cut each other meet along a curve. Moves that shorten the curve separate them, and need not know
//! which side is which (Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour
//! minimization"). Costs one sweep over the boxes when nothing cuts.

use darn_budget::{Budget, Exhausted};

use super::Patch;
use super::intersections::{intersections_after, intersections_from};
use super::sides::Sides;
use crate::mesh::layers::Layers;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec3};

/// The scan around a patch with the patch's faces: what is tested for collisions.
#[derive(Debug, Clone)]
pub(super) struct CollisionMesh {
    /// Held vertices: the region's, then those of other layers. The patch's inner ones come after them.
    positions: Vec<Vec3>,
    /// Held faces: the region's, then those of other layers; then the patch's.
    faces: Vec<[u32; 3]>,
    /// The patch's first face.
    first_face: usize,
    /// Edges of the patch with a free end.
    edges: Vec<RestEdge>,
    /// Mean of their lengths, scene units.
    mean_edge: f64,
    /// Other components of whose sides the patch keeps to one.
    sides: Sides,
}

/// Which patches are pushed apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Untangling {
    /// All.
    Always,
    /// Those that may come apart as a whole. A tangle stays as it is: for a patch that is of use only when it cuts next to nothing.
    UnlessTangled,
}

/// An edge with the length that it should have, scene units.
#[derive(Debug, Clone)]
struct RestEdge {
    from: u32,
    to: u32,
    length: f64,
}

/// Most rounds of pushes.
const ROUNDS: usize = 100;
/// Most pairs that all rounds together push apart, for each face of the patch. Patches that came apart needed 0.05, tangles that lost some
/// of their pairs 12.
const PAIRS_PER_FACE: usize = 20;
/// Pairs at the start, for each face of the patch, beyond which it is a tangle. Of 48 fair surfaces of lumpy holes, those with 3 a face and
/// more kept at least 0.8 a face, those with 1 to 3 at least 0.13.
const TANGLE: usize = 3;
/// Nanoseconds of work a pair in a round.
const PUSH_WORK: u64 = 500;
/// Nanoseconds of work an edge in a round.
const EDGE_WORK: u64 = 80;
/// Longest push of one round, in mean edges.
const PUSH: f64 = 0.35;
/// Sweeps of length correction after each round of pushes.
const SWEEPS: usize = 4;
/// Most rounds that bring a patch to its side of other components.
const SIDE_ROUNDS: usize = 30;
/// Moves of at most this end them, in mean edges.
const SLIGHT: f64 = 0.01;
/// Lengths within 1 ± this of their rest lengths are not corrected.
const GIVE: f64 = 0.03;

impl CollisionMesh {
    /// The region with the patch that closes its hole; `rim` holds the region vertices of the patch's first vertices,
    /// `length` gives the length that an edge of the patch should have, scene units.
    pub fn new(
        rim: &[u32],
        patch_faces: &[[u32; 3]],
        length: impl Fn(u32, u32) -> f64,
        region: &Region,
    ) -> CollisionMesh {
        let base = region.mesh.positions.len() as u32;
        let corners = rim.len() as u32;
        let vertex = |v: u32| rim.get(v as usize).copied().unwrap_or(base + v - corners);
        let mut faces = region.mesh.faces.clone();
        faces.extend(patch_faces.iter().map(|f| f.map(vertex)));
        let mut edges: Vec<(u32, u32)> = (patch_faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .filter(|(_, b)| *b >= corners)
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let edges: Vec<RestEdge> = (edges.into_iter())
            .map(|(a, b)| RestEdge {
                from: vertex(a),
                to: vertex(b),
                length: length(a, b),
            })
            .collect();
        CollisionMesh {
            positions: region.mesh.positions.clone(),
            first_face: region.mesh.faces.len(),
            faces,
            mean_edge: edges.iter().map(|e| e.length).sum::<f64>() / edges.len().max(1) as f64,
            edges,
            sides: Sides::default(),
        }
    }

    /// The same with the region's vertices at other positions.
    pub fn with_region_at(mut self, region: &[Vec3]) -> CollisionMesh {
        self.positions[..region.len()].copy_from_slice(region);
        self
    }

    /// The same with what lies near the hole beside its region, which the patch must not cut. Where the region lies on one
    /// side of another component, such as a body, so will the patch, unless it is farther than `reach` (scene units) from it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn beside(
        mut self,
        layers: &Layers,
        reach: f64,
        budget: &Budget,
    ) -> Result<CollisionMesh, Exhausted> {
        self.sides = Sides::shown_by(&self.positions, layers, self.mean_edge, reach, budget)?;
        Ok(self.with_layers(&layers.mesh))
    }

    /// The same with more that the patch must not cut.
    pub fn with_layers(mut self, layers: &TriMesh) -> CollisionMesh {
        let (base, more) = (self.positions.len() as u32, layers.positions.len() as u32);
        // The patch's inner vertices come after all held ones.
        let moved = |v: u32| if v < base { v } else { v + more };
        for face in &mut self.faces[self.first_face..] {
            *face = face.map(moved);
        }
        for edge in &mut self.edges {
            (edge.from, edge.to) = (moved(edge.from), moved(edge.to));
        }
        self.positions.extend_from_slice(&layers.positions);
        let held = layers.faces.iter().map(|f| f.map(|v| base + v));
        self.faces.splice(self.first_face..self.first_face, held);
        self.first_face += layers.faces.len();
        self
    }

    /// Bytes of memory held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.faces[..])
            + size_of_val(&self.edges[..])
            + self.sides.bytes()
    }

    /// Moves inner vertices of the patch to their side of other components, then until nothing cuts, or keeps the round
    /// with the fewest cuts. Adds the pairs that came apart to `patch.collisions` and leaves the rest in
    /// `patch.crossings`.
    ///
    /// The rounds also end when they have looked at too many pairs for the size of the patch: a tangle in which every
    /// face cuts every other does not come apart. They end, too, when the positions of an earlier round come back, as all
    /// that follows was there.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn separate(
        &self,
        patch: &mut Patch,
        untangling: Untangling,
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        let (rim, base) = (patch.rim.len(), self.positions.len());
        let mut positions = self.positions.clone();
        positions.extend_from_slice(&patch.positions[rim..]);
        let mut mesh = TriMesh {
            positions,
            faces: self.faces.clone(),
        };
        let mut pairs = intersections_from(&mesh, self.first_face, budget)?;
        let found = pairs.len();
        if self.keep_sides(&mut mesh.positions, SIDE_ROUNDS, budget)? {
            patch.positions[rim..].copy_from_slice(&mesh.positions[base..]);
            pairs = intersections_from(&mesh, self.first_face, budget)?;
        }
        let mut least = pairs.len();
        let mut looked_at = 0;
        let tangled = least > TANGLE * patch.faces.len();
        let rounds = match untangling {
            Untangling::UnlessTangled if tangled => 0,
            _ => ROUNDS,
        };
        let mut earlier = Vec::new();
        for round in 0..rounds {
            looked_at += pairs.len();
            if pairs.is_empty() || looked_at > PAIRS_PER_FACE * patch.faces.len() {
                break;
            }
            let inner = &mesh.positions[base..];
            let same = |(a, b)| same_bits(a, b);
            if inner.len() == earlier.len() && inner.iter().zip(&earlier).all(same) {
                break;
            }
            // Kept from each power of two to the next, they show a cycle of any length (Brent 1980).
            if round.is_power_of_two() {
                earlier = inner.to_vec();
            }
            budget.spend(PUSH_WORK * pairs.len() as u64 + EDGE_WORK * self.edges.len() as u64)?;
            let before = mesh.positions[base..].to_vec();
            self.push(&mut mesh, &pairs);
            for _ in 0..SWEEPS {
                self.restore_lengths(&mut mesh.positions);
            }
            self.keep_sides(&mut mesh.positions, 1, budget)?;
            pairs = self.pairs_after(&mesh, &before, &pairs, budget)?;
            if pairs.len() < least {
                least = pairs.len();
                patch.positions[rim..].copy_from_slice(&mesh.positions[base..]);
            }
        }
        patch.collisions += found.saturating_sub(least);
        patch.crossings = least;
        Ok(())
    }

    /// The pairs that cut, where the inner vertices were at `positions` and `pairs` cut before. Most rounds move a few vertices.
    ///
    /// # Errors
    /// `Exhausted`.
    fn pairs_after(
        &self,
        mesh: &TriMesh,
        positions: &[Vec3],
        pairs: &[(u32, u32)],
        budget: &Budget,
    ) -> Result<Vec<(u32, u32)>, Exhausted> {
        let base = self.positions.len();
        let each = mesh.positions[base..].iter().zip(positions);
        let moved: Vec<bool> = each.map(|(now, then)| !same_bits(now, then)).collect();
        let inner = |v: u32| (v as usize).checked_sub(base);
        let has_moved = |v: u32| inner(v).is_some_and(|k| moved[k]);
        let faces = self.faces.iter();
        let has_moved: Vec<bool> = faces
            .map(|face| face.iter().any(|v| has_moved(*v)))
            .collect();
        intersections_after(mesh, &has_moved, pairs, budget)
    }

    /// Moves inner vertices to their side of other components, in so many rounds at most. Whether any moved.
    ///
    /// # Errors
    /// `Exhausted`.
    fn keep_sides(
        &self,
        positions: &mut [Vec3],
        rounds: usize,
        budget: &Budget,
    ) -> Result<bool, Exhausted> {
        let base = self.positions.len();
        if self.sides.is_empty() {
            return Ok(false);
        }
        for round in 0..rounds {
            let inner = &mut positions[base..];
            budget.spend(Sides::work(inner.len()) + EDGE_WORK * self.edges.len() as u64)?;
            let mut farthest = 0.0f64;
            for p in inner {
                if let Some(push) = self.sides.push(p) {
                    *p += push;
                    farthest = farthest.max(push.norm());
                }
            }
            if farthest <= SLIGHT * self.mean_edge {
                return Ok(round > 0 || farthest > 0.0);
            }
            // The last round ends on the right side.
            if round + 1 < rounds {
                (0..SWEEPS).for_each(|_| self.restore_lengths(positions));
            }
        }
        Ok(true)
    }

    /// One step along the gradients of the intersection curves' lengths.
    fn push(&self, mesh: &mut TriMesh, pairs: &[(u32, u32)]) {
        let base = self.positions.len();
        let mut moves = vec![Vec3::zeros(); mesh.positions.len() - base];
        let mut add = |v: u32, d: Vec3| {
            if let Some(m) = (v as usize)
                .checked_sub(base)
                .and_then(|k| moves.get_mut(k))
            {
                *m += d;
            }
        };
        for (f, g) in pairs {
            for (own, other) in [(*f, *g), (*g, *f)] {
                let (a, b) = (self.faces[own as usize], self.faces[other as usize]);
                for k in 0..3 {
                    let edge = [a[k], a[(k + 1) % 3], a[(k + 2) % 3]];
                    if let Some(crossing) = EdgeCrossing::new(
                        edge.map(|v| mesh.positions[v as usize]),
                        mesh.triangle(other as usize),
                    ) {
                        add(edge[0], crossing.push * (1.0 - crossing.along));
                        add(edge[1], crossing.push * crossing.along);
                        (0..3).for_each(|k| add(b[k], -crossing.push * crossing.weights[k]));
                    }
                }
            }
        }
        // Neighbours take part in half of each move: a vertex that moves alone is a spike.
        let mut shared = moves.clone();
        for edge in &self.edges {
            if let (Some(a), Some(b)) = (
                (edge.from as usize).checked_sub(base),
                (edge.to as usize).checked_sub(base),
            ) {
                shared[a] += moves[b] * 0.5;
                shared[b] += moves[a] * 0.5;
            }
        }
        for (k, d) in shared.into_iter().enumerate() {
            mesh.positions[base + k] += d.cap_magnitude(1.0) * (PUSH * self.mean_edge);
        }
    }

    /// Corrects the lengths of edges that the pushes stretched or compressed, one edge after the other.
    fn restore_lengths(&self, positions: &mut [Vec3]) {
        let base = self.positions.len();
        for RestEdge { from, to, length } in &self.edges {
            let (a, b) = (*from as usize, *to as usize);
            let d = positions[b] - positions[a];
            let now = d.norm();
            let wanted = now.clamp(length * (1.0 - GIVE), length * (1.0 + GIVE));
            if wanted != now && now > 0.0 {
                let (wa, wb) = (
                    f64::from(u8::from(a >= base)),
                    f64::from(u8::from(b >= base)),
                );
                let shift = d * (0.5 * (now - wanted) / (now * (wa + wb)));
                positions[a] += shift * wa;
                positions[b] -= shift * wb;
            }
        }
    }
}

/// Whether two positions have the same bits.
fn same_bits(a: &Vec3, b: &Vec3) -> bool {
    (0..3).all(|d| a[d].to_bits() == b[d].to_bits())
}

/// The point where an edge of one face passes through another face.
struct EdgeCrossing {
    /// Its place on the edge, from 0 at the start to 1 at the end.
    along: f64,
    /// Its barycentric weights in the other face.
    weights: [f64; 3],
    /// The direction in which the edge should move, relative to the face, to shorten the intersection curve; length at
    /// most 1.
    push: Vec3,
}

impl EdgeCrossing {
    /// Where the edge from corner 0 to corner 1 of a face passes through another face.
    fn new(face: [Vec3; 3], other: [Vec3; 3]) -> Option<EdgeCrossing> {
        let (u, v) = (other[1] - other[0], other[2] - other[0]);
        let normal = u.cross(&v).try_normalize(0.0)?;
        let side = |p: &Vec3| normal.dot(&(p - other[0]));
        let (from, to) = (side(&face[0]), side(&face[1]));
        if from * to >= 0.0 {
            return None;
        }
        let along = from / (from - to);
        let x = face[0] + (face[1] - face[0]) * along;
        let doubled = u.cross(&v).dot(&normal);
        let weight = |k: usize| {
            let (b, c) = (other[(k + 1) % 3] - x, other[(k + 2) % 3] - x);
            b.cross(&c).dot(&normal) / doubled
        };
        let weights = [weight(0), weight(1), weight(2)];
        if weights.iter().any(|w| *w < 0.0) {
            return None;
        }
        // The direction of the curve: in both planes, from the edge into its face.
        let own = (face[1] - face[0]).cross(&(face[2] - face[0]));
        let line = own.cross(&normal).try_normalize(0.0)?;
        let inward = own.cross(&(face[1] - face[0]));
        let curve = if line.dot(&inward) > 0.0 { line } else { -line };
        let edge = (face[1] - face[0]).try_normalize(0.0)?;
        // d(length) = −d · (R − (E·R ÷ E·N) N); the least slope bounds the push of a grazing edge.
        let slope = edge.dot(&normal);
        let slope = slope.signum() * slope.abs().max(0.2);
        let push = curve - normal * (edge.dot(&curve) / slope);
        Some(EdgeCrossing {
            along,
            weights,
            push: push.cap_magnitude(1.0),
        })
    }
}

#[cfg(test)]
#[path = "collisions_tests.rs"]
mod tests;
