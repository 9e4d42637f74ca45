//! The network without burn: the attention U-Net's forward pass and gradient on the CPU, its weights file, and what it is shown.
//!
//! Grids go in, positions come out, both in the network's units ([`darn_geometry::grid`]). [`Network::fill`] prepares everything that the
//! network sees: the up direction, the plate under unknown cells and the Procrustes frame. What computes the answer is a [`Runtime`]: darn's
//! own [`engine`], or one of burn's backends, which `darn-lab` provides. This crate knows no scene space, no constraints and no files.

mod anchor;
pub mod config;
pub mod engine;
pub mod fill;
mod frame;
mod network;
mod networks;
mod planes;
pub mod reference;
mod runtime;
pub mod symmetry;
pub mod weights;

use darn_geometry::grid::CELLS;

pub use anchor::{AnchorLoss, AnchorProblem, SIGMA};
pub use config::UnetConfig;
pub use fill::{InputKind, plate, plates};
pub use frame::{FrameKind, NetworkFrame};
pub use network::{FillRequest, Network};
pub use networks::Networks;
pub use planes::{GridPlanes, cells, planes};
pub use runtime::{EngineRuntime, Runtime};
pub use symmetry::Averaging;
pub use weights::{TrainingCard, WeightsCard};

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
