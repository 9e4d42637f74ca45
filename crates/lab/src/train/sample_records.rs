//! Prepared samples as binary records for a trainer outside this program (`scripts/gpu`): little-endian, one after another, no header.
//!
//! | bytes | what |
//! |---|---|
//! | 3·4096·4 | the network's input, `[3, 64, 64]` f32: known positions, and the plate in the other cells |
//! | 3·4096·4 | the truth, `[3, 64, 64]` f32; zero where there is none |
//! | 3·4 | the up direction, f32 |
//! | 4096 | flags of each cell: 1 known, 2 hole, 4 valid |

use super::batch::{PreparedSample, TrainingBatch};
use darn_geometry::grid::CELLS;
use darn_net::InputKind;
use darn_net::engine::{EngineInput, input_positions};

/// Appends the records of `samples` to `records`.
pub fn write(samples: &[PreparedSample], records: &mut Vec<u8>) {
    for sample in samples {
        let batch = TrainingBatch::of(std::slice::from_ref(sample));
        let grid = EngineInput {
            positions: &batch.positions,
            known: &batch.known,
            base: Some(&batch.base),
            up: None,
        };
        let seen = input_positions(InputKind::Plate, grid);
        let numbers = seen.iter().chain(&batch.truth).chain(&batch.up);
        records.extend(numbers.flat_map(|x| x.to_le_bytes()));
        let flags = |k: usize| {
            u8::from(sample.known[k])
                | u8::from(sample.hole[k]) << 1
                | u8::from(sample.valid[k]) << 2
        };
        records.extend((0..CELLS).map(flags));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use burn::backend::Flex;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::super::batch::BatchGenerator;
    use super::super::burn_trainer::input_fill;
    use super::*;
    use crate::scarffolds::samples::TrainingSample;
    use darn_geometry::grid::cell_centre;
    use darn_net::UnetConfig;

    /// Length of one record, bytes.
    const RECORD: usize = 2 * 3 * CELLS * 4 + 3 * 4 + CELLS;

    /// Two bent sheets with the same hole.
    fn bent(_: &mut ChaCha8Rng) -> Vec<TrainingSample> {
        let hole: Vec<bool> = (0..CELLS).map(|k| (1000..1040).contains(&k)).collect();
        let sheet = |bend: f32| TrainingSample {
            truth: (0..CELLS)
                .map(|k| cell_centre(k).map(|x| x as f32))
                .map(|p| [p.x, p.y, bend * (7.0 * p.x).sin()])
                .collect(),
            valid: vec![true; CELLS],
            known: hole.iter().map(|h| !h).collect(),
            hole: hole.clone(),
        };
        vec![sheet(0.1), sheet(0.03)]
    }

    #[test]
    fn records_hold_the_input_of_the_network() {
        let generator = BatchGenerator {
            source: Arc::new(bent),
            network: UnetConfig::default(),
            size: 40,
            seed: 5,
        };
        let samples = generator.samples(&mut ChaCha8Rng::seed_from_u64(5));
        // Anchors are not on the plate, so the membrane is not zero there.
        let anchored = samples
            .iter()
            .filter(|s| s.hole.iter().filter(|h| **h).count() < 40);
        assert!(anchored.count() > 0);
        let mut records = Vec::new();
        write(&samples, &mut records);
        assert_eq!(records.len(), samples.len() * RECORD);
        let seen = input_fill::<Flex>(&samples);
        for ((record, sample), seen) in records.chunks(RECORD).zip(&samples).zip(seen) {
            let number = |k: usize| f32::from_le_bytes(record[4 * k..][..4].try_into().unwrap());
            for (k, seen) in seen.iter().enumerate() {
                for (axis, seen) in seen.iter().enumerate() {
                    assert!((number(axis * CELLS + k) - seen).abs() < 1e-5);
                    assert_eq!(number((3 + axis) * CELLS + k), sample.truth[k][axis]);
                }
                let flags = record[RECORD - CELLS + k];
                let found = [1, 2, 4].map(|bit| flags & bit > 0);
                assert_eq!(found, [sample.known[k], sample.hole[k], sample.valid[k]]);
            }
            assert_eq!([0, 1, 2].map(|axis| number(6 * CELLS + axis)), sample.up);
        }
    }
}
