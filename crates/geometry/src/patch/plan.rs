//! A patch in two halves: what the hole alone decides (triangles, factors), and what each fill of it needs.

use super::cloth::Fabric;
use super::contacts::Surroundings;
use super::harmonic::Extension;
use super::hem::Hem;
use super::pull::Pull;
use super::triangulate::Triangulation;
use super::{Patch, PatchError, PatchOptions};

mod tile;
mod touch;
use crate::flatten::Chart;
use crate::grid;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2, Vec3};
use tile::Places;
pub use touch::bearable;

/// Everything about a patch that does not depend on what fills the hole; owned, so that a session can keep it.
pub struct PatchPlan {
    rim: Vec<u32>,
    /// Positions of the rim.
    own: Vec<Vec3>,
    /// What is added to all vertices in the end, where the cloth is to join a rim that lies elsewhere.
    shift: Option<Vec<Vec3>>,
    tiled: Triangulation,
    seam: Extension,
    hem: Hem,
    fabric: Fabric,
    surroundings: Surroundings,
}

/// Plans the patch of a region's hole, knowing of the scan no more than the region.
///
/// # Errors
/// `RimCrosses` when the chart overlaps itself at the hole, `Singular` when triangles degenerate.
pub fn plan(
    region: &Region,
    chart: &Chart,
    options: &PatchOptions,
) -> Result<PatchPlan, PatchError> {
    let rim = turned(region);
    let places = Places::of(&at(&rim, &region.mesh), &region.mesh);
    planned(rim, places, (region, chart), options)
}

/// Plans the patch of a region's hole in the whole scan: the region's positions may be others than the scan's (without its noise), and
/// cloth beyond it may touch the rim.
///
/// # Errors
/// `RimCrosses` when the chart overlaps itself at the hole, `Singular` when triangles degenerate.
pub fn plan_in(
    scan: &TriMesh,
    region: &Region,
    chart: &Chart,
    options: &PatchOptions,
) -> Result<PatchPlan, PatchError> {
    let rim = turned(region);
    let scanned: Vec<u32> = (rim.iter())
        .map(|v| region.vertices[*v as usize].0)
        .collect();
    let places = Places::of(&at(&scanned, scan), scan);
    planned(rim, places, (region, chart), options)
}

/// The rim runs with the cloth on its left, so with the hole on its right: turned round it encloses the patch.
fn turned(region: &Region) -> Vec<u32> {
    region.rim.iter().rev().copied().collect()
}

fn at(vertices: &[u32], mesh: &TriMesh) -> Vec<Vec3> {
    let position = |v: &u32| mesh.positions[*v as usize];
    vertices.iter().map(position).collect()
}

fn planned(
    rim: Vec<u32>,
    places: Places,
    (region, chart): (&Region, &Chart),
    options: &PatchOptions,
) -> Result<PatchPlan, PatchError> {
    let flat: Vec<Vec2> = rim.iter().map(|v| chart.flat[*v as usize]).collect();
    let tiled = tile::tile(flat, places, spacing(region, chart), options.most_vertices)?;

    let own = at(&rim, &region.mesh);
    let held: Vec<u32> = (0..rim.len() as u32).collect();
    let seam = Extension::new(&tiled.points, &tiled.faces, &held).map_err(|_| singular("seam"))?;
    let hem = Hem::around(&rim, &tiled, region, chart);
    let fabric = Fabric::new(&hem.sheet(), &options.elastics).map_err(|_| singular("strain"))?;
    let surroundings = Surroundings::new(&rim, &tiled, region);
    Ok(PatchPlan {
        rim,
        own,
        shift: None,
        tiled,
        seam,
        hem,
        fabric,
        surroundings,
    })
}

impl PatchPlan {
    /// Joins the scan where its vertices really lie, when the region was one without the scanner's noise: the cloth is made without it,
    /// and what the rim is off by is spread harmonically.
    ///
    /// # Errors
    /// `Singular` when triangles degenerate.
    pub fn joining(mut self, positions: &[Vec3]) -> Result<PatchPlan, PatchError> {
        let gaps: Vec<[f64; 3]> = (self.rim.iter().zip(&self.own))
            .map(|(v, own)| (positions[*v as usize] - own).into())
            .collect();
        let spread = self.seam.extend(&gaps).map_err(|_| singular("seam"))?;
        self.shift = Some(spread.into_iter().map(Vec3::from).collect());
        self.surroundings = self.surroundings.around(positions);
        Ok(self)
    }

    /// Keeps the cloth from cutting other layers of the scan, too, not only its region.
    pub fn among(mut self, others: &TriMesh) -> PatchPlan {
        self.surroundings = self.surroundings.among(others);
        self
    }

    /// Pushes a finished patch off cloth that the plan does not know; what it knows stays kept off, too.
    pub fn keep_off(&self, patch: &mut Patch, others: &TriMesh) {
        self.surroundings.clone().among(others).separate(patch);
    }

    /// All vertices in the plane of the chart, scene units; the rim's come first.
    pub fn flat(&self) -> &[Vec2] {
        &self.tiled.points
    }

    /// Counter-clockwise triangles, oriented as the scan's.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.tiled.faces
    }

    /// Region vertices of the rim, counter-clockwise around the patch.
    pub fn rim(&self) -> &[u32] {
        &self.rim
    }

    /// The harmonic extension from the rim.
    pub(super) fn seam(&self) -> &Extension {
        &self.seam
    }

    /// Bytes held, about: for a cap on what sessions keep.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rim[..])
            + size_of_val(&self.own[..])
            + self.shift.as_ref().map_or(0, |s| size_of_val(&s[..]))
            + size_of_val(&self.tiled.points[..])
            + size_of_val(&self.tiled.faces[..])
            + self.seam.bytes()
            + self.hem.bytes()
            + self.fabric.bytes()
            + self.surroundings.bytes()
    }

    /// Meshes the hole with the positions of a filled grid and draws it to where the pulls want it.
    ///
    /// `chart` must be the one of [`plan`]. `options` may differ from the plan's in what does not set the triangles; other weights of
    /// bending and tether cost a new factor. A pull beside the hole, or all but on its rim, does nothing.
    ///
    /// # Errors
    /// `Singular` when triangles degenerate.
    pub fn patch(
        &self,
        chart: &Chart,
        filled: &[Vec3],
        pulls: &[Pull],
        options: &PatchOptions,
    ) -> Result<Patch, PatchError> {
        let elastics = &options.elastics;
        let other;
        let fabric = if self.fabric.fits(elastics) {
            &self.fabric
        } else {
            other = Fabric::new(&self.hem.sheet(), elastics).map_err(|_| singular("strain"))?;
            &other
        };
        let mut positions = self.hem.with_inner(self.drawing(chart, filled)?);
        let rest = fabric.relax(&mut positions, elastics);
        let mut patch = Patch {
            rim: self.rim.clone(),
            flat: self.tiled.points.clone(),
            positions: self.with_rim(&positions),
            faces: self.tiled.faces.clone(),
            strain_rounds: rest.map_err(|_| singular("strain"))?.rounds,
            collisions: 0,
            crossings: 0,
        };
        self.shift(&mut patch, 1.0);
        self.surroundings.separate(&mut patch);
        let grips = self.grips(pulls, chart);
        if !grips.is_empty() {
            self.shift(&mut patch, -1.0);
            let inner = patch.positions[self.own.len()..].to_vec();
            let mut positions = self.hem.with_inner(inner);
            let rounds = self.pull(fabric, &mut positions, &grips, elastics);
            patch.strain_rounds += rounds.map_err(|_| singular("strain"))?;
            patch.positions = self.with_rim(&positions);
            self.shift(&mut patch, 1.0);
            self.surroundings.separate(&mut patch);
        }
        Ok(patch)
    }

    /// Moves a patch to where the rim really lies, or back from there.
    fn shift(&self, patch: &mut Patch, share: f64) {
        let by = self.shift.as_deref().unwrap_or_default();
        let each = patch.positions.iter_mut().zip(by);
        each.for_each(|(p, by)| *p += by * share);
    }

    /// The rim's own positions, then the inner ones of a hem.
    fn with_rim(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let free = self.tiled.points.len() - self.own.len();
        let rim = self.own.iter().copied();
        rim.chain(positions[..free].iter().copied()).collect()
    }

    /// The inner points read off the filled grid, shifted so that the seam is closed: the differences at the rim are spread harmonically.
    fn drawing(&self, chart: &Chart, filled: &[Vec3]) -> Result<Vec<Vec3>, PatchError> {
        let drawn: Vec<Vec3> = (self.tiled.points.iter())
            .map(|p| grid::evaluate(filled, chart.frame.uv(*p)))
            .collect();
        let gaps: Vec<[f64; 3]> = (self.own.iter().zip(&drawn))
            .map(|(own, drawn)| (own - drawn).into())
            .collect();
        let spread = self.seam.extend(&gaps).map_err(|_| singular("seam"))?;
        let closed = drawn.iter().zip(&spread).map(|(p, d)| p + Vec3::from(*d));
        Ok(closed.skip(self.own.len()).collect())
    }
}

fn singular(stage: &'static str) -> PatchError {
    PatchError::Singular { stage }
}

/// Edge length of a patch, in the plane: as fine as the grid that is drawn from, so that no fold drawn there is cut short, but between half
/// the scan's own resolution and all of it.
fn spacing(region: &Region, chart: &Chart) -> f64 {
    let (edge, cell) = (
        median_edge(region, chart),
        chart.frame.side / grid::SIDE as f64,
    );
    // Not `clamp`, which panics where a chart is not finite.
    cell.max(FINER * edge).min(edge)
}

/// How much finer than the scan a patch may be.
const FINER: f64 = 0.5;

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
