//! Pushing apart what crosses after strain limiting: the patch with itself and with the cloth around it.
//!
//! Where two pieces of cloth cross they meet along a curve; moving them apart so that the curve shortens untangles them without knowing
//! which side is which (Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour minimization").
//! Costs one sweep over the boxes when nothing crosses.

use super::Patch;
use super::crossings::crossings;
use super::triangulate::Triangulation;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec3};

/// The cloth around a patch, and how the patch's triangles continue it.
#[derive(Debug, Clone)]
pub(super) struct Surroundings {
    /// The region's vertices; the patch's inner ones are appended to them.
    positions: Vec<Vec3>,
    /// The region's faces, then the patch's.
    faces: Vec<[u32; 3]>,
    first_face: usize,
    /// Edges of the patch with a free end and their lengths in the chart.
    edges: Vec<(u32, u32, f64)>,
    /// Mean of these lengths.
    edge: f64,
}

/// Most rounds of pushing.
const ROUNDS: usize = 100;
/// Push of one round, in mean edges.
const PUSH: f64 = 0.35;
/// Sweeps of length correction after each push.
const SWEEPS: usize = 4;
/// Lengths within 1 ± this are left alone while pushing.
const GIVE: f64 = 0.03;

impl Surroundings {
    /// The cloth of a region around the patch that closes its hole.
    pub fn new(rim: &[u32], tiled: &Triangulation, region: &Region) -> Surroundings {
        let base = region.mesh.positions.len() as u32;
        let corners = rim.len() as u32;
        let place = |v: u32| rim.get(v as usize).copied().unwrap_or(base + v - corners);
        let mut faces = region.mesh.faces.clone();
        faces.extend(tiled.faces.iter().map(|f| f.map(place)));
        let mut edges: Vec<(u32, u32)> = (tiled.faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .filter(|(_, b)| *b >= corners)
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let length =
            |(a, b): (u32, u32)| (tiled.points[a as usize] - tiled.points[b as usize]).norm();
        let edges: Vec<(u32, u32, f64)> = (edges.into_iter())
            .map(|e| (place(e.0), place(e.1), length(e)))
            .collect();
        Surroundings {
            positions: region.mesh.positions.clone(),
            first_face: region.mesh.faces.len(),
            faces,
            edge: edges.iter().map(|e| e.2).sum::<f64>() / edges.len().max(1) as f64,
            edges,
        }
    }

    /// The same where the region's vertices lie elsewhere.
    pub fn around(mut self, region: &[Vec3]) -> Surroundings {
        self.positions[..region.len()].copy_from_slice(region);
        self
    }

    /// The same with other cloth that the patch must not cut: layers that lie over or under it, beyond the region.
    pub fn among(mut self, others: &TriMesh) -> Surroundings {
        let (base, more) = (self.positions.len() as u32, others.positions.len() as u32);
        // The patch's inner vertices come after all that is held.
        let moved = |v: u32| if v < base { v } else { v + more };
        for face in &mut self.faces[self.first_face..] {
            *face = face.map(moved);
        }
        for (a, b, _) in &mut self.edges {
            (*a, *b) = (moved(*a), moved(*b));
        }
        self.positions.extend_from_slice(&others.positions);
        let held = others.faces.iter().map(|f| f.map(|v| base + v));
        self.faces.splice(self.first_face..self.first_face, held);
        self.first_face += others.faces.len();
        self
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.faces[..])
            + size_of_val(&self.edges[..])
    }

    /// Moves inner vertices of the patch until nothing crosses, or as little as can be had; the patch counts what that took away and left.
    pub fn separate(&self, patch: &mut Patch) {
        let (rim, base) = (patch.rim.len(), self.positions.len());
        let mut positions = self.positions.clone();
        positions.extend_from_slice(&patch.positions[rim..]);
        let mut mesh = TriMesh {
            positions,
            faces: self.faces.clone(),
        };
        let mut pairs = crossings(&mesh, self.first_face);
        let found = pairs.len();
        let mut least = found;
        for _ in 0..ROUNDS {
            if pairs.is_empty() {
                break;
            }
            self.push(&mut mesh, &pairs);
            for _ in 0..SWEEPS {
                self.restore_lengths(&mut mesh.positions);
            }
            pairs = crossings(&mesh, self.first_face);
            if pairs.len() < least {
                least = pairs.len();
                patch.positions[rim..].copy_from_slice(&mesh.positions[base..]);
            }
        }
        patch.collisions += found - least;
        patch.crossings = least;
    }

    /// One step along the gradients of the crossing curves.
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
                    if let Some(crossing) = Crossing::of(
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
        // A lone vertex pushed is a spike: half of each move is shared with the neighbours.
        let mut shared = moves.clone();

        for (a, b, _) in &self.edges {
            if let (Some(a), Some(b)) = (
                (*a as usize).checked_sub(base),
                (*b as usize).checked_sub(base),
            ) {
                shared[a] += moves[b] * 0.5;
                shared[b] += moves[a] * 0.5;
            }
        }
        for (k, d) in shared.into_iter().enumerate() {
            mesh.positions[base + k] += d.cap_magnitude(1.0) * (PUSH * self.edge);
        }
    }

    /// Brings edges that the pushing stretched or squeezed back, in order.
    fn restore_lengths(&self, positions: &mut [Vec3]) {
        let base = self.positions.len();
        for (a, b, length) in &self.edges {
            let (a, b) = (*a as usize, *b as usize);
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

/// An edge of one face that passes through another.
struct Crossing {
    /// Where on the edge, from 0 at its start to 1 at its end.
    along: f64,
    /// Where in the other face.
    weights: [f64; 3],
    /// The way the edge should move against the face so that the curve of crossing shortens; about unit length.
    push: Vec3,
}

impl Crossing {
    /// The crossing of the edge from corner 0 to corner 1 of a face with another face.
    fn of(face: [Vec3; 3], other: [Vec3; 3]) -> Option<Crossing> {
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
        // The curve runs in both planes, from the edge into its face.
        let own = (face[1] - face[0]).cross(&(face[2] - face[0]));
        let line = own.cross(&normal).try_normalize(0.0)?;
        let inward = own.cross(&(face[1] - face[0]));
        let curve = if line.dot(&inward) > 0.0 { line } else { -line };
        let edge = (face[1] - face[0]).try_normalize(0.0)?;
        // d(length) = −d · (R − (E·R ÷ E·N) N); a grazing edge would be sent far.
        let slope = edge.dot(&normal);
        let slope = slope.signum() * slope.abs().max(0.2);
        let push = curve - normal * (edge.dot(&curve) / slope);
        Some(Crossing {
            along,
            weights,
            push: push.cap_magnitude(1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Vec2;

    /// A lattice of n × n vertices, unit spacing, lifted by `z` of its place; faces from vertex `first` on.
    fn lattice(n: u32, first: u32, z: impl Fn(Vec2) -> f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let middle = Vec2::repeat(f64::from(n - 1) / 2.0);
        let at = |k: u32| Vec2::new(f64::from(k % n), f64::from(k / n)) - middle;
        let points = (0..n * n)
            .map(at)
            .map(|p| Vec3::new(p.x, p.y, z(p)))
            .collect();
        let faces = (0..n - 1)
            .flat_map(|j| (0..n - 1).map(move |i| first + j * n + i))
            .flat_map(|a| [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]])
            .collect();
        (points, faces)
    }

    #[test]
    fn a_dent_through_another_layer_comes_back_out() {
        let (positions, mut faces) = lattice(14, 0, |p| 0.01 * p.x);
        let (first_face, base) = (faces.len(), positions.len() as u32);
        let (tile, tile_faces) = lattice(9, base, |p| 0.5 - 0.9 * (-0.5 * p.norm_squared()).exp());
        faces.extend(&tile_faces);
        let edges: Vec<(u32, u32, f64)> = (tile_faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2])])
            .map(|(a, b)| {
                let at = |v: u32| tile[(v - base) as usize];
                (a, b, (at(a) - at(b)).norm())
            })
            .collect();
        let around = Surroundings {
            positions,
            faces,
            first_face,
            edges,
            edge: 1.0,
        };
        let mut patch = Patch {
            rim: Vec::new(),
            flat: Vec::new(),
            positions: tile.clone(),
            faces: tile_faces,
            strain_rounds: 0,
            collisions: 0,
            crossings: 0,
        };
        let joined = |tile: &[Vec3]| TriMesh {
            positions: around.positions.iter().chain(tile).copied().collect(),
            faces: around.faces.clone(),
        };
        let before = crossings(&joined(&tile), first_face).len();
        assert!(before > 0);
        around.separate(&mut patch);
        assert_eq!((patch.collisions, patch.crossings), (before, 0));
        assert_eq!(crossings(&joined(&patch.positions), first_face), []);
        let again = patch.positions.clone();
        around.separate(&mut patch);
        assert_eq!(patch.collisions, before, "counted once");
        assert_eq!(patch.positions, again, "what does not cross is left alone");

        // Where all of the cloth below is another layer, the same comes of it.
        let layer = TriMesh {
            positions: around.positions.clone(),
            faces: around.faces[..first_face].to_vec(),
        };
        let own = |v: u32| v - base;
        let alone = Surroundings {
            positions: Vec::new(),
            faces: around.faces[first_face..]
                .iter()
                .map(|f| f.map(own))
                .collect(),
            first_face: 0,
            edges: around
                .edges
                .iter()
                .map(|(a, b, l)| (own(*a), own(*b), *l))
                .collect(),
            edge: 1.0,
        };
        (patch.positions, patch.collisions) = (tile, 0);
        alone.clone().separate(&mut patch);
        assert_eq!(patch.collisions, 0, "it does not cut itself");
        alone.among(&layer).separate(&mut patch);
        assert_eq!((patch.collisions, patch.crossings), (before, 0));
        assert_eq!(patch.positions, again);
    }
}
