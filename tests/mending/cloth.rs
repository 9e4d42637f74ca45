//! Scans with holes for the tests, and a mended scan taken apart.

use std::sync::{Arc, OnceLock};

use darn_contract::Constraints;
use darn_contract::port::Mended;
use darn_geometry::mesh::curvature::{face_areas, vertex_normals};
use darn_geometry::mesh::index::FaceId;
use darn_geometry::mesh::loops::{BoundaryLoop, boundary_loops};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::weld::{WeldedMesh, weld};
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_gltf_scan::Scan;
use darn_gltf_scan::export::{NewMesh, glb};
use darn_lab::scarffolds::holed_scan::{HoleShape, HoledScan, holed_scan};
use darn_lab::scarffolds::sheets::{self, SimulatedSheet};
use darn_mend::{MendError, NetworkMender, mend};
use darn_net::engine::EngineOptions;
use darn_net::{Network, Networks};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The standard weights that ship with darn.
pub const WEIGHTS: &[u8] = include_bytes!("../../weights/standard.safetensors");

/// A hole in the middle, a quarter of the sheet wide.
pub const ROUND: HoleShape = HoleShape::Circle {
    centre: Vec2::new(0.5, 0.48),
    radius: 0.13,
};

/// A network on weights that ship with darn.
pub fn network(weights: &[u8]) -> Network {
    Network::load(weights, EngineOptions::default()).expect("the shipped weights load")
}

/// The mender, loaded once for all tests.
pub fn mender() -> &'static Arc<NetworkMender> {
    static MENDER: OnceLock<Arc<NetworkMender>> = OnceLock::new();
    MENDER.get_or_init(|| {
        Arc::new(NetworkMender::new(Networks::new(
            network(WEIGHTS),
            Vec::new(),
        )))
    })
}

/// Simulated sheets, made once for all tests.
pub fn sheet(index: usize) -> &'static SimulatedSheet {
    static SHEETS: OnceLock<Vec<SimulatedSheet>> = OnceLock::new();
    let make = || (0..3).map(|k| sheets::make(20, k).expect("a sheet").0);
    &SHEETS.get_or_init(|| make().collect())[index]
}

/// A sheet whose point (u, v) of the unit square lies at `place(u, v)`.
pub fn laid(place: impl Fn(f32, f32) -> [f32; 3]) -> SimulatedSheet {
    let at = |k: usize| place((k % 51) as f32 / 50.0, (k / 51) as f32 / 50.0);
    SimulatedSheet {
        positions: (0..51 * 51).map(at).collect(),
    }
}

/// A sheet as a scan of about 45² vertices with a hole.
pub fn holed(sheet: &SimulatedSheet, hole: &HoleShape) -> HoledScan {
    holed_scan(sheet, 45, hole, &mut ChaCha8Rng::seed_from_u64(5))
}

/// A mesh as GLB; texture coordinates may be left empty.
pub fn packed(mesh: &TriMesh, texcoords: &[[f32; 2]]) -> Vec<u8> {
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.cast().into()).collect();
    let normals = vertex_normals(mesh);
    let normals: Vec<[f32; 3]> = normals.iter().map(|n| n.cast().into()).collect();
    let fresh = NewMesh {
        name: "scarf",
        positions: &positions,
        normals: &normals,
        texcoords,
        faces: &mesh.faces,
    };
    glb(&fresh).expect("a small file")
}

pub fn read(bytes: &[u8]) -> Scan {
    Scan::read(bytes.to_vec(), &darn_gltf_scan::ScanLimits::default()).expect("a readable scan")
}

pub fn mended(bytes: &[u8], constraints: &Constraints) -> Result<Mended, MendError> {
    mend(&read(bytes), constraints, mender())
}

/// A mended scan, welded, and the indices of its reconstructed faces.
pub struct MendedScan {
    pub scan: Scan,
    pub welded: WeldedMesh,
    pub topology: Topology,
    pub loops: Vec<BoundaryLoop>,
    pub patch: Vec<usize>,
}

impl MendedScan {
    pub fn of(bytes: &[u8]) -> MendedScan {
        let scan = read(bytes);
        let welded = weld(&scan.surface);
        let topology = Topology::new(&welded.mesh);
        let loops = boundary_loops(&welded.mesh, &topology);
        let new = |f: &usize| {
            let part = (welded.soup_faces.of(FaceId(*f as u32)))
                .and_then(|own| scan.part_of_face(own))
                .expect("a part");
            scan.parts[part].reconstructed
        };
        let patch = (0..welded.mesh.faces.len()).filter(new).collect();
        MendedScan {
            scan,
            welded,
            topology,
            loops,
            patch,
        }
    }

    pub fn patch_area(&self) -> f64 {
        let areas = face_areas(&self.welded.mesh);
        self.patch.iter().map(|f| areas[*f]).sum()
    }

    /// Positions of the patch's vertices that are not on the rim.
    pub fn new_positions(&self) -> Vec<Vec3> {
        let mut scans = vec![false; self.welded.mesh.positions.len()];
        let faces = self.welded.mesh.faces.iter().enumerate();
        for (_, face) in faces.filter(|(f, _)| self.patch.binary_search(f).is_err()) {
            face.iter().for_each(|v| scans[*v as usize] = true);
        }
        let positions = self.welded.mesh.positions.iter().zip(&scans);
        positions.filter(|(_, s)| !**s).map(|(p, _)| *p).collect()
    }
}

pub fn area(mesh: &TriMesh) -> f64 {
    face_areas(mesh).iter().sum()
}
