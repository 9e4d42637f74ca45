//! Even triangles for a patch in space: long edges are split, edges flipped towards Delaunay, inner vertices drawn to
//! the middle of their neighbours. The rim stays.

use std::collections::HashSet;

use darn_budget::{Budget, Exhausted};

use crate::mesh::curvature::vertex_normals;
use crate::mesh::{TriMesh, Vec3};

/// A patch in space while it is made.
#[derive(Debug, Clone)]
pub(super) struct Sheet {
    /// The rim's vertices in order, then the inner ones, scene space.
    pub mesh: TriMesh,
    /// How many vertices the rim has.
    pub corners: usize,
}

/// An edge is split when it is longer than this many edges of the length asked for.
const LONG: f64 = 4.0 / 3.0;
/// Most passes over all edges in one remeshing.
const PASSES: usize = 40;
/// Two faces whose normals differ by more than this (cosine) keep their edge.
const BENT: f64 = 0.3;
/// Nanoseconds of work a face in a pass.
const FACE_WORK: u64 = 400;

/// An inner edge with its two faces: `face` runs from the first end to the second, `other` back.
struct InnerEdge {
    ends: [u32; 2],
    face: u32,
    other: u32,
}

impl Sheet {
    /// Remeshes to edges of about `length`, scene units, with at most about `most` inner vertices.
    ///
    /// An edge between two vertices of the rim is always split: the scan, or another piece of the patch, may join them
    /// by an edge already, which would get three faces.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn remesh(&mut self, length: f64, most: usize, budget: &Budget) -> Result<(), Exhausted> {
        for _ in 0..PASSES {
            budget.spend(2 * FACE_WORK * self.mesh.faces.len() as u64)?;
            let split = self.split(LONG * length, most);
            let flipped = self.flip();
            if split + flipped == 0 {
                break;
            }
        }
        budget.spend(FACE_WORK * self.mesh.faces.len() as u64)?;
        self.relax();
        Ok(())
    }

    /// Area, scene units squared.
    pub fn area(&self) -> f64 {
        crate::mesh::curvature::face_areas(&self.mesh).iter().sum()
    }

    fn inner(&self) -> usize {
        self.mesh.positions.len() - self.corners
    }

    fn is_chord(&self, a: u32, b: u32) -> bool {
        (a.max(b) as usize) < self.corners
    }

    /// All inner edges, ascending by their lower end.
    fn inner_edges(&self) -> Vec<InnerEdge> {
        let mut sides: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * self.mesh.faces.len());
        for (f, face) in (0u32..).zip(&self.mesh.faces) {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                sides.push((a.min(b), a.max(b), f, a < b));
            }
        }
        sides.sort_unstable();
        let inner = |pair: &[(u32, u32, u32, bool)]| match pair {
            [(a, b, f, up), (_, _, g, _)] => Some(InnerEdge {
                ends: if *up { [*a, *b] } else { [*b, *a] },
                face: *f,
                other: *g,
            }),
            _ => None,
        };
        let same = |a: &(u32, u32, u32, bool), b: &(u32, u32, u32, bool)| (a.0, a.1) == (b.0, b.1);
        sides.chunk_by(same).filter_map(inner).collect()
    }

    /// Splits chords and edges longer than `longest` in the middle, the longest first, each face at most once; how many.
    fn split(&mut self, longest: f64, most: usize) -> usize {
        let room = most.saturating_sub(self.inner());
        let length = |e: &InnerEdge| {
            let [a, b] = e.ends.map(|v| self.mesh.positions[v as usize]);
            (b - a).norm()
        };
        let mut long: Vec<(bool, f64, InnerEdge)> = (self.inner_edges().into_iter())
            .map(|e| (self.is_chord(e.ends[0], e.ends[1]), length(&e), e))
            .filter(|(chord, length, _)| *chord || (*length > longest && room > 0))
            .collect();
        // Chords first: they are split even where there is no room.
        long.sort_by(|a, b| {
            (b.0.cmp(&a.0))
                .then(b.1.total_cmp(&a.1))
                .then(a.2.ends.cmp(&b.2.ends))
        });
        let mut touched = vec![false; self.mesh.faces.len()];
        let mut count = 0;
        for (chord, _, edge) in long {
            let (f, g) = (edge.face as usize, edge.other as usize);
            if touched[f] || touched[g] || (!chord && count >= room) {
                continue;
            }
            (touched[f], touched[g]) = (true, true);
            let [a, b] = edge.ends;
            let middle = self.mesh.positions.len() as u32;
            let [from, to] = edge.ends.map(|v| self.mesh.positions[v as usize]);
            self.mesh.positions.push((from + to) * 0.5);
            for face in [f, g] {
                let old = self.mesh.faces[face];
                self.mesh.faces[face] = old.map(|v| if v == b { middle } else { v });
                self.mesh
                    .faces
                    .push(old.map(|v| if v == a { middle } else { v }));
            }
            count += 1;
        }
        count
    }

    /// Flips edges whose opposite angles add up to more than π, each face at most once; how many.
    fn flip(&mut self) -> usize {
        let edges = self.inner_edges();
        let key = |a: u32, b: u32| (a.min(b), a.max(b));
        let mut joined: HashSet<(u32, u32)> = (self.mesh.faces.iter())
            .flat_map(|f| [key(f[0], f[1]), key(f[1], f[2]), key(f[2], f[0])])
            .collect();
        let mut touched = vec![false; self.mesh.faces.len()];
        let mut count = 0;
        for InnerEdge {
            ends: [a, b],
            face,
            other,
        } in edges
        {
            let (f, g) = (face as usize, other as usize);
            if touched[f] || touched[g] {
                continue;
            }
            let apex = |face: usize| {
                let corners = self.mesh.faces[face];
                corners.into_iter().find(|v| *v != a && *v != b)
            };
            let (Some(c), Some(d)) = (apex(f), apex(g)) else {
                continue;
            };
            if c == d
                || self.is_chord(c, d)
                || joined.contains(&key(c, d))
                || !self.improves([a, b, c, d])
            {
                continue;
            }
            self.mesh.faces[f] = [a, d, c];
            self.mesh.faces[g] = [d, b, c];
            (touched[f], touched[g]) = (true, true);
            joined.remove(&key(a, b));
            joined.insert(key(c, d));
            count += 1;
        }
        count
    }

    /// Whether the edge from `c` to `d` is better than that from `a` to `b`, with the faces (a, b, c) and (b, a, d).
    fn improves(&self, quad: [u32; 4]) -> bool {
        let [a, b, c, d] = quad.map(|v| self.mesh.positions[v as usize]);
        let angle = |p: Vec3, q: Vec3, r: Vec3| {
            let (u, v) = (q - p, r - p);
            u.cross(&v).norm().atan2(u.dot(&v))
        };
        if angle(c, a, b) + angle(d, a, b) <= std::f64::consts::PI + 1e-6 {
            return false;
        }
        let normal = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(&(r - p));
        let (old, other) = (normal(a, b, c), normal(b, a, d));
        let mean = old + other;
        let faces_along = |n: Vec3| n.dot(&mean) > 0.1 * n.norm() * mean.norm();
        old.dot(&other) > BENT * old.norm() * other.norm()
            && faces_along(normal(a, d, c))
            && faces_along(normal(d, b, c))
    }

    /// Draws every inner vertex half way to the mean of its neighbours, within its tangent plane.
    fn relax(&mut self) {
        let count = self.mesh.positions.len();
        let (mut sum, mut faces) = (vec![Vec3::zeros(); count], vec![0.0; count]);
        for face in &self.mesh.faces {
            let p = face.map(|v| self.mesh.positions[v as usize]);
            let middle = (p[0] + p[1] + p[2]) / 3.0;
            let area = (p[1] - p[0]).cross(&(p[2] - p[0])).norm();
            for v in face {
                sum[*v as usize] += middle * area;
                faces[*v as usize] += area;
            }
        }
        let normals = vertex_normals(&self.mesh);
        for v in self.corners..count {
            if faces[v] > 0.0 {
                let way = sum[v] / faces[v] - self.mesh.positions[v];
                self.mesh.positions[v] += (way - normals[v] * normals[v].dot(&way)) * 0.5;
            }
        }
    }
}
