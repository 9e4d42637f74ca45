//! Random weights and grids for the tests of this crate.

use crate::tensors::NamedTensors;
use crate::{InputKind, UnetConfig};
use darn_geometry::grid::CELLS;

/// A linear congruential generator, so that the tests' numbers never change.
pub struct Random(pub u64);

impl Random {
    /// In −1..1.
    pub fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    /// So many numbers in −size..size.
    pub fn values(&mut self, count: usize, size: f32) -> Vec<f32> {
        (0..count).map(|_| self.next() * size).collect()
    }
}

/// An architecture of a width and an input.
pub fn config(width: usize, input: InputKind) -> UnetConfig {
    UnetConfig {
        width,
        input,
        ..UnetConfig::default()
    }
}

/// Random weights that keep activations O(1), with statistics away from zero and one.
pub fn random_tensors(config: &UnetConfig) -> NamedTensors {
    let width = config.width;
    let mut random = Random(7);
    let mut tensors = NamedTensors::new();
    let mut put = |name: String, shape: Vec<usize>, middle: f32, size: f32| {
        let values = random.values(shape.iter().product(), size);
        let values = values.into_iter().map(|x| x + middle).collect();
        tensors.insert(name, (shape, values));
    };
    let mut conv = |name: String, norm: String, [to, from, side]: [usize; 3]| {
        let size = (6.0 / (from * side * side) as f32).sqrt();
        put(
            format!("{name}.weight"),
            vec![to, from, side, side],
            0.0,
            size,
        );
        for (part, middle, size) in [
            ("scale", 1.0, 0.3),
            ("shift", 0.0, 0.3),
            ("mean", 0.0, 0.3),
            ("variance", 1.0, 0.3),
        ] {
            put(format!("{norm}.{part}"), vec![to], middle, size);
        }
    };
    let block = |conv: &mut dyn FnMut(String, String, [usize; 3]), name: String, from, to| {
        for (i, from) in [(0, from), (1, to)] {
            conv(
                format!("{name}.conv{i}"),
                format!("{name}.norm{i}"),
                [to, from, 3],
            );
        }
    };
    block(&mut conv, "down.0".into(), config.frame.channels(), width);
    for level in 1..5 {
        block(
            &mut conv,
            format!("down.{level}"),
            width << (level - 1),
            width << level,
        );
    }
    for level in 0..4 {
        let name = format!("up.{level}");
        let (from, to) = (width << (level + 1), width << level);
        let inner = (to / 2).max(1);
        conv(
            format!("{name}.conv"),
            format!("{name}.norm"),
            [to, from, 3],
        );
        for part in ["skip", "signal"] {
            let part = format!("{name}.gate.{part}");
            conv(part.clone(), format!("{part}_norm"), [inner, to, 1]);
        }
        block(&mut conv, format!("{name}.block"), 2 * to, to);
    }
    for level in 0..4 {
        let inner = ((width << level) / 2).max(1);
        put(
            format!("up.{level}.gate.score.weight"),
            vec![1, inner, 1, 1],
            0.0,
            1.0,
        );
        put(format!("up.{level}.gate.score.bias"), vec![1], 0.0, 1.0);
    }
    put("last.weight".into(), vec![3, width, 1, 1], 0.0, 1.0);
    put("last.bias".into(), vec![3], 0.0, 1.0);
    tensors
}

/// Planes of positions and of the mask: waves with noise, and a soft-edged hole at a different place in each grid.
pub fn grids(count: usize) -> (Vec<f32>, Vec<f32>) {
    let mut random = Random(3);
    let (mut positions, mut known) = (Vec::new(), Vec::new());
    for grid in 0..count {
        let mask: Vec<f32> = (0..CELLS)
            .map(|at| {
                let (i, j) = (
                    (at % 64) as f32 - 20.0 - 7.0 * grid as f32,
                    (at / 64) as f32 - 30.0,
                );
                ((i * i + j * j).sqrt() / 4.0 - 3.0 + 0.1 * random.next()).clamp(0.03, 0.97)
            })
            .collect();
        for axis in 0..3 {
            positions.extend((0..CELLS).map(|at| {
                let (u, v) = ((at % 64) as f32 / 64.0, (at / 64) as f32 / 64.0);
                let plane = [
                    u - 0.5,
                    v - 0.5,
                    0.1 * (9.0 * u + 4.0 * v + grid as f32).sin(),
                ];
                plane[axis] + 0.003 * random.next()
            }));
        }
        known.extend(mask);
    }
    (positions, known)
}

/// The same numbers in f64.
pub fn wide(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}
