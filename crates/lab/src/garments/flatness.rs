//! How far the cloth around a hole is from lying flat: the area within the rim when it is laid flat, against the area of the lost cloth.

use darn_budget::Budget;
use darn_geometry::flatten::{self, FlattenLimits};
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::loops::{BoundaryLoop, boundary_loops};
use darn_geometry::mesh::region::{BoundedMesh, grow};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::panel::shoelace;

/// Bands of the error of the laid-flat rim's area.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum FlatnessBand {
    /// Below 2 %.
    #[serde(rename = "0-2")]
    Flat,
    /// 2 to 5 %.
    #[serde(rename = "2-5")]
    Bent,
    /// 5 to 10 %.
    #[serde(rename = "5-10")]
    Shaped,
    /// Above 10 %, or nothing lays it flat.
    #[serde(rename = ">10")]
    Round,
}

impl FlatnessBand {
    /// All bands, the flattest first.
    pub const ALL: [FlatnessBand; 4] = [Self::Flat, Self::Bent, Self::Shaped, Self::Round];

    /// The band of an error (0.02 for 2 %); `None` stands for cloth that cannot be laid flat.
    pub fn of(error: Option<f64>) -> Self {
        match error {
            Some(e) if e < 0.02 => Self::Flat,
            Some(e) if e < 0.05 => Self::Bent,
            Some(e) if e < 0.1 => Self::Shaped,
            _ => Self::Round,
        }
    }

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat => "0–2 %",
            Self::Bent => "2–5 %",
            Self::Shaped => "5–10 %",
            Self::Round => "> 10 %",
        }
    }
}

/// The boundary loop of a cut garment that is nearest to the rim's centroid.
pub(crate) fn rim_at<'a>(
    loops: &'a [BoundaryLoop],
    mesh: &TriMesh,
    centroid: &Vec3,
) -> Option<&'a BoundaryLoop> {
    let mean = |l: &BoundaryLoop| {
        let sum: Vec3 = l.vertices.iter().map(|v| mesh.positions[v.index()]).sum();
        sum / l.vertices.len().max(1) as f64
    };
    let off = |l: &BoundaryLoop| (mean(l) - centroid).norm();
    loops.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// |area within the rim laid flat ÷ area of the lost cloth − 1|; `None` where the cloth around cannot be laid flat.
///
/// The cloth is laid flat to half the hole's diameter around it, as a mender does.
pub(super) fn area_error(mesh: &TriMesh, lost: &TriMesh, centroid: &Vec3) -> Option<f64> {
    let topology = Topology::new(mesh);
    let loops = boundary_loops(mesh, &topology);
    let rim = rim_at(&loops, mesh, centroid)?;
    let whole = BoundedMesh {
        mesh,
        topology: &topology,
        loops: &loops,
    };
    let area: f64 = face_areas(lost).iter().sum();
    let reach = (area / std::f64::consts::PI).sqrt();
    let region = grow(&whole, rim.id, reach, Budget::unlimited()).ok()?;
    let chart = flatten::flatten(&region, &FlattenLimits::default(), Budget::unlimited()).ok()?;
    let polygon: Vec<Vec2> = region.rim.iter().map(|v| chart.flat[*v as usize]).collect();
    Some((shoelace(&polygon).abs() / area - 1.0).abs())
}
