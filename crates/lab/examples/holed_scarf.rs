//! Simulates a sheet of cloth, cuts a ragged hole into it and writes it as GLB. `examples/scarf_hole.glb` was made with it.
//!
//! `cargo run --release -p darn-lab --example holed_scarf -- [SEED] [INDEX] [OUT]`

use darn_geometry::mesh::{Vec2, Vec3, curvature::vertex_normals};
use darn_gltf_scan::export::{NewMesh, glb};
use darn_lab::scarffolds::holed_scan::{HoleShape, holed_scan};
use darn_lab::scarffolds::sheets;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let seed = words.next().map_or(Ok(7), |w| w.parse())?;
    let index = words.next().map_or(Ok(0), |w| w.parse())?;
    let out = words
        .next()
        .unwrap_or_else(|| "examples/scarf_hole.glb".to_owned());
    let (sheet, _) = sheets::make(seed, index)?;
    let hole = HoleShape::Blob {
        centre: Vec2::new(0.48, 0.53),
        radius: 0.17,
    };
    let scan = holed_scan(&sheet, 62, &hole, &mut ChaCha8Rng::seed_from_u64(seed));
    // The up direction is +z in the simulation and +y in glTF.
    let upright = |p: &Vec3| [p.x as f32, p.z as f32, -p.y as f32];
    let positions: Vec<[f32; 3]> = scan.mesh.positions.iter().map(upright).collect();
    let normals: Vec<[f32; 3]> = vertex_normals(&scan.mesh).iter().map(upright).collect();
    let texcoords: Vec<[f32; 2]> = scan
        .rest
        .iter()
        .map(|p| [p.x as f32, 1.0 - p.y as f32])
        .collect();
    let bytes = glb(&NewMesh {
        name: "scarf",
        positions: &positions,
        normals: &normals,
        texcoords: &texcoords,
        faces: &scan.mesh.faces,
    })?;
    std::fs::write(&out, &bytes)?;
    println!(
        "{out}: {} vertices, {} triangles, {} bytes",
        positions.len(),
        scan.mesh.faces.len(),
        bytes.len()
    );
    Ok(())
}
