//! How near the best of several plausible fills comes to the truth.

use std::fmt::Write as _;

use rayon::prelude::*;

use super::cases::EvaluationCase;
use super::error::EvaluateError;
use super::metrics::rmse;
use super::patched::patched;
use super::sweep::ObservedCase;
use darn_geometry::grid::NormalGrid;
use darn_geometry::patch::PatchOptions;

/// Fills a grid in several ways, the likeliest first; network's units.
pub type AlternativesFunction<'a> =
    &'a (dyn Fn(&NormalGrid) -> Result<Vec<Vec<[f32; 3]>>, EvaluateError> + Sync);

/// One case filled in several ways.
#[derive(Debug, Clone, PartialEq)]
pub struct AlternativeFills {
    /// RMSE of each fill, cells.
    pub filled: Vec<f64>,
    /// RMSE of each after the patch, cells; infinite where it could not be patched.
    pub patched: Vec<f64>,
}

/// Fills and patches every case in all ways.
///
/// # Errors
/// A network that fails, a case with hardly any known cells.
pub fn alternative_fills(
    cases: &[EvaluationCase],
    fill: AlternativesFunction,
) -> Result<Vec<AlternativeFills>, EvaluateError> {
    let of_case = |(number, case): (usize, &EvaluationCase)| {
        let observed = ObservedCase::of(number, case, 0.0, 0)?;
        let grid = observed.grid.normalised(&observed.normalisation);
        let mut found = AlternativeFills {
            filled: Vec::new(),
            patched: Vec::new(),
        };
        for answer in fill(&grid)? {
            let filled = observed.grid.filled(&answer, &observed.normalisation);
            let options = PatchOptions::default();
            let after = patched(&observed.grid, &case.sample.hole, &filled, &options);
            found.filled.push(rmse(case, &filled));
            let error = |after: Vec<_>| rmse(case, &after);
            found.patched.push(after.map_or(f64::INFINITY, error));
        }
        Ok(found)
    };
    cases.par_iter().enumerate().map(of_case).collect()
}

/// A Markdown table: the mean RMSE of the best of the first one, two, four, eight fills.
pub fn alternatives_table(cases: &[AlternativeFills]) -> String {
    let mut text = String::from(
        "| best of | RMSE as filled | below the first | RMSE after patch | below the first | not patched |\n|---|---|---|---|---|---|\n",
    );
    let best = |of: fn(&AlternativeFills) -> &[f64], count: usize| {
        let each = cases.iter().map(|case| {
            let all = of(case).iter().take(count);
            all.copied().fold(f64::INFINITY, f64::min)
        });
        each.sum::<f64>() / cases.len().max(1) as f64
    };
    for count in [1, 2, 4, 8] {
        let stages: [fn(&AlternativeFills) -> &[f64]; 2] = [|c| &c.filled, |c| &c.patched];
        let cells = stages.map(|of| {
            let (first, now) = (best(of, 1), best(of, count));
            format!("{now:.3} | {:.1} %", 100.0 * (1.0 - now / first))
        });
        let failed = |case: &AlternativeFills| {
            let each = case.patched.iter().take(count);
            each.filter(|rmse| rmse.is_infinite()).count()
        };
        let failed: usize = cases.iter().map(failed).sum();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {count} | {} | {failed} |", cells.join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_more_fills_is_no_worse() {
        let case = |filled: &[f64], patched: &[f64]| AlternativeFills {
            filled: filled.to_vec(),
            patched: patched.to_vec(),
        };
        let cases = [
            case(&[1.0, 0.5, 2.0, 2.0], &[1.0, f64::INFINITY, 0.5, 2.0]),
            case(&[1.0, 2.0, 3.0, 0.5], &[1.0, 2.0, 3.0, 2.0]),
        ];
        let table = alternatives_table(&cases);
        let lines: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(lines[0], "| 1 | 1.000 | 0.0 % | 1.000 | 0.0 % | 0 |");
        assert_eq!(lines[1], "| 2 | 0.750 | 25.0 % | 1.000 | 0.0 % | 1 |");
        assert_eq!(lines[2], "| 4 | 0.500 | 50.0 % | 0.750 | 25.0 % | 1 |");
        assert_eq!(lines[3], lines[2].replacen('4', "8", 1));
    }
}
