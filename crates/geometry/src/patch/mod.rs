//! From a filled grid to triangles on the hole's own rim: triangulation, seam, strain limiting, attributes, and what came of it in numbers.
//! Stages: `triangulate` → grid positions → `harmonic` (seam) → `cloth` (strain, with `pull`s) → `contacts` → `quality`; `plan` has them in
//! order, split into what a hole needs once and what each fill needs; `attributes` carries texture and colour over.
//! No glTF here (the scan's numbers come in as columns) and no network: a patch is made from whatever grid it is given.

mod anderson;
pub mod attributes;
mod bending;
mod cloth;
mod contacts;
mod crossings;
mod harmonic;
mod hem;
mod plan;
mod pull;
pub mod quality;
#[cfg(test)]
mod tests;
mod triangulate;
mod untangle;

pub use cloth::Elastics;
pub use plan::{PatchPlan, bearable, plan, plan_in};
pub use pull::{Firmness, Pull};
pub use triangulate::signed_area;

use crate::flatten::Chart;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// Why a hole could not be patched.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PatchError {
    /// The rim, laid flat, crosses or touches itself.
    #[error("the rim crosses itself when the cloth around it is laid flat")]
    RimCrosses,
    /// A sparse system of the patch had no factor.
    #[error("the {stage} system of the patch cannot be solved; its triangles are degenerate")]
    Singular {
        /// Which stage's system.
        stage: &'static str,
    },
}

/// How a patch is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchOptions {
    /// Most inner vertices; beyond it the patch is coarser than the scan.
    pub most_vertices: usize,
    /// The energy of strain limiting.
    pub elastics: Elastics,
}

impl Default for PatchOptions {
    fn default() -> Self {
        PatchOptions {
            most_vertices: 20_000,
            elastics: Elastics::default(),
        }
    }
}

/// Triangles that close a hole.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Region vertices of the rim, counter-clockwise around the patch; they are the patch's first vertices. Where the rim touches itself it
    /// comes to a place more than once, each time at another vertex, and the patch is several pieces that meet there.
    pub rim: Vec<u32>,
    /// All vertices in the plane of the chart, scene units.
    pub flat: Vec<Vec2>,
    /// All vertices in scene space; the rim's are the region's own.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise triangles, oriented as the scan's.
    pub faces: Vec<[u32; 3]>,
    /// Rounds of strain limiting.
    pub strain_rounds: usize,
    /// Pairs of triangles that crossed after strain limiting and were pushed apart.
    pub collisions: usize,
    /// Pairs of triangles, at least one of the patch, that cross still.
    pub crossings: usize,
}

impl Patch {
    /// The position at a point of the plane: barycentric in the triangle there, or the nearest vertex's beside the patch. O(faces).
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

/// The first face that holds a point of the plane, and the point's barycentric weights in it. O(faces), with a box test for most.
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

/// Meshes the hole of a region with the positions of a filled grid: [`plan`] and [`PatchPlan::patch`] in one, without pulls.
///
/// `filled` holds one scene position per cell. Inner vertices are read off it (bicubic), the difference between grid and scan along the
/// rim is spread harmonically, then the chart's lengths are restored with the rim held, and what crosses is pushed apart.
///
/// # Errors
/// `RimCrosses` when the chart overlaps itself at the hole, `Singular` when triangles degenerate.
pub fn build(
    region: &Region,
    chart: &Chart,
    filled: &[Vec3],
    options: &PatchOptions,
) -> Result<Patch, PatchError> {
    plan(region, chart, options)?.patch(chart, filled, &[], options)
}
