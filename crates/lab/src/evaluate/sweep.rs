//! The measurement: every case at every noise level by every fill method, before and after the patch.

use rayon::prelude::*;

use super::cases::EvaluationCase;
use super::error::EvaluateError;
use super::metrics::{Measurement, measure};
use super::patched::patched;
use super::report::{
    AngleDefects, EvaluationReport, EvaluationRow, EvaluationStage, FillMethod, stages,
};
use super::shaded_views::ShadedViews;
use darn_geometry::grid::{CELLS, Grid, NormalGrid, Normalisation};
use darn_geometry::mesh::Vec3;
use darn_geometry::patch::PatchOptions;
use darn_geometry::smooth::{Smooth, smooth};
use darn_net::FilledGrid;

/// Grids given to the network at once.
const CHUNK: usize = 16;

/// Fills grids in the network's units.
pub type FillFunction<'a> =
    &'a (dyn Fn(&[NormalGrid]) -> Result<Vec<FilledGrid>, EvaluateError> + Sync);

/// What is to be measured.
#[derive(Debug, Clone)]
pub struct EvaluationPlan {
    /// Standard deviations of the noise on known cells, in cells.
    pub noises: Vec<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// How patches are made.
    pub options: PatchOptions,
}

/// Measures all cases. `progress` gets the number of cases just finished, once for each noise level; any thread may call it.
///
/// # Errors
/// A network that fails, a case with hardly any known cells.
pub fn run(
    cases: &[EvaluationCase],
    plan: &EvaluationPlan,
    fill: FillFunction,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<EvaluationReport, EvaluateError> {
    let nothing = |(stage, method)| AngleDefects {
        method,
        stage,
        defects: Vec::new(),
    };
    let mut report = EvaluationReport {
        defects: stages().map(nothing).collect(),
        ..EvaluationReport::default()
    };
    for noise in &plan.noises {
        let measured = in_chunks(cases, *noise, plan.seed, fill, |case, answer| {
            let found = case.measured(&answer.positions, &plan.options)?;
            progress(1);
            Ok((case.number, found))
        })?;
        for ((number, outcomes), case) in measured.into_iter().zip(cases) {
            report.add(number, case, *noise, outcomes);
        }
    }
    Ok(report)
}

/// What `of` makes of every case and the network's answer to it, in order; some grids are given to the network at once.
pub(super) fn in_chunks<T: Send>(
    cases: &[EvaluationCase],
    noise: f64,
    seed: u64,
    fill: FillFunction,
    of: impl Fn(&ObservedCase, &FilledGrid) -> Result<T, EvaluateError> + Sync,
) -> Result<Vec<T>, EvaluateError> {
    let mut all = Vec::with_capacity(cases.len());
    for (number, chunk) in cases.chunks(CHUNK).enumerate() {
        let observed = (number * CHUNK..)
            .zip(chunk)
            .map(|(k, case)| ObservedCase::of(k, case, noise, seed))
            .collect::<Result<Vec<_>, _>>()?;
        let inputs: Vec<NormalGrid> = (observed.iter())
            .map(|case| case.grid.normalised(&case.normalisation))
            .collect();
        let answers = fill(&inputs)?;
        let made: Result<Vec<T>, _> = observed
            .par_iter()
            .zip(&answers)
            .map(|(case, answer)| of(case, answer))
            .collect();
        all.extend(made?);
    }
    Ok(all)
}

/// The measurement of one fill at one stage; `None` when it could not be patched.
struct FillOutcome {
    method: FillMethod,
    stage: EvaluationStage,
    measurement: Option<Measurement>,
}

/// A case as a scan would show it.
pub(super) struct ObservedCase<'a> {
    number: usize,
    /// The case.
    pub case: &'a EvaluationCase,
    /// What the scan shows.
    pub grid: Grid,
    /// Converts between the scan's space and the network's units.
    pub normalisation: Normalisation,
}

impl<'a> ObservedCase<'a> {
    /// What a scan with noise of so many cells would show of a case; the noise is drawn from `seed` and the number of the case.
    pub fn of(
        number: usize,
        case: &'a EvaluationCase,
        noise: f64,
        seed: u64,
    ) -> Result<Self, EvaluateError> {
        let grid = case.observed(noise, seed.wrapping_add(number as u64));
        let normalisation = grid
            .normalisation()
            .ok_or(EvaluateError::TooLittleKnown { sample: number })?;
        Ok(ObservedCase {
            number,
            case,
            grid,
            normalisation,
        })
    }

    /// All methods at both stages; `answer` is the network's.
    fn measured(
        &self,
        answer: &[[f32; 3]],
        options: &PatchOptions,
    ) -> Result<Vec<FillOutcome>, EvaluateError> {
        let hole = &self.case.sample.hole;
        let views = ShadedViews::of(self.case);
        let mut all = Vec::new();
        for method in FillMethod::ALL {
            let filled = self.filled(method, answer)?;
            all.push(FillOutcome {
                method,
                stage: EvaluationStage::Filled,
                measurement: Some(measure(self.case, &views, &filled)),
            });
            let patched = patched(&self.grid, hole, &filled, options).ok();
            all.push(FillOutcome {
                method,
                stage: EvaluationStage::Patched,
                measurement: patched.map(|p| measure(self.case, &views, &p)),
            });
        }
        Ok(all)
    }

    /// One position per cell: the scan's where known.
    fn filled(&self, method: FillMethod, answer: &[[f32; 3]]) -> Result<Vec<Vec3>, EvaluateError> {
        let energy = match method {
            FillMethod::Truth => return Ok(self.case.answer(&self.grid)),
            FillMethod::Network if answer.len() == CELLS => {
                return Ok(self.grid.filled(answer, &self.normalisation));
            }
            FillMethod::Network => {
                return Err(EvaluateError::Nothing("the network's answer is too short"));
            }
            FillMethod::Membrane => Smooth::Membrane,
            FillMethod::ThinPlate => Smooth::ThinPlate,
        };
        let filled = smooth(
            &self.grid.positions,
            &self.grid.known,
            &self.case.sample.hole,
            energy,
            1,
        );
        filled.ok_or(EvaluateError::Singular {
            fill: method.name(),
            sample: self.number,
        })
    }
}

impl EvaluationReport {
    fn add(
        &mut self,
        number: usize,
        case: &EvaluationCase,
        noise: f64,
        outcomes: Vec<FillOutcome>,
    ) {
        for outcome in outcomes {
            let FillOutcome { method, stage, .. } = outcome;
            let Some(measurement) = outcome.measurement else {
                self.not_patched += 1;
                continue;
            };
            self.rows.push(EvaluationRow {
                case: number,
                shape: case.shape,
                size: case.size,
                noise,
                fill: method,
                stage,
                metrics: measurement.metrics,
            });
            let pool = (self.defects.iter_mut())
                .find(|pool| noise == 0.0 && pool.method == method && pool.stage == stage);
            if let Some(pool) = pool {
                pool.defects.extend(measurement.defects);
            }
        }
    }
}
