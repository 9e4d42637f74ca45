//! Training steps by burn, on any autodiff backend.

use burn::module::AutodiffModule;
use burn::optim::GradientsParams;
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};

use super::batch::{Batch, Prepared};
use super::loss::{Target, loss};
use super::optimiser::{AdamW, average, flat, with_values};
use super::student::{Learned, Snapshot, Student, numbers, terms};
use super::{TrainError, TrainOptions};
use crate::unet::{Convolve, Sight, Unet, build, export, over};
use darn_geometry::grid::{CELLS, SIDE};
use darn_net::{FrameKind, InputKind, UnetConfig, cells};

/// A network of burn's with its optimiser.
#[derive(Debug)]
pub struct Burned<B: AutodiffBackend> {
    config: UnetConfig,
    network: Unet<B>,
    /// The values of the averaged network, end to end.
    averaged: Tensor<B::InnerBackend, 1>,
    optimiser: AdamW<B::InnerBackend>,
}

impl<B> Student for Burned<B>
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
    fn of(snapshot: Snapshot, options: &TrainOptions) -> Result<Self, TrainError> {
        let config = options.network;
        let device = B::Device::default();
        let inner = Default::default();
        let tensor = |values: Vec<f32>| {
            let n = values.len();
            Tensor::<B::InnerBackend, 1>::from_data(TensorData::new(values, [n]), &inner)
        };
        let averaged = build::<B::InnerBackend>(&config, &snapshot.averaged, &inner)?;
        Ok(Burned {
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
        batch: Batch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<Learned, TrainError> {
        let device = B::Device::default();
        let Sight {
            positions,
            known,
            base,
            up,
        } = sight::<B::InnerBackend>(&batch, self.config.frame);
        // The fill does not depend on the weights: it is computed outside the graph.
        let filled = match self.config.input {
            InputKind::Zeros => positions * known.clone(),
            InputKind::Membrane | InputKind::Plate => over(base, positions, known.clone()),
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
        let loss = loss(predicted, &Target::of(batch, &device), &options.loss);
        let terms = terms(&loss).inner();
        let gradients = GradientsParams::from_grads(loss.total.backward(), &self.network);
        let network = self.network.clone();
        let (network, norm) = self.optimiser.step::<B, _>(network, &gradients, rate);
        let averaged = self.averaged.clone();
        self.averaged = average(averaged, flat(&network.valid()), self.optimiser.step);
        self.network = network;
        // The one place where a step waits for its device.
        let [terms @ .., norm] = numbers::<_, 6>(Tensor::cat(vec![terms, norm], 0));
        Ok((terms, norm.into()))
    }

    fn steps(&self) -> u64 {
        self.optimiser.step
    }

    fn snapshot(&self) -> Snapshot {
        let values = |x: &Tensor<B::InnerBackend, 1>| {
            let data = x.to_data().convert::<f32>();
            data.into_vec().unwrap_or_default()
        };
        let moments = self.optimiser.moments.iter();
        Snapshot {
            network: export(&self.network.valid()),
            averaged: export(&self.averaged()),
            moments: moments.map(|pair| pair.each_ref().map(values)).collect(),
            step: self.optimiser.step,
        }
    }

    fn predictions(&self, samples: &[Prepared]) -> Result<Vec<Vec<[f32; 3]>>, TrainError> {
        let averaged = self.averaged();
        Ok(answers(samples, |batch| {
            let sight = sight::<B::InnerBackend>(batch, self.config.frame);
            averaged.predict(self.config.input, sight)
        }))
    }
}

impl<B: AutodiffBackend> Burned<B> {
    fn averaged(&self) -> Unet<B::InnerBackend> {
        with_values(self.network.valid(), self.averaged.clone())
    }
}

/// What a batch shows a network of this frame.
fn sight<B: Backend>(batch: &Batch, frame: FrameKind) -> Sight<B> {
    let device = B::Device::default();
    let tensor = |values: &[f32], channels: usize| {
        Tensor::from_data(
            TensorData::new(values.to_vec(), [batch.count, channels, SIDE, SIDE]),
            &device,
        )
    };
    let up = frame.told_up().then(|| batch.up.clone());
    Sight {
        positions: tensor(&batch.positions, 3),
        known: tensor(&batch.known, 1),
        base: Some(tensor(&batch.base, 3)),
        up: up.map(|up| Tensor::from_data(TensorData::new(up, [batch.count, 3]), &device)),
    }
}

/// What the network sees in unknown cells, as an answer, for comparison.
pub fn input_fill<B: Backend>(samples: &[Prepared]) -> Vec<Vec<[f32; 3]>> {
    answers(samples, |batch| {
        let sight = sight::<B>(batch, FrameKind::Canonical);
        over(sight.base, sight.positions, sight.known)
    })
}

fn answers<B: Backend>(
    samples: &[Prepared],
    answer: impl Fn(&Batch) -> Tensor<B, 4>,
) -> Vec<Vec<[f32; 3]>> {
    let chunks = samples.chunks(8).flat_map(|chunk| {
        let planes: Vec<f32> = answer(&Batch::of(chunk))
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
