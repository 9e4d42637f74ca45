//! The gradient with respect to the weights, by name, for whoever trains: batch norm keeps its statistics, all else may change.

use std::ops::Range;

use rayon::prelude::*;

use super::backward::Gradients;
use super::forward::{Activations, Saved};
use super::network::{Folds, GateFolds};
use super::pack::{EPSILON, Folded, tensor};
use super::scratch::{LastAdjoint, Room, TOGETHER, image3, say, show};
use super::sums::WeightSums;
use super::{Engine, EngineError, Input};
use crate::config::OUTPUT_SCALE;
use crate::weights::NamedTensors;
use darn_geometry::grid::CELLS;

/// Room for the lessons of one network.
#[derive(Debug, Default)]
pub struct Lessons {
    lanes: Vec<Lane>,
    predictions: Vec<f32>,
    cotangents: Vec<f32>,
}

/// A loss, given which grids of the call it is about and their predictions `[n, 3, 64, 64]`: fills in its derivatives with respect to
/// them (zero at first), and says whatever it has to say. Called for some grids at a time, on a thread of the pool, where it must not wait
/// for others; what is learned is the sum.
pub type Lesson<'a, T> = dyn Fn(Range<usize>, &[f32], &mut [f32]) -> T + Sync + 'a;

/// What [`TOGETHER`] grids need.
#[derive(Debug)]
struct Lane {
    forward: Activations,
    saved: Saved,
    backward: Gradients,
    sums: WeightSums,
    room: Room,
}

impl Lane {
    fn new(engine: &Engine) -> Lane {
        let folds = &engine.folds;
        Lane {
            forward: Activations::new([TOGETHER, 1], folds, engine.forward()),
            saved: Saved::new(TOGETHER, folds, engine.forward()),
            backward: Gradients::new([TOGETHER, 1], folds, engine.reverse()),
            sums: WeightSums::new(TOGETHER, folds),
            room: Room::default(),
        }
    }

    fn predict(&mut self, engine: &Engine, input: Input, out: &mut [f32]) {
        let images = input.images();
        show(
            engine,
            (&mut self.room, false),
            input,
            (out, &mut self.forward.input),
        );
        let (forward, saved) = (&mut self.forward, &mut self.saved);
        let features = forward.run(engine.target, images, engine.forward(), Some(saved));
        say((engine, 1), features, out);
    }

    fn differentiate(&mut self, engine: &Engine, cotangents: &[f32]) {
        let (target, images) = (engine.target, cotangents.len() / (3 * CELLS));
        self.sums.clear();
        let features = &self.saved.result[0];
        for image in 0..images {
            let cotangent = image3(cotangents, image);
            target.run(LastAdjoint {
                engine,
                features,
                image,
                cotangent,
                result: &mut self.backward.result[0],
            });
            let by: Vec<f32> = cotangent.iter().map(|x| x * OUTPUT_SCALE).collect();
            self.sums.add_last(target, (features, image), &by);
        }
        self.backward.run(
            target,
            images,
            (engine.forward(), engine.reverse()),
            (&self.forward, &self.saved),
            Some(&mut self.sums),
        );
    }
}

impl Engine {
    /// The gradient of a loss with respect to the weights, by their names, and what the lessons said, in the order of their grids; `tensors`
    /// are those that the engine was made from.
    ///
    /// Statistics of batch norm (`mean`, `variance`) are taken as they are and have no gradient. The same on any number of threads.
    ///
    /// # Errors
    /// Slices whose lengths are not those of the same number of grids; tensors of another network.
    pub fn learn<T: Send>(
        &self,
        lessons: &mut Lessons,
        tensors: &NamedTensors,
        input: Input,
        lesson: &Lesson<T>,
    ) -> Result<(NamedTensors, Vec<T>), EngineError> {
        input.check()?;
        let images = input.images();
        let lanes = images.div_ceil(TOGETHER);
        while lessons.lanes.len() < lanes.max(1) {
            lessons.lanes.push(Lane::new(self));
        }
        lessons.predictions.resize(images * 3 * CELLS, 0.0);
        lessons.cotangents.resize(images * 3 * CELLS, 0.0);
        let size = TOGETHER * 3 * CELLS;
        let parts =
            (lessons.predictions.par_chunks_mut(size)).zip(lessons.cotangents.par_chunks_mut(size));
        let numbered = lessons.lanes.par_iter_mut().zip(parts).enumerate();
        let said = numbered.map(|(place, (lane, (out, by)))| {
            let first = place * TOGETHER;
            let grids = first..first + out.len() / (3 * CELLS);
            lane.predict(self, input.part(grids.clone()), out);
            by.fill(0.0);
            let said = lesson(grids, out, by);
            lane.differentiate(self, by);
            said
        });
        let said = said.collect();
        let (first, others) = lessons.lanes.split_at_mut(1);
        let sums = &mut first[0].sums;
        for other in others.iter().take(lanes.saturating_sub(1)) {
            sums.join(&other.sums);
        }
        Ok((sums.folds().by_name(tensors)?, said))
    }
}

impl Folds {
    /// The gradient with respect to the named tensors, from the one with respect to the folded weights.
    fn by_name(self, tensors: &NamedTensors) -> Result<NamedTensors, EngineError> {
        let mut named = NamedTensors::new();
        let blocks = self.down.into_iter().enumerate();
        let mut blocks: Vec<(String, [Folded; 2])> = blocks
            .map(|(level, block)| (format!("down.{level}"), block))
            .collect();
        for (level, up) in self.up.into_iter().enumerate() {
            let name = format!("up.{level}");
            let (conv, norm) = (format!("{name}.conv"), format!("{name}.norm"));
            up.conv.by_name(tensors, [&conv, &norm], &mut named)?;
            up.gate
                .by_name(tensors, &format!("{name}.gate"), &mut named)?;
            blocks.push((format!("{name}.block"), up.block));
        }
        for (name, block) in blocks {
            for (i, conv) in block.into_iter().enumerate() {
                let names = [&format!("{name}.conv{i}"), &format!("{name}.norm{i}")];
                conv.by_name(tensors, names.map(String::as_str), &mut named)?;
            }
        }
        named.insert("last.weight".into(), (vec![3, self.width, 1, 1], self.last));
        named.insert("last.bias".into(), (vec![3], self.last_bias.to_vec()));
        Ok(named)
    }
}

impl GateFolds {
    fn by_name(
        self,
        tensors: &NamedTensors,
        name: &str,
        named: &mut NamedTensors,
    ) -> Result<(), EngineError> {
        let Folded {
            to, from, kernel, ..
        } = self.joint;
        for (part, half) in [("skip", 0), ("signal", from / 2)] {
            let rows = kernel.chunks(from);
            let conv = Folded {
                to,
                from: from / 2,
                kernel: rows
                    .flat_map(|row| &row[half..half + from / 2])
                    .copied()
                    .collect(),
                bias: self.joint.bias.clone(),
            };
            let (weights, norm) = (format!("{name}.{part}"), format!("{name}.{part}_norm"));
            conv.by_name(tensors, [&weights, &norm], named)?;
        }
        let score = (vec![1, to, 1, 1], self.score);
        named.insert(format!("{name}.score.weight"), score);
        let bias = (vec![1], vec![self.score_bias]);
        named.insert(format!("{name}.score.bias"), bias);
        Ok(())
    }
}

impl Folded {
    /// The adjoint of [`Folded::read`]: kernel, scale and shift.
    fn by_name(
        self,
        tensors: &NamedTensors,
        [conv, norm]: [&str; 2],
        named: &mut NamedTensors,
    ) -> Result<(), EngineError> {
        let size = self.taps().isqrt();
        let shape = [self.to, self.from, size, size];
        let kernel = tensor(tensors, &format!("{conv}.weight"), &shape)?;
        let vector = |name: &str| tensor(tensors, &format!("{norm}.{name}"), &[self.to]);
        let (scale, mean, variance) = (vector("scale")?, vector("mean")?, vector("variance")?);
        let row = self.kernel.len() / self.to.max(1);
        let mut by_kernel = self.kernel;
        let mut by_scale = Vec::with_capacity(self.to);
        let rows = by_kernel.chunks_mut(row).zip(kernel.chunks(row));
        for (c, (by, kernel)) in rows.enumerate() {
            let deviation = (f64::from(variance[c]) + EPSILON).sqrt();
            let seen = by.iter().zip(kernel);
            let seen: f64 = seen.map(|(by, w)| f64::from(*by) * f64::from(*w)).sum();
            let shifted = f64::from(mean[c]) * f64::from(self.bias[c]);
            by_scale.push(((seen - shifted) / deviation) as f32);
            let factor = (f64::from(scale[c]) / deviation) as f32;
            by.iter_mut().for_each(|by| *by *= factor);
        }
        named.insert(format!("{conv}.weight"), (shape.to_vec(), by_kernel));
        named.insert(format!("{norm}.scale"), (vec![self.to], by_scale));
        named.insert(format!("{norm}.shift"), (vec![self.to], self.bias));
        Ok(())
    }
}
