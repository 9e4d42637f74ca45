//! A pull: a user's wish that a point of the patch lies at a given position.

use crate::mesh::{Vec2, Vec3};

/// A user's wish that a point of the patch lies at a given position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pull {
    /// The point: in the plane of the chart, inside the hole, scene units.
    pub at: Vec2,
    /// Its target, scene space.
    pub to: Vec3,
    /// How firmly it is held there.
    pub firmness: Firmness,
}

/// How firmly a pull holds its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Firmness {
    /// Yields where the cloth resists.
    Soft,
    /// As near to the target as the strain limit allows.
    Hard,
}

impl Firmness {
    /// Displacement that remains per unit of force (dimensionless, as the energy's stiffness is).
    pub(super) fn compliance(self) -> f64 {
        match self {
            Firmness::Soft => 0.05,
            Firmness::Hard => 0.0,
        }
    }

    /// Largest force ÷ radius of its contact disk; 1 puts a strip of the radius' width under strain 1.
    pub(super) fn strength(self) -> f64 {
        match self {
            Firmness::Soft => 1.0,
            Firmness::Hard => 4.0,
        }
    }
}
