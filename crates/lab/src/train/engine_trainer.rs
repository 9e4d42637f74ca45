//! Training steps by the engine of `darn-net`: its kernels for the network, [`super::loss_gradient`] for the loss. Batch norm keeps its
//! statistics. The means of the loss are over the few grids that go through the kernels together, not over the batch.

use std::ops::Range;

use rayon::prelude::*;

use super::batch::{PreparedSample, TrainingBatch};
use super::error::TrainError;
use super::loss_gradient::loss_and_gradient;
use super::muon;
use super::optimiser::{BETA1, BETA2, CLIP, DECAY, EPSILON, share_kept};
use super::options::{OptimiserKind, TrainOptions};
use super::snapshot::TrainSnapshot;
use super::teacher::Teacher;
use super::trainer::{StepOutcome, Trainer};
use darn_geometry::grid::CELLS;
use darn_net::engine::{
    Engine, EngineError, EngineInput, EngineOptions, Scratch, WeightGradientBuffers,
};
use darn_net::weights::NamedTensors;
use darn_net::{UnetConfig, cells};

/// The tensors of a network, with their optimiser.
#[derive(Debug)]
pub(super) struct EngineTrainer {
    config: UnetConfig,
    network: NamedTensors,
    averaged: NamedTensors,
    optimiser: OptimiserKind,
    teacher: Option<Teacher>,
    /// First and second moments by trained tensor, in the order of the names; tensors that Muon trains have no second.
    moments: Vec<[Vec<f32>; 2]>,
    step: u64,
    buffers: WeightGradientBuffers,
}

/// A tensor of a step.
struct TrainedTensor<'a> {
    values: &'a mut [f32],
    gradient: &'a [f32],
    moments: &'a mut [Vec<f32>; 2],
    /// Factor that the values shrink by.
    decay: f32,
    rule: StepRule,
}

/// How a tensor of a step moves.
#[derive(Debug, Clone, Copy)]
enum StepRule {
    AdamW,
    /// Muon on a matrix of so many rows.
    Muon {
        outputs: usize,
    },
}

impl EngineTrainer {
    fn engine(&self, tensors: &NamedTensors) -> Result<Engine, EngineError> {
        let options = EngineOptions {
            threads: rayon::current_num_threads(),
            ..EngineOptions::default()
        };
        Engine::new(tensors, &self.config, options)
    }

    fn input<'a>(&self, batch: &'a TrainingBatch) -> EngineInput<'a> {
        EngineInput {
            positions: &batch.positions,
            known: &batch.known,
            base: Some(&batch.base),
            up: self.config.frame.told_up().then_some(&batch.up),
        }
    }

    /// One step on all tensors that have a gradient; returns the norm of the gradient before clipping.
    fn descend(&mut self, gradient: &NamedTensors, rate: f64) -> f64 {
        self.step += 1;
        let squares = gradient.par_iter().map(|(_, (_, values))| {
            let squares = values.iter().map(|x| f64::from(*x).powi(2));
            squares.sum::<f64>()
        });
        // Summed in the order of the names: the order of a parallel sum would depend on the threads.
        let norm = squares.collect::<Vec<_>>().iter().sum::<f64>().sqrt();
        let clip = if norm > CLIP { CLIP / norm } else { 1.0 } as f32;
        if self.moments.is_empty() {
            let zeros = |(name, (shape, values)): (&String, &(Vec<usize>, Vec<f32>))| {
                let second = match rule(self.optimiser, name, shape) {
                    StepRule::AdamW => values.len(),
                    StepRule::Muon { .. } => 0,
                };
                [vec![0.0; values.len()], vec![0.0; second]]
            };
            self.moments = gradient.iter().map(zeros).collect();
        }
        let time = self.step as i32;
        let unbias = |beta: f64| (1.0 / (1.0 - beta.powi(time))) as f32;
        let (scale1, scale2) = (unbias(BETA1) * rate as f32, unbias(BETA2));
        let (beta1, beta2) = (BETA1 as f32, BETA2 as f32);
        let trained = self.network.iter_mut();
        let trained = trained.filter(|(name, _)| gradient.contains_key(*name));
        let pairs = trained.zip(gradient.values()).zip(&mut self.moments);
        let tensors: Vec<TrainedTensor> = pairs
            .map(|(((name, tensor), by), moments)| TrainedTensor {
                rule: rule(self.optimiser, name, &tensor.0),
                // Kernels decay, vectors do not.
                decay: if tensor.0.len() > 1 {
                    1.0 - rate * DECAY
                } else {
                    1.0
                } as f32,
                values: &mut tensor.1,
                gradient: &by.1,
                moments,
            })
            .collect();
        tensors.into_par_iter().for_each(|tensor| {
            let [first, second] = tensor.moments;
            if let StepRule::Muon { outputs } = tensor.rule {
                let gradient: Vec<f32> = tensor.gradient.iter().map(|by| by * clip).collect();
                tensor.values.iter_mut().for_each(|x| *x *= tensor.decay);
                muon::step(tensor.values, &gradient, first, outputs, rate as f32);
                return;
            }
            let moments = first.iter_mut().zip(second);
            let values = tensor.values.iter_mut().zip(tensor.gradient);
            for ((x, by), (first, second)) in values.zip(moments) {
                let by = by * clip;
                *first = *first * beta1 + by * (1.0 - beta1);
                *second = *second * beta2 + by * by * (1.0 - beta2);
                let change = scale1 * *first / ((*second * scale2).sqrt() + EPSILON as f32);
                *x = *x * tensor.decay - change;
            }
        });
        norm
    }

    /// Moves the averaged tensors towards the current ones.
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

/// How an optimiser moves a tensor.
fn rule(optimiser: OptimiserKind, name: &str, shape: &[usize]) -> StepRule {
    match optimiser {
        OptimiserKind::Muon if muon::trains(name, shape) => StepRule::Muon { outputs: shape[0] },
        _ => StepRule::AdamW,
    }
}

impl Trainer for EngineTrainer {
    fn of(snapshot: TrainSnapshot, options: &TrainOptions) -> Result<Self, TrainError> {
        if snapshot.step == 0 && options.from.is_none() {
            return Err(TrainError::Options(
                "the engine keeps the statistics of batch norm: it needs weights to start from"
                    .into(),
            ));
        }
        let open = |path| Teacher::open(path, &options.network);
        Ok(EngineTrainer {
            config: options.network,
            optimiser: options.optimiser,
            teacher: options.teacher.as_deref().map(open).transpose()?,
            network: snapshot.network,
            averaged: snapshot.averaged,
            moments: snapshot.moments,
            step: snapshot.step,
            buffers: WeightGradientBuffers::default(),
        })
    }

    fn step(
        &mut self,
        mut batch: TrainingBatch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<StepOutcome, TrainError> {
        if let Some(teacher) = &mut self.teacher {
            teacher.teach(&mut batch)?;
        }
        let engine = self.engine(&self.network)?;
        let input = self.input(&batch);
        let count = batch.count;
        let batch_loss = |grids: Range<usize>, predictions: &[f32], by: &mut [f32]| {
            let share = grids.len() as f32 / count as f32;
            let terms = loss_and_gradient(predictions, &batch.part(grids), &options.loss, by);
            by.iter_mut().for_each(|x| *x *= share);
            terms.scaled(share)
        };
        let buffers = &mut self.buffers;
        let (gradient, terms) =
            engine.weight_gradients(buffers, &self.network, input, &batch_loss)?;
        let norm = self.descend(&gradient, rate);
        self.average();
        Ok(StepOutcome {
            loss: terms.into_iter().sum(),
            norm,
        })
    }

    fn steps(&self) -> u64 {
        self.step
    }

    fn snapshot(&self) -> TrainSnapshot {
        TrainSnapshot {
            network: self.network.clone(),
            averaged: self.averaged.clone(),
            moments: self.moments.clone(),
            step: self.step,
        }
    }

    fn predictions(&self, samples: &[PreparedSample]) -> Result<Vec<Vec<[f32; 3]>>, TrainError> {
        let engine = self.engine(&self.averaged)?;
        let batch = TrainingBatch::of(samples);
        let input = self.input(&batch);
        let mut out = vec![0.0; batch.positions.len()];
        engine.predict(&mut Scratch::default(), input, &mut out)?;
        Ok(out.chunks_exact(3 * CELLS).map(cells).collect())
    }
}
