//! The anchor search on a hole: the network as a landscape, the start, and the answer in the contract's words.

use std::time::Instant;

use super::inpainter::Inpainter;
use super::prepared::{Prepared, Unedited};
use super::{Call, MendError, MendLimits, milliseconds};
use crate::edit::{Found, Landscape, Slope, Step, descend, exhaust, map, nearest_cell, seeds};
use darn_contract::port::Cancellation;
use darn_contract::{FieldError, Search, v1};
use darn_geometry::grid::{CELLS, SIDE, cell_centre};
use darn_geometry::mesh::{Vec2, Vec3};
use darn_net::AnchorProblem;

/// Targets farther away than this many extents of the hole are looked for that far along the same line: the network's numbers are f32.
const FAR: f64 = 100.0;

/// The losses of an anchor at a target, cell by cell.
struct Losses<'a> {
    inpainter: &'a Inpainter<'a>,
    problem: AnchorProblem,
    /// How far the target was drawn in, scene units.
    drawn_in: f64,
    cancellation: Cancellation<'a>,
}

impl Losses<'_> {
    fn go_on(&self) -> Result<(), MendError> {
        match self.cancellation.is_cancelled() {
            true => Err(MendError::Abandoned),
            false => Ok(()),
        }
    }
}

impl<'a> Losses<'a> {
    fn new(
        prepared: &Prepared,
        inpainter: &'a Inpainter<'a>,
        target: Vec3,
    ) -> Result<Losses<'a>, MendError> {
        let centre = prepared.normal.centre;
        let near = centre + (target - centre).cap_magnitude(FAR * prepared.extent());
        let target_at = prepared.normal.to_network(&near);
        Ok(Losses {
            drawn_in: (target - near).norm(),
            problem: inpainter.anchor_problem(&prepared.normal_grid(), target_at)?,
            inpainter,
            cancellation: Cancellation::NEVER,
        })
    }
}

impl Landscape for Losses<'_> {
    type Error = MendError;

    fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, MendError> {
        self.go_on()?;
        let losses = self.inpainter.losses(&self.problem, &uvs(cells))?;
        Ok(losses.into_iter().map(f64::from).collect())
    }

    fn slopes(&self, cells: &[usize]) -> Result<Vec<Slope>, MendError> {
        self.go_on()?;
        let slopes = self.inpainter.slopes(&self.problem, &uvs(cells))?;
        let slope = |at: darn_net::AnchorLoss| Slope {
            loss: at.loss.into(),
            gradient: Vec2::new(at.gradient[0].into(), at.gradient[1].into()),
        };
        Ok(slopes.into_iter().map(slope).collect())
    }
}

fn uvs(cells: &[usize]) -> Vec<[f32; 2]> {
    let uv = |k: &usize| cell_centre(*k).cast::<f32>().into();
    cells.iter().map(uv).collect()
}

/// The uv at which an anchor brings the cloth nearest to a position.
pub fn place(
    prepared: &Prepared,
    unedited: &Unedited,
    inpainter: &Inpainter,
    (position, limits): (Vec3, &MendLimits),
) -> Result<Vec2, MendError> {
    let losses = Losses::new(prepared, inpainter, position)?;
    let first =
        nearest(prepared, unedited, position).ok_or(MendError::NoCells { hole: prepared.id })?;
    let found = walk(prepared, &losses, first, limits)?;
    Ok(cell_centre(found.cell))
}

/// Searches as asked and says how it went.
pub fn find(
    prepared: &Prepared,
    unedited: &Unedited,
    inpainter: &Inpainter,
    (search, call): (&Search, Call),
) -> Result<v1::AnchorFound, MendError> {
    let started = Instant::now();
    let limits = &call.mender.limits;
    let target = Vec3::from(search.target);
    let losses = Losses {
        cancellation: call.cancellation,
        ..Losses::new(prepared, inpainter, target)?
    };
    let first = match search.start {
        None => nearest(prepared, unedited, target),
        Some(uv) if prepared.holds(uv.into()) => nearest_cell(&prepared.cells, uv.into()),
        Some([u, v]) => {
            let detail = format!("[{u}, {v}] does not lie in the hole");
            return Err(MendError::Constraints(vec![FieldError::new(
                "/start", detail,
            )]));
        }
    };
    let none = MendError::NoCells { hole: prepared.id };
    let first = first.ok_or(none)?;
    let found = if search.exhaustive {
        let found = exhaust(&losses, &prepared.cells, &limits.search)?;
        found.ok_or(MendError::NoCells { hole: prepared.id })?
    } else {
        walk(prepared, &losses, first, limits)?
    };
    let mut answer = answer(prepared, &found);
    answer.distance += losses.drawn_in;
    if search.map {
        chart(prepared, &losses, &found, (&mut answer, limits))?;
    }
    answer.milliseconds = milliseconds(started);
    Ok(answer)
}

fn walk(
    prepared: &Prepared,
    losses: &Losses,
    first: usize,
    limits: &MendLimits,
) -> Result<Found, MendError> {
    let seeds = seeds(&prepared.cells, first, limits.seeds);
    let found = descend(losses, &prepared.cells, &seeds, &limits.search)?;
    found.ok_or(MendError::NoCells { hole: prepared.id })
}

/// The hole's cell whose unedited position is nearest to a target.
fn nearest(prepared: &Prepared, unedited: &Unedited, target: Vec3) -> Option<usize> {
    let away = |k: &usize| (unedited.filled[*k] - target).norm_squared();
    let each = prepared.cells.indices().iter().copied();
    each.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
}

fn answer(prepared: &Prepared, found: &Found) -> v1::AnchorFound {
    let place = |k: usize| vec![(k % SIDE) as u32, (k / SIDE) as u32];
    let step = |step: &Step| v1::SearchStep {
        cell: place(step.cell),
        loss: step.slope.loss,
        gradient: step.slope.gradient.iter().copied().collect(),
    };
    v1::AnchorFound {
        hole: prepared.id,
        uv: cell_centre(found.cell).iter().copied().collect(),
        cell: place(found.cell),
        loss: found.loss,
        distance: found.loss.max(0.0).sqrt() * prepared.cell(),
        path: found.path.iter().map(step).collect(),
        evaluations: found.evaluations,
        gradients: found.gradients,
        ..Default::default()
    }
}

/// Adds the map of the whole hole, which takes an evaluation with gradient of each of its cells.
fn chart(
    prepared: &Prepared,
    losses: &Losses,
    found: &Found,
    (answer, limits): (&mut v1::AnchorFound, &MendLimits),
) -> Result<(), MendError> {
    let mut slopes: Vec<Option<Slope>> = vec![None; CELLS];
    for cells in prepared.cells.indices().chunks(limits.search.batch.max(1)) {
        for (cell, slope) in cells.iter().zip(losses.slopes(cells)?) {
            slopes[*cell] = Some(slope);
        }
    }
    let count = prepared.cells.indices().len() as u32;
    answer.evaluations += count;
    answer.gradients += count;
    let loss = |s: &Option<Slope>| s.map_or(f64::NAN, |s| s.loss);
    let gradient = |s: &Option<Slope>| s.map_or([f64::NAN; 2], |s| s.gradient.into());
    answer.map = slopes.iter().map(loss).collect();
    answer.map_gradient = slopes.iter().flat_map(gradient).collect();
    let png = map::png(&map::picture(&slopes, &found.path)).map_err(MendError::Picture)?;
    answer.map_png = png.into();
    Ok(())
}
