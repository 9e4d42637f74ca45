//! A patch for a hole that has no chart: a fair surface in space.
//!
//! Stages: `span` (triangles between the rim's vertices) → `remesh` (even triangles) and `surface` (where their vertices
//! belong) in turn, first with few vertices, then with the scan's edge length → collisions, as for other patches.

mod layout;
mod remesh;
mod span;
mod surface;
#[cfg(test)]
mod tests;

use darn_budget::{Budget, Exhausted};

use super::attributes::AttributeMap;
use super::collisions::{CollisionMesh, Untangling};
use super::harmonic::HarmonicExtension;
use super::plan::rim_pieces;
use super::{Patch, PatchError, PatchWork};
use crate::mesh::layers::Layers;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec3};
pub use layout::FairLayout;
use remesh::Sheet;
use span::{SpanRim, span};
use surface::{Bend, Fairing};

/// Inner vertices of the first sheet, about; its shape is found with these.
const COARSE: usize = 1500;
/// Most steps with few vertices.
const COARSE_STEPS: usize = 20;
/// Steps with all vertices.
const FINE_STEPS: usize = 3;
/// Steps with few vertices end when none moves farther than this share of an edge.
const AT_REST: f64 = 0.05;
/// A surface with continued curvature is given up when it grows beyond this many times the extent of the surface of
/// least bending.
const RUNAWAY: f64 = 3.0;

/// What a fair surface is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fairness {
    /// Its curvature continues that of the cloth around.
    Curved,
    /// It bends as little as possible: less like cloth, and sound around rims whose triangles are slivers or folded.
    Plain,
}

/// A fair patch, with what is needed to finish it and to continue attributes into it.
pub struct FairPatch {
    /// The patch; without a chart its `flat` is empty.
    pub patch: Patch,
    /// Area of the triangles between the rim's vertices that bend least, scene units squared: how much cloth the rim asks for.
    pub span_area: f64,
    /// From the rim to all vertices.
    rim_extension: HarmonicExtension,
    collisions: CollisionMesh,
}

impl FairPatch {
    /// Closes the hole of a region with a fair surface. The region needs no chart and need not be a disk; a few rings
    /// of cloth around the rim suffice.
    ///
    /// # Errors
    /// `RimCrosses` when the rim encloses nothing, `Singular` when triangles are degenerate (a plain one: when they are no numbers);
    /// `Exhausted`.
    pub fn new<'a>(
        region: &Region,
        fairness: Fairness,
        work: impl Into<PatchWork<'a>>,
    ) -> Result<FairPatch, PatchError> {
        let PatchWork {
            options, budget, ..
        } = work.into();
        let rim: Vec<u32> = region.rim.iter().rev().copied().collect();
        let mut sheet = spanned(&rim, region, budget)?;
        let span_area = sheet.area();
        let edge = median_edge(&region.mesh);
        let fairing = Fairing::new(region, &rim, fairness, budget);
        let bend = settle(&mut sheet, &fairing, edge, budget)?;
        let most = options.max_vertices;
        let fine = edge.max(spacing_for(sheet.area(), most));
        for step in 0..FINE_STEPS {
            if step < 2 {
                sheet.remesh(fine, most, budget)?;
            }
            fairing.step(&mut sheet, bend)?;
        }
        let Sheet { mesh, corners } = sheet;
        let held: Vec<u32> = (0..corners as u32).collect();
        let rim_extension = HarmonicExtension::on_surface(&mesh, &held, budget)
            .map_err(PatchError::of_stage("seam"))?;
        let at = |v: u32| mesh.positions[v as usize];
        let length = |a: u32, b: u32| (at(a) - at(b)).norm();
        let collisions = CollisionMesh::new(&rim, &mesh.faces, length, region);
        Ok(FairPatch {
            patch: Patch {
                rim,
                flat: Vec::new(),
                positions: mesh.positions,
                faces: mesh.faces,
                strain_rounds: 0,
                collisions: 0,
                crossings: 0,
            },
            span_area,
            rim_extension,
            collisions,
        })
    }

    /// The same patch with the rim at other `positions` of the region's vertices, scene space: the offsets of the rim
    /// are added with their harmonic extension inside.
    ///
    /// # Errors
    /// `Singular` when triangles are degenerate.
    pub fn with_region_at(mut self, positions: &[Vec3]) -> Result<FairPatch, PatchError> {
        let patch = &mut self.patch;
        let gaps: Vec<[f64; 3]> = (patch.rim.iter().zip(&patch.positions))
            .map(|(v, own)| (positions[*v as usize] - own).into())
            .collect();
        let extended = (self.rim_extension.extend(&gaps)).map_err(PatchError::of_stage("seam"))?;
        let each = patch.positions.iter_mut().zip(&extended);
        each.for_each(|(p, by)| *p += Vec3::from(*by));
        for (v, p) in patch.rim.iter().zip(&mut patch.positions) {
            *p = positions[*v as usize];
        }
        self.collisions = self.collisions.with_region_at(positions);
        Ok(self)
    }

    /// The same patch clear of itself, of its region and of what lies near the hole beside it, as far as that can be done.
    /// Where the region lies on one side of another component that is nearer than `reach` (scene units), so does the patch.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn clear_of(
        mut self,
        layers: &Layers,
        reach: f64,
        untangling: Untangling,
        budget: &Budget,
    ) -> Result<FairPatch, Exhausted> {
        self.collisions = self.collisions.beside(layers, reach, budget)?;
        (self.collisions).separate(&mut self.patch, untangling, budget)?;
        Ok(self)
    }

    /// Separates a copy of the patch from a mesh beside it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn separate(
        &self,
        patch: &mut Patch,
        others: &TriMesh,
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        let all = self.collisions.clone().with_layers(others);
        all.separate(patch, Untangling::Always, budget)
    }

    /// How attributes are continued into the patch.
    pub fn attribute_map(&self) -> AttributeMap<'_> {
        AttributeMap::on_surface(&self.rim_extension)
    }

    /// Bytes of memory held, about.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.patch.positions[..])
            + size_of_val(&self.patch.faces[..])
            + self.rim_extension.bytes()
            + self.collisions.bytes()
    }
}

/// Triangles between the vertices of the rim. Where it touches itself there are several pieces.
fn spanned(rim: &[u32], region: &Region, budget: &Budget) -> Result<Sheet, PatchError> {
    let position = |v: &u32| region.mesh.positions[*v as usize];
    let points: Vec<Vec3> = rim.iter().map(position).collect();
    let normals = edge_normals(rim, region);
    let pieces = rim_pieces(&points);
    let mut faces = Vec::new();
    for piece in &pieces {
        // An edge of a piece is one of the rim, from its vertex to the rim's next one.
        let line = SpanRim {
            points: piece.iter().map(|k| points[*k]).collect(),
            normals: piece.iter().map(|k| normals[*k]).collect(),
        };
        let own = span(&line, budget)?.into_iter();
        faces.extend(own.map(|f| f.map(|v| piece[v as usize] as u32)));
    }
    if faces.is_empty() {
        return Err(PatchError::RimCrosses);
    }
    Ok(Sheet {
        corners: points.len(),
        mesh: TriMesh {
            positions: points,
            faces,
        },
    })
}

/// Per edge of the rim the unit normal of the region's face there; zero where there is none.
fn edge_normals(rim: &[u32], region: &Region) -> Vec<Vec3> {
    let mut place = vec![usize::MAX; region.mesh.positions.len()];
    for (k, v) in rim.iter().enumerate() {
        place[*v as usize] = k;
    }
    let mut normals = vec![Vec3::zeros(); rim.len()];
    for face in &region.mesh.faces {
        for c in 0..3 {
            // The region's face has the edge in the opposite direction.
            let (to, from) = (face[c] as usize, face[(c + 1) % 3] as usize);
            let (k, next) = (place[from], place[to]);
            if k != usize::MAX && next == (k + 1) % rim.len() {
                let [a, b, c] = face.map(|v| region.mesh.positions[v as usize]);
                let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
                normals[k] = normal.unwrap_or_else(Vec3::zeros);
            }
        }
    }
    normals
}

/// Finds the surface with few vertices: first the one of least bending, then the one with continued curvature, unless
/// that grows out of all proportion or is not asked for. Gives the bend that it has.
fn settle(
    sheet: &mut Sheet,
    fairing: &Fairing,
    edge: f64,
    budget: &Budget,
) -> Result<Bend, PatchError> {
    let spacing = |sheet: &Sheet| edge.max(spacing_for(sheet.area(), COARSE));
    for _ in 0..2 {
        sheet.remesh(spacing(sheet), 2 * COARSE, budget)?;
        fairing.step(sheet, Bend::Least)?;
    }
    if fairing.fairness == Fairness::Plain {
        return Ok(Bend::Least);
    }
    let (least, extent) = (sheet.clone(), extent(sheet));
    for _ in 0..COARSE_STEPS {
        let length = spacing(sheet);
        sheet.remesh(length, 2 * COARSE, budget)?;
        let moved = fairing.step(sheet, Bend::Continued)?;
        if self::extent(sheet) > RUNAWAY * extent {
            *sheet = least;
            return Ok(Bend::Least);
        }
        if moved <= AT_REST * length {
            break;
        }
    }
    Ok(Bend::Continued)
}

/// Edge length of even triangles with this many inner vertices on this area.
fn spacing_for(area: f64, vertices: usize) -> f64 {
    (area / (vertices.max(1) as f64 * 0.75f64.sqrt())).sqrt()
}

/// Half the diagonal of the box of a sheet, scene units.
fn extent(sheet: &Sheet) -> f64 {
    let each = || sheet.mesh.positions.iter();
    let low = each().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
    let high = each().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
    0.5 * (high - low).norm()
}

/// Median edge length of a mesh, scene units; 1 without faces.
fn median_edge(mesh: &TriMesh) -> f64 {
    let mut edges: Vec<f64> = (0..mesh.faces.len())
        .flat_map(|f| {
            let [a, b, c] = mesh.triangle(f);
            [(b - a).norm(), (c - b).norm(), (a - c).norm()]
        })
        .collect();
    let middle = edges.len() / 2;
    match edges.is_empty() {
        true => 1.0,
        false => *edges.select_nth_unstable_by(middle, f64::total_cmp).1,
    }
}
