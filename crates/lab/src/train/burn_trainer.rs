//! Training steps by burn, on any autodiff backend: from random weights or given ones, batch norm with the statistics of each batch.

use burn::module::AutodiffModule;
use burn::optim::GradientsParams;
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};

use super::batch::{PreparedSample, TrainingBatch};
use super::error::TrainError;
use super::loss::{LossTarget, LossTerms, loss};
use super::optimiser::{AdamW, average, flat, with_values};
use super::options::TrainOptions;
use super::snapshot::TrainSnapshot;
use super::trainer::{StepOutcome, Trainer};
use crate::unet::{Convolve, InputTensors, Unet, build, export, fill_over_base};
use darn_geometry::grid::{CELLS, SIDE};
use darn_net::{FrameKind, InputKind, UnetConfig, cells};

/// A network in burn with its optimiser.
#[derive(Debug)]
pub(super) struct BurnTrainer<B: AutodiffBackend> {
    config: UnetConfig,
    network: Unet<B>,
    /// All values of the averaged network, in the module's order.
    averaged: Tensor<B::InnerBackend, 1>,
    optimiser: AdamW<B::InnerBackend>,
}

impl<B> Trainer for BurnTrainer<B>
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
    fn of(snapshot: TrainSnapshot, options: &TrainOptions) -> Result<Self, TrainError> {
        let config = options.network;
        let device = B::Device::default();
        let inner = Default::default();
        let tensor = |values: Vec<f32>| {
            let n = values.len();
            Tensor::<B::InnerBackend, 1>::from_data(TensorData::new(values, [n]), &inner)
        };
        let averaged = build::<B::InnerBackend>(&config, &snapshot.averaged, &inner)?;
        Ok(BurnTrainer {
            config,
            network: build::<B>(&config, &snapshot.network, &device)?,
            averaged: flat(&averaged),
            optimiser: AdamW {
                step: snapshot.step,
                moments: (snapshot.moments.into_iter().next()).map(|pair| pair.map(tensor)),
            },
        })
    }

    fn step(
        &mut self,
        batch: TrainingBatch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<StepOutcome, TrainError> {
        let device = B::Device::default();
        let InputTensors {
            positions,
            known,
            base,
            up,
        } = input_tensors::<B::InnerBackend>(&batch, self.config.frame);
        // The fill does not depend on the weights, so it is computed without autodiff.
        let filled = match self.config.input {
            InputKind::Zeros => positions * known.clone(),
            InputKind::Membrane | InputKind::Plate => {
                fill_over_base(base, positions, known.clone())
            }
        };
        let (filled, known) = (
            Tensor::<B, 4>::from_inner(filled),
            Tensor::from_inner(known),
        );
        let added = self
            .network
            .residual(filled.clone(), known, up.map(Tensor::from_inner));
        let predicted = match self.config.input {
            InputKind::Zeros => added,
            InputKind::Membrane | InputKind::Plate => added + filled,
        };
        let loss = loss(predicted, &LossTarget::of(batch, &device), &options.loss);
        let terms = loss.stacked().inner();
        let gradients = GradientsParams::from_grads(loss.total.backward(), &self.network);
        let network = self.network.clone();
        let (network, norm) = self.optimiser.step::<B, _>(network, &gradients, rate);
        let averaged = self.averaged.clone();
        self.averaged = average(averaged, flat(&network.valid()), self.optimiser.step);
        self.network = network;
        // The only place where a step waits for its device.
        let numbers = Tensor::cat(vec![terms, norm], 0).into_data();
        let numbers = numbers.convert::<f32>();
        let mut numbers = numbers.iter::<f32>();
        let mut next = || numbers.next().unwrap_or(f32::NAN);
        Ok(StepOutcome {
            loss: LossTerms {
                total: next(),
                data: next(),
                gradient: next(),
                stretch: next(),
                self_penetration: next(),
            },
            norm: next().into(),
        })
    }

    fn steps(&self) -> u64 {
        self.optimiser.step
    }

    fn snapshot(&self) -> TrainSnapshot {
        let values = |x: &Tensor<B::InnerBackend, 1>| {
            let data = x.to_data().convert::<f32>();
            data.into_vec().unwrap_or_default()
        };
        let moments = self.optimiser.moments.iter();
        TrainSnapshot {
            network: export(&self.network.valid()),
            averaged: export(&self.averaged()),
            moments: moments.map(|pair| pair.each_ref().map(values)).collect(),
            step: self.optimiser.step,
        }
    }

    fn predictions(&self, samples: &[PreparedSample]) -> Result<Vec<Vec<[f32; 3]>>, TrainError> {
        let averaged = self.averaged();
        Ok(answers(samples, |batch| {
            let input_tensors = input_tensors::<B::InnerBackend>(batch, self.config.frame);
            averaged.predict(self.config.input, input_tensors)
        }))
    }
}

impl<B: AutodiffBackend> BurnTrainer<B> {
    fn averaged(&self) -> Unet<B::InnerBackend> {
        with_values(self.network.valid(), self.averaged.clone())
    }
}

/// The input that a network of this frame gets of a batch.
fn input_tensors<B: Backend>(batch: &TrainingBatch, frame: FrameKind) -> InputTensors<B> {
    let device = B::Device::default();
    let tensor = |values: &[f32], channels: usize| {
        Tensor::from_data(
            TensorData::new(values.to_vec(), [batch.count, channels, SIDE, SIDE]),
            &device,
        )
    };
    let up = frame.told_up().then(|| batch.up.clone());
    InputTensors {
        positions: tensor(&batch.positions, 3),
        known: tensor(&batch.known, 1),
        base: Some(tensor(&batch.base, 3)),
        up: up.map(|up| Tensor::from_data(TensorData::new(up, [batch.count, 3]), &device)),
    }
}

/// The fill that the network sees in unknown cells, as a prediction, for comparison.
pub(super) fn input_fill<B: Backend>(samples: &[PreparedSample]) -> Vec<Vec<[f32; 3]>> {
    answers(samples, |batch| {
        let input_tensors = input_tensors::<B>(batch, FrameKind::Canonical);
        fill_over_base(
            input_tensors.base,
            input_tensors.positions,
            input_tensors.known,
        )
    })
}

fn answers<B: Backend>(
    samples: &[PreparedSample],
    answer: impl Fn(&TrainingBatch) -> Tensor<B, 4>,
) -> Vec<Vec<[f32; 3]>> {
    let chunks = samples.chunks(8).flat_map(|chunk| {
        let planes: Vec<f32> = answer(&TrainingBatch::of(chunk))
            .into_data()
            .convert::<f32>()
            .into_vec()
            .unwrap_or_default();
        planes
            .chunks_exact(3 * CELLS)
            .map(cells)
            .collect::<Vec<_>>()
    });
    chunks.collect()
}
