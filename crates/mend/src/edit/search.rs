//! The anchor search: at which cell of the hole an anchor brings the cloth nearest to a target (paper 3.5).
//! Descent on whole cells along the loss's gradient, several walkers at once, so that the network is always asked in batches.

use std::collections::BTreeMap;

use super::HoleCells;
use darn_geometry::grid::{SIDE, cell_at, cell_centre, cell_index};
use darn_geometry::mesh::Vec2;

/// What the search walks on: the loss of an anchor at each cell of a hole, in squared cells.
pub trait Landscape {
    /// Why there is no answer.
    type Error;

    /// The loss at each cell.
    ///
    /// # Errors
    /// Whatever keeps the landscape from answering.
    fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, Self::Error>;

    /// Loss and gradient at each cell.
    ///
    /// # Errors
    /// Whatever keeps the landscape from answering.
    fn slopes(&self, cells: &[usize]) -> Result<Vec<Slope>, Self::Error>;
}

/// The loss at a cell and its gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// Squared cells.
    pub loss: f64,
    /// Its derivative by u and v, per cell width.
    pub gradient: Vec2,
}

/// How far a search goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchOptions {
    /// How many of the best seeds set out; the first seed always does.
    pub walkers: usize,
    /// The longest first step, in cells.
    pub stride: f64,
    /// Most steps of each walker.
    pub steps: usize,
    /// Cells that are asked about together.
    pub batch: usize,
}

impl Default for SearchOptions {
    fn default() -> Self {
        SearchOptions {
            walkers: 4,
            stride: 8.0,
            steps: 32,
            batch: 64,
        }
    }
}

/// What a search came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The cell with the least loss.
    pub cell: usize,
    /// The loss there.
    pub loss: f64,
    /// The cells that led there.
    pub path: Vec<Step>,
    /// Forward passes, those of a batch counted one by one, those with a gradient included.
    pub evaluations: u32,
    /// Those with a gradient.
    pub gradients: u32,
}

/// A cell on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The cell.
    pub cell: usize,
    /// Loss and gradient there.
    pub slope: Slope,
}

/// Walks down from the best of the seeds: along the negative gradient, on whole cells, with a step that is halved until it lowers the
/// loss, down to one cell; then to neighbouring cells as long as one of them is lower. Every step lowers the loss, so no cell is visited twice.
///
/// All step lengths of all walkers are tried in one batch. `None` when there is no seed in the hole.
///
/// # Errors
/// Whatever the landscape fails with.
pub fn descend<L: Landscape>(
    landscape: &L,
    hole: &HoleCells,
    seeds: &[usize],
    options: &SearchOptions,
) -> Result<Option<Found>, L::Error> {
    let mut asked = Asked::of(landscape, options.batch);
    let seeds: Vec<usize> = (seeds.iter().copied())
        .filter(|k| hole.contains(*k))
        .collect();
    asked.about(&seeds)?;
    let mut walkers: Vec<Walker> = (setting_out(&asked, &seeds, options.walkers).into_iter())
        .map(|cell| Walker::at(cell, options.stride))
        .collect();
    for _ in 0..options.steps {
        let standing: Vec<usize> = (walkers.iter())
            .filter(|w| w.stride > 0.0)
            .map(|w| w.cell)
            .collect();
        if standing.is_empty() {
            break;
        }
        asked.slopes_of(&standing)?;
        let ways: Vec<Vec<(f64, usize)>> =
            walkers.iter().map(|w| w.way_down(&asked, hole)).collect();
        let tried: Vec<usize> = ways.iter().flatten().map(|(_, cell)| *cell).collect();
        asked.about(&tried)?;
        for (walker, way) in walkers.iter_mut().zip(&ways) {
            walker.step(way, &asked);
        }
    }
    let best = walkers.into_iter().min_by(|a, b| {
        (asked.loss(a.cell).total_cmp(&asked.loss(b.cell))).then(a.cell.cmp(&b.cell))
    });
    let Some(mut best) = best else {
        return Ok(None);
    };
    for _ in 0..options.steps {
        let around: Vec<usize> = around(best.cell).filter(|k| hole.contains(*k)).collect();
        asked.about(&around)?;
        match asked.least(&around) {
            Some(next) if asked.loss(next) < asked.loss(best.cell) => best.to(next),
            _ => break,
        }
    }
    asked.slopes_of(&best.path)?;
    Ok(Some(asked.found(best.cell, &best.path)))
}

/// Tries every cell of the hole. `None` when it has none.
///
/// # Errors
/// Whatever the landscape fails with.
pub fn exhaust<L: Landscape>(
    landscape: &L,
    hole: &HoleCells,
    options: &SearchOptions,
) -> Result<Option<Found>, L::Error> {
    let mut asked = Asked::of(landscape, options.batch);
    asked.about(hole.indices())?;
    let Some(cell) = asked.least(hole.indices()) else {
        return Ok(None);
    };
    asked.slopes_of(&[cell])?;
    Ok(Some(asked.found(cell, &[cell])))
}

/// Where to start: the given cell first, then cells of the hole as far from it and from each other as they come.
pub fn seeds(hole: &HoleCells, first: usize, count: usize) -> Vec<usize> {
    let centres: Vec<Vec2> = hole.indices().iter().map(|k| cell_centre(*k)).collect();
    let spread = farthest_first(&centres, &[cell_centre(first)], count.saturating_sub(1));
    let spread = spread.into_iter().map(|k| hole.indices()[k]);
    std::iter::once(first).chain(spread).collect()
}

/// Up to `most` of the points, each the farthest from `taken` and the ones before it (Gonzalez 1985); from the first point if none is taken.
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

/// The first seed, and the best of the others.
fn setting_out<L: Landscape>(asked: &Asked<L>, seeds: &[usize], most: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = seeds.first().copied().into_iter().collect();
    let mut others: Vec<usize> = seeds.iter().copied().skip(1).collect();
    others.sort_by(|a, b| asked.loss(*a).total_cmp(&asked.loss(*b)).then(a.cmp(b)));
    for cell in others {
        if chosen.len() < most && !chosen.contains(&cell) {
            chosen.push(cell);
        }
    }
    chosen
}

/// One descent.
struct Walker {
    cell: usize,
    /// The longest step to try next, in cells; 0 when it has arrived.
    stride: f64,
    path: Vec<usize>,
}

impl Walker {
    fn at(cell: usize, stride: f64) -> Walker {
        Walker {
            cell,
            stride,
            path: vec![cell],
        }
    }

    fn to(&mut self, cell: usize) {
        self.cell = cell;
        self.path.push(cell);
    }

    /// The cells downhill at the stride, half of it, … one cell; none when it has arrived or stands on level ground.
    fn way_down<L: Landscape>(&self, asked: &Asked<L>, hole: &HoleCells) -> Vec<(f64, usize)> {
        let Some(slope) = asked.slope(self.cell).filter(|_| self.stride > 0.0) else {
            return Vec::new();
        };
        let Some(down) = (-slope.gradient).try_normalize(1e-12) else {
            return Vec::new();
        };
        let mut way: Vec<(f64, usize)> = Vec::new();
        let mut stride = self.stride;
        while stride >= 1.0 {
            let cell = moved(self.cell, down * stride)
                .filter(|k| hole.contains(*k) && *k != self.cell)
                .filter(|k| way.iter().all(|(_, tried)| tried != k));
            way.extend(cell.map(|cell| (stride, cell)));
            stride *= 0.5;
        }
        way
    }

    /// Goes to the first cell of the way that is lower, or stays for good.
    fn step<L: Landscape>(&mut self, way: &[(f64, usize)], asked: &Asked<L>) {
        let here = asked.loss(self.cell);
        let lowest = way
            .iter()
            .min_by(|a, b| asked.loss(a.1).total_cmp(&asked.loss(b.1)));
        match lowest {
            Some((stride, cell)) if asked.loss(*cell) < here => {
                self.stride = *stride;
                self.to(*cell);
            }
            _ => self.stride = 0.0,
        }
    }
}

/// The cell that a step from a cell's centre ends in; at least one cell away along the longer axis.
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

/// What the landscape has answered so far; no cell is asked about twice.
struct Asked<'a, L> {
    landscape: &'a L,
    batch: usize,
    losses: BTreeMap<usize, f64>,
    slopes: BTreeMap<usize, Slope>,
    evaluations: u32,
    gradients: u32,
}

impl<'a, L: Landscape> Asked<'a, L> {
    fn of(landscape: &'a L, batch: usize) -> Self {
        Asked {
            landscape,
            batch: batch.max(1),
            losses: BTreeMap::new(),
            slopes: BTreeMap::new(),
            evaluations: 0,
            gradients: 0,
        }
    }

    fn about(&mut self, cells: &[usize]) -> Result<(), L::Error> {
        let new = unique(cells, |k| !self.losses.contains_key(k));
        for batch in new.chunks(self.batch) {
            let losses = self.landscape.losses(batch)?;
            self.losses.extend(batch.iter().copied().zip(losses));
            self.evaluations += batch.len() as u32;
        }
        Ok(())
    }

    fn slopes_of(&mut self, cells: &[usize]) -> Result<(), L::Error> {
        let new = unique(cells, |k| !self.slopes.contains_key(k));
        for batch in new.chunks(self.batch) {
            let slopes = self.landscape.slopes(batch)?;
            self.slopes.extend(batch.iter().copied().zip(slopes));
            self.evaluations += batch.len() as u32;
            self.gradients += batch.len() as u32;
        }
        Ok(())
    }

    /// The loss at a cell; infinite where it is not a number or nobody asked.
    fn loss(&self, cell: usize) -> f64 {
        let loss = self.losses.get(&cell).copied().filter(|x| x.is_finite());
        loss.unwrap_or(f64::INFINITY)
    }

    fn slope(&self, cell: usize) -> Option<Slope> {
        self.slopes.get(&cell).copied()
    }

    fn least(&self, cells: &[usize]) -> Option<usize> {
        let each = cells.iter().copied();
        each.min_by(|a, b| self.loss(*a).total_cmp(&self.loss(*b)).then(a.cmp(b)))
    }

    fn found(&self, cell: usize, path: &[usize]) -> Found {
        let step = |cell: &usize| {
            let slope = self.slope(*cell)?;
            Some(Step { cell: *cell, slope })
        };
        Found {
            cell,
            loss: self.loss(cell),
            path: path.iter().filter_map(step).collect(),
            evaluations: self.evaluations,
            gradients: self.gradients,
        }
    }
}

/// The cells that are `new`, each once, in their order.
fn unique(cells: &[usize], new: impl Fn(&usize) -> bool) -> Vec<usize> {
    let mut seen = std::collections::BTreeSet::new();
    let each = cells.iter().copied();
    each.filter(|k| new(k) && seen.insert(*k)).collect()
}

/// The hole's cell whose centre is nearest to a uv's; the uv's own if it is one.
pub fn nearest_cell(hole: &HoleCells, uv: Vec2) -> Option<usize> {
    let own = cell_at(uv);
    if hole.contains(own) {
        return Some(own);
    }
    let away = |k: &usize| (cell_centre(*k) - uv).norm_squared();
    let each = hole.indices().iter().copied();
    each.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::testing::disk;
    use proptest::prelude::*;

    /// A loss given as a function, with its gradient by differences.
    struct Bowl<F>(F);

    impl<F: Fn(Vec2) -> f64> Landscape for Bowl<F> {
        type Error = std::convert::Infallible;

        fn losses(&self, cells: &[usize]) -> Result<Vec<f64>, Self::Error> {
            Ok(cells
                .iter()
                .map(|k| (self.0)(cell_centre(*k) * 64.0))
                .collect())
        }

        fn slopes(&self, cells: &[usize]) -> Result<Vec<Slope>, Self::Error> {
            let slope = |k: &usize| {
                let at = cell_centre(*k) * 64.0;
                let by = |d: Vec2| ((self.0)(at + d) - (self.0)(at - d)) / (2.0 * d.norm());
                Slope {
                    loss: (self.0)(at),
                    gradient: Vec2::new(by(Vec2::x() * 1e-3), by(Vec2::y() * 1e-3)),
                }
            };
            Ok(cells.iter().map(slope).collect())
        }
    }

    proptest! {
        #[test]
        fn in_a_bowl_descent_finds_what_trying_all_finds(
            x in 24.0..40.0f64, y in 24.0..40.0f64, tilt in 0.2..2.0f64, start in 0usize..600
        ) {
            let hole = disk(14.0);
            let bowl = Bowl(|at: Vec2| (at.x - x).powi(2) + tilt * (at.y - y).powi(2) + 0.3 * (at.x - x) * (at.y - y));
            let first = hole.indices()[start % hole.indices().len()];
            let found = descend(&bowl, &hole, &seeds(&hole, first, 8), &SearchOptions::default()).unwrap().unwrap();
            let best = exhaust(&bowl, &hole, &SearchOptions::default()).unwrap().unwrap();
            prop_assert_eq!(found.cell, best.cell);
            prop_assert!(found.evaluations < best.evaluations / 3, "{}", found.evaluations);
            prop_assert!(found.path.windows(2).all(|w| w[1].slope.loss < w[0].slope.loss));
            prop_assert_eq!(found.path.last().unwrap().cell, found.cell);
        }

        #[test]
        fn it_ends_on_any_ground(heights in prop::collection::vec(prop_oneof![Just(f64::NAN), -1.0..1.0f64], 4096)) {
            let hole = disk(9.0);
            let ground = Bowl(|at: Vec2| heights[cell_at(at / 64.0)]);
            let found = descend(&ground, &hole, &seeds(&hole, hole.indices()[0], 5), &SearchOptions::default()).unwrap().unwrap();
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
