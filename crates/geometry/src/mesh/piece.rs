//! A part of the mesh as a mesh of its own: its loops, and whether it is a disk once its holes are closed.

use super::TriMesh;
use super::growth::Growth;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::pairing::{Paired, Twins};
use super::region::{BoundedMesh, Region};
use super::sparse::SparseValues;
use super::tube_cut::CutEdges;

/// A piece of the mesh, of any shape.
pub(super) struct Piece {
    /// The piece; its `outer` is empty.
    pub region: Region,
    /// Its loops that are neither the rim nor holes, each along its half-edges.
    pub rest: Vec<Vec<u32>>,
    /// Handles (genus).
    pub handles: usize,
}

impl Piece {
    /// The faces `inside` as a mesh of its own, cut along some edges.
    pub fn new(growth: &Growth, inside: &SparseValues<bool>, cut: &CutEdges, reach: f64) -> Piece {
        let BoundedMesh { mesh, topology, .. } = growth.whole;
        let faces: Vec<FaceId> = growth.faces().filter(|f| inside[f.index()]).collect();
        let to_local = |whole: HalfEdgeId| {
            let local = faces.binary_search(&whole.face()).ok()?;
            Some(FaceId(local as u32).half_edges()[whole.corner()])
        };
        let to_whole = |local: HalfEdgeId| faces[local.face().index()].half_edges()[local.corner()];
        let is_cut = |h: HalfEdgeId| {
            let (a, b) = (topology.origin(h), topology.target(h));
            !cut.is_empty() && cut.contains(&(a.min(b), a.max(b)))
        };
        let twins: Twins = faces
            .iter()
            .flat_map(|f| f.half_edges())
            .map(|h| {
                let twin = topology.twin(h).filter(|_| !is_cut(h));
                twin.and_then(to_local)
            })
            .collect();
        let (fans, count) = twins.corner_fans();
        let origin = |local: HalfEdgeId| VertexId(fans[local.face().index()][local.corner()]);
        let (mut rim, mut holes, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for cycle in twins.boundary_cycles(origin) {
            let loop_at = |&l: &HalfEdgeId| growth.loop_at(to_whole(l));
            let first = cycle.first().and_then(loop_at);
            let is_whole_loop =
                (cycle.iter()).all(|l| loop_at(l).map(|l| l.id) == first.map(|l| l.id));
            let vertices: Vec<u32> = cycle.iter().map(|&l| origin(l).0).collect();
            match first.filter(|_| is_whole_loop) {
                Some(l) if l.id == growth.rim.id => {
                    let start = growth.rim.half_edges.first();
                    let shift = cycle
                        .iter()
                        .position(|&l| Some(&to_whole(l)) == start)
                        .unwrap_or(0);
                    rim = vertices;
                    rim.rotate_left(shift);
                }
                Some(l) if l.is_surrounded() => holes.push(vertices),
                _ => rest.push(vertices),
            }
        }
        // χ = V − E + F = 2 − 2g − (loops); every edge has two half-edges or one and a boundary.
        let boundary = twins.boundary().count();
        let loop_count = holes.len() + rest.len() + usize::from(!rim.is_empty());
        let euler = count as i64 - (twins.half_edges() + boundary) as i64 / 2 + faces.len() as i64;
        let handles = ((2 - loop_count as i64 - euler) / 2).max(0) as usize;
        let mut vertices = vec![VertexId(0); count];
        for (l, &v) in (0u32..).map(HalfEdgeId).zip(fans.as_flattened()) {
            vertices[v as usize] = topology.origin(to_whole(l));
        }
        let positions = vertices.iter().map(|v| mesh.positions[v.index()]).collect();
        Piece {
            region: Region {
                mesh: TriMesh {
                    positions,
                    faces: fans,
                },
                vertices,
                faces,
                rim,
                holes,
                islands: Vec::new(),
                outer: Vec::new(),
                reach,
                wraps: false,
            },
            rest,
            handles,
        }
    }

    /// The piece, if it is a disk once its holes are closed.
    pub fn disk(mut self) -> Result<Region, Shape> {
        let shape = Shape {
            handles: self.handles,
            outer: self.rest.len(),
        };
        match self.rest.pop() {
            Some(outer)
                if self.rest.is_empty() && self.handles == 0 && !self.region.rim.is_empty() =>
            {
                Ok(Region {
                    outer,
                    ..self.region
                })
            }
            _ => Err(shape),
        }
    }
}

/// The topology of a piece that is no disk.
pub(super) struct Shape {
    /// Handles (genus).
    pub handles: usize,
    /// Loops that are not holes.
    pub outer: usize,
}
