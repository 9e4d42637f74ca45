//! Errors of this crate.

use crate::engine;
use darn_geometry::grid::CELLS;

/// Why a network could not be loaded or could not predict.
#[derive(Debug, thiserror::Error)]
pub enum NetError {
    /// The file is no safetensors container.
    #[error("not a safetensors file: {0}")]
    Container(String),
    /// The model card is missing, malformed or contradicts the tensors.
    #[error("the model card is unusable: {0}")]
    Card(String),
    /// A tensor of the architecture is missing.
    #[error("tensor `{name}` is missing")]
    MissingTensor {
        /// The tensor's name.
        name: String,
    },
    /// A tensor that the architecture does not have.
    #[error("tensor `{name}` does not belong to this architecture")]
    UnexpectedTensor {
        /// The tensor's name.
        name: String,
    },
    /// A tensor has another shape than the architecture needs.
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// The tensor's name.
        name: String,
        /// Its shape in the file.
        found: Vec<usize>,
        /// The shape that the architecture needs.
        expected: Vec<usize>,
    },
    /// A tensor has an element type that is not read.
    #[error("tensor `{name}` has element type {found}; f16, bf16 and f32 are read")]
    ElementType {
        /// The tensor's name.
        name: String,
        /// Its element type.
        found: String,
    },
    /// A tensor has a value that is not finite.
    #[error("tensor `{name}` has a value that is not finite")]
    NotFinite {
        /// The tensor's name.
        name: String,
    },
    /// The engine could not be built or could not compute.
    #[error(transparent)]
    Engine(#[from] engine::EngineError),
    /// A grid does not have 64×64 cells.
    #[error("grid {index} has {positions} positions and {known} known flags; both must be {CELLS}")]
    GridSize {
        /// The grid's place in the call.
        index: usize,
        /// Its positions.
        positions: usize,
        /// Its known flags.
        known: usize,
    },
    /// A prediction is not finite.
    #[error(
        "the network's answer for grid {index} is not finite; the grid's known positions must be finite and normalised"
    )]
    Answer {
        /// The grid's place in the call.
        index: usize,
    },
}
