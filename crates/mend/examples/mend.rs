//! Mends a scan and prints what was done to its holes: `cargo run --release -p darn-mend --example mend -- SCAN.glb
//! MENDED.glb`
//!
//! It runs in the repository's root, where `weights/standard.safetensors` lies.

use std::error::Error;

use darn_contract::Constraints;
use darn_gltf_scan::{Scan, ScanLimits};
use darn_mend::{NetworkMender, mend};
use darn_net::engine::EngineOptions;
use darn_net::{Network, Networks};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(input), Some(output)) = (arguments.next(), arguments.next()) else {
        return Err("give the path of a GLB or glTF, and the path of the mended one".into());
    };
    let weights = std::fs::read("weights/standard.safetensors")?;
    let network = Network::load(&weights, EngineOptions::default())?;
    let mender = NetworkMender::new(Networks::new(network, Vec::new()));

    let scan = Scan::read(std::fs::read(input)?, &ScanLimits::default())?;
    let mended = mend(&scan, &Constraints::default(), &mender)?;
    std::fs::write(output, &mended.bytes)?;

    for hole in &mended.report.holes {
        let patch = hole.patch.clone().unwrap_or_default();
        println!(
            "hole {}: rim of {} vertices, patch of {} faces, largest stretch {:.3}",
            hole.id, hole.vertices, patch.faces, patch.stretch_max
        );
        for note in &hole.notes {
            println!("  note: {note}");
        }
    }
    for skipped in &mended.report.skipped {
        println!("loop {} is left: {}", skipped.id, skipped.reason);
    }
    Ok(())
}
