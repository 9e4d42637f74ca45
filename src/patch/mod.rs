//! From a filled grid to triangles on the hole's own rim: triangulation, seam, strain limiting, attributes, and what came of it in numbers.
//! Stages: `triangulate` → grid positions → `harmonic` (seam) → `cloth` (strain) → `quality`; `attributes` carries texture and colour over.
//! No glTF here (the scan's numbers come in as columns) and no network: a patch is made from whatever grid it is given.

pub mod attributes;
mod cloth;
mod harmonic;
mod hem;
pub mod quality;
mod triangulate;
mod untangle;

pub use cloth::Elastics;
pub use triangulate::signed_area;

use crate::flatten::Chart;
use crate::grid;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};
use hem::Hem;
use triangulate::Triangulation;

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
pub struct Options {
    /// Most inner vertices; beyond it the patch is coarser than the scan.
    pub most_vertices: usize,
    /// The energy of strain limiting.
    pub elastics: Elastics,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            most_vertices: 20_000,
            elastics: Elastics::default(),
        }
    }
}

/// Triangles that close a hole.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Region vertices of the rim, counter-clockwise around the patch; they are the patch's first vertices.
    pub rim: Vec<u32>,
    /// All vertices in the plane of the chart, scene units.
    pub flat: Vec<Vec2>,
    /// All vertices in scene space; the rim's are the region's own.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise triangles, oriented as the scan's.
    pub faces: Vec<[u32; 3]>,
    /// Rounds of strain limiting.
    pub strain_rounds: usize,
}

impl Patch {
    /// The position at a point of the plane: barycentric in the triangle there, or the nearest vertex's beside the patch.
    pub fn at(&self, p: Vec2) -> Vec3 {
        for face in &self.faces {
            let [a, b, c] = face.map(|v| self.flat[v as usize]);
            let area = (b - a).perp(&(c - a));
            let (wa, wb) = ((b - p).perp(&(c - p)) / area, (c - p).perp(&(a - p)) / area);
            let weights = [wa, wb, 1.0 - wa - wb];
            if weights.iter().all(|w| *w >= -1e-9) {
                return face
                    .iter()
                    .zip(weights)
                    .map(|(v, w)| self.positions[*v as usize] * w)
                    .sum();
            }
        }
        let nearest = (0..self.flat.len()).min_by(|a, b| {
            (self.flat[*a] - p)
                .norm()
                .total_cmp(&(self.flat[*b] - p).norm())
        });
        nearest.map_or_else(Vec3::zeros, |v| self.positions[v])
    }
}

/// Meshes the hole of a region with the positions of a filled grid.
///
/// `filled` holds one scene position per cell. Inner vertices are read off it (bicubic), the difference between grid and scan along the
/// rim is spread harmonically, then the chart's lengths are restored with the rim held.
///
/// # Errors
/// `RimCrosses` when the chart overlaps itself at the hole, `Singular` when triangles degenerate.
pub fn build(
    region: &Region,
    chart: &Chart,
    filled: &[Vec3],
    options: &Options,
) -> Result<Patch, PatchError> {
    // The rim runs with the cloth on its left, so with the hole on its right: turned round it encloses the patch.
    let rim: Vec<u32> = region.rim.iter().rev().copied().collect();
    let polygon: Vec<Vec2> = rim.iter().map(|v| chart.flat[*v as usize]).collect();
    let polygon = untangle::untangled(&polygon).ok_or(PatchError::RimCrosses)?;
    let mut tiled =
        triangulate::triangulate(&polygon, median_edge(region, chart), options.most_vertices)?;
    let edges = region
        .mesh
        .faces
        .iter()
        .flat_map(|f| (0..3).map(|k| (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]))));
    let edges: std::collections::HashSet<(u32, u32)> = edges.collect();
    tiled.split_chords(rim.len(), |a, b| {
        let (a, b) = (rim[a as usize], rim[b as usize]);
        edges.contains(&(a.min(b), a.max(b)))
    });

    let own: Vec<Vec3> = (rim.iter())
        .map(|v| region.mesh.positions[*v as usize])
        .collect();
    let drawn = drawing(&tiled, chart, filled, &own)?;
    let hem = Hem::around(&rim, &tiled, region, chart);
    let (inner, strain_rounds) = hem.relax(drawn, &options.elastics)?;
    Ok(Patch {
        rim,
        flat: tiled.points,
        positions: own.into_iter().chain(inner).collect(),
        faces: tiled.faces,
        strain_rounds,
    })
}

/// The inner points read off the filled grid, shifted so that the seam is closed: the differences at the rim are spread harmonically.
fn drawing(
    tiled: &Triangulation,
    chart: &Chart,
    filled: &[Vec3],
    own: &[Vec3],
) -> Result<Vec<Vec3>, PatchError> {
    let drawn: Vec<Vec3> = (tiled.points.iter())
        .map(|p| grid::evaluate(filled, chart.frame.uv(*p)))
        .collect();
    let gaps: Vec<[f64; 3]> = (own.iter().zip(&drawn))
        .map(|(own, drawn)| (own - drawn).into())
        .collect();
    let held: Vec<u32> = (0..own.len() as u32).collect();
    let spread = harmonic::Extension::new(&tiled.points, &tiled.faces, &held)
        .and_then(|e| e.extend(&gaps))
        .map_err(|_| PatchError::Singular { stage: "seam" })?;
    let closed = drawn.iter().zip(&spread).map(|(p, d)| p + Vec3::from(*d));
    Ok(closed.skip(own.len()).collect())
}

/// Median edge length of the region in the plane: the scan's own resolution.
fn median_edge(region: &Region, chart: &Chart) -> f64 {
    let edge = |f: &[u32; 3], k: usize| {
        (chart.flat[f[k] as usize] - chart.flat[f[(k + 1) % 3] as usize]).norm()
    };
    let mut edges: Vec<f64> = region
        .mesh
        .faces
        .iter()
        .flat_map(|f| (0..3).map(move |k| edge(f, k)))
        .collect();
    let middle = edges.len() / 2;
    if edges.is_empty() {
        1.0
    } else {
        *edges.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}
