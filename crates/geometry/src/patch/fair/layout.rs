//! A fair patch and the cloth around it laid flat together, to place a texture in.

use darn_budget::{Budget, Exhausted};

use super::super::{Patch, quality};
use crate::flatten::{FlattenError, FlattenLimits, flatten};
use crate::mesh::loops::boundary_loops;
use crate::mesh::region::Region;
use crate::mesh::topology::Topology;
use crate::mesh::{TriMesh, Vec2};

/// A patch and its region in one plane, scene units; faces are counter-clockwise. What encloses curvature is stretched.
#[derive(Debug, Clone, PartialEq)]
pub struct FairLayout {
    /// One point per vertex of the region.
    pub region: Vec<Vec2>,
    /// One point per vertex of the patch.
    pub patch: Vec<Vec2>,
    /// Mean over edges of max(r, 1/r), r = flat length ÷ scene length.
    pub stretch_mean: f64,
}

impl FairLayout {
    /// Lays out a patch with a region around its hole, whose rim has the same vertices in the same order. `None` where the two together are
    /// no disk once holes in the region are closed, or cannot be laid flat within the limits.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(
        patch: &Patch,
        region: &Region,
        limits: &FlattenLimits,
        budget: &Budget,
    ) -> Result<Option<FairLayout>, Exhausted> {
        let rim: Vec<u32> = region.rim.iter().rev().copied().collect();
        if rim.len() != patch.rim.len() {
            return Ok(None);
        }
        let patch = Patch {
            rim,
            ..patch.clone()
        };
        let Some(whole) = disk(quality::joined(&patch, region), region.reach) else {
            return Ok(None);
        };
        let chart = match flatten(&whole, limits, budget) {
            Ok(chart) => chart,
            Err(FlattenError::Exhausted(exhausted)) => return Err(exhausted),
            Err(_) => return Ok(None),
        };
        let own = region.mesh.positions.len();
        let rim = patch.rim.iter().map(|v| chart.flat[*v as usize]);
        Ok(Some(FairLayout {
            patch: rim.chain(chart.flat[own..].iter().copied()).collect(),
            region: chart.flat[..own].to_vec(),
            stretch_mean: chart.stretch_mean,
        }))
    }
}

/// A mesh as a region without a rim, its longest loop outside; `None` when it is no disk once the others are closed.
fn disk(mesh: TriMesh, reach: f64) -> Option<Region> {
    let topology = Topology::new(&mesh);
    let mut loops = boundary_loops(&mesh, &topology);
    loops.sort_by(|a, b| b.length.total_cmp(&a.length).then(a.id.cmp(&b.id)));
    let boundary: usize = loops.iter().map(|l| l.half_edges.len()).sum();
    let edges = (3 * mesh.faces.len() + boundary) / 2;
    let euler = (mesh.positions.len() + mesh.faces.len()) as i64 - edges as i64;
    let is_disk = topology.components == 1
        && topology.non_manifold.is_empty()
        && euler + loops.len() as i64 == 2;
    let mut lines = (loops.iter()).map(|l| l.vertices.iter().map(|v| v.0).collect::<Vec<u32>>());
    let outer = lines.next().filter(|_| is_disk)?;
    let holes = lines.collect();
    Some(Region {
        mesh,
        vertices: Vec::new(),
        faces: Vec::new(),
        rim: Vec::new(),
        holes,
        islands: Vec::new(),
        outer,
        reach,
        wraps: false,
    })
}
