//! The network: the attention U-Net, what it sees in unknown cells, its weights file, and inference for many threads.
//! Grids in, positions out, in the network's units; the only rooms that know burn are this one and `train`.
//! No scene space, no constraints, no training, no files: bytes come from the caller.

mod anchor;
mod convolve;
pub mod engine;
mod fill;
mod frame;
mod networks;
mod norm;
mod shared;
mod slope;
pub mod symmetry;
mod unet;
pub mod weights;

#[cfg(test)]
mod anchor_tests;
#[cfg(test)]
mod tests;

use std::str::FromStr;

use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::tensor::{Tensor, TensorData};

use crate::grid::{CELLS, NormalGrid, SIDE};

pub use anchor::AnchorLoss;
pub use convolve::Convolve;
pub(crate) use fill::over;
pub use fill::{InputKind, plate, plates};
pub use frame::{Frame, FrameKind};
pub use networks::Networks;
pub use symmetry::Averaging;
pub use unet::{Sight, Unet, UnetConfig};
pub use weights::{TrainingCard, WeightsCard};

use shared::Shared;
use weights::NamedTensors;

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
    #[error(transparent)]
    Engine(#[from] engine::EngineError),
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

/// What computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendKind {
    /// darn's own [`engine`].
    #[default]
    Engine,
    /// burn-flex.
    Flex,
    /// burn-ndarray: the numerical reference.
    #[cfg(feature = "ndarray")]
    Ndarray,
}

impl BackendKind {
    /// The names that [`FromStr`] knows in this build.
    #[cfg(feature = "ndarray")]
    pub const NAMES: &[&str] = &["engine", "flex", "ndarray"];
    /// The names that [`FromStr`] knows in this build.
    #[cfg(not(feature = "ndarray"))]
    pub const NAMES: &[&str] = &["engine", "flex"];
}

impl FromStr for BackendKind {
    type Err = NetError;

    fn from_str(name: &str) -> Result<Self, NetError> {
        match name {
            "engine" => Ok(BackendKind::Engine),
            "flex" => Ok(BackendKind::Flex),
            #[cfg(feature = "ndarray")]
            "ndarray" => Ok(BackendKind::Ndarray),
            other => Err(NetError::Backend {
                name: other.to_owned(),
            }),
        }
    }
}

/// What computes a network's answers and its gradients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// Forward passes.
    pub backend: BackendKind,
    /// Gradients of the anchor search; the backend's own where there is none.
    pub autodiff: Option<BackendKind>,
    /// How darn's own engine computes.
    pub engine: engine::Options,
}

impl From<BackendKind> for Settings {
    fn from(backend: BackendKind) -> Settings {
        Settings {
            backend,
            ..Settings::default()
        }
    }
}

/// A loaded network, ready for inference. Threads share one behind an `Arc`.
#[derive(Debug)]
pub struct Network {
    forward: Runtime,
    /// What differentiates, where it is not what predicts.
    reverse: Option<Runtime>,
    card: WeightsCard,
}

#[derive(Debug)]
enum Runtime {
    Engine(Box<Shared>),
    Flex(Unet<Flex>),
    #[cfg(feature = "ndarray")]
    Ndarray(Unet<NdArray>),
}

impl Network {
    /// Reads a weights file.
    ///
    /// # Errors
    /// Whatever is wrong with the file, by the tensor's name; see [`weights::load`]. An instruction set that this CPU lacks.
    pub fn load(bytes: &[u8], settings: impl Into<Settings>) -> Result<Network, NetError> {
        let settings = settings.into();
        let (card, tensors) = weights::read(bytes)?;
        weights::check(&card, &tensors)?;
        let runtime = |kind: BackendKind| Runtime::new(kind, (&card, &tensors), settings.engine);
        let reverse = settings.autodiff.filter(|kind| *kind != settings.backend);
        Ok(Network {
            forward: runtime(settings.backend)?,
            reverse: reverse.map(runtime).transpose()?,
            card,
        })
    }

    /// Does what the first answer would otherwise wait for; a network that is never asked saves the memory.
    pub fn prepare(&self) {
        if let Runtime::Engine(engine) = &self.forward {
            engine.prepare();
        }
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
            answers.extend(match &self.forward {
                Runtime::Engine(engine) => seen(config, chunk, |shown| engine.predict(&shown))?,
                Runtime::Flex(unet) => {
                    seen(config, chunk, |shown| Ok(predict(unet, config, shown)))?
                }
                #[cfg(feature = "ndarray")]
                Runtime::Ndarray(unet) => {
                    seen(config, chunk, |shown| Ok(predict(unet, config, shown)))?
                }
            });
        }
        match answers
            .iter()
            .position(|answer| answer.iter().flatten().any(|x| !x.is_finite()))
        {
            Some(index) => Err(NetError::Answer { index }),
            None => Ok(answers),
        }
    }

    /// The anchor search's loss (paper §3.5) of a target, in the network's units, at each of the uvs; squared cells.
    ///
    /// # Errors
    /// A grid of another size, or one whose values make the answer overflow.
    pub fn anchor_losses(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        check_sizes(std::slice::from_ref(grid))?;
        let config = &self.card.architecture;
        let mut losses = Vec::with_capacity(uvs.len());
        for uvs in uvs.chunks(BATCH) {
            losses.extend(match &self.forward {
                Runtime::Engine(engine) => slope::losses(engine, config, (grid, target), uvs)?,
                Runtime::Flex(unet) => anchor::losses(unet, config, (grid, target), uvs)?,
                #[cfg(feature = "ndarray")]
                Runtime::Ndarray(unet) => anchor::losses(unet, config, (grid, target), uvs)?,
            });
        }
        Ok(losses)
    }

    /// The same loss with its gradient.
    ///
    /// # Errors
    /// As of [`Network::anchor_losses`].
    pub fn anchor_gradients(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        check_sizes(std::slice::from_ref(grid))?;
        let config = &self.card.architecture;
        let mut losses = Vec::with_capacity(uvs.len());
        for uvs in uvs.chunks(BATCH) {
            losses.extend(match self.reverse.as_ref().unwrap_or(&self.forward) {
                Runtime::Engine(engine) => slope::gradients(engine, config, (grid, target), uvs)?,
                Runtime::Flex(unet) => anchor::gradients(unet, config, (grid, target), uvs)?,
                #[cfg(feature = "ndarray")]
                Runtime::Ndarray(unet) => anchor::gradients(unet, config, (grid, target), uvs)?,
            });
        }
        Ok(losses)
    }
}

impl Runtime {
    fn new(
        kind: BackendKind,
        (card, tensors): (&WeightsCard, &NamedTensors),
        options: engine::Options,
    ) -> Result<Runtime, NetError> {
        let config = &card.architecture;
        Ok(match kind {
            BackendKind::Engine => {
                Runtime::Engine(Box::new(Shared::new(tensors, config, options)?))
            }
            BackendKind::Flex => {
                Runtime::Flex(weights::build(config, tensors, &Default::default())?)
            }
            #[cfg(feature = "ndarray")]
            BackendKind::Ndarray => {
                Runtime::Ndarray(weights::build(config, tensors, &Default::default())?)
            }
        })
    }
}

fn check_sizes(grids: &[NormalGrid]) -> Result<(), NetError> {
    match grids.iter().position(|grid| {
        let base = grid.base.as_ref().map_or(CELLS, Vec::len);
        [grid.positions.len(), grid.known.len(), base] != [CELLS; 3]
    }) {
        Some(index) => Err(NetError::GridSize {
            index,
            positions: grids[index].positions.len(),
            known: grids[index].known.len(),
        }),
        None => Ok(()),
    }
}

/// What is shown to the network at once: planes of some grids, in its frame.
struct Shown {
    /// `[count, 3, 64, 64]`.
    positions: Vec<f32>,
    /// `[count, 1, 64, 64]`.
    known: Vec<f32>,
    /// `[count, 3, 64, 64]`, for networks that want it.
    base: Option<Vec<f32>>,
    /// `[count, 3]`, for networks that want it.
    up: Option<Vec<f32>>,
}

/// The fill that a network wants under a grid's anchors, in the grid's frame: the grid's own, else made of its known cells.
fn base_of(config: &UnetConfig, grid: &NormalGrid) -> Option<Vec<[f32; 3]>> {
    let wanted = config.input == InputKind::Plate;
    let made = || {
        let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
        // A grid of which next to nothing is known has no plate: then a membrane alone is seen.
        let plate = plate(&grid.positions, &known);
        plate.unwrap_or_else(|| vec![[0.0; 3]; CELLS])
    };
    wanted.then(|| grid.base.clone().unwrap_or_else(made))
}

/// Where up is in a frame, for a network that wants to know.
fn up_of(config: &UnetConfig, frame: &Frame) -> Option<[f32; 3]> {
    config.frame.told_up().then(|| frame.up())
}

/// Grids of checked size turned to the network's frame, shown to it, its answer turned back.
fn seen(
    config: &UnetConfig,
    grids: &[NormalGrid],
    answer: impl FnOnce(Shown) -> Result<Vec<f32>, NetError>,
) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
    let frames: Vec<Frame> = grids
        .iter()
        .map(|grid| Frame::of(config.frame, grid))
        .collect();
    let turned = |cells: &[[f32; 3]], frame: &Frame| -> Vec<[f32; 3]> {
        cells.iter().map(|p| frame.enter(*p)).collect()
    };
    let each = || grids.iter().zip(&frames);
    let positions: Vec<_> = each().map(|(g, f)| turned(&g.positions, f)).collect();
    let base: Option<Vec<_>> = each()
        .map(|(g, f)| Some(turned(&base_of(config, g)?, f)))
        .collect();
    let known = grids.iter().flat_map(|grid| grid.known.iter().copied());
    let up = frames.iter().map(|frame| up_of(config, frame));
    let up: Option<Vec<[f32; 3]>> = up.collect();
    let answer = answer(Shown {
        positions: planes(&positions),
        known: known.collect(),
        base: base.map(|base| planes(&base)),
        up: up.map(|up| up.as_flattened().to_vec()),
    })?;
    let cells = answer.chunks_exact(3 * CELLS).map(cells);
    Ok(cells
        .zip(&frames)
        .map(|(cells, frame)| cells.into_iter().map(|p| frame.leave(p)).collect())
        .collect())
}

/// One pass of burn's network over planes.
fn predict<B: Convolve>(unet: &Unet<B>, config: &UnetConfig, shown: Shown) -> Vec<f32> {
    let device = B::Device::default();
    let count = shown.known.len() / CELLS;
    let tensor = |planes: Vec<f32>, channels: usize| {
        Tensor::from_data(
            TensorData::new(planes, [count, channels, SIDE, SIDE]),
            &device,
        )
    };
    let up = shown.up.map(|up| TensorData::new(up, [count, 3]));
    let sight = Sight {
        positions: tensor(shown.positions, 3),
        known: tensor(shown.known, 1),
        base: shown.base.map(|base| tensor(base, 3)),
        up: up.map(|up| Tensor::from_data(up, &device)),
    };
    unet.predict(config.input, sight)
        .into_data()
        .convert::<f32>()
        .into_vec::<f32>()
        .unwrap_or_default()
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
