//! Writes a piece of cloth with a hole, stored in every compressed way that is read, for programs that check what is mended.
//!
//! ```sh
//! cargo run --release --package darn-gltf-scan --example compressed -- FOLDER
//! ```

use std::error::Error;
use std::path::PathBuf;

#[allow(dead_code, reason = "tests use the rest")]
#[path = "../src/compressed/encoded.rs"]
mod encoded;

use encoded::{Coding, PlainMesh};

/// Vertices along a side.
const N: u32 = 40;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    let cloth = cloth();
    for coding in Coding::ALL {
        let path = folder.join(format!("cloth_{coding:?}.glb"));
        std::fs::write(path, cloth.encode(coding))?;
    }
    Ok(())
}

/// Waved cloth with a round hole.
fn cloth() -> PlainMesh {
    let at = |k: u32| [k % N, k / N].map(|i| i as f32 / (N - 1) as f32);
    let is_there = |k: &u32| {
        let [u, v] = at(*k);
        (u - 0.5).hypot(v - 0.5) > 0.15
    };
    let cells = (0..N * (N - 1)).filter(|k| k % N < N - 1);
    let faces = cells.flat_map(|k| [[k, k + 1, k + N + 1], [k, k + N + 1, k + N]]);
    let faces: Vec<[u32; 3]> = faces.filter(|face| face.iter().all(is_there)).collect();
    // Streams have the vertices of triangles alone.
    let mut used: Vec<u32> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let number = |vertex: u32| used.partition_point(|other| *other < vertex) as u32;
    let points = || used.iter().map(|k| at(*k));
    let normal = |[u, _]: [f32; 2]| {
        let slope = 0.6 * (6.0 * u).cos();
        let length = slope.hypot(1.0);
        [-slope / length, 0.0, 1.0 / length]
    };
    PlainMesh {
        positions: points()
            .map(|[u, v]| [u, v, 0.1 * (6.0 * u).sin()])
            .collect(),
        normals: points().map(normal).collect(),
        texcoords: points().collect(),
        faces: faces.iter().map(|face| face.map(number)).collect(),
    }
}
