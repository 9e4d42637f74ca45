//! Decimated cloth is not noisy: meshes with a fraction of their triangles, as scanners' programs write them.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeSet, BinaryHeap};
use std::sync::Arc;

use darn_budget::Budget;
use nalgebra::{Matrix4, Vector4};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::denoise;
use crate::mesh::shapes::{jitter, sheet};
use crate::mesh::topology::Topology;
use crate::mesh::weld::weld;
use crate::mesh::{TriMesh, Vec3};

/// A mesh whose edges are collapsed one by one, always the one that moves the surface least (Garland and Heckbert 1997).
struct Decimation {
    positions: Vec<Vec3>,
    /// Per vertex the sum of the squared distances from its faces' planes.
    quadrics: Vec<Matrix4<f64>>,
    faces: Vec<[u32; 3]>,
    /// Per vertex its faces that are left.
    around: Vec<BTreeSet<u32>>,
    /// Per vertex how often it has changed.
    changed: Vec<u32>,
}

/// An edge that may be collapsed: its cost, its ends, and how often they had changed when it was measured.
#[derive(PartialEq)]
struct Collapse {
    cost: f64,
    ends: [u32; 2],
    seen: [u32; 2],
}

impl Eq for Collapse {}

impl Ord for Collapse {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.cost.total_cmp(&other.cost)).then_with(|| self.ends.cmp(&other.ends))
    }
}

impl PartialOrd for Collapse {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Decimation {
    fn new(mesh: &TriMesh) -> Decimation {
        let mut decimation = Decimation {
            positions: mesh.positions.clone(),
            quadrics: vec![Matrix4::zeros(); mesh.positions.len()],
            faces: mesh.faces.clone(),
            around: vec![BTreeSet::new(); mesh.positions.len()],
            changed: vec![0; mesh.positions.len()],
        };
        for (f, face) in (0u32..).zip(&mesh.faces) {
            let [a, b, c] = mesh.triangle(f as usize);
            let doubled = (b - a).cross(&(c - a));
            let normal = doubled.normalize();
            let plane = Vector4::new(normal.x, normal.y, normal.z, -normal.dot(&a));
            for v in face {
                decimation.around[*v as usize].insert(f);
                decimation.quadrics[*v as usize] += plane * plane.transpose() * doubled.norm();
            }
        }
        decimation
    }

    fn neighbours(&self, vertex: u32) -> BTreeSet<u32> {
        let faces = self.around[vertex as usize].iter();
        let corners = faces.flat_map(|f| self.faces[*f as usize]);
        corners.filter(|v| *v != vertex).collect()
    }

    /// Where an edge is collapsed to: the best of its ends and its middle.
    fn place(&self, [a, b]: [u32; 2]) -> (f64, Vec3) {
        let quadric = self.quadrics[a as usize] + self.quadrics[b as usize];
        let (p, q) = (self.positions[a as usize], self.positions[b as usize]);
        let cost = |p: &Vec3| {
            let p = Vector4::new(p.x, p.y, p.z, 1.0);
            p.dot(&(quadric * p))
        };
        let places = [0.5 * (p + q), p, q];
        let each = places.iter().map(|p| (cost(p), *p));
        each.min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("three places")
    }

    fn collapse(&self, ends: [u32; 2]) -> Collapse {
        Collapse {
            // Where all is flat, short edges go first.
            cost: self.place(ends).0
                + 1e-9
                    * (self.positions[ends[0] as usize] - self.positions[ends[1] as usize])
                        .norm_squared(),
            ends,
            seen: ends.map(|v| self.changed[v as usize]),
        }
    }

    /// Moves b to a; false where that would fold or pinch the surface.
    fn collapsed(&mut self, [a, b]: [u32; 2]) -> bool {
        let shared: Vec<u32> = (self.around[a as usize])
            .intersection(&self.around[b as usize])
            .copied()
            .collect();
        let common = self.neighbours(a).intersection(&self.neighbours(b)).count();
        let (_, place) = self.place([a, b]);
        let turns = |v: u32| {
            let others = self.around[v as usize]
                .iter()
                .filter(|f| !shared.contains(f));
            others.into_iter().any(|f| {
                let face = self.faces[*f as usize];
                let normal = |moved: bool| {
                    let [p, q, r] = face.map(|w| match moved && w == v {
                        true => place,
                        false => self.positions[w as usize],
                    });
                    (q - p).cross(&(r - p))
                };
                let (old, new) = (normal(false), normal(true));
                new.dot(&old) < 0.2 * new.norm() * old.norm() || new.norm() < 0.02 * old.norm()
            })
        };
        // Borders stay.
        if shared.len() != 2 || common != 2 || turns(a) || turns(b) {
            return false;
        }
        for f in shared {
            for v in self.faces[f as usize] {
                self.around[v as usize].remove(&f);
            }
        }
        for f in std::mem::take(&mut self.around[b as usize]) {
            let face = &mut self.faces[f as usize];
            *face = face.map(|v| if v == b { a } else { v });
            self.around[a as usize].insert(f);
        }
        self.positions[a as usize] = place;
        let added = self.quadrics[b as usize];
        self.quadrics[a as usize] += added;
        self.changed[a as usize] += 1;
        self.changed[b as usize] += 1;
        true
    }
}

/// The mesh with about this share of its triangles. Vertices at a border stay.
fn decimated(mesh: &TriMesh, share: f64) -> TriMesh {
    let border: BTreeSet<u32> = {
        let topology = Topology::new(mesh);
        let ends =
            (0..mesh.faces.len() as u32).flat_map(|f| crate::mesh::index::FaceId(f).half_edges());
        let ends = ends.filter(|h| topology.twin(*h).is_none());
        ends.flat_map(|h| [topology.origin(h).0, topology.target(h).0])
            .collect()
    };
    let mut decimation = Decimation::new(mesh);
    let inner = |ends: &[u32; 2]| !ends.iter().any(|v| border.contains(v));
    let mut queue = BinaryHeap::new();
    for [a, b, c] in &mesh.faces {
        for ends in [[*a, *b], [*b, *c], [*c, *a]] {
            if ends[0] < ends[1] && inner(&ends) {
                queue.push(Reverse(decimation.collapse(ends)));
            }
        }
    }
    let mut left = mesh.faces.len();
    while left as f64 > share * mesh.faces.len() as f64 {
        let Some(Reverse(next)) = queue.pop() else {
            break;
        };
        let fresh = next.ends.map(|v| decimation.changed[v as usize]) == next.seen;
        if fresh && decimation.collapsed(next.ends) {
            left -= 2;
            let a = next.ends[0];
            for v in decimation.neighbours(a) {
                let ends = [a.min(v), a.max(v)];
                if inner(&ends) {
                    queue.push(Reverse(decimation.collapse(ends)));
                }
            }
        }
    }
    let faces = decimation
        .around
        .iter()
        .flatten()
        .copied()
        .collect::<BTreeSet<u32>>();
    let whole = TriMesh {
        positions: decimation.positions,
        faces: decimation.faces,
    };
    whole.part(faces.iter().map(|f| whole.faces[*f as usize]))
}

/// A folded sheet: folds that run askew to its squares, pleats among them.
fn folded_sheet(n: usize, folds: f64, depth: f64, seed: u64) -> TriMesh {
    let flat = jitter(
        &sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0)),
        0.3 / n as f64,
        seed,
    );
    let lift = |p: &Vec3| {
        let along = p.x + 0.4 * p.y + 0.1 * (4.0 * p.y).sin();
        Vec3::new(
            p.x,
            p.y,
            depth * (folds * along).sin() + 0.3 * depth * (2.3 * folds * along + 5.0 * p.y).cos(),
        )
    };
    TriMesh {
        positions: flat.positions.iter().map(lift).collect(),
        faces: flat.faces,
    }
}

/// A robe of a statue: a closed wall with chiselled folds around it.
fn robe(n: usize, folds: f64, depth: f64) -> TriMesh {
    let chisel = |x: f64| 4.0 * (x.rem_euclid(1.0) - 0.5).abs() - 1.0;
    let open = sheet(
        n,
        |_, _| true,
        |u, v| {
            let angle = if u == 1.0 {
                0.0
            } else {
                std::f64::consts::TAU * u
            };
            let fold =
                chisel(folds.round() * angle / std::f64::consts::TAU + 0.3 * (3.0 * v).sin());
            let radius = 0.4 + 0.15 * v + depth * fold * (0.3 + v);
            Vec3::new(radius * angle.cos(), radius * angle.sin(), 1.5 * v)
        },
    );
    Arc::unwrap_or_clone(weld(&open).mesh)
}

/// Mean edge, scene units.
fn mean_edge(mesh: &TriMesh) -> f64 {
    let all = (0..mesh.faces.len()).map(|f| {
        let [a, b, c] = mesh.triangle(f);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    });
    all.sum::<f64>() / (3 * mesh.faces.len()) as f64
}

/// The mesh with normal noise of this standard deviation in mean edges.
fn noisy(mesh: &TriMesh, amount: f64, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let size = amount * mean_edge(mesh);
    // Twelve uniform numbers add up to about a normal one of variance 1.
    let mut normal = || size * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let moved = mesh
        .positions
        .iter()
        .map(|p| p + Vec3::new(normal(), normal(), normal()));
    TriMesh {
        positions: moved.collect(),
        faces: mesh.faces.clone(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn decimated_cloth_is_not_noisy_and_noise_on_it_is(
        folds in 6.0..22.0f64, depth in 0.01..0.05f64, share in 0.08..0.6f64, seed: u64,
    ) {
        let folded = decimated(&folded_sheet(80, folds, depth, seed), share);
        prop_assert_eq!(denoise(&folded, Budget::unlimited()), Ok(None));
        let found = denoise(&noisy(&folded, 0.12, seed), Budget::unlimited()).unwrap();
        prop_assert!(found.is_some());
    }

    #[test]
    fn a_decimated_statue_is_not_noisy(
        folds in 8.0..18.0f64, depth in 0.02..0.06f64, share in 0.08..0.6f64,
    ) {
        let carved = decimated(&robe(80, folds, depth), share);
        prop_assert_eq!(denoise(&carved, Budget::unlimited()), Ok(None));
    }
}

#[test]
fn decimation_takes_triangles_away_and_keeps_the_surface() {
    let fine = folded_sheet(60, 9.0, 0.04, 3);
    let coarse = decimated(&fine, 0.2);
    assert!(
        coarse.faces.len() * 4 < fine.faces.len(),
        "{}",
        coarse.faces.len()
    );
    assert_eq!(weld(&coarse).mesh.faces.len(), coarse.faces.len());
    let area = |mesh: &TriMesh| crate::mesh::curvature::face_areas(mesh).iter().sum::<f64>();
    assert!((area(&coarse) / area(&fine) - 1.0).abs() < 0.03);
}
