//! Defects that files of cloth have and cloth has not, put into sound meshes: for tests.

use std::collections::{BTreeMap, BTreeSet};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{TriMesh, Vec3};

/// A kind of defect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Defect {
    /// A triangle that faces the other way than its neighbours.
    FlippedFace,
    /// A triangle on an edge that two others share.
    Fin,
    /// A triangle twice, the second time with the same side or the other.
    DuplicateFace,
    /// A triangle with two corners in one place.
    DegenerateFace,
    /// An edge that one of its two triangles has in two parts.
    TJunction,
    /// A seam through the middle of the mesh, across x, whose two sides differ by a hundred-thousandth of the mesh's size.
    NearSeam,
}

impl Defect {
    /// Every kind.
    pub const ALL: [Defect; 6] = [
        Defect::FlippedFace,
        Defect::Fin,
        Defect::DuplicateFace,
        Defect::DegenerateFace,
        Defect::TJunction,
        Defect::NearSeam,
    ];
}

/// The mesh with defects of these kinds: one to four of each at random places that do not touch each other, and one
/// seam. Faces that are not changed stay in place; new ones follow.
pub fn with_defects(mesh: &TriMesh, kinds: &[Defect], seed: u64) -> TriMesh {
    let mut change = Change {
        mesh: mesh.clone(),
        touched: BTreeSet::new(),
        rng: ChaCha8Rng::seed_from_u64(seed),
    };
    let kinds: BTreeSet<Defect> = kinds.iter().copied().collect();
    for kind in kinds {
        // The seam is last, and cuts what the others made.
        let count = match kind {
            Defect::NearSeam => 1,
            _ => change.rng.random_range(1..=4),
        };
        for _ in 0..count {
            change.add(kind);
        }
    }
    change.mesh
}

/// A mesh on its way to having defects.
struct Change {
    mesh: TriMesh,
    /// Vertices near a defect; further ones keep off.
    touched: BTreeSet<u32>,
    rng: ChaCha8Rng,
}

impl Change {
    fn add(&mut self, kind: Defect) {
        if kind == Defect::NearSeam {
            return self.cut_seam();
        }
        let Some(face) = self.untouched_face() else {
            return;
        };
        let [a, b, c] = self.mesh.faces[face];
        match kind {
            Defect::FlippedFace => self.mesh.faces[face] = [a, c, b],
            Defect::DuplicateFace => {
                let again = if self.rng.random() {
                    [a, b, c]
                } else {
                    [c, b, a]
                };
                self.mesh.faces.push(again);
            }
            Defect::DegenerateFace => {
                let at = self.mesh.positions[a as usize];
                let copy = self.vertex(at);
                self.mesh.faces.push([a, b, copy]);
            }
            Defect::Fin => {
                if self.across(a, b).is_none() {
                    return;
                }
                let [p, q, r] = self.mesh.triangle(face);
                let up = (q - p).cross(&(r - p)).normalize() * (q - p).norm();
                let tip = self.vertex((p + q) * 0.5 + up);
                self.mesh.faces.push([a, b, tip]);
            }
            Defect::TJunction => {
                let Some(other) = self.across(a, b) else {
                    return;
                };
                let [from, to, tip] = other.corners;
                self.touched.insert(tip);
                let [p, q] = [a, b].map(|v| self.mesh.positions[v as usize]);
                let middle = self.vertex((p + q) * 0.5);
                self.mesh.faces[other.face] = [from, middle, tip];
                self.mesh.faces.push([middle, to, tip]);
            }
            Defect::NearSeam => {}
        }
    }

    fn vertex(&mut self, at: Vec3) -> u32 {
        self.mesh.positions.push(at);
        self.mesh.positions.len() as u32 - 1
    }

    /// A face at random that no defect is near; its corners count as near one from then on.
    fn untouched_face(&mut self) -> Option<usize> {
        for _ in 0..100 {
            let face = self.rng.random_range(0..self.mesh.faces.len());
            let corners = self.mesh.faces[face];
            if corners.iter().all(|v| !self.touched.contains(v)) {
                let near = |f: &&[u32; 3]| f.iter().any(|v| corners.contains(v));
                let around = self.mesh.faces.iter().filter(near);
                self.touched.extend(around.flatten().copied());
                return Some(face);
            }
        }
        None
    }

    /// The face on the other side of an edge, if there is one.
    fn across(&self, a: u32, b: u32) -> Option<Across> {
        self.mesh
            .faces
            .iter()
            .enumerate()
            .find_map(|(face, corners)| {
                let k = (0..3).find(|&k| corners[k] == b && corners[(k + 1) % 3] == a)?;
                let corners = [0, 1, 2].map(|i: usize| corners[(k + i) % 3]);
                Some(Across { face, corners })
            })
    }

    /// Gives the faces left of the middle their own vertices on the seam, each a little off.
    fn cut_seam(&mut self) {
        let size = |p: &Vec3| p.amax();
        let size = self.mesh.positions.iter().map(size).fold(0.0, f64::max);
        let x = |v: u32| self.mesh.positions[v as usize].x;
        let low = self
            .mesh
            .positions
            .iter()
            .map(|p| p.x)
            .fold(f64::MAX, f64::min);
        let high = self
            .mesh
            .positions
            .iter()
            .map(|p| p.x)
            .fold(f64::MIN, f64::max);
        let middle = 0.5 * (low + high);
        let is_left = |f: &[u32; 3]| f.iter().map(|&v| x(v)).sum::<f64>() < 3.0 * middle;
        let left: Vec<bool> = self.mesh.faces.iter().map(is_left).collect();
        let faces = self.mesh.faces.clone();
        let right: BTreeSet<u32> = (faces.iter().zip(&left))
            .filter(|(_, left)| !**left)
            .flat_map(|(face, _)| *face)
            .collect();
        let mut own = BTreeMap::new();
        for (f, face) in faces.iter().enumerate().filter(|(f, _)| left[*f]) {
            self.mesh.faces[f] = face.map(|v| {
                if !right.contains(&v) {
                    return v;
                }
                *own.entry(v).or_insert_with(|| {
                    let off = Vec3::from_fn(|_, _| self.rng.random_range(-5e-6..5e-6));
                    self.mesh
                        .positions
                        .push(self.mesh.positions[v as usize] + off * size);
                    self.mesh.positions.len() as u32 - 1
                })
            });
        }
    }
}

/// A face on the other side of an edge.
struct Across {
    face: usize,
    /// Its corners, from the edge's end on.
    corners: [u32; 3],
}
