//! A scan seen as cloth: welded, with its boundary loops, and how its triangles lead back to the scan's own.

use std::time::Instant;

use super::milliseconds;
use darn_contract::v1;
use darn_geometry::mesh::index::{FaceId, VertexId};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind, boundary_loops};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::{WeldedMesh, weld};
use darn_gltf_scan::Scan;

/// The welded surface of a scan and its loops.
pub struct Cloth {
    /// Welded mesh; its faces lead back to the scan's by `soup_face`.
    pub welded: WeldedMesh,
    /// Its topology.
    pub topology: Topology,
    /// Its boundary loops; a loop's id is its place here.
    pub loops: Vec<BoundaryLoop>,
    /// Milliseconds of welding and of finding loops.
    pub timings: v1::ScanTimings,
}

impl Cloth {
    /// Welds a scan and finds its loops.
    pub fn of(scan: &Scan) -> Cloth {
        let started = Instant::now();
        let welded = weld(&scan.surface);
        let weld = milliseconds(started);
        let started = Instant::now();
        let topology = welded.topology();
        let loops = boundary_loops(&welded.mesh, &topology);
        let timings = v1::ScanTimings {
            weld,
            loops: milliseconds(started),
            ..Default::default()
        };
        Cloth {
            welded,
            topology,
            loops,
            timings,
        }
    }

    /// Bytes of memory it holds, about.
    pub fn bytes(&self) -> usize {
        let mesh = &self.welded.mesh;
        let loops: usize = self.loops.iter().map(|l| 8 * l.vertices.len()).sum();
        // A position and the topology's entry for a vertex; corners, twins and origin for a face.
        (24 + 8) * mesh.positions.len() + (12 + 16 + 4) * mesh.faces.len() + loops
    }

    /// The scan's part that a welded face belongs to, and its corners there.
    pub fn source(&self, scan: &Scan, face: FaceId) -> Option<(usize, [u32; 3])> {
        let own = *self.welded.soup_face.get(face.index())?;
        Some((
            scan.part_of_face(own)?,
            *scan.surface.faces.get(own as usize)?,
        ))
    }

    /// A loop as the API describes it.
    pub fn described(&self, rim: &BoundaryLoop, scan: &Scan) -> v1::Loop {
        let part = rim
            .half_edges
            .first()
            .and_then(|h| self.source(scan, h.face()))
            .map(|(part, _)| part);
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
                .unwrap_or_default()
                .to_owned(),
            component: rim.component,
        }
    }

    /// Whether the meshes a loop lies on are drawn here for the first time, all along it: a patch on a mesh shows at every node that
    /// draws it.
    pub fn on_first_instance(&self, scan: &Scan, rim: &BoundaryLoop) -> bool {
        let mut parts = rim.half_edges.iter().map(|h| self.source(scan, h.face()));
        parts.all(|part| part.is_none_or(|(part, _)| scan.parts[part].first_instance))
    }

    /// What a person should know about the scan as a whole.
    pub fn notes(&self, scan: &Scan) -> Vec<String> {
        let mut notes = Vec::new();
        if self.welded.dropped > 0 {
            notes.push(format!(
                "{} degenerate or duplicate triangle(s) were not looked at",
                self.welded.dropped
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

    /// Places where boundary loops touch in a point (bow-ties).
    fn touching(&self) -> usize {
        let place = |v: &VertexId| self.welded.mesh.positions[v.index()];
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
        LoopKind::Outer => v1::LoopKind::OuterBoundary,
        LoopKind::TubeEnd => v1::LoopKind::TubeEnd,
    }
}
