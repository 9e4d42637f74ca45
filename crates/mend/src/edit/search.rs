//! The anchor search: at which cell of the hole an anchor brings the cloth nearest to a target (paper §3.5). Several
//! descents go from cell to cell along the loss's gradient, side by side, so that the network is always asked in
//! batches.

use std::collections::{BTreeMap, BTreeSet};

use super::cells::HoleCells;
use darn_geometry::grid::{SIDE, cell_centre, cell_index};
use darn_geometry::mesh::Vec2;

/// The loss of an anchor at each cell of a hole, in squared cells.
pub trait LossField {
    /// Why there is no answer.
    type Error;

    /// The loss at each of the cells.
    ///
    /// # Errors
    /// Whatever keeps the field from answering.
    fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, Self::Error>;

    /// Loss and gradient at each of the cells.
    ///
    /// # Errors
    /// Whatever keeps the field from answering.
    fn gradients(&self, cells: &[usize]) -> Result<Vec<CellLoss>, Self::Error>;
}

/// The loss at a cell and its gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellLoss {
    /// Squared cells.
    pub loss: f64,
    /// Its derivative by u and v, per cell width.
    pub gradient: Vec2,
}

/// How far an anchor search goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchOptions {
    /// How many descents start from the best seeds; one always starts from the first seed.
    pub descents: usize,
    /// The longest first step, in cells.
    pub stride: f64,
    /// Most steps of each descent.
    pub steps: usize,
    /// Cells that are asked about together.
    pub batch: usize,
}

impl Default for SearchOptions {
    fn default() -> Self {
        SearchOptions {
            descents: 4,
            stride: 8.0,
            steps: 32,
            batch: 64,
        }
    }
}

/// The result of an anchor search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchOutcome {
    /// The cell with the least loss.
    pub cell: usize,
    /// The loss there.
    pub loss: f64,
    /// The cells that led there.
    pub path: Vec<PathCell>,
    /// Forward passes, each cell of a batch counted, those with a gradient included.
    pub evaluations: u32,
    /// Forward passes with a gradient.
    pub gradients: u32,
}

/// A cell on the path of a descent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathCell {
    /// The cell.
    pub cell: usize,
    /// Loss and gradient there.
    pub at: CellLoss,
}

/// Descends from the best of the seeds along the negative gradient, from cell to cell. A step is halved, down to one
/// cell, until it lowers the loss; at last the best descent goes to neighbouring cells as long as one of them is lower.
/// Every step lowers the loss, so no descent comes to a cell twice.
///
/// All step lengths of all descents are tried in one batch. `None` when no seed lies in the hole.
///
/// # Errors
/// Whatever the field fails with.
pub fn descend<F: LossField>(
    field: &F,
    hole: &HoleCells,
    seeds: &[usize],
    options: &SearchOptions,
) -> Result<Option<SearchOutcome>, F::Error> {
    let mut known = KnownLosses::of(field, options.batch);
    let seeds: Vec<usize> = (seeds.iter().copied())
        .filter(|k| hole.contains(*k))
        .collect();
    known.ask_losses(&seeds)?;
    let starts = best_seeds(&known, &seeds, options.descents);
    let mut descents: Vec<Descent> = (starts.into_iter())
        .map(|cell| Descent::from(cell, options.stride))
        .collect();
    for _ in 0..options.steps {
        let unfinished: Vec<usize> = (descents.iter())
            .filter(|d| d.stride > 0.0)
            .map(|d| d.cell)
            .collect();
        if unfinished.is_empty() {
            break;
        }
        known.ask_gradients(&unfinished)?;
        let steps: Vec<Vec<DownhillStep>> =
            descents.iter().map(|d| d.steps(&known, hole)).collect();
        let tried: Vec<usize> = steps.iter().flatten().map(|step| step.cell).collect();
        known.ask_losses(&tried)?;
        for (descent, steps) in descents.iter_mut().zip(&steps) {
            descent.take_lowest(steps, &known);
        }
    }
    let best = descents.into_iter().min_by(|a, b| {
        (known.loss(a.cell).total_cmp(&known.loss(b.cell))).then(a.cell.cmp(&b.cell))
    });
    let Some(mut best) = best else {
        return Ok(None);
    };
    for _ in 0..options.steps {
        let around: Vec<usize> = around(best.cell).filter(|k| hole.contains(*k)).collect();
        known.ask_losses(&around)?;
        match known.least(&around) {
            Some(next) if known.loss(next) < known.loss(best.cell) => best.move_to(next),
            _ => break,
        }
    }
    known.ask_gradients(&best.path)?;
    Ok(Some(known.outcome(best.cell, &best.path)))
}

/// Tries every cell of the hole. `None` when it has none.
///
/// # Errors
/// Whatever the field fails with.
pub fn search_every_cell<F: LossField>(
    field: &F,
    hole: &HoleCells,
    options: &SearchOptions,
) -> Result<Option<SearchOutcome>, F::Error> {
    let mut known = KnownLosses::of(field, options.batch);
    known.ask_losses(hole.indices())?;
    let Some(cell) = known.least(hole.indices()) else {
        return Ok(None);
    };
    known.ask_gradients(&[cell])?;
    Ok(Some(known.outcome(cell, &[cell])))
}

/// Where descents may start: the given cell, then cells of the hole as far from it and from each other as possible;
/// `count` in all.
pub fn seeds(hole: &HoleCells, first: usize, count: usize) -> Vec<usize> {
    let centres: Vec<Vec2> = hole.indices().iter().map(|k| cell_centre(*k)).collect();
    let spread = farthest_first(&centres, &[cell_centre(first)], count.saturating_sub(1));
    let spread = spread.into_iter().map(|k| hole.indices()[k]);
    std::iter::once(first).chain(spread).collect()
}

/// Indices of up to `most` of the points, each the farthest from `taken` and the ones before it (Gonzalez 1985). The
/// first point comes first if none is taken.
pub fn farthest_first(points: &[Vec2], taken: &[Vec2], most: usize) -> Vec<usize> {
    if points.len() <= most {
        return (0..points.len()).collect();
    }
    let mut away: Vec<f64> = (points.iter())
        .map(|p| {
            let each = taken.iter().map(|t| (p - t).norm_squared());
            each.fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mut chosen = Vec::new();
    while chosen.len() < most {
        let farthest =
            (0..points.len()).max_by(|a, b| away[*a].total_cmp(&away[*b]).then(b.cmp(a)));
        let Some(next) = farthest.filter(|k| away[*k] > 0.0) else {
            break;
        };
        for (d, p) in away.iter_mut().zip(points) {
            *d = d.min((p - points[next]).norm_squared());
        }
        chosen.push(next);
    }
    chosen
}

/// The first seed, and the best of the others; `most` in all.
fn best_seeds<F: LossField>(known: &KnownLosses<F>, seeds: &[usize], most: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = seeds.first().copied().into_iter().collect();
    let mut others: Vec<usize> = seeds.iter().copied().skip(1).collect();
    others.sort_by(|a, b| known.loss(*a).total_cmp(&known.loss(*b)).then(a.cmp(b)));
    for cell in others {
        if chosen.len() < most && !chosen.contains(&cell) {
            chosen.push(cell);
        }
    }
    chosen
}

/// One descent and the cells on its path.
struct Descent {
    cell: usize,
    /// The longest step to try next, in cells; 0 when the descent has ended.
    stride: f64,
    path: Vec<usize>,
}

/// A step that a descent may take.
struct DownhillStep {
    /// Its length, in cells.
    stride: f64,
    /// The cell it ends in.
    cell: usize,
}

impl Descent {
    fn from(cell: usize, stride: f64) -> Descent {
        Descent {
            cell,
            stride,
            path: vec![cell],
        }
    }

    fn move_to(&mut self, cell: usize) {
        self.cell = cell;
        self.path.push(cell);
    }

    /// The steps downhill of the stride's length, half of it, … one cell; none when the descent has ended or the
    /// gradient is zero.
    fn steps<F: LossField>(&self, known: &KnownLosses<F>, hole: &HoleCells) -> Vec<DownhillStep> {
        let Some(here) = known.gradient(self.cell).filter(|_| self.stride > 0.0) else {
            return Vec::new();
        };
        let Some(down) = (-here.gradient).try_normalize(1e-12) else {
            return Vec::new();
        };
        let mut steps: Vec<DownhillStep> = Vec::new();
        let mut stride = self.stride;
        while stride >= 1.0 {
            let cell = moved(self.cell, down * stride)
                .filter(|k| hole.contains(*k) && *k != self.cell)
                .filter(|k| steps.iter().all(|tried| tried.cell != *k));
            steps.extend(cell.map(|cell| DownhillStep { stride, cell }));
            stride *= 0.5;
        }
        steps
    }

    /// Takes the step to the lowest cell if that is lower than this one, and ends otherwise.
    fn take_lowest<F: LossField>(&mut self, steps: &[DownhillStep], known: &KnownLosses<F>) {
        let here = known.loss(self.cell);
        let lowest = steps
            .iter()
            .min_by(|a, b| known.loss(a.cell).total_cmp(&known.loss(b.cell)));
        match lowest {
            Some(step) if known.loss(step.cell) < here => {
                self.stride = step.stride;
                self.move_to(step.cell);
            }
            _ => self.stride = 0.0,
        }
    }
}

/// The cell that a step from a cell's centre ends in, at least one cell away along the longer axis; `None` outside the
/// grid.
fn moved(cell: usize, by: Vec2) -> Option<usize> {
    let longest = by.amax().max(f64::MIN_POSITIVE);
    let by = if longest < 1.0 { by / longest } else { by };
    let along = |at: usize, by: f64| {
        let to = at as f64 + by.round();
        (0.0..SIDE as f64).contains(&to).then_some(to as usize)
    };
    Some(cell_index(
        along(cell % SIDE, by.x)?,
        along(cell / SIDE, by.y)?,
    ))
}

/// The up to eight cells around a cell.
fn around(cell: usize) -> impl Iterator<Item = usize> {
    let steps = (0..9).filter(|k| *k != 4);
    steps.filter_map(move |k| moved(cell, Vec2::new(f64::from(k % 3 - 1), f64::from(k / 3 - 1))))
}

/// What the field has answered so far; it is asked about no cell twice.
struct KnownLosses<'a, F> {
    field: &'a F,
    batch: usize,
    losses: BTreeMap<usize, f64>,
    gradients: BTreeMap<usize, CellLoss>,
    evaluations: u32,
    gradient_evaluations: u32,
}

impl<'a, F: LossField> KnownLosses<'a, F> {
    fn of(field: &'a F, batch: usize) -> Self {
        KnownLosses {
            field,
            batch: batch.max(1),
            losses: BTreeMap::new(),
            gradients: BTreeMap::new(),
            evaluations: 0,
            gradient_evaluations: 0,
        }
    }

    fn ask_losses(&mut self, cells: &[usize]) -> Result<(), F::Error> {
        let new = unique(cells, |k| !self.losses.contains_key(k));
        for batch in new.chunks(self.batch) {
            let losses = self.field.losses(batch)?;
            self.losses.extend(batch.iter().copied().zip(losses));
            self.evaluations += batch.len() as u32;
        }
        Ok(())
    }

    fn ask_gradients(&mut self, cells: &[usize]) -> Result<(), F::Error> {
        let new = unique(cells, |k| !self.gradients.contains_key(k));
        for batch in new.chunks(self.batch) {
            let gradients = self.field.gradients(batch)?;
            self.gradients.extend(batch.iter().copied().zip(gradients));
            self.evaluations += batch.len() as u32;
            self.gradient_evaluations += batch.len() as u32;
        }
        Ok(())
    }

    /// The loss at a cell; infinite where it is not a number or was not asked for.
    fn loss(&self, cell: usize) -> f64 {
        let loss = self.losses.get(&cell).copied().filter(|x| x.is_finite());
        loss.unwrap_or(f64::INFINITY)
    }

    fn gradient(&self, cell: usize) -> Option<CellLoss> {
        self.gradients.get(&cell).copied()
    }

    fn least(&self, cells: &[usize]) -> Option<usize> {
        let each = cells.iter().copied();
        each.min_by(|a, b| self.loss(*a).total_cmp(&self.loss(*b)).then(a.cmp(b)))
    }

    fn outcome(&self, cell: usize, path: &[usize]) -> SearchOutcome {
        let path_cell = |cell: &usize| {
            let at = self.gradient(*cell)?;
            Some(PathCell { cell: *cell, at })
        };
        SearchOutcome {
            cell,
            loss: self.loss(cell),
            path: path.iter().filter_map(path_cell).collect(),
            evaluations: self.evaluations,
            gradients: self.gradient_evaluations,
        }
    }
}

/// The cells that `is_new` accepts, each once, in their order.
fn unique(cells: &[usize], is_new: impl Fn(&usize) -> bool) -> Vec<usize> {
    let mut seen = BTreeSet::new();
    let each = cells.iter().copied();
    each.filter(|k| is_new(k) && seen.insert(*k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::cells::testing::disk;
    use darn_geometry::grid::cell_at;
    use proptest::prelude::*;

    /// A loss given as a function, with its gradient by differences.
    struct Bowl<F>(F);

    impl<F: Fn(Vec2) -> f64> LossField for Bowl<F> {
        type Error = std::convert::Infallible;

        fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, Self::Error> {
            Ok(cells
                .iter()
                .map(|k| (self.0)(cell_centre(*k) * 64.0))
                .collect())
        }

        fn gradients(&self, cells: &[usize]) -> Result<Vec<CellLoss>, Self::Error> {
            let at_cell = |k: &usize| {
                let at = cell_centre(*k) * 64.0;
                let by = |d: Vec2| ((self.0)(at + d) - (self.0)(at - d)) / (2.0 * d.norm());
                CellLoss {
                    loss: (self.0)(at),
                    gradient: Vec2::new(by(Vec2::x() * 1e-3), by(Vec2::y() * 1e-3)),
                }
            };
            Ok(cells.iter().map(at_cell).collect())
        }
    }

    proptest! {
        #[test]
        fn in_a_bowl_descent_finds_the_cell_that_trying_all_finds(
            x in 24.0..40.0f64, y in 24.0..40.0f64, tilt in 0.2..2.0f64, start in 0usize..600
        ) {
            let hole = disk(14.0);
            let bowl = Bowl(|at: Vec2| (at.x - x).powi(2) + tilt * (at.y - y).powi(2) + 0.3 * (at.x - x) * (at.y - y));
            let first = hole.indices()[start % hole.indices().len()];
            let found = descend(&bowl, &hole, &seeds(&hole, first, 8), &SearchOptions::default()).unwrap().unwrap();
            let best = search_every_cell(&bowl, &hole, &SearchOptions::default()).unwrap().unwrap();
            prop_assert_eq!(found.cell, best.cell);
            prop_assert!(found.evaluations < best.evaluations / 3, "{}", found.evaluations);
            prop_assert!(found.path.windows(2).all(|w| w[1].at.loss < w[0].at.loss));
            prop_assert_eq!(found.path.last().unwrap().cell, found.cell);
        }

        #[test]
        fn it_ends_on_any_loss(heights in prop::collection::vec(prop_oneof![Just(f64::NAN), -1.0..1.0f64], 4096)) {
            let hole = disk(9.0);
            let rough = Bowl(|at: Vec2| heights[cell_at(at / 64.0)]);
            let found = descend(&rough, &hole, &seeds(&hole, hole.indices()[0], 5), &SearchOptions::default()).unwrap().unwrap();
            prop_assert!(hole.contains(found.cell));
            prop_assert!(found.path.len() < 200);
        }
    }

    #[test]
    fn no_seed_in_the_hole_finds_nothing() {
        let hole = disk(9.0);
        let found = descend(&Bowl(|_| 0.0), &hole, &[0], &SearchOptions::default()).unwrap();
        assert_eq!(found, None);
    }
}
