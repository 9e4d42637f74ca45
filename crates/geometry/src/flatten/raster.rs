//! From a chart to its grid: a cell whose centre lies on a face gets the position there (barycentric), all other
//! cells stay unknown.

use super::chart::Chart;
use crate::grid::{CELLS, Grid, SIDE, cell_index};
use crate::mesh::{TriMesh, Vec2};

/// Samples the positions of a mesh, scene space, at the centres of the cells that its faces cover in `chart`.
///
/// Where faces overlap in the chart, the face of lower index counts.
pub fn raster(mesh: &TriMesh, chart: &Chart) -> Grid {
    let mut grid = Grid::unknown();
    cover(mesh, chart, |cell, face, weights| {
        if !grid.known[cell] {
            let corners = mesh.faces[face].map(|v| mesh.positions[v as usize]);
            grid.positions[cell] =
                corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
            grid.known[cell] = true;
        }
    });
    grid
}

/// Per cell the face that its centre lies on; where faces overlap in the chart, the one of lowest index.
pub(crate) fn cell_faces(mesh: &TriMesh, chart: &Chart) -> Vec<Option<usize>> {
    let mut faces = vec![None; CELLS];
    cover(mesh, chart, |cell, face, _| {
        faces[cell].get_or_insert(face);
    });
    faces
}

/// Calls `covers` with every cell whose centre lies on a face, that face, in order of index, and the centre's barycentric weights.
fn cover(mesh: &TriMesh, chart: &Chart, mut covers: impl FnMut(usize, usize, [f64; 3])) {
    for (index, face) in mesh.faces.iter().enumerate() {
        let uv = face.map(|v| chart.uv(v) * SIDE as f64 - Vec2::repeat(0.5));
        let area = (uv[1] - uv[0]).perp(&(uv[2] - uv[0]));
        if area <= 0.0 {
            continue;
        }
        let low = uv[0].inf(&uv[1]).inf(&uv[2]);
        let high = uv[0].sup(&uv[1]).sup(&uv[2]);
        for j in cells(low.y, high.y) {
            for i in cells(low.x, high.x) {
                let p = Vec2::new(i as f64, j as f64);
                let weights =
                    [1, 2, 0].map(|k: usize| (uv[(k + 1) % 3] - uv[k]).perp(&(p - uv[k])) / area);
                if weights.iter().all(|w| *w >= -1e-9) {
                    covers(cell_index(i, j), index, weights);
                }
            }
        }
    }
}

/// Cells along one axis whose centres lie between two cell coordinates.
fn cells(low: f64, high: f64) -> std::ops::Range<usize> {
    let first = low.ceil().max(0.0) as usize;
    let end = (high.floor() + 1.0).clamp(0.0, SIDE as f64) as usize;
    first..end.max(first)
}
