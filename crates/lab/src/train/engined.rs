//! Training steps by darn's own engine: its kernels for the network, the loss's derivatives written out. The loss's means are over the few
//! grids that go through the kernels together, not over the batch.

use std::ops::Range;

use rayon::prelude::*;

use super::batch::{Batch, Prepared};
use super::optimiser::{BETA1, BETA2, CLIP, DECAY, EPSILON, share_kept};
use super::slopes::slopes;
use super::student::{Learned, Snapshot, Student};
use super::{TrainError, TrainOptions};
use darn_geometry::grid::CELLS;
use darn_net::engine::{
    Engine, EngineError, EngineInput, EngineOptions, Scratch, WeightGradientBuffers,
};
use darn_net::weights::NamedTensors;
use darn_net::{UnetConfig, cells};

/// A network by its tensors, with its optimiser.
#[derive(Debug)]
pub struct Engined {
    config: UnetConfig,
    network: NamedTensors,
    averaged: NamedTensors,
    /// By trained tensor, in the order of their names.
    moments: Vec<[Vec<f32>; 2]>,
    step: u64,
    lessons: WeightGradientBuffers,
}

impl Engined {
    fn engine(&self, tensors: &NamedTensors) -> Result<Engine, EngineError> {
        let options = EngineOptions {
            threads: rayon::current_num_threads(),
            ..EngineOptions::default()
        };
        Engine::new(tensors, &self.config, options)
    }

    fn input<'a>(&self, batch: &'a Batch) -> EngineInput<'a> {
        EngineInput {
            positions: &batch.positions,
            known: &batch.known,
            base: Some(&batch.base),
            up: self.config.frame.told_up().then_some(&batch.up),
        }
    }

    /// AdamW on all tensors that have a gradient; returns the gradient's norm before clipping.
    fn descend(&mut self, gradient: &NamedTensors, rate: f64) -> f64 {
        self.step += 1;
        let squares = gradient.par_iter().map(|(_, (_, values))| {
            let squares = values.iter().map(|x| f64::from(*x).powi(2));
            squares.sum::<f64>()
        });
        // In the order of names: a parallel sum's order would depend on the threads.
        let norm = squares.collect::<Vec<_>>().iter().sum::<f64>().sqrt();
        let clip = if norm > CLIP { CLIP / norm } else { 1.0 } as f32;
        if self.moments.is_empty() {
            let zeros = |(_, values): &(Vec<usize>, Vec<f32>)| vec![0.0; values.len()];
            self.moments = gradient.values().map(|t| [zeros(t), zeros(t)]).collect();
        }
        let time = self.step as i32;
        let unbias = |beta: f64| (1.0 / (1.0 - beta.powi(time))) as f32;
        let (scale1, scale2) = (unbias(BETA1) * rate as f32, unbias(BETA2));
        let (beta1, beta2) = (BETA1 as f32, BETA2 as f32);
        let trained = self.network.iter_mut();
        let trained = trained.filter(|(name, _)| gradient.contains_key(*name));
        let tensors: Vec<_> = trained.zip(gradient).zip(&mut self.moments).collect();
        tensors.into_par_iter().for_each(
            |(((_, (shape, values)), (_, (_, by))), [first, second])| {
                let decay = if shape.len() > 1 {
                    1.0 - rate * DECAY
                } else {
                    1.0
                } as f32;
                let moments = first.iter_mut().zip(second);
                for ((x, by), (first, second)) in values.iter_mut().zip(by).zip(moments) {
                    let by = by * clip;
                    *first = *first * beta1 + by * (1.0 - beta1);
                    *second = *second * beta2 + by * by * (1.0 - beta2);
                    let change = scale1 * *first / ((*second * scale2).sqrt() + EPSILON as f32);
                    *x = *x * decay - change;
                }
            },
        );
        norm
    }

    fn average(&mut self) {
        let keep = share_kept(self.step) as f32;
        let pairs = self.averaged.iter_mut().zip(self.network.iter());
        let both: Vec<_> = pairs.collect();
        both.into_par_iter()
            .for_each(|((_, (_, averaged)), (_, (_, current)))| {
                for (averaged, current) in averaged.iter_mut().zip(current) {
                    *averaged = *averaged * keep + current * (1.0 - keep);
                }
            });
    }
}

impl Student for Engined {
    fn of(snapshot: Snapshot, options: &TrainOptions) -> Result<Self, TrainError> {
        if snapshot.step == 0 && options.from.is_none() {
            return Err(TrainError::EngineOptions(
                "the engine keeps the statistics of batch norm: it needs weights to start from"
                    .into(),
            ));
        }
        Ok(Engined {
            config: options.network,
            network: snapshot.network,
            averaged: snapshot.averaged,
            moments: snapshot.moments,
            step: snapshot.step,
            lessons: WeightGradientBuffers::default(),
        })
    }

    fn step(
        &mut self,
        batch: Batch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<Learned, TrainError> {
        let engine = self.engine(&self.network)?;
        let input = self.input(&batch);
        let count = batch.count;
        let lesson = |grids: Range<usize>, predictions: &[f32], by: &mut [f32]| {
            let share = grids.len() as f32 / count as f32;
            let said = slopes(predictions, &batch.part(grids), &options.loss, by);
            by.iter_mut().for_each(|x| *x *= share);
            said.map(|term| term * share)
        };
        let lessons = &mut self.lessons;
        let (gradient, said) = engine.weight_gradients(lessons, &self.network, input, &lesson)?;
        let sum = |term: usize| said.iter().map(|terms| terms[term]).sum();
        let terms = std::array::from_fn(sum);
        let norm = self.descend(&gradient, rate);
        self.average();
        Ok((terms, norm))
    }

    fn steps(&self) -> u64 {
        self.step
    }

    fn snapshot(&self) -> Snapshot {
        Snapshot {
            network: self.network.clone(),
            averaged: self.averaged.clone(),
            moments: self.moments.clone(),
            step: self.step,
        }
    }

    fn predictions(&self, samples: &[Prepared]) -> Result<Vec<Vec<[f32; 3]>>, TrainError> {
        let engine = self.engine(&self.averaged)?;
        let batch = Batch::of(samples);
        let input = self.input(&batch);
        let mut out = vec![0.0; batch.positions.len()];
        engine.predict(&mut Scratch::default(), input, &mut out)?;
        Ok(out.chunks_exact(3 * CELLS).map(cells).collect())
    }
}
