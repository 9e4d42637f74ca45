//! Makes the patch of a hole from a filled grid: triangles that start at the hole's rim and have the lengths of the
//! chart.
//!
//! Stages: `triangulate` → positions from the grid → `harmonic` (closes the seam) → `strain` (limits strain, with
//! `forces` for pulls) → `collisions` → [`quality`]. `plan` calls them in order, first those that depend on the hole
//! alone, then those that depend on the grid. [`attributes`] continues texture coordinates and colours into the patch.
//! A hole without a chart gets a [`FairPatch`].
//!
//! Reads no glTF (the scan's attributes come as columns of numbers) and calls no network; any grid will do.

mod anderson;
pub mod attributes;
mod bending;
mod collisions;
mod deformation;
mod energy;
mod fair;
mod forces;
mod harmonic;
mod intersections;
mod last_strain;
mod metric;
mod plan;
mod pull;
pub mod quality;
mod rest;
mod rim_join;
mod sides;
mod strain;
#[cfg(test)]
mod tests;
mod triangulate;
mod untangle;

pub use collisions::Untangling;
pub use energy::StrainOptions;
pub use fair::{FairLayout, FairPatch, Fairness};
pub use last_strain::LastStrain;
pub use metric::{PatchMetric, log_stretch};
pub use plan::{PatchMesh, PatchPlan, median_edge, plan, stretch_limit};
pub use pull::{Firmness, Pull};
pub use triangulate::signed_area;
pub(crate) use triangulate::{Outline, across};

use darn_budget::{Budget, Exhausted};

use crate::cholesky::SolveError;
use crate::flatten::Chart;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2, Vec3};

/// Why a hole could not be patched.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PatchError {
    /// The rim crosses or touches itself in the plane of the chart.
    #[error("the rim crosses itself when the cloth around it is laid flat")]
    RimCrosses,
    /// A sparse system of the patch has no factor or no finite solution.
    #[error("the {stage} system of the patch cannot be solved; its triangles are degenerate")]
    Singular {
        /// The stage that the system belongs to.
        stage: &'static str,
    },
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
}

impl PatchError {
    /// Makes the errors of a stage's system errors of the patch.
    fn of_stage(stage: &'static str) -> impl Fn(SolveError) -> PatchError {
        move |error| match error {
            SolveError::NotPositive => PatchError::Singular { stage },
            SolveError::Exhausted(exhausted) => PatchError::Exhausted(exhausted),
        }
    }
}

/// How a patch is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchOptions {
    /// Most inner vertices, about; a larger hole gets longer edges.
    pub max_vertices: usize,
    /// How strain is limited.
    pub strain: StrainOptions,
}

/// How a patch is made, and what that may cost.
#[derive(Debug, Clone, Copy)]
pub struct PatchWork<'a> {
    /// How.
    pub options: &'a PatchOptions,
    /// What it may cost.
    pub budget: &'a Budget<'a>,
    /// The last patch of the same plan, to start from while something is dragged; what lies across itself is looked for at the end only then. `None`
    /// starts anew: the same input gives the same bits.
    pub last: Option<&'a LastStrain>,
}

impl<'a> From<&'a PatchOptions> for PatchWork<'a> {
    /// Without limits.
    fn from(options: &'a PatchOptions) -> PatchWork<'a> {
        PatchWork {
            options,
            budget: Budget::unlimited(),
            last: None,
        }
    }
}

impl Default for PatchOptions {
    fn default() -> Self {
        PatchOptions {
            max_vertices: 20_000,
            strain: StrainOptions::default(),
        }
    }
}

/// Triangles that close a hole.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Region vertices of the rim, counter-clockwise around the patch, then those around islands in the hole; they are the
    /// patch's first vertices. Where the
    /// rim touches itself, several of them lie at one point and the patch consists of pieces that meet there.
    pub rim: Vec<u32>,
    /// All vertices in the plane of the chart, scene units; empty for a patch without a chart.
    pub flat: Vec<Vec2>,
    /// All vertices in scene space; those of the rim lie at the region's positions.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise triangles, oriented as the scan's.
    pub faces: Vec<[u32; 3]>,
    /// Rounds of strain limiting.
    pub strain_rounds: usize,
    /// Pairs of triangles that cut each other after strain limiting and were separated.
    pub collisions: usize,
    /// Pairs of triangles that still cut each other, at least one of them the patch's.
    pub crossings: usize,
}

impl Patch {
    /// Its triangles.
    pub fn mesh(&self) -> TriMesh {
        TriMesh {
            positions: self.positions.clone(),
            faces: self.faces.clone(),
        }
    }

    /// The largest distance of its vertices from the box of its rim, per axis; scene units.
    pub fn beyond_rim(&self) -> f64 {
        let rim = || self.positions[..self.rim.len()].iter();
        let low = rim().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
        let high = rim().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
        let beyond = |p: &Vec3| (low - p).sup(&(p - high)).max();
        self.positions.iter().map(beyond).fold(0.0, f64::max)
    }

    /// The position, scene space, at a point in the plane of the chart: barycentric in its triangle, or that of the
    /// nearest vertex where the point lies beside the patch. O(faces).
    pub fn at(&self, p: Vec2) -> Vec3 {
        if let Some((face, weights)) = locate(&self.flat, &self.faces, p) {
            let corners = self.faces[face].iter().zip(weights);
            return corners.map(|(v, w)| self.positions[*v as usize] * w).sum();
        }
        let nearest = (0..self.flat.len()).min_by(|a, b| {
            let away = |v: &usize| (self.flat[*v] - p).norm_squared();
            away(a).total_cmp(&away(b))
        });
        nearest.map_or_else(Vec3::zeros, |v| self.positions[v])
    }
}

/// The first face that contains a point of the plane, with the point's barycentric weights. O(faces), with a box test
/// for most faces.
fn locate(flat: &[Vec2], faces: &[[u32; 3]], p: Vec2) -> Option<(usize, [f64; 3])> {
    faces.iter().enumerate().find_map(|(k, face)| {
        let [a, b, c] = face.map(|v| flat[v as usize]);
        let slack = 1e-9 * ((b - a).amax() + (c - a).amax());
        let beside = |p: f64, corners: [f64; 3]| {
            corners.iter().all(|x| *x > p + slack) || corners.iter().all(|x| *x < p - slack)
        };
        if beside(p.x, [a.x, b.x, c.x]) || beside(p.y, [a.y, b.y, c.y]) {
            return None;
        }
        let area = (b - a).perp(&(c - a));
        let (wa, wb) = ((b - p).perp(&(c - p)) / area, (c - p).perp(&(a - p)) / area);
        let weights = [wa, wb, 1.0 - wa - wb];
        weights.iter().all(|w| *w >= -1e-9).then_some((k, weights))
    })
}

/// Meshes the hole of a region with the positions of a filled grid, one per cell, scene space: [`plan`] and
/// [`PatchPlan::patch`] in one call, without pulls.
///
/// # Errors
/// `RimCrosses` when the rim overlaps itself in the plane, `Singular` when triangles are degenerate; `Exhausted`.
pub fn build<'a>(
    region: &Region,
    chart: &Chart,
    filled: &[Vec3],
    work: impl Into<PatchWork<'a>>,
) -> Result<Patch, PatchError> {
    let work = work.into();
    plan(region, chart, work)?.patch(chart, filled, &[], work)
}
