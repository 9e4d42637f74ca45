//! Errors of the engine.

use super::simd::Isa;

/// Why an engine could not be built or could not compute.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The weights lack a tensor.
    #[error("tensor `{name}` is missing")]
    MissingTensor {
        /// The tensor's name.
        name: String,
    },
    /// A tensor has another shape than the architecture needs.
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// The tensor's name.
        name: String,
        /// Its shape in the weights.
        found: Vec<usize>,
        /// The shape that the architecture needs.
        expected: Vec<usize>,
    },
    /// The architecture's width is not supported.
    #[error("width {width} is outside 1..=256")]
    Width {
        /// The width asked for.
        width: usize,
    },
    /// The CPU lacks the instruction set asked for.
    #[error("this CPU has no {}", isa.name())]
    Isa {
        /// The instruction set asked for.
        isa: Isa,
    },
    /// A slice's length does not fit the number of grids.
    #[error("`{what}` holds {found} values, expected {expected} for {images} grid(s)")]
    Size {
        /// The argument's name.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it needs.
        expected: usize,
        /// Grids in the call.
        images: usize,
    },
}
