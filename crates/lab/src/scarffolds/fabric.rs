//! The material of a simulated sheet.

use serde::{Deserialize, Serialize};

/// The material of a sheet. Every vertex has mass 1, so stiffnesses are per mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FabricParameters {
    /// Bending stiffness per areal mass, m⁴/s²; `(bend / 9.81)^(1/3)` is the length at which folds appear.
    pub bend: f32,
    /// Stiffness of the diagonals per mass, 1/s².
    pub shear: f32,
    /// Least distance between two layers, metres; between 0.72 and 1 spacings no vertex slips through a cell.
    pub thickness: f32,
    /// Coulomb friction of cloth on cloth and on obstacles.
    pub friction: f32,
    /// Drag of still air along the normal, 1/s.
    pub air: f32,
}
