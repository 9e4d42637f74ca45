//! Prints what the first primitive of scans is read to, a line of JSON for each scan: `positions`, `normals`, `texcoords` and `colors` by vertex,
//! and `faces`. tests/validator/decoders.mjs compares it with the reference decoders.
//!
//! ```sh
//! cargo run --release --package darn-gltf-scan --example decoded -- SCAN...
//! ```

use std::error::Error;

use darn_gltf_scan::{Scan, ScanLimits};
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let scan = Scan::read(std::fs::read(&path)?, &ScanLimits::default());
        let scan = scan.map_err(|error| format!("{path}: {error}"))?;
        let part = scan.parts.first().ok_or("a scan without primitives")?;
        let positions =
            &scan.surface.positions[part.vertices.start as usize..part.vertices.end as usize];
        let positions: Vec<[f64; 3]> = positions.iter().map(|p| [p.x, p.y, p.z]).collect();
        let faces = &scan.surface.faces[part.faces.start as usize..part.faces.end as usize];
        let texcoords: Vec<&[[f32; 2]]> = part.texcoords.iter().map(|set| &set[..]).collect();
        let colors: Vec<&[[f32; 4]]> = part.colors.iter().map(|set| &set[..]).collect();
        let line = json!({
            "positions": positions,
            "faces": faces,
            "normals": part.normals.as_deref(),
            "texcoords": texcoords,
            "colors": colors,
        });
        println!("{line}");
    }
    Ok(())
}
