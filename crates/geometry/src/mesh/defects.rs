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
    /// A triangle that is ten thousand times as long as high, between two others.
    Sliver,
    /// Two triangles on a border edge, one turned up from the border and one turned down.
    RimFin,
    /// An edge from the border inward that one of its two triangles has in two parts: its slit opens into the border.
    RimTJunction,
    /// A triangle on a border edge that is ten thousand times as long as high.
    RimSliver,
    /// A seam through the middle of the mesh, across x, whose two sides differ by a hundred-thousandth of the mesh's size.
    NearSeam,
}

impl Defect {
    /// Every kind.
    pub const ALL: [Defect; 10] = [
        Defect::FlippedFace,
        Defect::Fin,
        Defect::DuplicateFace,
        Defect::DegenerateFace,
        Defect::TJunction,
        Defect::Sliver,
        Defect::RimFin,
        Defect::RimTJunction,
        Defect::RimSliver,
        Defect::NearSeam,
    ];

    /// Whether it lies at a border.
    fn is_at_rim(self) -> bool {
        matches!(self, Self::RimFin | Self::RimTJunction | Self::RimSliver)
    }
}

/// Height of a sliver, in lengths of its longest edge.
const SLIVER_HEIGHT: f64 = 1e-4;

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
        let Some(Side { face, corners }) = self.untouched(kind.is_at_rim()) else {
            return;
        };
        let [a, b, c] = corners;
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
                let [middle, up, _] = self.axes(&corners);
                let tip = self.vertex(middle + up);
                self.mesh.faces.push([a, b, tip]);
            }
            Defect::RimFin => {
                let [middle, up, inward] = self.axes(&corners);
                for height in [0.5, -0.5] {
                    let tip = self.vertex(middle + up * height - inward * 0.3);
                    self.mesh.faces.push([b, a, tip]);
                }
            }
            Defect::TJunction => self.split_across(a, b),
            Defect::RimTJunction => self.split_across(b, c),
            Defect::Sliver => {
                let [middle, _, inward] = self.axes(&corners);
                let tip = self.vertex(middle + inward * SLIVER_HEIGHT);
                self.mesh.faces[face] = [a, tip, c];
                self.mesh.faces.extend([[tip, b, c], [a, b, tip]]);
            }
            Defect::RimSliver => {
                let [middle, _, inward] = self.axes(&corners);
                let tip = self.vertex(middle - inward * SLIVER_HEIGHT);
                self.mesh.faces.push([b, a, tip]);
            }
            Defect::NearSeam => {}
        }
    }

    /// Splits the face on the other side of an edge at the edge's middle; nothing at the border.
    fn split_across(&mut self, a: u32, b: u32) {
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

    /// The middle of a face's first edge, and vectors of that edge's length up from the face and into it.
    fn axes(&self, corners: &[u32; 3]) -> [Vec3; 3] {
        let [p, q, r] = corners.map(|v| self.mesh.positions[v as usize]);
        let up = (q - p).cross(&(r - p)).normalize();
        [(p + q) * 0.5, up * (q - p).norm(), up.cross(&(q - p))]
    }

    fn vertex(&mut self, at: Vec3) -> u32 {
        self.mesh.positions.push(at);
        self.mesh.positions.len() as u32 - 1
    }

    /// A face at random that no defect is near, its first edge on the border if that is asked for; its corners count as near one from then on.
    fn untouched(&mut self, at_rim: bool) -> Option<Side> {
        let sides: Vec<Side> = if at_rim {
            self.rim_sides()
        } else {
            let faces = self.mesh.faces.iter().enumerate();
            faces
                .map(|(face, &corners)| Side { face, corners })
                .collect()
        };
        for _ in 0..100 {
            let side = *sides.get(self.rng.random_range(0..sides.len().max(1)))?;
            let corners = side.corners;
            if corners.iter().all(|v| !self.touched.contains(v)) {
                let near = |f: &&[u32; 3]| f.iter().any(|v| corners.contains(v));
                let around = self.mesh.faces.iter().filter(near);
                self.touched.extend(around.flatten().copied());
                return Some(side);
            }
        }
        None
    }

    /// The faces at the border, once for each of their border edges, which come first.
    fn rim_sides(&self) -> Vec<Side> {
        let edges = |corners: [u32; 3]| {
            [0, 1, 2].map(|k: usize| [0, 1, 2].map(|i: usize| corners[(k + i) % 3]))
        };
        let directed = self.mesh.faces.iter().flat_map(|face| edges(*face));
        let directed: BTreeSet<[u32; 2]> = directed.map(|[a, b, _]| [a, b]).collect();
        let faces = self.mesh.faces.iter().enumerate();
        let sides =
            faces.flat_map(|(face, corners)| edges(*corners).map(|corners| Side { face, corners }));
        let at_rim = |side: &Side| !directed.contains(&[side.corners[1], side.corners[0]]);
        sides.filter(at_rim).collect()
    }

    /// The face on the other side of an edge, if there is one.
    fn across(&self, a: u32, b: u32) -> Option<Side> {
        self.mesh
            .faces
            .iter()
            .enumerate()
            .find_map(|(face, corners)| {
                let k = (0..3).find(|&k| corners[k] == b && corners[(k + 1) % 3] == a)?;
                let corners = [0, 1, 2].map(|i: usize| corners[(k + i) % 3]);
                Some(Side { face, corners })
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

/// A face, and its corners from an edge's end on.
#[derive(Debug, Clone, Copy)]
struct Side {
    face: usize,
    corners: [u32; 3],
}
