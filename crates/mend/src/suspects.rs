//! What a mesher has probably sealed in a scan, each with a cut that takes it out.

use crate::error::MendError;
use crate::welded_scan::WeldedScan;
use darn_budget::Budget;
use darn_contract::{Cut, v1};
use darn_geometry::mesh::cut::{Prism, distance, faces_in_ball};
use darn_geometry::mesh::index::FaceId;
use darn_geometry::mesh::membranes::{Membrane, membranes};
use darn_geometry::mesh::{TriMesh, Vec3};

/// Most suspects that are listed; the largest ones.
const MOST: usize = 100;
/// A membrane is stretched when half of its faces are longer than this, in their heights.
const STRETCHED: f64 = 5.0;
/// A membrane is oversized when its edges are longer than this, in edges of the cloth around.
const OVERSIZED: f64 = 3.0;
/// A membrane is called flat when no vertex is farther from its mean plane than this share of its width.
const FLAT: f64 = 0.03;
/// How far a cut's polygon stays inside the membrane's rim, in edges of the cloth around.
const INSIDE: f64 = 0.2;

/// The membranes of a scan, largest first.
///
/// # Errors
/// `Exhausted`.
pub fn suspects(welded: &WeldedScan, budget: &Budget) -> Result<Vec<v1::Suspect>, MendError> {
    let mesh = &welded.surface.mesh;
    let found = membranes(mesh, &welded.topology, budget)?;
    let mut suspects = Vec::new();
    for membrane in found.iter().take(MOST) {
        suspects.push(v1::Suspect {
            reason: reason(membrane).to_owned(),
            detail: detail(membrane, mesh),
            area: membrane.area,
            centroid: membrane.centroid.iter().copied().collect(),
            faces: membrane.faces.len() as u32,
            cut: Some(cut(membrane, mesh, budget)?.into()),
        });
    }
    Ok(suspects)
}

fn reason(membrane: &Membrane) -> &'static str {
    if membrane.stretch > STRETCHED {
        "stretched"
    } else if membrane.edge > OVERSIZED * membrane.edge_around {
        "oversized"
    } else {
        "sparse"
    }
}

fn detail(membrane: &Membrane, mesh: &TriMesh) -> String {
    let ratio = membrane.edge / membrane.edge_around;
    let flat = if is_flat(membrane, mesh) {
        "flat, "
    } else {
        ""
    };
    let inner = match membrane.inner {
        0 => "spanned between the vertices of its rim alone".to_owned(),
        n => format!("with {n} vertices inside its rim"),
    };
    format!(
        "{flat}{inner}; its edges are {ratio:.1} times as long as those around it, and its triangles {:.1} times as long as high",
        membrane.stretch
    )
}

fn places(membrane: &Membrane, mesh: &TriMesh) -> Vec<Vec3> {
    let all = membrane.rim.iter().map(|v| mesh.positions[v.index()]);
    all.collect()
}

/// Largest distance of a membrane's vertices from the mean plane of its rim; infinite when the rim has none.
fn height(membrane: &Membrane, mesh: &TriMesh) -> f64 {
    let Some(plane) = Prism::new(&places(membrane, mesh), 0.0) else {
        return f64::INFINITY;
    };
    let corners = membrane.faces.iter().flat_map(|f| mesh.triangle(f.index()));
    corners.map(|p| plane.height(p).abs()).fold(0.0, f64::max)
}

fn is_flat(membrane: &Membrane, mesh: &TriMesh) -> bool {
    height(membrane, mesh) < FLAT * membrane.area.sqrt()
}

/// A cut that takes the membrane out, and as little else as possible.
fn cut(membrane: &Membrane, mesh: &TriMesh, budget: &Budget) -> Result<Cut, MendError> {
    let centroid = membrane.centroid;
    let radius = (membrane.faces.iter())
        .map(|f| distance(&mesh.triangle(f.index()), &centroid))
        .fold(0.0, f64::max);
    // More than the distance of the farthest face, which must be reached.
    let radius = radius * (1.0 + 1e-6) + 1e-3 * membrane.edge_around;
    let by_ball = faces_in_ball(mesh, centroid, radius, budget)?;
    let ball = Cut::Ball {
        center: centroid.into(),
        radius,
    };
    let inward = |p: &Vec3| {
        let to = centroid - p;
        p + to * (INSIDE * membrane.edge_around / to.norm().max(f64::MIN_POSITIVE)).min(1.0)
    };
    let corners: Vec<Vec3> = places(membrane, mesh).iter().map(inward).collect();
    let depth = height(membrane, mesh) + membrane.edge_around;
    let prism = Prism::new(&corners, depth).filter(|_| depth.is_finite());
    let Some(prism) = prism else {
        return Ok(ball);
    };
    let by_prism = prism.faces(mesh, budget)?;
    // Faces that are missed count more than faces taken too many.
    let fault = |taken: &[u32]| {
        let own = taken.iter().filter(|f| {
            let is_own = |m: &FaceId| m.0.cmp(f);
            membrane.faces.binary_search_by(is_own).is_ok()
        });
        let own = own.count();
        3 * (membrane.faces.len() - own) + (taken.len() - own)
    };
    if fault(&by_ball) <= fault(&by_prism) {
        return Ok(ball);
    }
    Ok(Cut::Prism {
        polygon: corners.iter().map(|p| (*p).into()).collect(),
        depth,
    })
}
