//! A patch is made in two steps: the plan depends on the hole alone (triangles, factors), the patch also on the filled
//! grid and the pulls.

mod anchors;
mod pieces;

pub use anchors::stretch_limit;

pub(super) use pieces::rim_pieces;
use pieces::{Asked, RimPoints, triangulate_pieces};

use darn_budget::{Budget, Exhausted};

use super::attributes::AttributeMap;
use super::collisions::{CollisionMesh, Untangling};
use super::energy::StrainEnergy;
use super::harmonic::HarmonicExtension;
use super::metric::PatchMetric;
use super::pull::Pull;
use super::rim_join::RimJoin;
use super::strain::Minimisation;
use super::triangulate::Triangulation;
use super::{Patch, PatchError, PatchWork};
use crate::flatten::Chart;
use crate::grid;
use crate::mesh::blocks::FaceBlocks;
use crate::mesh::bounds::Bounds;
use crate::mesh::layers::Layers;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2, Vec3};

/// The part of a patch that does not depend on how its hole is filled; it borrows nothing, so a session can keep it.
pub struct PatchPlan {
    /// Region vertices of the rim, counter-clockwise around the patch.
    rim: Vec<u32>,
    /// Positions of the rim that the patch is made for, scene space.
    rim_positions: Vec<Vec3>,
    /// Per vertex: what is added in the end, when the patch has to meet the rim elsewhere; scene units.
    shift: Option<Vec<Vec3>>,
    triangulation: Triangulation,
    /// From the rim to all vertices.
    rim_extension: HarmonicExtension,
    join: RimJoin,
    energy: StrainEnergy,
    collisions: CollisionMesh,
}

/// The triangles of a patch in the plane of the chart: what a plan starts from.
pub struct PatchMesh {
    /// Region vertices of the rim, counter-clockwise around the patch.
    rim: Vec<u32>,
    triangulation: Triangulation,
    /// From the rim to all vertices.
    rim_extension: HarmonicExtension,
}

/// Plans the patch of a region's hole when the region is all that is known of the scan, with the lengths of the chart.
///
/// # Errors
/// `RimCrosses` when the rim overlaps itself in the plane, `Singular` when triangles are degenerate; `Exhausted`.
pub fn plan<'a>(
    region: &Region,
    chart: &Chart,
    work: impl Into<PatchWork<'a>>,
) -> Result<PatchPlan, PatchError> {
    let work = work.into();
    let rim = reversed_rim(region);
    let (mesh, faces) = (&region.mesh, 0..region.mesh.faces.len());
    let rim_points = RimPoints::new(&positions_of(&rim, mesh), mesh, faces);
    PatchMesh::new(rim, rim_points, region, chart, work)?.plan(region, chart, None, work)
}

impl PatchMesh {
    /// The triangles in a region's hole, in the whole scan. The region's positions may differ from the scan's (when it was denoised), and parts of
    /// the scan beyond the region may touch the rim: `blocks` are the scan's.
    ///
    /// # Errors
    /// `RimCrosses` when the rim overlaps itself in the plane, `Singular` when triangles are degenerate; `Exhausted`.
    pub fn in_scan<'a>(
        scan: &TriMesh,
        blocks: &FaceBlocks,
        region: &Region,
        chart: &Chart,
        work: impl Into<PatchWork<'a>>,
    ) -> Result<PatchMesh, PatchError> {
        let rim = reversed_rim(region);
        let scanned: Vec<u32> = (rim.iter())
            .map(|v| region.vertices[*v as usize].0)
            .collect();
        let work = work.into();
        work.budget.spend(blocks.search_work())?;
        let points = positions_of(&scanned, scan);
        let bounds = Bounds::of(&points);
        let near = bounds.iter().flat_map(|bounds| blocks.near(bounds));
        let rim_points = RimPoints::new(&points, scan, near);
        PatchMesh::new(rim, rim_points, region, chart, work)
    }

    fn new(
        rim: Vec<u32>,
        rim_points: RimPoints,
        region: &Region,
        chart: &Chart,
        work: PatchWork,
    ) -> Result<PatchMesh, PatchError> {
        let PatchWork {
            options, budget, ..
        } = work;
        let flat: Vec<Vec2> = rim.iter().map(|v| chart.flat[*v as usize]).collect();
        let asked = Asked {
            spacing: spacing(region, chart),
            max_points: options.max_vertices,
            islands: region.islands.iter().map(Vec::len).collect(),
            budget,
        };
        let triangulation = triangulate_pieces(flat, rim_points, &asked)?;
        let held: Vec<u32> = (0..rim.len() as u32).collect();
        let rim_extension =
            HarmonicExtension::new(&triangulation.points, &triangulation.faces, &held, budget)
                .map_err(PatchError::of_stage("seam"))?;
        Ok(PatchMesh {
            rim,
            triangulation,
            rim_extension,
        })
    }

    /// The plan of a patch of these triangles, with the lengths of a metric; without one, with those of the chart.
    ///
    /// # Errors
    /// `Singular` when triangles are degenerate; `Exhausted`.
    pub fn plan<'a>(
        self,
        region: &Region,
        chart: &Chart,
        metric: Option<&PatchMetric>,
        work: impl Into<PatchWork<'a>>,
    ) -> Result<PatchPlan, PatchError> {
        let PatchWork {
            options, budget, ..
        } = work.into();
        let PatchMesh {
            rim,
            triangulation,
            rim_extension,
        } = self;
        let mut join = RimJoin::new(&rim, &triangulation, region, chart);
        if let Some(metric) = metric {
            join = join.with_metric(metric, &triangulation, chart);
        }
        let energy = StrainEnergy::new(&join.rest(), &options.strain, budget)
            .map_err(PatchError::of_stage("strain"))?;
        Ok(PatchPlan {
            rim_positions: positions_of(&rim, &region.mesh),
            collisions: CollisionMesh::new(
                &rim,
                &triangulation.faces,
                |a, b| {
                    let [a, b] = [a, b].map(|v| triangulation.points[v as usize]);
                    (a - b).norm()
                },
                region,
            ),
            rim,
            shift: None,
            triangulation,
            rim_extension,
            join,
            energy,
        })
    }
}

/// The rim of a region has the scan on its left and the hole on its right; reversed it runs counter-clockwise around
/// the patch. The borders of islands in the hole follow, also reversed.
fn reversed_rim(region: &Region) -> Vec<u32> {
    let lines = std::iter::once(&region.rim).chain(&region.islands);
    lines.flat_map(|line| line.iter().rev().copied()).collect()
}

fn positions_of(vertices: &[u32], mesh: &TriMesh) -> Vec<Vec3> {
    let position = |v: &u32| mesh.positions[*v as usize];
    vertices.iter().map(position).collect()
}

impl PatchPlan {
    /// The same plan for a patch that meets the rim at other `positions` of the region's vertices, scene space. For a
    /// denoised region: the patch is made without the noise, then the rim's offsets are added, with their harmonic
    /// extension inside.
    ///
    /// # Errors
    /// `Singular` when triangles are degenerate.
    pub fn with_region_at(mut self, positions: &[Vec3]) -> Result<PatchPlan, PatchError> {
        let gaps: Vec<[f64; 3]> = (self.rim.iter().zip(&self.rim_positions))
            .map(|(v, own)| (positions[*v as usize] - own).into())
            .collect();
        let extended = (self.rim_extension.extend(&gaps)).map_err(PatchError::of_stage("seam"))?;
        self.shift = Some(extended.into_iter().map(Vec3::from).collect());
        self.collisions = self.collisions.with_region_at(positions);
        Ok(self)
    }

    /// The same plan for a patch that must not cut what lies near the hole beside its region. Where the region lies on one
    /// side of another component, such as a body, so will the patch, unless it is farther than `reach` (scene units) from it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn beside(
        mut self,
        layers: &Layers,
        reach: f64,
        budget: &Budget,
    ) -> Result<PatchPlan, Exhausted> {
        self.collisions = self.collisions.beside(layers, reach, budget)?;
        Ok(self)
    }

    /// Separates a finished patch from a mesh that the plan does not contain; the patch stays clear of what the plan
    /// contains.
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

    /// How attributes are continued into the patches of this plan; `chart` must be the plan's.
    pub fn attribute_map<'a>(&'a self, chart: &'a Chart) -> AttributeMap<'a> {
        AttributeMap::on_chart(&self.rim_extension, chart)
    }

    /// How many vertices are not on the rim.
    fn free(&self) -> usize {
        self.triangulation.points.len() - self.rim.len()
    }

    /// Bytes of memory held, about.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rim[..])
            + size_of_val(&self.rim_positions[..])
            + self.shift.as_ref().map_or(0, |s| size_of_val(&s[..]))
            + size_of_val(&self.triangulation.points[..])
            + size_of_val(&self.triangulation.faces[..])
            + self.rim_extension.bytes()
            + self.join.bytes()
            + self.energy.bytes()
            + self.collisions.bytes()
    }

    /// Meshes the hole with the positions of a filled grid (one per cell, scene space) and moves it towards the targets
    /// of the pulls.
    ///
    /// `chart` must be the plan's. Of the options only those of strain limiting are read; other lengths of bending and
    /// tether than the plan's cost a new factor. A pull beside the hole, or next to its rim, does nothing.
    ///
    /// # Errors
    /// `Singular` when triangles are degenerate; `Exhausted`.
    pub fn patch<'a>(
        &self,
        chart: &Chart,
        filled: &[Vec3],
        pulls: &[Pull],
        work: impl Into<PatchWork<'a>>,
    ) -> Result<Patch, PatchError> {
        let PatchWork {
            options,
            budget,
            last,
        } = work.into();
        let strain = &options.strain;
        let refactored;
        let energy = if self.energy.fits(strain) {
            &self.energy
        } else {
            refactored = StrainEnergy::new(&self.join.rest(), strain, budget)
                .map_err(PatchError::of_stage("strain"))?;
            &refactored
        };
        let initial = self.join.with_inner(self.initial(chart, filled)?);
        let target = energy.target_near(&initial, strain);
        let mut positions = last
            .and_then(|last| last.at_rest(&initial))
            .unwrap_or_else(|| initial.clone());
        let minimisation = Minimisation {
            energy,
            target: &target,
            forces: None,
            options: *strain,
            budget,
        };
        let rounds = minimisation.run(&mut positions);
        if let Some(last) = last {
            last.keep_rest(initial, &positions);
        }
        let mut patch = Patch {
            rim: self.rim.clone(),
            flat: self.triangulation.points.clone(),
            positions: self.with_rim(&positions),
            faces: self.triangulation.faces.clone(),
            strain_rounds: rounds.map_err(PatchError::of_stage("strain"))?,
            collisions: 0,
            crossings: 0,
        };
        self.shift(&mut patch.positions, 1.0);
        if last.is_none() || pulls.is_empty() {
            (self.collisions).separate(&mut patch, Untangling::Always, budget)?;
        }
        if pulls.is_empty() {
            return Ok(patch);
        }
        let mut unshifted = patch.positions.clone();
        self.shift(&mut unshifted, -1.0);
        let mut positions = self.join.with_inner(unshifted.split_off(self.rim.len()));
        let forces = self.forces(pulls, chart, &positions, budget)?;
        if !forces.is_empty() {
            let at_rest = last.map(|last| (last, positions.clone()));
            let places: Vec<Vec2> = pulls.iter().map(|pull| pull.at).collect();
            let near = last.and_then(|last| last.pulled(&places, &positions));
            let rounds = self.apply_forces(&minimisation, &mut positions, &forces, near);
            if let Some((last, at_rest)) = at_rest {
                last.keep_pulled(places, at_rest, &positions);
            }
            patch.strain_rounds += rounds.map_err(PatchError::of_stage("strain"))?;
            patch.positions = self.with_rim(&positions);
            self.shift(&mut patch.positions, 1.0);
            (self.collisions).separate(&mut patch, Untangling::Always, budget)?;
        }
        Ok(patch)
    }

    /// Adds `share` of the shift to the positions of a patch.
    fn shift(&self, positions: &mut [Vec3], share: f64) {
        let by = self.shift.as_deref().unwrap_or_default();
        let each = positions.iter_mut().zip(by);
        each.for_each(|(p, by)| *p += by * share);
    }

    /// Positions of the patch: the rim's, then the inner ones of a [`RimJoin`].
    fn with_rim(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let rim = self.rim_positions.iter().copied();
        rim.chain(positions[..self.free()].iter().copied())
            .collect()
    }

    /// Positions of the inner vertices, read off the filled grid (bicubic). The differences between grid and scan at
    /// the rim are added, with their harmonic extension inside, so that the seam is closed.
    fn initial(&self, chart: &Chart, filled: &[Vec3]) -> Result<Vec<Vec3>, PatchError> {
        let sampled: Vec<Vec3> = (self.triangulation.points.iter())
            .map(|p| grid::evaluate(filled, chart.frame.uv(*p)))
            .collect();
        let gaps: Vec<[f64; 3]> = (self.rim_positions.iter().zip(&sampled))
            .map(|(own, sampled)| (own - sampled).into())
            .collect();
        let extended = (self.rim_extension.extend(&gaps)).map_err(PatchError::of_stage("seam"))?;
        let closed = (sampled.iter().zip(&extended)).map(|(p, d)| p + Vec3::from(*d));
        Ok(closed.skip(self.rim.len()).collect())
    }
}

/// Edge length of a patch in the plane, scene units: a grid cell's side, so that the patch follows all folds of the
/// grid, but at most the scan's median edge and at least `FINER` of it.
fn spacing(region: &Region, chart: &Chart) -> f64 {
    let (edge, cell) = (
        median_edge(region, chart),
        chart.frame.side / grid::SIDE as f64,
    );
    // Not `clamp`, which panics when the chart is not finite.
    cell.max(FINER * edge).min(edge)
}

/// Least edge length of a patch ÷ median edge length of the scan.
const FINER: f64 = 0.5;

/// Median edge length of a region in the plane, scene units; 1 without faces.
pub fn median_edge(region: &Region, chart: &Chart) -> f64 {
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
