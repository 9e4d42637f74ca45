//! The frame that a grid's positions are turned to before the network sees them.
//!
//! Cloth has no preferred direction in space, and the network need not learn all directions: the canonical frame turns the known cells
//! as close to the chart as one rotation can (orthogonal Procrustes, Schönemann 1966).

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use darn_geometry::grid::{NormalGrid, cell_centre};

/// The frame a network was trained in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrameKind {
    /// As given.
    Given,
    /// Turned so that x runs along u and y along v, as far as the known cells allow.
    #[default]
    Canonical,
    /// As canonical, and three more channels give the network the up direction, +z of the given frame.
    Hanging,
}

impl FrameKind {
    /// Whether +z must be up in the grids that a network of this frame is given.
    pub fn knows_up(self) -> bool {
        self != FrameKind::Canonical
    }

    /// Whether a network of this frame is given the up direction.
    pub fn told_up(self) -> bool {
        self == FrameKind::Hanging
    }

    /// Whether grids are turned before a network of this frame sees them.
    pub fn turns(self) -> bool {
        self != FrameKind::Given
    }

    /// Channels of the network's input: positions, mask, and up.
    pub fn channels(self) -> usize {
        match self {
            FrameKind::Given | FrameKind::Canonical => 4,
            FrameKind::Hanging => 7,
        }
    }
}

/// The rotation from the given frame to the one the network was trained in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkFrame(Matrix3<f64>);

impl NetworkFrame {
    /// The rotation for a grid; the identity if its known cells do not determine one (none are known, or all are in one place).
    pub fn of(kind: FrameKind, grid: &NormalGrid) -> NetworkFrame {
        match kind {
            FrameKind::Given => NetworkFrame(Matrix3::identity()),
            FrameKind::Canonical | FrameKind::Hanging => {
                NetworkFrame(procrustes(grid).unwrap_or_else(Matrix3::identity))
            }
        }
    }

    /// A position of the given frame, in the network's frame.
    #[inline]
    pub fn enter(&self, p: [f32; 3]) -> [f32; 3] {
        array(self.0 * vector(p))
    }

    /// The given frame's +z, in the network's frame.
    pub fn up(&self) -> [f32; 3] {
        self.enter([0.0, 0.0, 1.0])
    }

    /// A position of the network's frame, in the given frame.
    #[inline]
    pub fn leave(&self, p: [f32; 3]) -> [f32; 3] {
        array(self.0.tr_mul(&vector(p)))
    }
}

/// The rotation R that minimises Σ known ‖R p − (u, v, 0)‖² over the cells.
fn procrustes(grid: &NormalGrid) -> Option<Matrix3<f64>> {
    let cells = || grid.positions.iter().zip(&grid.known).enumerate();
    let mut total = 0.0;
    let mut centre = Vector3::zeros();
    let mut chart_centre = Vector3::zeros();
    for (index, (p, known)) in cells() {
        let weight = f64::from(*known);
        total += weight;
        centre += vector(*p) * weight;
        chart_centre += chart(index) * weight;
    }
    if total <= 0.0 {
        return None;
    }
    centre /= total;
    chart_centre /= total;
    let mut correlation = Matrix3::zeros();
    for (index, (p, known)) in cells() {
        correlation +=
            (chart(index) - chart_centre) * (vector(*p) - centre).transpose() * f64::from(*known);
    }
    let size = correlation.norm();
    if !size.is_finite() || size <= 1e-12 {
        return None;
    }
    let svd = correlation.try_svd(true, true, f64::EPSILON, 1000)?;
    let (u, vt) = (svd.u?, svd.v_t?);
    let mut rotation = u * vt;
    if rotation.determinant() < 0.0 {
        // The third singular value is zero (the chart is flat), so its direction is free.
        let least = svd.singular_values.imin();
        let mut flipped = u;
        flipped.column_mut(least).neg_mut();
        rotation = flipped * vt;
    }
    Some(rotation)
}

fn chart(index: usize) -> Vector3<f64> {
    let uv = cell_centre(index);
    Vector3::new(uv.x, uv.y, 0.0)
}

fn vector(p: [f32; 3]) -> Vector3<f64> {
    Vector3::new(p[0].into(), p[1].into(), p[2].into())
}

fn array(p: Vector3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}
