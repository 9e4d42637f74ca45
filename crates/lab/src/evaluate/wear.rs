//! What happens to the meshes of garments before anybody mends them: triangles trimmed from their edges, noise, torn and bitten edges.

use super::cases::gaussian;
use darn_geometry::mesh::index::{FaceId, VertexId};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec3, weld};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Lobes of a torn edge: its depth is a sum of waves that go two to this many times around.
const LOBES: usize = 8;
/// Radius of a bite ÷ the length of the edge.
const BITE: f64 = 0.08;

/// Something that happened to a whole mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wear {
    /// Nothing.
    AsMade,
    /// A part of the triangles at every edge is gone, this many times.
    Trimmed {
        /// Which share of the triangles with a vertex on the boundary.
        share: f64,
        /// How often.
        times: usize,
    },
    /// Every coordinate is off by a normal deviation of this many edges.
    Noisy(f64),
}

/// Something that happened to one edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeWear {
    /// It is torn off all around, four edges deep in the mean.
    Torn,
    /// A piece is bitten out of it.
    Bitten,
}

impl Wear {
    /// What is measured.
    pub const ALL: [Wear; 5] = [
        Wear::AsMade,
        Wear::Trimmed {
            share: 0.5,
            times: 1,
        },
        Wear::Trimmed {
            share: 0.5,
            times: 2,
        },
        Wear::Noisy(0.2),
        Wear::Noisy(0.3),
    ];

    /// What happened, for a table.
    pub fn name(self) -> String {
        match self {
            Wear::AsMade => "as made".into(),
            Wear::Trimmed { share, times } => {
                format!("trimmed by {:.0} %, {times} ×", 100.0 * share)
            }
            Wear::Noisy(edges) => format!("noise of {edges} edges"),
        }
    }

    /// The mesh afterwards: its largest piece.
    pub fn of(self, mesh: &TriMesh, rng: &mut ChaCha8Rng) -> TriMesh {
        let mut worn = mesh.clone();
        match self {
            Wear::AsMade => {}
            Wear::Trimmed { share, times } => {
                for _ in 0..times {
                    let boundary = Topology::new(&worn).boundary_vertices();
                    let at_edge = |f: &[u32; 3]| f.iter().any(|v| boundary[*v as usize]);
                    worn.faces
                        .retain(|f| !at_edge(f) || !rng.random_bool(share));
                    worn = largest_piece(&worn);
                }
            }
            Wear::Noisy(edges) => {
                let sigma = edges * mean_edge(mesh);
                for p in &mut worn.positions {
                    *p += Vec3::from_fn(|_, _| sigma * gaussian(rng));
                }
            }
        }
        worn
    }
}

impl EdgeWear {
    /// What is measured.
    pub const ALL: [EdgeWear; 2] = [EdgeWear::Torn, EdgeWear::Bitten];

    /// What happened, for a table.
    pub fn name(self) -> &'static str {
        match self {
            EdgeWear::Torn => "one edge torn off",
            EdgeWear::Bitten => "a bite in one edge",
        }
    }

    /// The mesh after this happened to the edge along some vertices, in their order: its largest piece.
    pub fn of(self, mesh: &TriMesh, edge: &[VertexId], rng: &mut ChaCha8Rng) -> TriMesh {
        let rim: Vec<Vec3> = edge.iter().map(|v| mesh.positions[v.index()]).collect();
        let usual = mean_edge(mesh);
        let middle = |f: &[u32; 3]| -> Vec3 {
            f.iter().map(|v| mesh.positions[*v as usize]).sum::<Vec3>() / 3.0
        };
        let mut worn = mesh.clone();
        match self {
            EdgeWear::Torn => {
                let spread = 0.6 / (LOBES as f64 - 2.0).sqrt();
                let waves: Vec<[f64; 2]> = (2..LOBES)
                    .map(|_| [spread * gaussian(rng), spread * gaussian(rng)])
                    .collect();
                let depth = |at: f64| -> f64 {
                    let wave = |(k, w): (usize, &[f64; 2])| {
                        let turn = (k + 2) as f64 * at;
                        w[0] * turn.cos() + w[1] * turn.sin()
                    };
                    1.0 + waves.iter().enumerate().map(wave).sum::<f64>()
                };
                worn.faces.retain(|f| {
                    let centre = middle(f);
                    let k = nearest(&rim, &centre);
                    let around = TAU * k as f64 / rim.len() as f64;
                    let deep = (depth(around) + 0.25 * gaussian(rng)).clamp(0.0, 3.0);
                    (centre - rim[k]).norm() >= 4.0 * usual * deep
                });
            }
            EdgeWear::Bitten => {
                let centre = rim[rng.random_range(0..rim.len())];
                let next = rim.iter().cycle().skip(1);
                let length: f64 = rim.iter().zip(next).map(|(a, b)| (b - a).norm()).sum();
                worn.faces.retain(|f| {
                    let reach = BITE * length + 0.6 * usual * gaussian(rng);
                    (middle(f) - centre).norm() >= reach
                });
            }
        }
        largest_piece(&worn)
    }
}

/// Mean length of the sides of all triangles.
fn mean_edge(mesh: &TriMesh) -> f64 {
    let sides = |f: usize| {
        let [a, b, c] = mesh.triangle(f);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    };
    let sum: f64 = (0..mesh.faces.len()).map(sides).sum();
    sum / (3 * mesh.faces.len()).max(1) as f64
}

/// The point that is nearest to another.
fn nearest(points: &[Vec3], to: &Vec3) -> usize {
    let off = |k: &usize| (points[*k] - to).norm_squared();
    let nearest = (0..points.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
    nearest.unwrap_or(0)
}

/// The connected piece with the most triangles, with the vertices that it uses.
fn largest_piece(mesh: &TriMesh) -> TriMesh {
    let topology = Topology::new(mesh);
    let piece = |f: usize| topology.component(FaceId(f as u32));
    let mut sizes = vec![0usize; topology.components];
    (0..mesh.faces.len()).for_each(|f| sizes[piece(f) as usize] += 1);
    let largest = (0..sizes.len()).max_by_key(|c| sizes[*c]).unwrap_or(0) as u32;
    let kept = (0..mesh.faces.len()).filter(|f| piece(*f) == largest);
    let one = TriMesh {
        positions: mesh.positions.clone(),
        faces: kept.map(|f| mesh.faces[f]).collect(),
    };
    Arc::unwrap_or_clone(weld::weld(&one).mesh)
}
