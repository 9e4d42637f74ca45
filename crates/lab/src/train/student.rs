//! Whoever takes a training step: burn with any backend, or darn's own engine. The loop does not know which.

use burn::backend::Flex;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use serde::{Deserialize, Serialize};

use super::batch::{Batch, Prepared};
use super::loss::Loss;
use super::{TrainError, TrainOptions};
use crate::unet::{Unet, export};
use darn_net::weights::{self, NamedTensors};

/// A score whose sigmoid is 1 in f32, with no slope.
const WIDE: f32 = 80.0;

/// What computes the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trainer {
    /// burn: batch norm with the statistics of each batch; from random weights or given ones.
    #[default]
    Burn,
    /// burn on an NVIDIA GPU.
    #[cfg(feature = "cuda")]
    Cuda,
    /// darn's own kernels, several times as fast: batch norm keeps its statistics, so it starts from weights that burn has trained.
    Engine,
}

/// A run between two steps. The samples' generator needs no state: batch k follows from the seed and k.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// The network being trained.
    pub network: NamedTensors,
    /// Its average over the last steps, which is what ships.
    pub averaged: NamedTensors,
    /// The optimiser's first and second moments, in the student's own layout.
    pub moments: Vec<[Vec<f32>; 2]>,
    /// Steps taken.
    pub step: u64,
}

/// The loss with its terms (data, gradient, stretch, self-penetration), and the gradient's norm.
pub type Learned = ([f32; 5], f64);

/// Something that can be trained.
pub trait Student: Sized {
    /// Goes on from a snapshot.
    ///
    /// # Errors
    /// Tensors of another network.
    fn of(snapshot: Snapshot, options: &TrainOptions) -> Result<Self, TrainError>;

    /// One step on a batch.
    ///
    /// # Errors
    /// A network that cannot be asked.
    fn step(
        &mut self,
        batch: Batch,
        options: &TrainOptions,
        rate: f64,
    ) -> Result<Learned, TrainError>;

    /// Steps taken.
    fn steps(&self) -> u64;

    /// All that a later sitting needs.
    fn snapshot(&self) -> Snapshot;

    /// The averaged network's answers for prepared samples, in their own frame.
    ///
    /// # Errors
    /// A network that cannot be asked.
    fn predictions(&self, samples: &[Prepared]) -> Result<Vec<Vec<[f32; 3]>>, TrainError>;
}

impl Snapshot {
    /// A fresh run's: random weights, or those of a file.
    ///
    /// # Errors
    /// A file that cannot be read, or holds another architecture.
    pub fn fresh(options: &TrainOptions) -> Result<Snapshot, TrainError> {
        let mut network = match &options.from {
            None => {
                let device = Default::default();
                Flex::seed(&device, options.seed);
                export(&Unet::<Flex>::init(&options.network, &device))
            }
            Some(_) => given(options)?,
        };
        if options.open_gates {
            open_gates(&mut network);
        }
        Ok(Snapshot {
            averaged: network.clone(),
            network,
            ..Snapshot::default()
        })
    }
}

/// The weights that a run starts from.
fn given(options: &TrainOptions) -> Result<NamedTensors, TrainError> {
    let path = options.from.clone().unwrap_or_default();
    let bytes = std::fs::read(&path).map_err(|source| TrainError::File {
        path: path.clone(),
        source,
    })?;
    let (card, mut tensors) = weights::read(&bytes)?;
    weights::check(&card, &tensors)?;
    if card.architecture.width != options.network.width {
        return Err(TrainError::Options(format!(
            "{} holds another architecture than the one to train",
            path.display()
        )));
    }
    let [before, after] = [card.architecture, options.network].map(|net| net.frame.channels());
    if before != after {
        see(&mut tensors, [before, after]);
    }
    if card.architecture.input != options.network.input {
        // What it has learned to see stays of use; what is to be added to another fill is to be learned anew.
        let last = tensors
            .iter_mut()
            .filter(|(name, _)| name.starts_with("last."));
        last.for_each(|(_, (_, values))| values.fill(0.0));
    }
    Ok(tensors)
}

/// Opens all gates so wide that they let everything through and learn nothing.
fn open_gates(tensors: &mut NamedTensors) {
    for (name, (_, values)) in tensors {
        if name.ends_with(".gate.score.weight") {
            values.fill(0.0);
        } else if name.ends_with(".gate.score.bias") {
            values.fill(WIDE);
        }
    }
}

/// Lets a network see another number of channels: further ones mean nothing to it at first, the last ones are lost.
fn see(tensors: &mut NamedTensors, [before, after]: [usize; 2]) {
    let Some((shape, values)) = tensors.get_mut("down.0.conv0.weight") else {
        return;
    };
    let taps: usize = shape[2..].iter().product();
    let rows = values.chunks(before * taps);
    let row = |row: &[f32]| {
        let mut row = row.to_vec();
        row.resize(after * taps, 0.0);
        row
    };
    *values = rows.flat_map(row).collect();
    shape[1] = after;
}

/// The loss and its terms, `[5]`.
pub fn terms<B: Backend>(loss: &Loss<B>) -> Tensor<B, 1> {
    let terms = [
        &loss.total,
        &loss.data,
        &loss.gradient,
        &loss.stretch,
        &loss.self_penetration,
    ];
    Tensor::cat(terms.map(Tensor::clone).to_vec(), 0)
}

/// The numbers of a tensor `[N]`; NaN where there are fewer.
pub fn numbers<B: Backend, const N: usize>(x: Tensor<B, 1>) -> [f32; N] {
    let data = x.into_data().convert::<f32>();
    let mut numbers = data.iter::<f32>();
    std::array::from_fn(|_| numbers.next().unwrap_or(f32::NAN))
}
