//! Distillation: the truth of hole cells is replaced by the mean of a trained network's answers to a grid's eight symmetries, so that a network
//! that is asked once may learn what is better in that mean.

use super::batch::TrainingBatch;
use super::error::TrainError;
use darn_geometry::grid::CELLS;
use darn_net::engine::{Engine, EngineInput, EngineOptions, Scratch};
use darn_net::symmetry::origins;
use darn_net::weights;
use darn_net::{FrameKind, UnetConfig};
use std::path::Path;

/// Symmetries of the grid.
const SYMMETRIES: usize = 8;

/// A trained network whose answers are learned from.
#[derive(Debug)]
pub(super) struct Teacher {
    engine: Engine,
    told_up: bool,
    scratch: Scratch,
}

impl Teacher {
    /// The network of a weights file, for batches that are prepared for `student`.
    ///
    /// # Errors
    /// A file that cannot be read, or whose network sees other inputs than the student.
    pub fn open(path: &Path, student: &UnetConfig) -> Result<Teacher, TrainError> {
        let bytes = std::fs::read(path).map_err(|source| TrainError::File {
            path: path.to_owned(),
            source,
        })?;
        let (card, tensors) = weights::read(&bytes)?;
        weights::check(&card, &tensors)?;
        let UnetConfig { input, frame, .. } = card.architecture;
        if (input, frame) != (student.input, student.frame) || frame == FrameKind::Given {
            return Err(TrainError::Options(format!(
                "{} sees other inputs than the network to train, or uncanonical frames",
                path.display()
            )));
        }
        let options = EngineOptions {
            threads: rayon::current_num_threads(),
            ..EngineOptions::default()
        };
        Ok(Teacher {
            engine: Engine::new(&tensors, &card.architecture, options)?,
            told_up: frame.told_up(),
            scratch: Scratch::default(),
        })
    }

    /// Replaces the truth of a batch's hole cells.
    ///
    /// # Errors
    /// A network that cannot be evaluated.
    pub fn teach(&mut self, batch: &mut TrainingBatch) -> Result<(), TrainError> {
        let mut mean = vec![0.0; batch.truth.len()];
        let mut answer = vec![0.0; batch.truth.len()];
        for symmetry in 0..SYMMETRIES {
            let turn = GridTurn::of(symmetry);
            let (positions, base) = (turn.planes(&batch.positions), turn.planes(&batch.base));
            let (known, up) = (turn.mask(&batch.known), turn.directions(&batch.up));
            let input = EngineInput {
                positions: &positions,
                known: &known,
                base: Some(&base),
                up: self.told_up.then_some(&up),
            };
            self.engine.predict(&mut self.scratch, input, &mut answer)?;
            turn.add_back(&answer, &mut mean);
        }
        let grids = batch.truth.chunks_exact_mut(3 * CELLS);
        let pairs = grids.zip(mean.chunks_exact(3 * CELLS));
        for ((truth, mean), hole) in pairs.zip(batch.hole.chunks_exact(CELLS)) {
            for (at, (truth, mean)) in truth.iter_mut().zip(mean).enumerate() {
                if hole[at % CELLS] > 0.0 {
                    *truth = mean / SYMMETRIES as f32;
                }
            }
        }
        Ok(())
    }
}

/// A symmetry of the grid as the canonical frame shows it: cells change places, and the frame, which follows the chart, turns.
#[derive(Debug)]
struct GridTurn {
    /// For each cell the cell that it comes from.
    from: Vec<usize>,
    /// For each axis the axis that it comes from, and its sign; together a rotation.
    axes: [(usize, f32); 3],
}

impl GridTurn {
    /// The symmetry that [`origins`] numbers so.
    fn of(symmetry: usize) -> GridTurn {
        let sign = |bit: usize| match symmetry >> bit & 1 {
            0 => 1.0,
            _ => -1.0,
        };
        let [x, y] = match symmetry >> 2 & 1 {
            0 => [0, 1],
            _ => [1, 0],
        };
        GridTurn {
            from: origins(symmetry),
            axes: [(x, sign(0)), (y, sign(1)), (2, sign(0) * sign(1) * sign(2))],
        }
    }

    /// Positions `[n, 3, 64, 64]` after the symmetry.
    fn planes(&self, planes: &[f32]) -> Vec<f32> {
        let mut turned = Vec::with_capacity(planes.len());
        for grid in planes.chunks_exact(3 * CELLS) {
            for (axis, sign) in self.axes {
                let plane = &grid[axis * CELLS..][..CELLS];
                turned.extend(self.from.iter().map(|k| sign * plane[*k]));
            }
        }
        turned
    }

    /// Masks `[n, 1, 64, 64]` after the symmetry.
    fn mask(&self, masks: &[f32]) -> Vec<f32> {
        let grids = masks.chunks_exact(CELLS);
        grids
            .flat_map(|mask| self.from.iter().map(|k| mask[*k]))
            .collect()
    }

    /// Directions `[n, 3]` after the symmetry.
    fn directions(&self, directions: &[f32]) -> Vec<f32> {
        let each = directions.chunks_exact(3);
        each.flat_map(|d| self.axes.map(|(axis, sign)| sign * d[axis]))
            .collect()
    }

    /// Adds positions after the symmetry to `sum`, which is before it.
    fn add_back(&self, turned: &[f32], sum: &mut [f32]) {
        let grids = turned.chunks_exact(3 * CELLS);
        for (grid, sum) in grids.zip(sum.chunks_exact_mut(3 * CELLS)) {
            for (plane, (axis, sign)) in grid.chunks_exact(CELLS).zip(self.axes) {
                for (value, k) in plane.iter().zip(&self.from) {
                    sum[axis * CELLS + k] += sign * value;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::{PreparedSample, prepare};
    use super::super::tests::cylinder;
    use super::*;
    use crate::scarffolds::samples::TrainingSample;
    use darn_net::{TrainingCard, WeightsCard};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn symmetric(sample: &TrainingSample, symmetry: usize) -> TrainingSample {
        let from = origins(symmetry);
        let flags = |of: &[bool]| from.iter().map(|k| of[*k]).collect();
        TrainingSample {
            truth: from.iter().map(|k| sample.truth[*k]).collect(),
            valid: flags(&sample.valid),
            known: flags(&sample.known),
            hole: flags(&sample.hole),
        }
    }

    fn batch(sample: &TrainingSample, network: &UnetConfig) -> TrainingBatch {
        let prepared: Vec<PreparedSample> = prepare(sample, network).into_iter().collect();
        TrainingBatch::of(&prepared)
    }

    fn assert_near(a: &[f32], b: &[f32]) {
        assert_eq!(a.len(), b.len());
        let gap = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        let gap = gap.fold(0.0, f32::max);
        assert!(gap < 2e-4, "{gap}");
    }

    #[test]
    fn a_turned_batch_is_that_of_the_turned_sample() {
        let network = UnetConfig {
            frame: FrameKind::Hanging,
            ..UnetConfig::default()
        };
        let sample = cylinder(&mut ChaCha8Rng::seed_from_u64(4));
        let before = batch(&sample, &network);
        for symmetry in 0..SYMMETRIES {
            let after = batch(&symmetric(&sample, symmetry), &network);
            let turn = GridTurn::of(symmetry);
            assert_near(&turn.planes(&before.positions), &after.positions);
            assert_near(&turn.planes(&before.base), &after.base);
            assert_near(&turn.planes(&before.truth), &after.truth);
            assert_near(&turn.mask(&before.known), &after.known);
            assert_near(&turn.directions(&before.up), &after.up);
            let mut back = vec![0.0; before.truth.len()];
            turn.add_back(&after.truth, &mut back);
            assert_near(&back, &before.truth);
        }
    }

    #[test]
    fn a_network_that_adds_nothing_teaches_the_plate_in_the_hole_alone() {
        let student = UnetConfig {
            width: 2,
            ..UnetConfig::default()
        };
        let options = super::super::TrainOptions {
            network: student,
            ..Default::default()
        };
        let mut network = super::super::snapshot::TrainSnapshot::fresh(&options)
            .unwrap()
            .network;
        let last = network
            .iter_mut()
            .filter(|(name, _)| name.starts_with("last."));
        last.for_each(|(_, (_, values))| values.fill(0.0));
        let card = WeightsCard {
            name: "teacher".into(),
            sha256: String::new(),
            architecture: student,
            training: TrainingCard::default(),
            scores: Default::default(),
            errors: None,
            darn_version: "0".into(),
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("teacher.safetensors");
        std::fs::write(&path, weights::write(&network, &card).unwrap()).unwrap();
        let sample = cylinder(&mut ChaCha8Rng::seed_from_u64(4));
        let mut taught = batch(&sample, &student);
        let before = taught.clone();
        let mut teacher = Teacher::open(&path, &student).unwrap();
        teacher.teach(&mut taught).unwrap();
        for (at, truth) in taught.truth.iter().enumerate() {
            let expected = match before.hole[at % CELLS] > 0.0 {
                true => before.base[at],
                false => before.truth[at],
            };
            assert!((truth - expected).abs() < 1e-5, "{at}: {truth} {expected}");
        }
        let other = UnetConfig {
            frame: FrameKind::Hanging,
            ..student
        };
        assert!(matches!(
            Teacher::open(&path, &other),
            Err(TrainError::Options(_))
        ));
    }
}
