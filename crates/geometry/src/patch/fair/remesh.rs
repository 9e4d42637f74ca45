//! Even triangles for a patch in space: long edges are split, edges flipped towards Delaunay, inner vertices drawn to
//! the middle of their neighbours. The rim stays.

use std::collections::BTreeMap;

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
#[derive(Debug, Clone, Copy)]
struct InnerEdge {
    ends: [u32; 2],
    face: u32,
    other: u32,
}

/// The edges of a sheet, each between a lower and a higher vertex, ascending.
struct Edges {
    all: Vec<(u32, u32)>,
    inner: Vec<InnerEdge>,
}

impl Edges {
    fn of(faces: &[[u32; 3]]) -> Edges {
        // Lower end, higher end, face, whether the face runs up from the lower one: in one number, as sorting them takes most of the time.
        let sides = (0u32..).zip(faces).flat_map(|(f, face)| {
            [0, 1, 2].map(|k| {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                let ends = u128::from(a.min(b)) << 96 | u128::from(a.max(b)) << 64;
                ends | u128::from(f) << 32 | u128::from(a < b)
            })
        });
        let mut sides: Vec<u128> = sides.collect();
        sides.sort_unstable();
        let of_edge = || sides.chunk_by(|a, b| a >> 64 == b >> 64);
        let ends = |side: u128| ((side >> 96) as u32, (side >> 64) as u32);
        let inner = |sides: &[u128]| match *sides {
            [first, second] => {
                let (low, high) = ends(first);
                Some(InnerEdge {
                    ends: if first & 1 == 1 {
                        [low, high]
                    } else {
                        [high, low]
                    },
                    face: (first >> 32) as u32,
                    other: (second >> 32) as u32,
                })
            }
            _ => None,
        };
        Edges {
            all: of_edge().map(|sides| ends(sides[0])).collect(),
            inner: of_edge().filter_map(inner).collect(),
        }
    }
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
        let mut edges = Edges::of(&self.mesh.faces);
        for _ in 0..PASSES {
            budget.spend(2 * FACE_WORK * self.mesh.faces.len() as u64)?;
            let split = self.split(&edges, LONG * length, most);
            if split > 0 {
                edges = Edges::of(&self.mesh.faces);
            }
            let flipped = self.flip(&edges);
            if flipped > 0 {
                edges = Edges::of(&self.mesh.faces);
            }
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

    /// Splits chords and edges longer than `longest` in the middle, the longest first, each face at most once; how many.
    fn split(&mut self, edges: &Edges, longest: f64, most: usize) -> usize {
        let room = most.saturating_sub(self.inner());
        let length = |e: &InnerEdge| {
            let [a, b] = e.ends.map(|v| self.mesh.positions[v as usize]);
            (b - a).norm()
        };
        let mut long: Vec<(bool, f64, InnerEdge)> = (edges.inner.iter())
            .map(|e| (self.is_chord(e.ends[0], e.ends[1]), length(e), *e))
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
    fn flip(&mut self, edges: &Edges) -> usize {
        let key = |a: u32, b: u32| (a.min(b), a.max(b));
        // Whether two vertices are joined, where the flips so far have changed that.
        let mut changed: BTreeMap<(u32, u32), bool> = BTreeMap::new();
        let mut touched = vec![false; self.mesh.faces.len()];
        let mut count = 0;
        for InnerEdge {
            ends: [a, b],
            face,
            other,
        } in edges.inner.iter().copied()
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
            if c == d || self.is_chord(c, d) || !self.improves([a, b, c, d]) {
                continue;
            }
            let was_joined = || edges.all.binary_search(&key(c, d)).is_ok();
            if changed.get(&key(c, d)).copied().unwrap_or_else(was_joined) {
                continue;
            }
            self.mesh.faces[f] = [a, d, c];
            self.mesh.faces[g] = [d, b, c];
            (touched[f], touched[g]) = (true, true);
            changed.insert(key(a, b), false);
            changed.insert(key(c, d), true);
            count += 1;
        }
        count
    }

    /// Whether the edge from `c` to `d` is better than that from `a` to `b`, with the faces (a, b, c) and (b, a, d).
    fn improves(&self, quad: [u32; 4]) -> bool {
        let [a, b, c, d] = quad.map(|v| self.mesh.positions[v as usize]);
        // Two acute angles add up to less than π: most edges need no more than this.
        if (a - c).dot(&(b - c)) > 0.0 && (a - d).dot(&(b - d)) > 0.0 {
            return false;
        }
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
