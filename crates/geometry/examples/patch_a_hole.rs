//! Patches the round hole of a flat sheet: `cargo run -p darn-geometry --example patch_a_hole`.

use std::error::Error;

use darn_budget::Budget;
use darn_geometry::flatten::{FlattenLimits, flatten, raster};
use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
use darn_geometry::mesh::region::{BoundedMesh, grow};
use darn_geometry::mesh::shapes::holed_sheet;
use darn_geometry::mesh::weld::weld;
use darn_geometry::patch::quality::measure;
use darn_geometry::patch::{PatchOptions, build};
use darn_geometry::smooth::{Smooth, smooth};

/// Reach of the region around the hole, scene units; the sheet has side 1, its hole radius 0.2.
const REACH: f64 = 0.25;

fn main() -> Result<(), Box<dyn Error>> {
    // 1. The hole: a boundary loop of the welded mesh, and the region around it.
    let welded = weld(&holed_sheet(40, 0.2));
    let topology = welded.topology();
    let loops = boundary_loops(&welded.mesh, &topology);
    let hole = loops.iter().find(|l| l.kind == LoopKind::Hole);
    let hole = hole.ok_or("the sheet has no hole")?.id;
    let region = grow(
        &BoundedMesh {
            mesh: &welded.mesh,
            topology: &topology,
            loops: &loops,
        },
        hole,
        REACH,
        Budget::unlimited(),
    )?;

    // 2. The chart of the region, sampled on a grid.
    let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited())?;
    let grid = raster(&region.mesh, &chart);

    // 3. Positions for the unknown cells. A network fills the grid here in the service.
    let unknown: Vec<bool> = grid.known.iter().map(|known| !known).collect();
    let filled = smooth(&grid.positions, &grid.known, &unknown, Smooth::TautPlate, 1);
    let filled = filled.ok_or("the known cells do not determine the fill")?;

    // 4. The patch, and its quality.
    let patch = build(&region, &chart, &filled, &PatchOptions::default())?;
    let quality = measure(&patch, &region);
    println!("rim vertices       {}", patch.rim.len());
    println!("faces              {}", patch.faces.len());
    println!("area               {:.4}", quality.area);
    println!("largest stretch    {:.4}", quality.stretch_max);
    println!("gap at the seam    {:e}", quality.seam_gap);
    println!("self-intersections {}", quality.self_intersections);
    Ok(())
}
