//! Sets of garments, each with its holes: made from a seed, written to and read from a folder of GLB files with a JSON manifest.

use super::error::GarmentError;
use super::flatness::{FlatnessBand, area_error};
use super::garment::{Garment, GarmentKind, Opening, make};
use super::holes::{CutGarment, HoleWish, cut};
use darn_geometry::mesh::curvature::{face_areas, vertex_normals};
use darn_geometry::mesh::{TriMesh, Vec3, weld};
use darn_gltf_scan::export::{NewMesh, glb};
use darn_gltf_scan::{Scan, ScanLimits};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// Version of the generator: raised whenever the same seed gives other garments.
pub const VERSION: u32 = 1;
/// Name of the manifest.
const MANIFEST: &str = "manifest.json";

/// The holes of every garment.
const WISHES: [HoleWish; 5] = [
    wish(None, false),
    wish(Some(0.15), true),
    wish(Some(0.35), false),
    wish(Some(0.35), true),
    wish(Some(0.6), true),
];

const fn wish(share: Option<f64>, ragged: bool) -> HoleWish {
    HoleWish { share, ragged }
}

/// A garment of a set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GarmentRecord {
    /// `KIND-SEED`.
    pub name: String,
    /// Its kind.
    pub kind: GarmentKind,
    /// The seed it was made with.
    pub seed: u64,
    /// File of the intact garment.
    pub file: String,
    /// Vertices of its welded mesh.
    pub vertices: usize,
    /// Its triangles.
    pub faces: usize,
    /// Its boundary loops; none of them is a hole.
    pub openings: Vec<Opening>,
    /// Root mean square of (length ÷ rest length − 1) over the edges.
    pub strain: f64,
    /// Pairs of triangles that cut each other.
    pub crossings: usize,
    /// Its holes, each in a file of its own.
    pub holes: Vec<HoleRecord>,
    /// Holes that had no room.
    pub no_room: Vec<HoleWish>,
}

/// A hole of a garment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HoleRecord {
    /// `KIND-SEED-HOLE`.
    pub name: String,
    /// File of the garment with this hole.
    pub file: String,
    /// File of the cloth that was cut out; its vertices on the rim are those of the garment.
    pub truth: String,
    /// What was asked for.
    pub wish: HoleWish,
    /// Height ÷ width of the hole in the panels.
    pub shape: f64,
    /// Mean of the rim's vertices.
    pub centroid: [f64; 3],
    /// Area of the lost cloth, square metres.
    pub area: f64,
    /// Error of the area within the rim when it is laid flat (0.02 for 2 %); `None` where the cloth cannot be laid flat.
    pub flatness: Option<f64>,
    /// The band of this error.
    pub band: FlatnessBand,
}

/// A garment with its meshes.
#[derive(Debug, Clone)]
pub struct GarmentCase {
    /// What is known of it.
    pub record: GarmentRecord,
    /// The intact garment.
    pub intact: TriMesh,
    /// The meshes of `record.holes`, in their order.
    pub holes: Vec<HoleCase>,
}

/// The meshes of a hole.
#[derive(Debug, Clone)]
pub struct HoleCase {
    /// What remains of the garment.
    pub mesh: TriMesh,
    /// The cloth that was cut out.
    pub lost: TriMesh,
}

/// The contents of the manifest.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Manifest {
    version: u32,
    seed: u64,
    garments: Vec<GarmentRecord>,
}

/// Makes the garment of a kind and number in the set of a seed, with its holes.
///
/// # Errors
/// As [`make`].
pub fn case(seed: u64, kind: GarmentKind, number: u64) -> Result<GarmentCase, GarmentError> {
    let own = seed.wrapping_mul(1000).wrapping_add(number);
    let garment = make(kind, own)?;
    let name = format!("{}-{own}", kind.name());
    let mut record = GarmentRecord {
        file: format!("{name}.glb"),
        kind,
        seed: own,
        vertices: garment.mesh.positions.len(),
        faces: garment.mesh.faces.len(),
        openings: garment.openings.clone(),
        strain: garment.strain,
        crossings: garment.crossings,
        holes: Vec::new(),
        no_room: Vec::new(),
        name,
    };
    let mut holes = Vec::new();
    for (number, wish) in WISHES.into_iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(own);
        rng.set_stream(1000 + number as u64);
        match cut(&garment, wish, &mut rng) {
            Some(found) => {
                record
                    .holes
                    .push(hole_record(&garment, &record.name, &found));
                holes.push(HoleCase {
                    mesh: found.mesh,
                    lost: found.lost,
                });
            }
            None => record.no_room.push(wish),
        }
    }
    Ok(GarmentCase {
        record,
        intact: garment.mesh,
        holes,
    })
}

fn hole_record(garment: &Garment, of: &str, found: &CutGarment) -> HoleRecord {
    let size = match found.wish.share {
        Some(share) => format!("{:.0}", 100.0 * share),
        None => "moth".into(),
    };
    let edge = if found.wish.ragged { "ragged" } else { "round" };
    let name = format!("{of}-{size}-{edge}");
    // Only the mesh, not the seed: the same for a set that is read.
    let flatness = area_error(&found.mesh, &found.lost, &found.centroid);
    debug_assert!(found.mesh.faces.len() + found.lost.faces.len() == garment.mesh.faces.len());
    HoleRecord {
        file: format!("{name}.glb"),
        truth: format!("{name}-truth.glb"),
        wish: found.wish,
        shape: found.shape,
        centroid: found.centroid.into(),
        area: face_areas(&found.lost).iter().sum(),
        flatness,
        band: FlatnessBand::of(flatness),
        name,
    }
}

/// Writes a set.
///
/// # Errors
/// Files that cannot be written.
pub fn write(dir: &Path, seed: u64, cases: &[GarmentCase]) -> Result<(), GarmentError> {
    std::fs::create_dir_all(dir).map_err(|source| GarmentError::Io {
        path: dir.into(),
        source,
    })?;
    for case in cases {
        write_mesh(
            &dir.join(&case.record.file),
            &case.record.name,
            &case.intact,
        )?;
        for (hole, meshes) in case.record.holes.iter().zip(&case.holes) {
            write_mesh(&dir.join(&hole.file), &hole.name, &meshes.mesh)?;
            write_mesh(&dir.join(&hole.truth), "truth", &meshes.lost)?;
        }
    }
    let manifest = Manifest {
        version: VERSION,
        seed,
        garments: cases.iter().map(|c| c.record.clone()).collect(),
    };
    let path = dir.join(MANIFEST);
    let mut text = serde_json::to_vec_pretty(&manifest).map_err(|e| format_error(&path, &e))?;
    text.push(b'\n');
    std::fs::write(&path, text).map_err(|source| GarmentError::Io { path, source })
}

/// Reads a set that [`write()`] wrote.
///
/// # Errors
/// Files that cannot be read, or have another format.
pub fn read(dir: &Path) -> Result<Vec<GarmentCase>, GarmentError> {
    let path = dir.join(MANIFEST);
    let text = std::fs::read(&path).map_err(|source| GarmentError::Io {
        path: path.clone(),
        source,
    })?;
    let manifest: Manifest = serde_json::from_slice(&text).map_err(|e| format_error(&path, &e))?;
    let case = |record: GarmentRecord| {
        let hole = |hole: &HoleRecord| {
            Ok(HoleCase {
                mesh: read_mesh(&dir.join(&hole.file))?,
                lost: read_mesh(&dir.join(&hole.truth))?,
            })
        };
        Ok(GarmentCase {
            intact: read_mesh(&dir.join(&record.file))?,
            holes: record.holes.iter().map(hole).collect::<Result<_, _>>()?,
            record,
        })
    };
    manifest.garments.into_iter().map(case).collect()
}

/// The mesh of a file, welded.
///
/// # Errors
/// A file that cannot be read, or is no glTF file with triangles.
pub fn read_mesh(path: &Path) -> Result<TriMesh, GarmentError> {
    let bytes = std::fs::read(path).map_err(|source| GarmentError::Io {
        path: path.into(),
        source,
    })?;
    let scan = Scan::read(bytes, &ScanLimits::default()).map_err(|e| format_error(path, &e))?;
    Ok(Arc::unwrap_or_clone(weld::weld(&scan.surface).mesh))
}

/// A mesh as GLB, with smooth normals.
///
/// # Errors
/// A mesh too large for the format.
pub fn as_glb(name: &str, mesh: &TriMesh) -> Result<Vec<u8>, darn_gltf_scan::ScanError> {
    let triple = |p: &Vec3| [p.x as f32, p.y as f32, p.z as f32];
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(triple).collect();
    let normals: Vec<[f32; 3]> = vertex_normals(mesh).iter().map(triple).collect();
    glb(&NewMesh {
        name,
        positions: &positions,
        normals: &normals,
        texcoords: &[],
        faces: &mesh.faces,
    })
}

fn write_mesh(path: &Path, name: &str, mesh: &TriMesh) -> Result<(), GarmentError> {
    let bytes = as_glb(name, mesh).map_err(|e| format_error(path, &e))?;
    std::fs::write(path, bytes).map_err(|source| GarmentError::Io {
        path: path.into(),
        source,
    })
}

fn format_error(path: &Path, reason: &dyn std::fmt::Display) -> GarmentError {
    GarmentError::Format {
        path: path.into(),
        reason: reason.to_string(),
    }
}
