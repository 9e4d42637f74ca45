//! The measurement itself: every case at every level of noise by every fill, before and after the patch.

use rayon::prelude::*;

use super::cases::Case;
use super::measure::{Measured, measure};
use super::patched::patched;
use super::report::{Fill, Report, Row, Stage, stages};
use super::{EvaluateError, Filler};
use darn_geometry::grid::{CELLS, Grid, NormalGrid, Normalisation};
use darn_geometry::mesh::Vec3;
use darn_geometry::patch::PatchOptions;
use darn_geometry::smooth::{Smooth, smooth};

/// Cases the network gets together.
const CHUNK: usize = 16;

/// What is to be measured.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Levels of noise on known cells, in cells.
    pub noises: Vec<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// How patches are made.
    pub options: PatchOptions,
}

/// Measures all cases. `progress` is told how many were just finished, once for each level of noise.
///
/// # Errors
/// A network that fails, a case with hardly anything known.
pub fn run(
    cases: &[Case],
    plan: &Plan,
    filler: Filler,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Report, EvaluateError> {
    let mut report = Report {
        defects: stages().map(|(s, f)| (f, s, Vec::new())).collect(),
        ..Report::default()
    };
    for noise in &plan.noises {
        for (number, chunk) in cases.chunks(CHUNK).enumerate() {
            let first = number * CHUNK;
            let seen = (first..)
                .zip(chunk)
                .map(|(k, case)| Seen::of(k, case, *noise, plan.seed))
                .collect::<Result<Vec<_>, _>>()?;
            let inputs: Vec<NormalGrid> = seen.iter().map(|s| s.grid.normalised(&s.by)).collect();
            let answers = filler(&inputs)?;
            let measured: Vec<Vec<Outcome>> = seen
                .par_iter()
                .zip(&answers)
                .map(|(seen, answer)| {
                    let found = seen.measured(answer, &plan.options);
                    progress(1);
                    found
                })
                .collect::<Result<_, _>>()?;
            for (seen, outcomes) in seen.iter().zip(measured) {
                report.add(seen, *noise, outcomes);
            }
        }
    }
    Ok(report)
}

/// What came of one fill at one stage; nothing when it could not be patched.
type Outcome = (Fill, Stage, Option<Measured>);

/// A case as a scan would give it.
struct Seen<'a> {
    number: usize,
    case: &'a Case,
    grid: Grid,
    by: Normalisation,
}

impl<'a> Seen<'a> {
    fn of(number: usize, case: &'a Case, noise: f64, seed: u64) -> Result<Self, EvaluateError> {
        let grid = case.seen(noise, seed.wrapping_add(number as u64));
        let by = grid
            .normalisation()
            .ok_or(EvaluateError::TooLittleKnown { sample: number })?;
        Ok(Seen {
            number,
            case,
            grid,
            by,
        })
    }

    /// All fills at both stages.
    fn measured(
        &self,
        answer: &[[f32; 3]],
        options: &PatchOptions,
    ) -> Result<Vec<Outcome>, EvaluateError> {
        let hole = &self.case.sample.hole;
        let mut all = Vec::new();
        for fill in Fill::ALL {
            let filled = self.filled(fill, answer)?;
            all.push((fill, Stage::Filled, Some(measure(self.case, &filled))));
            let patched = patched(&self.grid, hole, &filled, options).ok();
            let measured = patched.map(|p| measure(self.case, &p));
            all.push((fill, Stage::Patched, measured));
        }
        Ok(all)
    }

    /// One position per cell: the scan's where known.
    fn filled(&self, fill: Fill, answer: &[[f32; 3]]) -> Result<Vec<Vec3>, EvaluateError> {
        let energy = match fill {
            Fill::Truth => return Ok(self.case.answer(&self.grid)),
            Fill::Network if answer.len() == CELLS => {
                return Ok(self.grid.filled(answer, &self.by));
            }
            Fill::Network => {
                return Err(EvaluateError::Nothing("the network's answer is too short"));
            }
            Fill::Membrane => Smooth::Membrane,
            Fill::ThinPlate => Smooth::ThinPlate,
        };
        let filled = smooth(
            &self.grid.positions,
            &self.grid.known,
            &self.case.sample.hole,
            energy,
        );
        filled.ok_or(EvaluateError::Singular {
            fill: fill.name(),
            sample: self.number,
        })
    }
}

impl Report {
    fn add(&mut self, seen: &Seen, noise: f64, outcomes: Vec<Outcome>) {
        for (fill, stage, measured) in outcomes {
            let Some(measured) = measured else {
                self.not_patched += 1;
                continue;
            };
            self.rows.push(Row {
                case: seen.number,
                shape: seen.case.shape,
                size: seen.case.size,
                noise,
                fill,
                stage,
                measures: measured.measures,
            });
            let of = (fill, stage);
            let pool = (self.defects.iter_mut()).find(|(f, s, _)| noise == 0.0 && (*f, *s) == of);
            if let Some((_, _, pool)) = pool {
                pool.extend(measured.defects);
            }
        }
    }
}
