//! The anchor search on a hole: the network's loss at each cell, the start, and the answer in the contract's words.

use std::cmp::Reverse;
use std::time::Instant;

use crate::context::HoleContext;
use crate::edit::{
    CellLoss, LossField, PathCell, SearchOutcome, descend, map, nearest_cell, search_every_cell,
    seeds,
};
use crate::error::MendError;
use crate::inpainter::Inpainter;
use crate::timings::milliseconds;
use darn_budget::Budget;
use darn_contract::port::MapSpan;
use darn_contract::{FieldError, Search, v1};
use darn_geometry::grid::{CELLS, SIDE, cell_centre};
use darn_geometry::mesh::{Vec2, Vec3};
use darn_net::{AnchorLoss, AnchorProblem};

/// Targets farther from the hole than this many of its extents are moved to that distance along the same line: the
/// network computes in f32.
const FAR: f64 = 100.0;

/// Nanoseconds of work of the network a cell.
const LOSS_WORK: u64 = 5_000_000;
/// The same with the gradient.
const GRADIENT_WORK: u64 = 12_500_000;

/// The network's loss of an anchor at a target, for each cell.
struct AnchorLosses<'a> {
    inpainter: &'a Inpainter<'a>,
    problem: AnchorProblem,
    /// How far the target was moved towards the hole, scene units.
    moved_in: f64,
    budget: &'a Budget<'a>,
}

impl<'a> AnchorLosses<'a> {
    fn new(context: &'a HoleContext<'a>, target: Vec3) -> Result<AnchorLosses<'a>, MendError> {
        let hole = context.hole;
        let centre = hole.normal.centre;
        let near = centre + (target - centre).cap_magnitude(FAR * hole.extent());
        let target_at = hole.normal.to_network(&near);
        let inpainter = &context.inpainter;
        Ok(AnchorLosses {
            moved_in: (target - near).norm(),
            problem: inpainter.anchor_problem(&hole.normal_grid(), target_at)?,
            inpainter,
            budget: context.call.budget,
        })
    }
}

impl LossField for AnchorLosses<'_> {
    type Error = MendError;

    fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, MendError> {
        self.budget.spend(LOSS_WORK * cells.len() as u64)?;
        let losses = self.inpainter.losses(&self.problem, &uvs(cells))?;
        Ok(losses.into_iter().map(f64::from).collect())
    }

    fn gradients(&self, cells: &[usize]) -> Result<Vec<CellLoss>, MendError> {
        self.budget.spend(GRADIENT_WORK * cells.len() as u64)?;
        let losses = self.inpainter.gradients(&self.problem, &uvs(cells))?;
        let cell_loss = |at: AnchorLoss| CellLoss {
            loss: at.loss.into(),
            gradient: Vec2::new(at.gradient[0].into(), at.gradient[1].into()),
        };
        Ok(losses.into_iter().map(cell_loss).collect())
    }
}

fn uvs(cells: &[usize]) -> Vec<[f32; 2]> {
    let uv = |k: &usize| cell_centre(*k).cast::<f32>().into();
    cells.iter().map(uv).collect()
}

impl HoleContext<'_> {
    /// The uv at which an anchor brings the cloth nearest to a position in scene space.
    ///
    /// # Errors
    /// `NoCells` when no cell lies in the hole; a failure of the network.
    pub fn place_anchor(&self, position: Vec3) -> Result<Vec2, MendError> {
        let losses = AnchorLosses::new(self, position)?;
        let first = (self.cell_near(position)).ok_or_else(|| self.no_cells())?;
        Ok(cell_centre(self.descend(&losses, first)?.cell))
    }

    /// Searches as asked, and reports the place and the path of the search.
    ///
    /// # Errors
    /// At `/start` when that does not lie in the hole; `NoCells` when no cell does; a failure of the network;
    /// `Exhausted`.
    pub fn search(&self, search: &Search) -> Result<v1::AnchorFound, MendError> {
        let started = Instant::now();
        let hole = self.hole;
        let target = Vec3::from(search.target);
        let losses = AnchorLosses::new(self, target)?;
        let first = match search.start {
            None => self.cell_near(target),
            Some(uv) if hole.contains(uv.into()) => nearest_cell(&hole.cells, uv.into()),
            Some([u, v]) => {
                let detail = format!("[{u}, {v}] does not lie in the hole");
                let wrong = FieldError::new("/start", detail);
                return Err(MendError::Constraints(vec![wrong]));
            }
        };
        let first = first.ok_or_else(|| self.no_cells())?;
        let outcome = if search.exhaustive {
            let outcome = search_every_cell(&losses, &hole.cells, &self.call.mender.limits.search)?;
            outcome.ok_or_else(|| self.no_cells())?
        } else {
            self.descend(&losses, first)?
        };
        let mut answer = self.answer(&outcome);
        answer.distance += losses.moved_in;
        if search.map {
            let map = self.map(&losses, search.map_gradient)?;
            self.add_map(&mut answer, &map, &outcome.path)?;
        }
        answer.milliseconds = milliseconds(started);
        Ok(answer)
    }

    /// Some of the hole's cells with the losses of a search's target, and gradients where the search asks for them. Cells far from each other
    /// come first: those on every 32nd row and column, then on every 16th, and so on.
    ///
    /// # Errors
    /// A failure of the network; `Exhausted`.
    pub fn map_piece(&self, search: &Search, span: MapSpan) -> Result<v1::MapPiece, MendError> {
        let losses = AnchorLosses::new(self, Vec3::from(search.target))?;
        let mut cells = self.hole.cells.indices().to_vec();
        let total = cells.len() as u32;
        let spread = |k: &usize| ((k % SIDE) | (k / SIDE)).trailing_zeros();
        cells.sort_by_key(|k| (Reverse(spread(k)), *k));
        let piece: Vec<usize> = (cells.into_iter().skip(span.first))
            .take(span.count)
            .collect();
        let (mut values, mut gradients) = (Vec::new(), Vec::new());
        if search.map_gradient {
            let found = losses.gradients(&piece)?;
            values.extend(found.iter().map(|at| at.loss));
            gradients.extend(found.iter().flat_map(|at| <[f64; 2]>::from(at.gradient)));
        } else {
            values = losses.losses(&piece)?;
        }
        Ok(v1::MapPiece {
            cells: piece.iter().map(|k| *k as u32).collect(),
            losses: values,
            gradients,
            total,
        })
    }

    fn no_cells(&self) -> MendError {
        MendError::NoCells { hole: self.hole.id }
    }

    fn descend(&self, losses: &AnchorLosses, first: usize) -> Result<SearchOutcome, MendError> {
        let cells = &self.hole.cells;
        let seeds = seeds(cells, first, self.call.mender.limits.seeds);
        let outcome = descend(losses, cells, &seeds, &self.call.mender.limits.search)?;
        outcome.ok_or_else(|| self.no_cells())
    }

    /// The hole's cell whose unedited position is nearest to a target.
    fn cell_near(&self, target: Vec3) -> Option<usize> {
        let away = |k: &usize| (self.unedited.filled[*k] - target).norm_squared();
        let each = self.hole.cells.indices().iter().copied();
        each.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
    }

    fn answer(&self, outcome: &SearchOutcome) -> v1::AnchorFound {
        let column_and_row = |k: usize| vec![(k % SIDE) as u32, (k / SIDE) as u32];
        let step = |step: &PathCell| v1::SearchStep {
            cell: column_and_row(step.cell),
            loss: step.at.loss,
            gradient: step.at.gradient.iter().copied().collect(),
        };
        v1::AnchorFound {
            hole: self.hole.id,
            uv: cell_centre(outcome.cell).iter().copied().collect(),
            cell: column_and_row(outcome.cell),
            loss: outcome.loss,
            distance: outcome.loss.max(0.0).sqrt() * self.hole.cell_width(),
            path: outcome.path.iter().map(step).collect(),
            evaluations: outcome.evaluations,
            gradients: outcome.gradients,
            ..Default::default()
        }
    }

    /// The loss of every cell of the hole, with its gradient: the network's own where that is asked for, else by the
    /// differences of neighbouring cells.
    fn map(&self, losses: &AnchorLosses, exact: bool) -> Result<LossMap, MendError> {
        let cells = self.hole.cells.indices();
        let mut at_cells: Vec<Option<CellLoss>> = vec![None; CELLS];
        for batch in cells.chunks(self.call.mender.limits.search.batch.max(1)) {
            let found = if exact {
                losses.gradients(batch)?
            } else {
                let alone = |loss| CellLoss {
                    loss,
                    gradient: Vec2::zeros(),
                };
                losses.losses(batch)?.into_iter().map(alone).collect()
            };
            for (cell, at) in batch.iter().zip(found) {
                at_cells[*cell] = Some(at);
            }
        }
        if !exact {
            for (cell, gradient) in gradients_by_differences(&at_cells) {
                if let Some(at) = &mut at_cells[cell] {
                    at.gradient = gradient;
                }
            }
        }
        Ok(LossMap {
            at_cells,
            evaluations: cells.len() as u32,
            exact,
        })
    }

    /// Adds a map to an answer, as numbers and as a picture.
    fn add_map(
        &self,
        answer: &mut v1::AnchorFound,
        map: &LossMap,
        path: &[PathCell],
    ) -> Result<(), MendError> {
        answer.evaluations += map.evaluations;
        let loss = |at: &Option<CellLoss>| at.map_or(f64::NAN, |at| at.loss);
        answer.map = map.at_cells.iter().map(loss).collect();
        if map.exact {
            answer.gradients += map.evaluations;
            let gradient =
                |at: &Option<CellLoss>| at.map_or([f64::NAN; 2], |at| at.gradient.into());
            answer.map_gradient = map.at_cells.iter().flat_map(gradient).collect();
        }
        let png = map::png(&map::picture(&map.at_cells, path)).map_err(MendError::Picture)?;
        answer.map_png = png.into();
        Ok(())
    }
}

/// The loss of every cell of a hole.
struct LossMap {
    /// One for each of the grid's cells; `None` outside the hole.
    at_cells: Vec<Option<CellLoss>>,
    /// Forward passes that it took.
    evaluations: u32,
    /// Whether the gradients are the network's own.
    exact: bool,
}

/// Per cell with a loss its gradient, per cell width: central differences, one-sided ones next to the hole's rim.
fn gradients_by_differences(at_cells: &[Option<CellLoss>]) -> Vec<(usize, Vec2)> {
    let loss = |k: usize| at_cells.get(k).copied().flatten().map(|at| at.loss);
    let along = |cell: usize, place: usize, step: usize| {
        let here = loss(cell)?;
        let before = cell.checked_sub(step).filter(|_| place > 0).and_then(loss);
        let after = loss(cell + step).filter(|_| place + 1 < SIDE);
        Some(match (before, after) {
            (Some(before), Some(after)) => 0.5 * (after - before),
            (Some(before), None) => here - before,
            (None, Some(after)) => after - here,
            (None, None) => 0.0,
        })
    };
    let gradient = |cell: usize| {
        let (u, v) = (
            along(cell, cell % SIDE, 1)?,
            along(cell, cell / SIDE, SIDE)?,
        );
        Some((cell, Vec2::new(u, v)))
    };
    (0..CELLS).filter_map(gradient).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_give_the_gradient_of_a_plane_to_the_rim() {
        let (du, dv) = (0.3, -0.7);
        let in_hole = |k: usize| (5..60).contains(&(k % SIDE)) && k / SIDE > 40;
        let plane = |k: usize| CellLoss {
            loss: du * (k % SIDE) as f64 + dv * (k / SIDE) as f64,
            gradient: Vec2::zeros(),
        };
        let at_cells: Vec<Option<CellLoss>> =
            (0..CELLS).map(|k| in_hole(k).then(|| plane(k))).collect();
        let found = gradients_by_differences(&at_cells);
        assert_eq!(found.len(), (0..CELLS).filter(|k| in_hole(*k)).count());
        for (cell, gradient) in found {
            assert!((gradient - Vec2::new(du, dv)).norm() < 1e-12, "{cell}");
        }
    }
}
