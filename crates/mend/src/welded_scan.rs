//! A scan with its triangles welded and its boundary loops found; each welded triangle leads back to one of the scan's.

use std::time::Instant;

use darn_budget::{Budget, Exhausted};

use crate::timings::milliseconds;
use darn_contract::{excerpt, v1};
use darn_geometry::mesh::index::{FaceId, VertexId};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind, boundary_loops};
use darn_geometry::mesh::openings::Evidence;
use darn_geometry::mesh::region::BoundedMesh;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::{WeldedMesh, weld};
use darn_gltf_scan::Scan;

/// The welded surface of a scan and its loops.
pub struct WeldedScan {
    /// The welded mesh; `soup_face` leads from its faces back to the scan's.
    pub surface: WeldedMesh,
    /// Its topology.
    pub topology: Topology,
    /// Its boundary loops; a loop's id is its index here.
    pub loops: Vec<BoundaryLoop>,
    /// Milliseconds of welding and of finding the loops.
    pub timings: v1::ScanTimings,
}

/// Bytes of memory a face while a scan is welded and its loops are found.
const WELDING: usize = 150;
/// Nanoseconds of work a face in welding.
const WELD_WORK: u64 = 120;
/// Nanoseconds of work a face in finding the loops.
const LOOPS_WORK: u64 = 80;

/// A face of a scan.
#[derive(Debug, Clone, Copy)]
pub struct SourceFace {
    /// Index of the scan's part that it belongs to.
    pub part: usize,
    /// Its corners, as vertices of the scan.
    pub corners: [u32; 3],
}

impl WeldedScan {
    /// Welds a scan and finds its loops.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(scan: &Scan, budget: &Budget) -> Result<WeldedScan, Exhausted> {
        let started = Instant::now();
        let faces = scan.surface.faces.len();
        budget.hold(WELDING * faces)?;
        budget.spend_at_once(WELD_WORK * faces as u64)?;
        let surface = weld(&scan.surface);
        let weld = milliseconds(started);
        let started = Instant::now();
        budget.spend_at_once(LOOPS_WORK * faces as u64)?;
        let topology = surface.topology();
        let loops = boundary_loops(&surface.mesh, &topology);
        let timings = v1::ScanTimings {
            weld,
            loops: milliseconds(started),
            ..Default::default()
        };
        let welded = WeldedScan {
            surface,
            topology,
            loops,
            timings,
        };
        budget.release(WELDING * faces);
        budget.hold(welded.bytes())?;
        Ok(welded)
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        let mesh = &self.surface.mesh;
        let loops = self.loops.iter().map(|l| 8 * l.vertices.len() + 200);
        let loops: usize = loops.sum();
        // For a vertex its position and the topology's entry; for a face its corners, twins and origin.
        (24 + 8) * mesh.positions.len() + (12 + 16 + 4) * mesh.faces.len() + loops
    }

    /// The welded mesh with its borders.
    pub fn bounded(&self) -> BoundedMesh<'_> {
        BoundedMesh {
            mesh: &self.surface.mesh,
            topology: &self.topology,
            loops: &self.loops,
        }
    }

    /// The scan's face that a welded face was made of.
    pub fn source(&self, scan: &Scan, face: FaceId) -> Option<SourceFace> {
        let own = *self.surface.soup_face.get(face.index())?;
        Some(SourceFace {
            part: scan.part_of_face(own)?,
            corners: *scan.surface.faces.get(own as usize)?,
        })
    }

    /// A loop in the contract's words.
    pub fn loop_report(&self, rim: &BoundaryLoop, scan: &Scan) -> v1::Loop {
        let part = rim
            .half_edges
            .first()
            .and_then(|h| self.source(scan, h.face()))
            .map(|source| source.part);
        v1::Loop {
            id: rim.id.0,
            kind: kind(rim.kind) as i32,
            length: rim.length,
            vertices: rim.vertices.len() as u32,
            centroid: rim.centroid.iter().copied().collect(),
            area: (rim.kind != LoopKind::TubeEnd).then_some(rim.area),
            turning: rim.turning,
            mesh: part
                .and_then(|p| scan.mesh_name(p))
                .map(|name| excerpt(name).into_owned())
                .unwrap_or_default(),
            component: rim.component,
            diameter: rim.diameter,
            confidence: rim.confidence,
            evidence: rim.evidence.iter().map(evidence).collect(),
        }
    }

    /// Whether every mesh that a loop lies on is drawn here by the first of its nodes. A patch on a mesh shows at every
    /// node that draws the mesh.
    pub fn on_first_instance(&self, scan: &Scan, rim: &BoundaryLoop) -> bool {
        let mut sources = rim.half_edges.iter().map(|h| self.source(scan, h.face()));
        sources.all(|s| s.is_none_or(|s| scan.parts[s.part].first_instance))
    }

    /// What a person should know about the scan as a whole.
    pub fn notes(&self, scan: &Scan) -> Vec<String> {
        let mut notes = Vec::new();
        if self.surface.dropped > 0 {
            notes.push(format!(
                "{} degenerate or duplicate triangle(s) were not looked at",
                self.surface.dropped
            ));
        }
        if !self.topology.non_manifold.is_empty() {
            notes.push(format!(
                "{} triangle side(s) lie on edges where more than two triangles meet, or two that face opposite ways; \
                 the cloth was taken to end there",
                self.topology.non_manifold.len()
            ));
        }
        let touching = self.touching();
        if touching > 0 {
            notes.push(format!(
                "boundary loops touch themselves or each other at {touching} point(s); where a hole touches the outer boundary \
                 it is part of it and stays open"
            ));
        }
        if scan.parts.iter().any(|p| p.shared) {
            notes.push(
                "a mesh is drawn by several nodes; a patch on it shows at each of them".to_owned(),
            );
        }
        if scan.posed_by_morph_targets() {
            notes.push(
                "morph targets move the scan by default; it was mended as it lies without them, and the new cloth does not move with them"
                    .to_owned(),
            );
        }
        notes
    }

    /// Number of points in which boundary loops touch (bow-ties).
    fn touching(&self) -> usize {
        let place = |v: &VertexId| self.surface.mesh.positions[v.index()];
        let ends = self.loops.iter().flat_map(|l| &l.vertices).map(place);
        let mut places: Vec<[u64; 3]> = ends.map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
        places.sort_unstable();
        let mut shared: Vec<[u64; 3]> = (places.windows(2))
            .filter(|w| w[0] == w[1])
            .map(|w| w[0])
            .collect();
        shared.dedup();
        shared.len()
    }
}

/// A loop's kind in the contract's words.
pub fn kind(kind: LoopKind) -> v1::LoopKind {
    match kind {
        LoopKind::Hole => v1::LoopKind::Hole,
        LoopKind::Opening => v1::LoopKind::Opening,
        LoopKind::Outer => v1::LoopKind::OuterBoundary,
        LoopKind::TubeEnd => v1::LoopKind::TubeEnd,
    }
}

fn evidence(evidence: &Evidence) -> v1::Evidence {
    v1::Evidence {
        code: evidence.kind.code().to_owned(),
        value: evidence.value,
        weight: evidence.weight,
        reason: evidence.reason(),
    }
}
