//! A patch in two halves: what the hole alone decides (triangles, factors), and what each fill of it needs.

use super::cloth::{Elastics, Fabric};
use super::contacts::Surroundings;
use super::harmonic::Extension;
use super::hem::Hem;
use super::pull::{Grip, Pull, Pulls};
use super::triangulate::{self, Triangulation};
use super::{Options, Patch, PatchError, locate, untangle};
use crate::flatten::Chart;
use crate::flatten::cholesky::NotPositive;
use crate::grid;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// Everything about a patch that does not depend on what fills the hole; owned, so that a session can keep it.
pub struct Plan {
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

/// Plans the patch of a region's hole.
///
/// # Errors
/// `RimCrosses` when the chart overlaps itself at the hole, `Singular` when triangles degenerate.
pub fn plan(region: &Region, chart: &Chart, options: &Options) -> Result<Plan, PatchError> {
    // The rim runs with the cloth on its left, so with the hole on its right: turned round it encloses the patch.
    let rim: Vec<u32> = region.rim.iter().rev().copied().collect();
    let polygon: Vec<Vec2> = rim.iter().map(|v| chart.flat[*v as usize]).collect();
    let polygon = untangle::untangled(&polygon).ok_or(PatchError::RimCrosses)?;
    let mut tiled =
        triangulate::triangulate(&polygon, spacing(region, chart), options.most_vertices)?;
    split_taken_chords(&mut tiled, &rim, region);

    let own: Vec<Vec3> = (rim.iter())
        .map(|v| region.mesh.positions[*v as usize])
        .collect();
    let held: Vec<u32> = (0..rim.len() as u32).collect();
    let seam = Extension::new(&tiled.points, &tiled.faces, &held).map_err(|_| singular("seam"))?;
    let hem = Hem::around(&rim, &tiled, region, chart);
    let fabric = Fabric::new(&hem.sheet(), &options.elastics).map_err(|_| singular("strain"))?;
    let surroundings = Surroundings::new(&rim, &tiled, region);
    Ok(Plan {
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

impl Plan {
    /// Joins the scan where its vertices really lie, when the region was one without the scanner's noise: the cloth is made without it,
    /// and what the rim is off by is spread harmonically.
    ///
    /// # Errors
    /// `Singular` when triangles degenerate.
    pub fn joining(mut self, positions: &[Vec3]) -> Result<Plan, PatchError> {
        let gaps: Vec<[f64; 3]> = (self.rim.iter().zip(&self.own))
            .map(|(v, own)| (positions[*v as usize] - own).into())
            .collect();
        let spread = self.seam.extend(&gaps).map_err(|_| singular("seam"))?;
        self.shift = Some(spread.into_iter().map(Vec3::from).collect());
        Ok(self)
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
        options: &Options,
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
        };
        patch.collisions = self.surroundings.separate(&mut patch);
        let grips = self.grips(pulls);
        if !grips.is_empty() {
            let inner = patch.positions[self.own.len()..].to_vec();
            let mut positions = self.hem.with_inner(inner);
            let rounds = self.pull(fabric, &mut positions, &grips, elastics);
            patch.strain_rounds += rounds.map_err(|_| singular("strain"))?;
            patch.positions = self.with_rim(&positions);
            patch.collisions += self.surroundings.separate(&mut patch);
        }
        for (p, shift) in patch.positions.iter_mut().zip(self.shift.iter().flatten()) {
            *p += shift;
        }
        Ok(patch)
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

    /// Draws the cloth, at rest where it lies, to where the pulls want it, as far as its strain allows; the rounds.
    fn pull(
        &self,
        fabric: &Fabric,
        positions: &mut [Vec3],
        grips: &[Grip],
        elastics: &Elastics,
    ) -> Result<usize, NotPositive> {
        let unpulled = positions.to_vec();
        let bound = STRETCH.max(MORE * self.stretch(&unpulled));
        let drawn = fabric.at_rest(positions);
        let mut ready = Pulls::new(fabric, positions, grips)?;
        self.lift(positions, grips)?;
        let mut rounds = 0;
        for _ in 0..=EASINGS {
            rounds += fabric.settle(&drawn, positions, elastics, &ready)?.rounds;
            if self.stretch(positions) <= bound {
                return Ok(rounds);
            }
            ready.ease();
        }
        positions.copy_from_slice(&unpulled);
        Ok(rounds)
    }

    /// Where the pulls take hold.
    fn grips(&self, pulls: &[Pull]) -> Vec<Grip> {
        let grip = |pull: &Pull| {
            let (face, weights) = locate(&self.tiled.points, &self.tiled.faces, pull.at)?;
            let face = self.tiled.faces[face];
            let corners = face.map(|v| self.hem.place(v) as usize);
            let shift = self.shift.as_ref().map_or(Vec3::zeros(), |shift| {
                let each = face.iter().zip(&weights);
                each.map(|(v, w)| shift[*v as usize] * *w).sum()
            });
            Some(Grip {
                corners: std::array::from_fn(|k| (corners[k], weights[k])),
                to: pull.to - shift,
                hold: pull.hold,
            })
        };
        pulls.iter().filter_map(grip).collect()
    }

    /// Moves the cloth so that the pulls are met, by the smoothest displacement that is zero at the rim (biharmonic): strain limiting
    /// starts from a fold, not from a spike.
    fn lift(&self, positions: &mut [Vec3], grips: &[Grip]) -> Result<(), NotPositive> {
        let free = self.tiled.points.len() - self.rim.len();
        let mut bumps = Vec::with_capacity(grips.len());
        for grip in grips {
            let mut bump = vec![[0.0]; free];
            for (v, w) in grip.corners.iter().filter(|(v, _)| *v < free) {
                bump[*v][0] += w;
            }
            self.seam.solve(&mut bump)?;
            self.seam.solve(&mut bump)?;
            bumps.push(bump);
        }
        let count = grips.len();
        let at = |grip: &Grip, bump: &[[f64; 1]]| -> f64 {
            let own = grip.corners.iter().filter(|(v, _)| *v < free);
            own.map(|(v, w)| bump[*v][0] * w).sum()
        };
        let mut gram = nalgebra::DMatrix::from_fn(count, count, |i, j| at(&grips[i], &bumps[j]));
        // Pulls on one triangle that disagree are met on average.
        let slack = 1e-6 * gram.trace() / count as f64 + f64::MIN_POSITIVE;
        (0..count).for_each(|k| gram[(k, k)] += slack);
        let mut gaps = nalgebra::DMatrix::zeros(count, 3);
        for (k, grip) in grips.iter().enumerate() {
            gaps.set_row(k, &(grip.to - grip.place(positions)).transpose());
        }
        gram.cholesky().ok_or(NotPositive)?.solve_mut(&mut gaps);
        for (k, bump) in bumps.iter().enumerate() {
            let gap = Vec3::new(gaps[(k, 0)], gaps[(k, 1)], gaps[(k, 2)]);
            (positions.iter_mut().zip(bump)).for_each(|(p, b)| *p += gap * b[0]);
        }
        Ok(())
    }

    /// Largest ratio of an edge with a free end to its length in the chart.
    fn stretch(&self, positions: &[Vec3]) -> f64 {
        let free = self.tiled.points.len() - self.rim.len();
        let sheet = self.hem.sheet();
        let edges = (sheet.faces.iter())
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .map(|(a, b)| (a as usize, b as usize))
            .filter(|(a, b)| *a.min(b) < free);
        let ratio = |(a, b): (usize, usize)| {
            (positions[a] - positions[b]).norm_squared()
                / (sheet.rest[a] - sheet.rest[b])
                    .norm_squared()
                    .max(f64::MIN_POSITIVE)
        };
        edges.map(ratio).fold(0.0, f64::max).sqrt()
    }
}

/// Pulls may stretch an edge this much, ...
const STRETCH: f64 = 1.25;
/// ... or this much more than it is stretched without them.
const MORE: f64 = 1.05;
/// How often the forces of pulls are halved before they are given up.
const EASINGS: usize = 8;

fn singular(stage: &'static str) -> PatchError {
    PatchError::Singular { stage }
}

/// Splits the patch's edges between rim vertices that the scan joins by an edge already.
fn split_taken_chords(tiled: &mut Triangulation, rim: &[u32], region: &Region) {
    let mut on_rim = vec![false; region.mesh.positions.len()];
    rim.iter().for_each(|v| on_rim[*v as usize] = true);
    let both = |(a, b): &(u32, u32)| on_rim[*a as usize] && on_rim[*b as usize];
    let mut edges: Vec<(u32, u32)> = (region.mesh.faces.iter())
        .flat_map(|f| (0..3).map(|k| (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]))))
        .filter(both)
        .collect();
    edges.sort_unstable();
    tiled.split_chords(rim.len(), |a, b| {
        let (a, b) = (rim[a as usize], rim[b as usize]);
        edges.binary_search(&(a.min(b), a.max(b))).is_ok()
    });
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
