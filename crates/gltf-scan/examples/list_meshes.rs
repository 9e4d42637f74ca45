//! Lists the parts of a scan: `cargo run -p darn-gltf-scan --example list_meshes -- examples/scarf_hole.glb`

use std::error::Error;

use darn_gltf_scan::{Scan, ScanLimits};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: list_meshes SCAN.glb")?;
    let scan = Scan::read(std::fs::read(&path)?, &ScanLimits::default())?;
    println!(
        "{path}: {} vertices, {} faces in all",
        scan.surface.positions.len(),
        scan.surface.faces.len()
    );
    for (index, part) in scan.parts.iter().enumerate() {
        println!(
            "part {index} ({}): node {}, mesh {}, primitive {}, {} vertices, {} faces{}",
            scan.mesh_name(index).unwrap_or("no name"),
            part.node,
            part.mesh,
            part.primitive,
            part.vertices.len(),
            part.faces.len(),
            if part.reconstructed {
                ", reconstructed"
            } else {
                ""
            }
        );
    }
    Ok(())
}
