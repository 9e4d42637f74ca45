//! Simple surfaces with known geometry, and changes to meshes with known effects: for tests, benchmarks and examples.
//!
//! Lengths are scene units. Shapes are triangle soups as a file might hold them: [`weld`](super::weld::weld) them
//! first. Everything random is determined by its seed.

use std::collections::HashMap;
use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{TriMesh, Vec3};

/// An `n` × `n` grid of squares, two triangles each, over (u, v) in [0, 1]²; `place` gives the position of a grid
/// point, in scene units.
///
/// Squares for whose middle `keep` is false are left out; their vertices stay, used or not. Vertex `j * (n + 1) + i`
/// is the grid point (i / n, j / n).
pub fn sheet(
    n: usize,
    keep: impl Fn(f64, f64) -> bool,
    place: impl Fn(f64, f64) -> Vec3,
) -> TriMesh {
    let at = |i: usize| i as f64 / n as f64;
    let positions = (0..(n + 1) * (n + 1))
        .map(|v| place(at(v % (n + 1)), at(v / (n + 1))))
        .collect();
    let mut faces = Vec::new();
    for (i, j) in (0..n * n).map(|q| (q % n, q / n)) {
        let half = 0.5 / n as f64;
        if keep(at(i) + half, at(j) + half) {
            let a = (j * (n + 1) + i) as u32;
            let (b, c) = (a + 1, a + n as u32 + 1);
            faces.extend([[a, b, c], [b, c + 1, c]]);
        }
    }
    TriMesh { positions, faces }
}

/// A flat square of side 1 in the plane z = 0 with a round hole of radius `hole` in its middle; `n` squares a side.
pub fn holed_sheet(n: usize, hole: f64) -> TriMesh {
    sheet(
        n,
        |u, v| (u - 0.5).hypot(v - 0.5) > hole,
        |u, v| Vec3::new(u, v, 0.0),
    )
}

/// A tube of radius 1 and length 4 along z, `n` rectangles around and along; those for which `keep(angle / 2π, height
/// / 4)` is false are left out.
///
/// The two columns of vertices at the seam have equal positions, so welding closes it.
pub fn tube(n: usize, keep: impl Fn(f64, f64) -> bool) -> TriMesh {
    sheet(n, keep, |u, v| {
        let angle = if u == 1.0 { 0.0 } else { u * TAU };
        Vec3::new(angle.cos(), angle.sin(), 4.0 * v)
    })
}

/// The mesh with every coordinate shifted at random by up to `amount`, scene units; equal positions are shifted
/// equally.
pub fn jitter(mesh: &TriMesh, amount: f64, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut shifts: HashMap<[u64; 3], Vec3> = HashMap::new();
    let positions = mesh.positions.iter().map(|p| {
        let key = [p.x, p.y, p.z].map(f64::to_bits);
        p + *shifts
            .entry(key)
            .or_insert_with(|| Vec3::from_fn(|_, _| rng.random_range(-amount..=amount)))
    });
    TriMesh {
        positions: positions.collect(),
        faces: mesh.faces.clone(),
    }
}

/// The same triangles with the vertices in a random order.
pub fn shuffle(mesh: &TriMesh, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..mesh.positions.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    let mut to = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        to[old] = new as u32;
    }
    TriMesh {
        positions: order.iter().map(|&old| mesh.positions[old]).collect(),
        faces: mesh
            .faces
            .iter()
            .map(|f| f.map(|v| to[v as usize]))
            .collect(),
    }
}

/// The same triangles, each with three vertices of its own.
pub fn explode(mesh: &TriMesh) -> TriMesh {
    TriMesh {
        positions: mesh
            .faces
            .iter()
            .flatten()
            .map(|&v| mesh.positions[v as usize])
            .collect(),
        faces: (0..mesh.faces.len() as u32)
            .map(|f| [3 * f, 3 * f + 1, 3 * f + 2])
            .collect(),
    }
}

/// Both meshes as one: the faces and vertices of `b` follow those of `a`.
pub fn concat(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let shift = a.positions.len() as u32;
    TriMesh {
        positions: a.positions.iter().chain(&b.positions).copied().collect(),
        faces: a
            .faces
            .iter()
            .copied()
            .chain(b.faces.iter().map(|f| f.map(|v| v + shift)))
            .collect(),
    }
}
