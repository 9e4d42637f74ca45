//! Mends generated scans and garments end to end, like requests: the mesh is written as GLB, read, mended and read again.

use darn_budget::Budget;
use darn_contract::port::HolesQuery;
use darn_contract::v1::LoopKind;
use darn_contract::{Constraints, HoleSelector};
use darn_geometry::mesh::{TriMesh, Vec3, weld};
use darn_gltf_scan::{Scan, ScanLimits};
use darn_lab::evaluate::{EvaluateError, ListedLoop};
use darn_lab::garments::set::as_glb;
use darn_lab::scarffolds::holed_scan::HoledScan;
use darn_mend::NetworkMender;
use std::error::Error;
use std::sync::Arc;

type BoxedError = Box<dyn Error + Send + Sync>;

/// The mended mesh, welded. The up direction is that of sheets, +z.
pub fn mended(scan: &HoledScan, mender: &NetworkMender) -> Result<TriMesh, EvaluateError> {
    through_glb(&scan.mesh, Vec::new(), [0.0, 0.0, 1.0], mender).map_err(EvaluateError::Mender)
}

/// The mesh of a garment with the hole at a vertex of its rim mended, welded. +y is up.
pub fn mended_at(
    mesh: &TriMesh,
    rim: Vec3,
    mender: &NetworkMender,
) -> Result<TriMesh, EvaluateError> {
    let hole = vec![HoleSelector::Near(rim.into())];
    through_glb(mesh, hole, [0.0, 1.0, 0.0], mender).map_err(EvaluateError::Mender)
}

/// The loops of a mesh as `POST /holes` lists them.
pub fn listed(mesh: &TriMesh) -> Result<Vec<ListedLoop>, EvaluateError> {
    let list = || -> Result<_, BoxedError> {
        let scan = Scan::read(as_glb("scan", mesh)?, &ScanLimits::default())?;
        Ok(darn_mend::find_holes(
            &scan,
            HolesQuery::default(),
            Budget::unlimited(),
        )?)
    };
    let report = list().map_err(EvaluateError::Mender)?;
    let listed = |l: &darn_contract::v1::Loop| ListedLoop {
        id: l.id,
        filled_by_default: l.kind() == LoopKind::Hole,
        centroid: Vec3::from_iterator(l.centroid.iter().copied().chain([0.0; 3]).take(3)),
        length: l.length,
        turning: l.turning,
    };
    Ok(report.loops.iter().map(listed).collect())
}

fn through_glb(
    mesh: &TriMesh,
    holes: Vec<HoleSelector>,
    up: [f64; 3],
    mender: &NetworkMender,
) -> Result<TriMesh, BoxedError> {
    let request = Scan::read(as_glb("scan", mesh)?, &ScanLimits::default())?;
    let architecture = mender.networks.default().card().architecture;
    let constraints = Constraints {
        up: (architecture.frame.knows_up()).then_some(up),
        holes,
        ..Constraints::default()
    };
    let mended = darn_mend::mend(&request, &constraints, mender)?;
    let scan = Scan::read(mended.bytes, &ScanLimits::default())?;
    Ok(Arc::unwrap_or_clone(weld::weld(&scan.surface).mesh))
}
