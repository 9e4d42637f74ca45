//! Islands: loose pieces of cloth that lie in a hole and belong to it.

use std::collections::HashSet;

use darn_budget::{Budget, Exhausted};

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId, LoopId, VertexId};
use super::loops::BoundaryLoop;
use super::region::{BoundedMesh, Region};

/// Nanoseconds of work a face of a loose piece.
const DISK_WORK: u64 = 200;
/// Nanoseconds of work a loop of the scan.
const LOOP_WORK: u64 = 5;

impl Region {
    /// The region with a piece of cloth that lies loose in its hole: a region of its own without a rim. Holes of the piece are others of the region.
    pub fn with_island(mut self, island: &Region) -> Region {
        let base = self.mesh.positions.len() as u32;
        self.mesh
            .positions
            .extend_from_slice(&island.mesh.positions);
        let faces = island.mesh.faces.iter().map(|f| f.map(|v| base + v));
        self.mesh.faces.extend(faces);
        self.vertices.extend_from_slice(&island.vertices);
        self.faces.extend_from_slice(&island.faces);
        let shifted = |line: &Vec<u32>| -> Vec<u32> { line.iter().map(|v| base + v).collect() };
        self.islands.push(shifted(&island.outer));
        self.holes.extend(island.holes.iter().map(shifted));
        self
    }
}

/// The whole component that an outer boundary bounds, when it is a disk once its holes are closed: a region without a rim.
///
/// # Errors
/// `Exhausted`.
pub fn loose_piece(
    whole: &BoundedMesh,
    boundary: LoopId,
    budget: &Budget,
) -> Result<Option<Region>, Exhausted> {
    let BoundedMesh {
        mesh,
        topology,
        loops,
    } = *whole;
    let Some(border) = loops.get(boundary.index()) else {
        return Ok(None);
    };
    // From the border inwards, so that small pieces of a large mesh cost little.
    let mut faces: Vec<FaceId> = border.half_edges.iter().map(|h| h.face()).collect();
    let mut met: HashSet<FaceId> = faces.iter().copied().collect();
    let mut next = 0;
    while next < faces.len() {
        budget.spend(DISK_WORK)?;
        let beside = faces[next].half_edges().map(|h| topology.twin(h));
        for f in beside.into_iter().flatten().map(HalfEdgeId::face) {
            if met.insert(f) {
                faces.push(f);
            }
        }
        next += 1;
    }
    let mut faces: Vec<FaceId> = met.into_iter().collect();
    faces.sort_unstable();
    let mut vertices: Vec<u32> = faces.iter().flat_map(|f| mesh.faces[f.index()]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    budget.spend(LOOP_WORK * loops.len() as u64)?;
    let others = loops.iter();
    let others = others.filter(|l| l.component == border.component && l.id != boundary);
    let own: Vec<&BoundaryLoop> = others.filter(|l| !l.vertices.is_empty()).collect();
    let mut on_boundary: Vec<VertexId> = (own.iter().chain([&border]))
        .flat_map(|l| l.vertices.iter().copied())
        .collect();
    let ends = on_boundary.len();
    on_boundary.sort_unstable();
    on_boundary.dedup();
    // χ of a disk is 1, less one for each hole; inner edges have two half-edges.
    let edges = (3 * faces.len() + ends) / 2;
    let is_disk = vertices.len() + faces.len() + own.len() == edges + 1;
    if !is_disk || on_boundary.len() != ends || own.iter().any(|l| !l.is_surrounded()) {
        return Ok(None);
    }
    let local = |v: u32| vertices.partition_point(|w| *w < v) as u32;
    let line = |l: &BoundaryLoop| -> Vec<u32> { l.vertices.iter().map(|v| local(v.0)).collect() };
    Ok(Some(Region {
        mesh: TriMesh {
            positions: vertices
                .iter()
                .map(|v| mesh.positions[*v as usize])
                .collect(),
            faces: faces
                .iter()
                .map(|f| mesh.faces[f.index()].map(local))
                .collect(),
        },
        faces,
        rim: Vec::new(),
        holes: own.iter().map(|l| line(l)).collect(),
        islands: Vec::new(),
        outer: line(border),
        reach: 0.0,
        wraps: false,
        vertices: vertices.into_iter().map(VertexId).collect(),
    }))
}
