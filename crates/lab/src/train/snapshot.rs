//! The state of a training run between two steps, and the state that a fresh run starts from.

use std::path::Path;

use burn::backend::Flex;
use burn::tensor::backend::Backend;

use super::error::TrainError;
use super::options::TrainOptions;
use crate::unet::{Unet, export};
use darn_net::UnetConfig;
use darn_net::weights::{self, NamedTensors};

/// A gate's score that is so large that its sigmoid is 1 in f32 and has no slope.
const OPEN_GATE_SCORE: f32 = 80.0;

/// The state of a run between two steps. Samples need no state: batch k follows from the seed and k.
#[derive(Debug, Clone, Default)]
pub struct TrainSnapshot {
    /// The network being trained.
    pub network: NamedTensors,
    /// Its average over the last steps: the weights that are exported.
    pub averaged: NamedTensors,
    /// The optimiser's first and second moments, in the trainer's own layout.
    pub moments: Vec<[Vec<f32>; 2]>,
    /// Steps taken.
    pub step: u64,
}

impl TrainSnapshot {
    /// The state of a fresh run: random weights, or those of a file.
    ///
    /// # Errors
    /// A file that cannot be read, or has another architecture.
    pub fn fresh(options: &TrainOptions) -> Result<TrainSnapshot, TrainError> {
        let mut network = match &options.from {
            None => {
                let device = Default::default();
                Flex::seed(&device, options.seed);
                export(&Unet::<Flex>::init(&options.network, &device))
            }
            Some(path) => starting_weights(path, &options.network)?,
        };
        if options.open_gates {
            open_gates(&mut network);
        }
        Ok(TrainSnapshot {
            averaged: network.clone(),
            network,
            ..TrainSnapshot::default()
        })
    }
}

/// The weights of a file, adapted to the network to train.
fn starting_weights(path: &Path, network: &UnetConfig) -> Result<NamedTensors, TrainError> {
    let bytes = std::fs::read(path).map_err(|source| TrainError::File {
        path: path.to_owned(),
        source,
    })?;
    let (card, mut tensors) = weights::read(&bytes)?;
    weights::check(&card, &tensors)?;
    if card.architecture.width != network.width {
        return Err(TrainError::Options(format!(
            "{} holds another architecture than the one to train",
            path.display()
        )));
    }
    let (before, after) = (card.architecture.frame.channels(), network.frame.channels());
    if before != after {
        set_input_channels(&mut tensors, before, after);
    }
    if card.architecture.input != network.input {
        // The features stay useful. The last layer starts at zero, since the network adds to another fill now.
        let last = tensors
            .iter_mut()
            .filter(|(name, _)| name.starts_with("last."));
        last.for_each(|(_, (_, values))| values.fill(0.0));
    }
    Ok(tensors)
}

/// Opens all gates so far that they pass everything and have no gradient.
fn open_gates(tensors: &mut NamedTensors) {
    for (name, (_, values)) in tensors {
        if name.ends_with(".gate.score.weight") {
            values.fill(0.0);
        } else if name.ends_with(".gate.score.bias") {
            values.fill(OPEN_GATE_SCORE);
        }
    }
}

/// Changes the number of input channels: new channels have weight zero, surplus ones at the end are dropped.
fn set_input_channels(tensors: &mut NamedTensors, before: usize, after: usize) {
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
