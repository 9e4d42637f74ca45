//! Mends a generated scan end to end, like a request: the mesh is written as GLB, read, mended and read again.

use darn_contract::Constraints;
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::{TriMesh, Vec3, weld};
use darn_gltf_scan::export::{NewMesh, glb};
use darn_gltf_scan::{Scan, ScanLimits};
use darn_lab::evaluate::EvaluateError;
use darn_lab::scarffolds::holed_scan::HoledScan;
use darn_mend::NetworkMender;
use std::error::Error;

/// The mended mesh, welded.
pub fn mended(scan: &HoledScan, mender: &NetworkMender) -> Result<TriMesh, EvaluateError> {
    through_glb(scan, mender).map_err(EvaluateError::Mender)
}

fn through_glb(
    scan: &HoledScan,
    mender: &NetworkMender,
) -> Result<TriMesh, Box<dyn Error + Send + Sync>> {
    let triple = |p: &Vec3| [p.x as f32, p.y as f32, p.z as f32];
    let positions: Vec<[f32; 3]> = scan.mesh.positions.iter().map(triple).collect();
    let normals: Vec<[f32; 3]> = vertex_normals(&scan.mesh).iter().map(triple).collect();
    let bytes = glb(&NewMesh {
        name: "scan",
        positions: &positions,
        normals: &normals,
        texcoords: &[],
        faces: &scan.mesh.faces,
    })?;
    let request = Scan::read(bytes, &ScanLimits::default())?;
    // The up direction of sheets is +z.
    let architecture = mender.networks.default().card().architecture;
    let constraints = Constraints {
        up: (architecture.frame.knows_up()).then_some([0.0, 0.0, 1.0]),
        ..Constraints::default()
    };
    let mended = darn_mend::mend(&request, &constraints, mender)?;
    let scan = Scan::read(mended.bytes, &ScanLimits::default())?;
    Ok(weld::weld(&scan.surface).mesh)
}
