//! What is done without a texture of the patch's own.

use darn_budget::Budget;
use darn_geometry::flatten::{Chart, FlattenLimits, flatten};
use darn_geometry::grid::CELLS;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::boundary_loops;
use darn_geometry::mesh::region::{BoundedMesh, Region, grow};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::weld;
use darn_geometry::patch::attributes::{AttributedPatch, Columns, extend_attributes};
use darn_geometry::patch::{Patch, PatchOptions, plan};

use super::scan::TestScan;
use crate::continued::ContinuedPatch;

/// A way of giving the patch texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// darn's: every texture island at the rim is continued alone.
    Continue,
    /// As MeshLib does: new vertices have the mean of the coordinates around them, whatever the islands.
    Average,
}

/// Sweeps of averaging.
const SWEEPS: usize = 400;

/// The patch of a test scan with continued texture coordinates; without faces when the sheet could not be laid flat.
pub fn continued(scan: &TestScan, peer: Peer) -> ContinuedPatch {
    let welded = weld(&scan.mesh);
    let budget = Budget::unlimited();
    let topology = Topology::new(&welded.mesh);
    let loops = boundary_loops(&welded.mesh, &topology);
    let whole = BoundedMesh {
        mesh: &welded.mesh,
        topology: &topology,
        loops: &loops,
    };
    let hole = loops.iter().find(|l| l.is_surrounded());
    let region = hole.map(|hole| grow(&whole, hole.id, f64::INFINITY, budget));
    let Some(Ok(region)) = region else {
        return ContinuedPatch::default();
    };
    let options = PatchOptions::default();
    let Ok(chart) = flatten(&region, &FlattenLimits::default(), budget) else {
        return ContinuedPatch::default();
    };
    let Ok(plan) = plan(&region, &chart, &options) else {
        return ContinuedPatch::default();
    };
    let Ok(patch) = plan.patch(&chart, &vec![Vec3::zeros(); CELLS], &[], &options) else {
        return ContinuedPatch::default();
    };
    let corners: Vec<Option<[u32; 3]>> = (region.faces.iter())
        .map(|f| welded.soup_corners(&scan.mesh, *f))
        .collect();
    let mut any = vec![0; region.mesh.positions.len()];
    for (face, corners) in region.mesh.faces.iter().zip(corners.iter().flatten()) {
        (face.iter().zip(corners)).for_each(|(v, s)| any[*v as usize] = *s);
    }
    let values = |s: u32| scan.texcoords[s as usize].map(f64::from).to_vec();
    let attributed = match peer {
        Peer::Continue => {
            let columns = Columns {
                corners: &corners,
                any: &any,
                values: &values,
                width: 2,
                budget,
            };
            match extend_attributes(&plan.attribute_map(&chart), &patch, &region, &columns) {
                Ok(attributed) => attributed,
                Err(_) => return ContinuedPatch::default(),
            }
        }
        Peer::Average => averaged(&patch, &any, scan),
    };
    placed(&attributed, &patch, &region, &chart)
}

fn averaged(patch: &Patch, any: &[u32], scan: &TestScan) -> AttributedPatch {
    use darn_geometry::patch::attributes::Corner;
    let rim = patch.rim.len();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); patch.flat.len()];
    for face in &patch.faces {
        (0..3).for_each(|k| around[face[k] as usize].push(face[(k + 1) % 3]));
    }
    let of_rim = |k: usize| scan.texcoords[any[patch.rim[k] as usize] as usize].map(f64::from);
    let middle = (0..rim).fold([0.0; 2], |sum, k| {
        [0, 1].map(|d: usize| sum[d] + of_rim(k)[d] / rim as f64)
    });
    let mut at: Vec<[f64; 2]> = (0..patch.flat.len())
        .map(|v| if v < rim { of_rim(v) } else { middle })
        .collect();
    for _ in 0..SWEEPS {
        for v in rim..at.len() {
            let sum = around[v].iter().fold([0.0; 2], |sum, o| {
                [0, 1].map(|d: usize| sum[d] + at[*o as usize][d])
            });
            at[v] = sum.map(|x| x / around[v].len().max(1) as f64);
        }
    }
    let corner = |(vertex, values): (usize, &[f64; 2])| Corner {
        vertex: vertex as u32,
        scan: None,
        values: values.to_vec(),
    };
    AttributedPatch {
        corners: at.iter().enumerate().map(corner).collect(),
        faces: patch.faces.clone(),
    }
}

/// The attributed patch back from its chart to the sheet, by the rigid motion between them.
fn placed(
    attributed: &AttributedPatch,
    patch: &Patch,
    region: &Region,
    chart: &Chart,
) -> ContinuedPatch {
    let count = chart.flat.len() as f64;
    let sheet: Vec<[f64; 2]> = region.mesh.positions.iter().map(|p| [p.x, p.y]).collect();
    let mean = |of: &dyn Fn(usize) -> [f64; 2]| {
        (0..chart.flat.len()).fold([0.0; 2], |sum, v| {
            [sum[0] + of(v)[0] / count, sum[1] + of(v)[1] / count]
        })
    };
    let flat = |v: usize| [chart.flat[v].x, chart.flat[v].y];
    let (from, to) = (mean(&flat), mean(&|v| sheet[v]));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (v, place) in sheet.iter().enumerate() {
        let (a, b) = (
            [flat(v)[0] - from[0], flat(v)[1] - from[1]],
            [place[0] - to[0], place[1] - to[1]],
        );
        cos += a[0] * b[0] + a[1] * b[1];
        sin += a[0] * b[1] - a[1] * b[0];
    }
    let length = cos.hypot(sin);
    let (cos, sin) = (cos / length, sin / length);
    let moved = |vertex: u32| {
        let p = patch.flat[vertex as usize];
        let (x, y) = (p.x - from[0], p.y - from[1]);
        [to[0] + cos * x - sin * y, to[1] + sin * x + cos * y]
    };
    let texcoord = |c: u32| {
        let values = &attributed.corners[c as usize].values;
        [values[0] as f32, values[1] as f32]
    };
    ContinuedPatch {
        flat: attributed.corners.iter().map(|c| moved(c.vertex)).collect(),
        faces: attributed.faces.clone(),
        material_of: vec![0; attributed.faces.len()],
        texcoords: vec![attributed.faces.iter().map(|f| f.map(texcoord)).collect()],
        colours: Vec::new(),
    }
}
