//! The network: the attention U-Net, what it sees in unknown cells, its weights file, and inference for many threads.
//! Grids in, positions out, in the network's units; the only rooms that know burn are this one and `train`.
//! No scene space, no constraints, no training, no files: bytes come from the caller.

mod convolve;
mod fill;
mod frame;
mod norm;
mod unet;
pub mod weights;

#[cfg(test)]
mod tests;

use std::str::FromStr;

use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::tensor::{Tensor, TensorData};

use crate::grid::{CELLS, NormalGrid, SIDE};

pub use convolve::Convolve;
pub use fill::{InputKind, membrane};
pub use frame::{Frame, FrameKind};
pub use unet::{Unet, UnetConfig};
pub use weights::{TrainingCard, WeightsCard};

/// Grids that go through the network together; bounds the memory of a call.
const BATCH: usize = 16;

/// Why a network could not be loaded or asked.
#[derive(Debug, thiserror::Error)]
pub enum NetError {
    #[error("not a safetensors file: {0}")]
    Container(String),
    #[error("the model card is unusable: {0}")]
    Card(String),
    #[error("tensor `{name}` is missing")]
    MissingTensor { name: String },
    #[error("tensor `{name}` does not belong to this architecture")]
    UnexpectedTensor { name: String },
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        name: String,
        found: Vec<usize>,
        expected: Vec<usize>,
    },
    #[error("tensor `{name}` has element type {found}; f16, bf16 and f32 are read")]
    ElementType { name: String, found: String },
    #[error("tensor `{name}` has a value that is not finite")]
    NotFinite { name: String },
    #[error("backend `{name}` is unknown or not built in; there are: {}", BackendKind::NAMES.join(", "))]
    Backend { name: String },
    #[error("grid {index} has {positions} positions and {known} known flags; both must be {CELLS}")]
    GridSize {
        index: usize,
        positions: usize,
        known: usize,
    },
    #[error(
        "the network's answer for grid {index} is not finite; the grid's known positions must be finite and normalised"
    )]
    Answer { index: usize },
}

/// Which of burn's backends computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendKind {
    /// burn-flex: fast.
    #[default]
    Flex,
    /// burn-ndarray: the numerical reference.
    #[cfg(feature = "ndarray")]
    Ndarray,
}

impl BackendKind {
    /// The names that [`FromStr`] knows in this build.
    #[cfg(feature = "ndarray")]
    pub const NAMES: &[&str] = &["flex", "ndarray"];
    /// The names that [`FromStr`] knows in this build.
    #[cfg(not(feature = "ndarray"))]
    pub const NAMES: &[&str] = &["flex"];
}

impl FromStr for BackendKind {
    type Err = NetError;

    fn from_str(name: &str) -> Result<Self, NetError> {
        match name {
            "flex" => Ok(BackendKind::Flex),
            #[cfg(feature = "ndarray")]
            "ndarray" => Ok(BackendKind::Ndarray),
            other => Err(NetError::Backend {
                name: other.to_owned(),
            }),
        }
    }
}

/// A loaded network, ready for inference. Threads share one behind an `Arc`.
#[derive(Debug)]
pub struct Network {
    engine: Engine,
    card: WeightsCard,
}

#[derive(Debug)]
enum Engine {
    Flex(Unet<Flex>),
    #[cfg(feature = "ndarray")]
    Ndarray(Unet<NdArray>),
}

impl Network {
    /// Reads a weights file.
    ///
    /// # Errors
    /// Whatever is wrong with the file, by the tensor's name; see [`weights::load`].
    pub fn load(bytes: &[u8], backend: BackendKind) -> Result<Network, NetError> {
        let (engine, card) = match backend {
            BackendKind::Flex => {
                let (unet, card) = weights::load(bytes, &Default::default())?;
                (Engine::Flex(unet), card)
            }
            #[cfg(feature = "ndarray")]
            BackendKind::Ndarray => {
                let (unet, card) = weights::load(bytes, &Default::default())?;
                (Engine::Ndarray(unet), card)
            }
        };
        Ok(Network { engine, card })
    }

    /// What the weights are.
    pub fn card(&self) -> &WeightsCard {
        &self.card
    }

    /// Predicts every cell of every grid, in the network's units and the grid's own frame.
    ///
    /// Known cells have the network's opinion too; callers keep the scan's.
    ///
    /// # Errors
    /// A grid of another size, or one whose values make the answer overflow.
    pub fn fill(&self, grids: &[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        check_sizes(grids)?;
        let config = &self.card.architecture;
        let mut answers = Vec::with_capacity(grids.len());
        for chunk in grids.chunks(BATCH) {
            let batch = match &self.engine {
                Engine::Flex(unet) => predict(unet, config, chunk),
                #[cfg(feature = "ndarray")]
                Engine::Ndarray(unet) => predict(unet, config, chunk),
            };
            answers.extend(batch);
        }
        match answers
            .iter()
            .position(|answer| answer.iter().flatten().any(|x| !x.is_finite()))
        {
            Some(index) => Err(NetError::Answer { index }),
            None => Ok(answers),
        }
    }
}

fn check_sizes(grids: &[NormalGrid]) -> Result<(), NetError> {
    match grids
        .iter()
        .position(|grid| grid.positions.len() != CELLS || grid.known.len() != CELLS)
    {
        Some(index) => Err(NetError::GridSize {
            index,
            positions: grids[index].positions.len(),
            known: grids[index].known.len(),
        }),
        None => Ok(()),
    }
}

/// One pass of the network over grids of checked size.
fn predict<B: Convolve>(
    unet: &Unet<B>,
    config: &UnetConfig,
    grids: &[NormalGrid],
) -> Vec<Vec<[f32; 3]>> {
    let device = B::Device::default();
    let frames: Vec<Frame> = grids
        .iter()
        .map(|grid| Frame::of(config.frame, grid))
        .collect();
    let turned: Vec<Vec<[f32; 3]>> = grids
        .iter()
        .zip(&frames)
        .map(|(grid, frame)| grid.positions.iter().map(|p| frame.enter(*p)).collect())
        .collect();
    let positions = planes(&turned);
    let known: Vec<f32> = grids
        .iter()
        .flat_map(|grid| grid.known.iter().copied())
        .collect();
    let count = grids.len();
    let positions = Tensor::from_data(TensorData::new(positions, [count, 3, SIDE, SIDE]), &device);
    let known = Tensor::from_data(TensorData::new(known, [count, 1, SIDE, SIDE]), &device);
    let answer = unet
        .predict(config.input, positions, known)
        .into_data()
        .convert::<f32>()
        .into_vec::<f32>()
        .unwrap_or_default();
    let cells = answer.chunks_exact(3 * CELLS).map(cells);
    cells
        .zip(&frames)
        .map(|(cells, frame)| cells.into_iter().map(|p| frame.leave(p)).collect())
        .collect()
}

/// Positions of cells as planes: x of all cells, y of all cells, z of all cells, grid after grid.
fn planes(grids: &[Vec<[f32; 3]>]) -> Vec<f32> {
    grids
        .iter()
        .flat_map(|grid| (0..3).flat_map(move |axis| grid.iter().map(move |p| p[axis])))
        .collect()
}

/// The cells of one grid's three planes.
pub(crate) fn cells(planes: &[f32]) -> Vec<[f32; 3]> {
    let (x, rest) = planes.split_at(CELLS);
    let (y, z) = rest.split_at(CELLS);
    x.iter()
        .zip(y)
        .zip(z)
        .map(|((x, y), z)| [*x, *y, *z])
        .collect()
}
