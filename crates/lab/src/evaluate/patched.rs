//! A filled grid after `patch`: the known cells become a mesh whose chart is the grid itself, the mesh is patched, and the patch is read at
//! the hole cells.

use darn_budget::Budget;
use darn_geometry::flatten::{Chart, UvSquare};
use darn_geometry::grid::{CELLS, Grid, cell_centre};
use darn_geometry::mesh::loops::boundary_loops;
use darn_geometry::mesh::region::{BoundedMesh, Region, grow};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_geometry::patch::{self, Patch, PatchError, PatchOptions, signed_area};
use darn_geometry::polygon::inside;

use super::metrics::faces;

/// The filled grid with every hole cell at its position on the patch. Hole cells that no patch covers keep the fill.
///
/// `grid` holds the known cells, `filled` one position per cell; `hole` marks the cells to be patched.
///
/// # Errors
/// See [`patch::build`].
pub(super) fn patched(
    grid: &Grid,
    hole: &[bool],
    filled: &[Vec3],
    options: &PatchOptions,
) -> Result<Vec<Vec3>, PatchError> {
    let mesh = TriMesh {
        positions: grid.positions.clone(),
        faces: faces(&grid.known),
    };
    let topology = Topology::new(&mesh);
    let loops = boundary_loops(&mesh, &topology);
    let whole = BoundedMesh {
        mesh: &mesh,
        topology: &topology,
        loops: &loops,
    };
    let mut answer = filled.to_vec();
    for rim in &loops {
        let polygon: Vec<Vec2> = rim
            .vertices
            .iter()
            .map(|v| cell_centre(v.index()))
            .collect();
        // Cloth lies left of its boundary loops, so the rim of a hole is clockwise in the chart.
        let own: Vec<usize> = if signed_area(&polygon) < 0.0 {
            (0..CELLS)
                .filter(|&k| hole[k] && inside(&polygon, cell_centre(k)))
                .collect()
        } else {
            Vec::new()
        };
        if own.is_empty() {
            continue;
        }
        let Ok(region) = grow(&whole, rim.id, f64::INFINITY, Budget::unlimited()) else {
            continue;
        };
        let chart = grid_chart(&region);
        let patch: Patch = patch::build(&region, &chart, filled, options)?;
        for cell in own {
            answer[cell] = patch.at(cell_centre(cell));
        }
    }
    Ok(answer)
}

/// The chart in which every cell is at its centre on the grid; uv and flat coordinates are the same.
fn grid_chart(region: &Region) -> Chart {
    let flat = region.vertices.iter().map(|v| cell_centre(v.index()));
    Chart {
        flat: flat.collect(),
        frame: UvSquare {
            origin: Vec2::zeros(),
            axis: Vec2::x(),
            side: 1.0,
        },
        stretch_mean: 1.0,
        stretch_max: 1.0,
        flipped: 0,
        rounds: 0,
    }
}
