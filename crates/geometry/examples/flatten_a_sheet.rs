//! Lays the cloth around a hole flat: a bent sheet with a hole → welded mesh → boundary loops → region → chart → grid.
//!
//! Run it with `cargo run -p darn-geometry --example flatten_a_sheet`.

use std::error::Error;

use darn_budget::Budget;
use darn_geometry::flatten::{FlattenLimits, flatten, raster};
use darn_geometry::grid::CELLS;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
use darn_geometry::mesh::region::{BoundedMesh, grow};
use darn_geometry::mesh::shapes::{jitter, sheet};
use darn_geometry::mesh::weld::weld;

/// Squares along one side of the sheet.
const SQUARES: usize = 40;
/// How far from the hole the region extends, scene units.
const REACH: f64 = 0.25;

fn main() -> Result<(), Box<dyn Error>> {
    // A square of side 1 with a round hole, bent around a cylinder of radius 0.5, with scanner noise of a tenth of an edge.
    let outside_hole = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
    let bent = |u: f64, v: f64| Vec3::new(0.5 * (2.0 * u).sin(), v, 0.5 * (2.0 * u).cos());
    let soup = jitter(&sheet(SQUARES, outside_hole, bent), 0.1 / SQUARES as f64, 7);

    // One vertex per position; then what bounds the surface.
    let welded = weld(&soup);
    let topology = welded.topology();
    let loops = boundary_loops(&welded.mesh, &topology);
    for rim in &loops {
        println!(
            "loop {}: {:?}, {} vertices, length {:.3}, turning {:+.2} rad",
            rim.id,
            rim.kind,
            rim.vertices.len(),
            rim.length,
            rim.turning
        );
    }

    // The cloth around the hole, as a mesh of its own, laid flat.
    let hole = loops.iter().find(|rim| rim.kind == LoopKind::Hole);
    let hole = hole.ok_or("the sheet has no hole")?;
    let region = grow(
        &BoundedMesh {
            mesh: &welded.mesh,
            topology: &topology,
            loops: &loops,
        },
        hole.id,
        REACH,
        Budget::unlimited(),
    )?;
    let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited())?;
    println!(
        "{} faces laid flat in {} rounds: mean stretch {:.4}, largest {:.4}",
        region.faces.len(),
        chart.rounds,
        chart.stretch_mean,
        chart.stretch_max
    );

    // The chart sampled on 64 × 64 cells: what an inpainting network is given.
    let grid = raster(&region.mesh, &chart);
    println!("{} of {CELLS} cells are known", grid.known_count());
    Ok(())
}
