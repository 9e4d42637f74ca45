//! A fair patch and the cloth around it laid flat together: to place a texture in, and to keep apart what lies on both sides of a hole.

use darn_budget::{Budget, Exhausted};

use super::super::{Patch, quality};
use crate::flatten::{Chart, ClothFaces, FlattenError, FlattenLimits, UvSquare, flatten_cloth};
use crate::mesh::loops::boundary_loops;
use crate::mesh::region::Region;
use crate::mesh::topology::Topology;
use crate::mesh::{TriMesh, Vec2};

/// A patch and its region in one plane, scene units; faces are counter-clockwise. What encloses curvature is stretched.
#[derive(Debug, Clone, PartialEq)]
pub struct FairLayout {
    /// The region.
    pub region: Chart,
    /// One point per vertex of the patch.
    pub patch: Vec<Vec2>,
}

impl FairLayout {
    /// Lays out a patch with a region around its hole, whose rim has the same vertices in the same order. `None` where the two together are
    /// no disk once holes in the region are closed, or cannot be laid flat within the limits.
    ///
    /// `weight` is how much the patch's shape counts beside the region's. None of its triangles is turned over, however little it counts: so
    /// the rim does not cross itself.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(
        patch: &Patch,
        region: &Region,
        weight: f64,
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
        let cloth = ClothFaces {
            count: region.mesh.faces.len(),
            weight_of_others: weight,
        };
        let chart = match flatten_cloth(&whole, cloth, limits, budget) {
            Ok(chart) => chart,
            Err(FlattenError::Exhausted(exhausted)) => return Err(exhausted),
            Err(_) => return Ok(None),
        };
        let own = region.mesh.positions.len();
        let rim = patch.rim.iter().map(|v| chart.flat[*v as usize]);
        let flat = chart.flat[..own].to_vec();
        Ok(Some(FairLayout {
            patch: rim.chain(chart.flat[own..].iter().copied()).collect(),
            region: Chart {
                frame: UvSquare::tightest(&flat),
                flat,
                ..chart
            },
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
