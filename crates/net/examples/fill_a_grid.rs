//! Fills a hole in a bent sheet: `cargo run --release -p darn-net --example fill_a_grid -- weights/standard.safetensors`.

use std::error::Error;

use darn_geometry::grid::{CELLS, NormalGrid, SIDE, cell_centre};
use darn_net::engine::EngineOptions;
use darn_net::{Averaging, FillRequest, Network};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1);
    let path = path.ok_or("which weights file? e.g. weights/standard.safetensors")?;
    let network = Network::load(&std::fs::read(path)?, EngineOptions::default())?;

    let truth: Vec<[f32; 3]> = (0..CELLS).map(bent_sheet).collect();
    let known: Vec<bool> = (0..CELLS).map(|cell| !in_hole(cell)).collect();
    let grid = NormalGrid {
        positions: (truth.iter().zip(&known))
            .map(|(p, known)| if *known { *p } else { [0.0; 3] })
            .collect(),
        known: known.iter().map(|k| f32::from(u8::from(*k))).collect(),
        base: None,
    };
    let filled = network.fill(&FillRequest {
        grids: &[grid],
        up: None,
        averaging: Averaging::Flips,
    })?;

    let hole: Vec<usize> = (0..CELLS).filter(|cell| !known[*cell]).collect();
    let distances = hole
        .iter()
        .map(|&k| distance(filled[0].positions[k], truth[k]));
    // Neighbouring cells are 1/64 apart in the network's units.
    let mean = distances.sum::<f32>() / hole.len() as f32 * SIDE as f32;
    println!(
        "{} hole cells, on average {mean:.3} cells from the truth",
        hole.len()
    );
    Ok(())
}

/// The position of a cell on a cylinder of radius ½, in the network's units.
fn bent_sheet(cell: usize) -> [f32; 3] {
    let uv = cell_centre(cell) - cell_centre(CELLS / 2 + SIDE / 2);
    let angle = 2.0 * uv.x;
    [0.5 * angle.sin(), 0.5 - 0.5 * angle.cos(), uv.y].map(|x| x as f32)
}

/// A round hole, 20 cells wide.
fn in_hole(cell: usize) -> bool {
    let (i, j) = ((cell % SIDE) as f32, (cell / SIDE) as f32);
    (i - 30.0).hypot(j - 33.0) < 10.0
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let squares = (0..3).map(|axis| (a[axis] - b[axis]).powi(2));
    squares.sum::<f32>().sqrt()
}
