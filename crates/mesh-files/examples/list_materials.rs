//! Reads an OBJ or a PLY and says what is in it.
//!
//! ```sh
//! cargo run --release -p darn-mesh-files --example list_materials -- cloth.obj
//! ```

use std::error::Error;

use darn_budget::Budget;
use darn_mesh_files::{MeshFile, MeshFileLimits, MeshFormat};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: list_materials FILE")?;
    let bytes = std::fs::read(path)?;
    let format = MeshFormat::of(&bytes).ok_or("neither an OBJ nor a PLY")?;
    let limits = MeshFileLimits {
        max_vertices: usize::MAX,
        max_faces: usize::MAX,
        max_materials: usize::MAX,
    };
    let file = MeshFile::read(bytes.into(), format, limits, Budget::unlimited())?;
    println!(
        "{}: {} vertices",
        format.media_type(),
        file.mesh().positions.len()
    );
    for group in &file.mesh().groups {
        let material = group.material.as_deref().unwrap_or("(no material)");
        println!("  {material}: {} triangles", group.faces.len());
    }
    Ok(())
}
