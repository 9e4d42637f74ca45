//! A scan with its triangles welded and its boundary loops found; each welded triangle leads back to one of the scan's.

use std::time::Instant;

use darn_budget::{Budget, Exhausted};

use crate::cut::CutLoops;
use crate::timings::milliseconds;
use darn_contract::{excerpt, v1};
use darn_geometry::mesh::blocks::FaceBlocks;
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::index::FaceId;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind, boundary_loops};
use darn_geometry::mesh::openings::Evidence;
use darn_geometry::mesh::region::BoundedMesh;
use darn_geometry::mesh::skins::{SecondSkin, on_patches, second_skins};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::{WeldedMesh, weld_within};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::Scan;

/// The welded surface of a scan and its loops.
pub struct WeldedScan {
    /// The welded mesh; `soup_faces` lead from its faces back to the scan's.
    pub surface: WeldedMesh,
    /// Its topology.
    pub topology: Topology,
    /// The boxes of blocks of its faces.
    pub blocks: FaceBlocks,
    /// Its boundary loops; a loop's id is its index here. One without vertices was there before the request's cuts.
    pub loops: Vec<BoundaryLoop>,
    /// Per loop whether it is a hole of a second skin, which is not filled again.
    pub second_skins: Vec<Option<SecondSkin>>,
    /// What the request's cuts did.
    pub cuts: CutLoops,
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
    /// The scan's vertices at the corners of the welded face; one of a split face may belong to another part.
    pub corners: [u32; 3],
}

impl WeldedScan {
    /// Welds a scan and finds its loops.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of(scan: &Scan, budget: &Budget) -> Result<WeldedScan, Exhausted> {
        Self::of_surface(scan, &scan.surface, budget)
    }

    /// Welds a scan's surface with further triangles behind it, which belong to no face of the scan.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn of_surface(
        scan: &Scan,
        surface: &TriMesh,
        budget: &Budget,
    ) -> Result<WeldedScan, Exhausted> {
        let started = Instant::now();
        let faces = surface.faces.len();
        budget.hold(WELDING * faces)?;
        budget.spend_at_once(WELD_WORK * faces as u64)?;
        let surface = weld_within(surface, &|v| scan.precision(v), budget)?;
        let weld = milliseconds(started);
        let started = Instant::now();
        budget.spend_at_once(LOOPS_WORK * faces as u64)?;
        let (topology, blocks) =
            rayon::join(|| surface.topology(), || FaceBlocks::new(&surface.mesh));
        let loops = boundary_loops(&surface.mesh, &topology);
        let mut welded = WeldedScan {
            blocks,
            surface,
            topology,
            loops: Vec::new(),
            second_skins: Vec::new(),
            cuts: CutLoops::default(),
            timings: v1::ScanTimings::default(),
        };
        welded.with_loops(scan, loops, budget)?;
        welded.timings = v1::ScanTimings {
            weld,
            loops: milliseconds(started),
            ..Default::default()
        };
        budget.release(WELDING * faces);
        budget.hold(welded.bytes())?;
        Ok(welded)
    }

    /// Takes these loops in the order of their ids, and finds which are holes of second skins.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn with_loops(
        &mut self,
        scan: &Scan,
        loops: Vec<BoundaryLoop>,
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        let mesh = &self.surface.mesh;
        self.second_skins = second_skins(mesh, &loops, budget)?;
        let patches = scan.parts.iter().filter(|part| part.reconstructed);
        let patched = patches.flat_map(|part| part.vertices.clone());
        let at = |v: u32| scan.surface.positions[v as usize].into();
        let patched: Vec<[f64; 3]> = patched.map(at).collect();
        if !patched.is_empty() {
            let holes = loops.iter().filter(|l| {
                l.kind == LoopKind::Hole
                    && self.second_skins[l.id.index()].is_none()
                    && !self.is_in_patch(scan, l)
            });
            for hole in on_patches(mesh, holes, patched, budget)? {
                self.second_skins[hole.id.index()] = Some(SecondSkin::Patched);
            }
        }
        self.loops = loops;
        Ok(())
    }

    /// Whether a loop runs along the triangles of a patch.
    fn is_in_patch(&self, scan: &Scan, rim: &BoundaryLoop) -> bool {
        let mut sources = rim.half_edges.iter().map(|h| self.source(scan, h.face()));
        sources.any(|s| s.is_some_and(|s| scan.parts[s.part].reconstructed))
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes(&self) -> usize {
        let mesh = &self.surface.mesh;
        let loops = self.loops.iter().map(|l| 8 * l.vertices.len() + 200);
        let loops: usize = loops.sum();
        // For a vertex its position and a half-edge; for a face its corners and twins, in a scan of several pieces the piece's number.
        let pieces = if self.topology.components > 1 { 4 } else { 0 };
        let faces = (12 + 12 + pieces) * mesh.faces.len() + self.surface.soup_faces.bytes();
        (24 + 4) * mesh.positions.len() + faces + loops
    }

    /// The welded mesh with its borders.
    pub fn bounded(&self) -> BoundedMesh<'_> {
        BoundedMesh {
            mesh: &self.surface.mesh,
            topology: &self.topology,
            loops: &self.loops,
        }
    }

    /// Area of the component that a loop bounds, scene units squared.
    pub fn piece_area(&self, rim: u32) -> f64 {
        let Some(rim) = self.loops.get(rim as usize) else {
            return 0.0;
        };
        let areas = face_areas(&self.surface.mesh);
        let own = (0u32..).map(FaceId).zip(&areas);
        own.filter(|(face, _)| self.topology.component(*face) == rim.component)
            .map(|(_, area)| area)
            .sum()
    }

    /// The place of a loop's vertex, counted on around the loop, scene space.
    pub fn rim_position(&self, rim: &BoundaryLoop, k: usize) -> Vec3 {
        self.surface.mesh.positions[rim.vertices[k % rim.vertices.len()].index()]
    }

    /// The unit direction out of the cloth at an edge of a loop, in the plane of the triangle there; zero where that has no area.
    pub fn outward(&self, rim: &BoundaryLoop, k: usize) -> Vec3 {
        let along = self.rim_position(rim, k + 1) - self.rim_position(rim, k);
        let face = rim.half_edges[k % rim.half_edges.len()].face();
        let [a, b, c] = self.surface.mesh.triangle(face.index());
        let outward = along.cross(&(b - a).cross(&(c - a)));
        outward.try_normalize(f64::MIN_POSITIVE).unwrap_or_default()
    }

    /// The scan's face that a welded face was made of; none for those behind its surface.
    pub fn source(&self, scan: &Scan, face: FaceId) -> Option<SourceFace> {
        let own = self.surface.soup_faces.of(face)?;
        Some(SourceFace {
            part: scan.part_of_face(own)?,
            corners: self.surface.soup_corners(&scan.surface, face)?,
        })
    }

    /// Whether a loop is a hole of a second skin.
    pub fn is_second_skin(&self, rim: &BoundaryLoop) -> bool {
        self.second_skins
            .get(rim.id.index())
            .is_some_and(Option::is_some)
    }

    /// Whether a second skin that shows the other side has a copy of this hole.
    pub fn has_back(&self, hole: u32) -> bool {
        let mut skins = self.second_skins.iter().flatten();
        skins
            .any(|skin| matches!(skin, SecondSkin::Copy { first, is_back: true } if *first == hole))
    }

    /// The loop with an id, or why there is none.
    pub fn loop_with_id(&self, id: u32) -> Result<&BoundaryLoop, String> {
        self.loops.get(id as usize).ok_or_else(|| {
            format!(
                "there is no loop {id}; the scan has {} boundary loop(s), numbered from 0",
                self.loops.len()
            )
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
