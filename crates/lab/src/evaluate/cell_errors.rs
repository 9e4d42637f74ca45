//! What a network's answers show of their errors, beside the errors: the measurement behind [`darn_net::ErrorModel`], its fit, and how well it holds.

use std::fmt::Write as _;

use rayon::prelude::*;

use super::cases::EvaluationCase;
use super::error::EvaluateError;
use super::patched::patched;
use super::sweep::{FillFunction, in_chunks};
use darn_geometry::grid::{CELLS, SIDE, distances_to};
use darn_geometry::patch::PatchOptions;
use darn_net::{DepthGrowth, ErrorModel, WITHIN_90};

/// Cells that are measured of a hole, about.
const CELLS_A_HOLE: usize = 80;
/// Where the bands of depth begin, cells.
const BANDS: [f64; 6] = [0.0, 2.0, 4.0, 6.0, 9.0, 14.0];
/// Bands with fewer cells get no factor of their own.
const FEW: usize = 200;
/// Squared errors over squared deviations count up to this: a few cells that are far off do not decide the fit.
const MOST_SQUARED: f64 = 16.0;

/// A hole cell after the patch; all in cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellError {
    /// Distance from the nearest known cell.
    pub depth: f64,
    /// How far the network's answers to the grid's symmetries lie apart there.
    pub spread: f64,
    /// Roughness of the grid's known cells.
    pub roughness: f64,
    /// Distance to the truth.
    pub error: f64,
}

/// Measures cells of every case, with noise of `sigma` cells on the known ones, drawn from `seed`.
///
/// # Errors
/// A network that fails, a case with hardly any known cells.
pub fn cell_errors(
    cases: &[EvaluationCase],
    sigma: f64,
    seed: u64,
    fill: FillFunction,
) -> Result<Vec<CellError>, EvaluateError> {
    let chunks = in_chunks(cases, sigma, seed, fill, |observed, answer| {
        let sample = &observed.case.sample;
        let filled = observed
            .grid
            .filled(&answer.positions, &observed.normalisation);
        let options = PatchOptions::default();
        let Ok(after) = patched(&observed.grid, &sample.hole, &filled, &options) else {
            return Ok(Vec::new());
        };
        let depths = distances_to(&sample.known);
        let roughness = observed
            .grid
            .normalised(&observed.normalisation)
            .roughness();
        // The truth is in units of the sample, which are those of the network but for the noise.
        let error = |k: usize| (after[k] - observed.case.truth(k)).norm() * SIDE as f64;
        let holes: Vec<usize> = (0..CELLS).filter(|k| sample.hole[*k]).collect();
        let each = holes.iter().step_by((holes.len() / CELLS_A_HOLE).max(1));
        Ok(each
            .map(|&k| CellError {
                depth: depths[k].into(),
                spread: f64::from(answer.spread[k]) * SIDE as f64,
                roughness,
                error: error(k),
            })
            .collect())
    })?;
    Ok(chunks.concat())
}

/// Cells that an error model is fitted to; each set counts the same.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CalibrationSets {
    /// Without noise.
    pub clean: Vec<Vec<CellError>>,
    /// With noise on the known cells: without it nothing would be learned of roughness.
    pub noisy: Vec<Vec<CellError>>,
}

/// Fits an error model to measured cells.
///
/// The weights of spread and roughness are those of the greatest likelihood of errors that are normal on three axes, with outliers cut; the growth
/// makes the 90 % interval hold in every band of depth on the clean sets together (conformal scaling).
///
/// # Errors
/// `Nothing` for a set without cells.
pub fn calibrated(sets: &CalibrationSets) -> Result<ErrorModel, EvaluateError> {
    let all = || sets.clean.iter().chain(&sets.noisy);
    if sets.clean.is_empty() || all().any(Vec::is_empty) {
        return Err(EvaluateError::Nothing("a set without cells"));
    }
    let weighted: Vec<(CellError, f64)> = all().flat_map(|set| weighted_alike(set)).collect();
    let clean: Vec<(CellError, f64)> = (sets.clean.iter())
        .flat_map(|set| weighted_alike(set))
        .collect();
    let model = |[spread, roughness]: [f64; 2]| ErrorModel {
        spread: spread.exp(),
        roughness: roughness.exp(),
        growth: Vec::new(),
    };
    let cost = |at: [f64; 2]| -> f64 {
        let model = model(at);
        let of = |(cell, weight): &(CellError, f64)| {
            let deviation = unscaled(&model, cell);
            let squared = (cell.error / deviation).powi(2).min(MOST_SQUARED);
            weight * (3.0 * deviation.ln() + 1.5 * squared)
        };
        weighted.par_iter().map(of).collect::<Vec<_>>().iter().sum()
    };
    let mut fitted = model(least(cost, [1.0, 0.0]));
    let growth = |band: usize| {
        let inside = |cell: &CellError| {
            cell.depth >= BANDS[band] && BANDS.get(band + 1).is_none_or(|end| cell.depth < *end)
        };
        let own: Vec<_> = clean.iter().filter(|(cell, _)| inside(cell)).collect();
        let scaled = own
            .iter()
            .map(|(cell, weight)| (cell.error / unscaled(&fitted, cell), *weight));
        let all: f64 = own.iter().map(|(_, weight)| weight).sum();
        let depth = own
            .iter()
            .map(|(cell, weight)| cell.depth * weight)
            .sum::<f64>()
            / all;
        (own.len() >= FEW).then(|| DepthGrowth {
            depth,
            factor: quantile(scaled.collect(), 0.9) / WITHIN_90,
        })
    };
    fitted.growth = (0..BANDS.len()).filter_map(growth).collect();
    Ok(fitted)
}

/// The cells of a set, each with its share of the set's weight, which is 1.
fn weighted_alike(set: &[CellError]) -> impl Iterator<Item = (CellError, f64)> {
    let weight = 1.0 / set.len() as f64;
    set.iter().map(move |cell| (*cell, weight))
}

/// How well an error model holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorCoverage {
    /// Number of cells.
    pub cells: usize,
    /// Share of cells whose error lies within the 90 % interval.
    pub covered: f64,
    /// Spearman's rank correlation of deviations and errors.
    pub rank: f64,
    /// Root mean square of the errors, cells.
    pub error: f64,
    /// Root mean square of the deviations, cells.
    pub deviation: f64,
}

/// Compares an error model with measured cells.
pub fn coverage(cells: &[CellError], model: &ErrorModel) -> ErrorCoverage {
    let deviations: Vec<f64> = (cells.iter())
        .map(|cell| model.factor(cell.depth) * unscaled(model, cell))
        .collect();
    let errors: Vec<f64> = cells.iter().map(|cell| cell.error).collect();
    let within = (errors.iter().zip(&deviations))
        .filter(|(error, deviation)| **error <= WITHIN_90 * **deviation)
        .count();
    let count = cells.len().max(1) as f64;
    let mean_square = |all: &[f64]| (all.iter().map(|x| x * x).sum::<f64>() / count).sqrt();
    ErrorCoverage {
        cells: cells.len(),
        covered: within as f64 / count,
        rank: correlation(&ranks(&errors), &ranks(&deviations)),
        error: mean_square(&errors),
        deviation: mean_square(&deviations),
    }
}

/// A Markdown table of an error model beside measured cells: one line for all, and one for each band of depth.
pub fn coverage_table(cells: &[CellError], model: &ErrorModel) -> String {
    let mut text = String::from(
        "| depth, cells | cells | within the 90 % interval | Spearman | RMS error | RMS deviation |\n|---|---|---|---|---|---|\n",
    );
    let mut line = |name: &str, own: &[CellError]| {
        let found = coverage(own, model);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {name} | {} | {:.1} % | {:.2} | {:.3} | {:.3} |",
            found.cells,
            100.0 * found.covered,
            found.rank,
            found.error,
            found.deviation
        );
    };
    line("all", cells);
    for (k, from) in BANDS.iter().enumerate() {
        let to = BANDS.get(k + 1).copied().unwrap_or(f64::INFINITY);
        let inside = |cell: &&CellError| (*from..to).contains(&cell.depth);
        let own: Vec<CellError> = cells.iter().filter(inside).copied().collect();
        if !own.is_empty() {
            line(&format!("from {from}"), &own);
        }
    }
    text
}

/// A deviation before growth, and never 0.
fn unscaled(model: &ErrorModel, cell: &CellError) -> f64 {
    model.unscaled(cell.spread, cell.roughness).max(1e-6)
}

/// Where a smooth function of two numbers is least, by steps along the axes that are halved (Hooke and Jeeves 1961).
fn least(cost: impl Fn([f64; 2]) -> f64, start: [f64; 2]) -> [f64; 2] {
    let (mut at, mut found, mut step) = (start, cost(start), 0.5);
    while step > 1e-3 {
        let around = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
        let tried = around.map(|by| [at[0] + by[0], at[1] + by[1]]);
        let best = tried.map(|next| (cost(next), next)).into_iter();
        match best.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((less, next)) if less < found => (at, found) = (next, less),
            _ => step *= 0.5,
        }
    }
    at
}

/// The smallest number below which at least this share of the weight lies.
fn quantile(mut weighted: Vec<(f64, f64)>, share: f64) -> f64 {
    weighted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    let reached = weighted.iter().find(|(_, weight)| {
        sum += weight;
        sum >= share * all
    });
    reached.or(weighted.last()).map_or(0.0, |(x, _)| *x)
}

/// The rank of each number; equal numbers share the mean of theirs.
fn ranks(numbers: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_unstable_by(|a, b| numbers[*a].total_cmp(&numbers[*b]));
    let mut ranks = vec![0.0; numbers.len()];
    for equal in order.chunk_by(|a, b| numbers[*a] == numbers[*b]) {
        let below = order.partition_point(|k| numbers[*k] < numbers[equal[0]]);
        let rank = below as f64 + 0.5 * (equal.len() - 1) as f64;
        equal.iter().for_each(|k| ranks[*k] = rank);
    }
    ranks
}

/// Pearson's correlation; 0 where one of the two does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
    let (of_a, of_b) = (mean(a), mean(b));
    let (mut both, mut squares) = (0.0, [0.0; 2]);
    for (a, b) in a.iter().zip(b) {
        both += (a - of_a) * (b - of_b);
        squares = [
            squares[0] + (a - of_a).powi(2),
            squares[1] + (b - of_b).powi(2),
        ];
    }
    let scale = (squares[0] * squares[1]).sqrt();
    if scale > 0.0 { both / scale } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::cases::gaussian;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Cells whose errors are normal on three axes, with twice the spread and once the roughness as deviation, and growing with depth.
    fn drawn(seed: u64, count: usize) -> Vec<CellError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let one = |_| {
            let depth = rng.random_range(1.0..16.0f64);
            let spread = rng.random_range(0.01..0.5f64);
            let roughness = *[0.0, 0.3].get(rng.random_range(0..2)).unwrap_or(&0.0);
            let deviation = (2.0 * spread).hypot(roughness) * (1.0 + 0.05 * depth);
            let squares = [(); 3].map(|()| (gaussian(&mut rng) * deviation).powi(2));
            CellError {
                depth,
                spread,
                roughness,
                error: squares.iter().sum::<f64>().sqrt(),
            }
        };
        (0..count).map(one).collect()
    }

    #[test]
    fn a_calibrated_interval_covers_nine_of_ten_new_cells_at_every_depth() {
        let sets = CalibrationSets {
            clean: vec![drawn(1, 20_000)],
            noisy: vec![drawn(2, 6_000)],
        };
        let model = calibrated(&sets).unwrap();
        // The ratio of the two weights is that of the drawn errors.
        assert!(
            (model.spread / model.roughness - 2.0).abs() < 0.1,
            "{model:?}"
        );
        let new = drawn(3, 20_000);
        for (from, to) in [(1.0, 4.0), (4.0, 9.0), (9.0, 13.0), (1.0, 16.0)] {
            let own: Vec<CellError> = (new.iter().filter(|c| (from..to).contains(&c.depth)))
                .copied()
                .collect();
            let found = coverage(&own, &model);
            assert!((found.covered - 0.9).abs() < 0.02, "{from}: {found:?}");
            assert!(found.rank > 0.5, "{found:?}");
        }
        let table = coverage_table(&new, &model);
        assert_eq!(table.lines().count(), 3 + BANDS.len(), "{table}");
    }

    #[test]
    fn a_set_without_cells_cannot_be_calibrated_on() {
        assert!(calibrated(&CalibrationSets::default()).is_err());
        let half = CalibrationSets {
            clean: vec![drawn(1, 500), Vec::new()],
            noisy: Vec::new(),
        };
        assert!(calibrated(&half).is_err());
    }

    #[test]
    fn equal_numbers_share_their_rank() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [2.5, 0.0, 2.5, 1.0]);
        assert_eq!(correlation(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]), 1.0);
        assert_eq!(correlation(&[1.0, 1.0], &[2.0, 4.0]), 0.0);
        assert_eq!(
            quantile(vec![(3.0, 1.0), (1.0, 1.0), (2.0, 2.0)], 0.75),
            2.0
        );
    }
}
