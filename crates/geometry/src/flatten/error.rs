//! Why a region has no chart.

use darn_budget::Exhausted;

use crate::cholesky::SolveError;

/// Why a region could not be flattened.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FlattenError {
    /// The sparse system of a stage had no positive definite factor: the region's triangles are degenerate.
    #[error(
        "the {stage} system of a region of {vertices} vertices cannot be solved; its triangles are degenerate"
    )]
    Singular {
        /// The stage: "ARAP", "Tutte" or "symmetric Dirichlet".
        stage: &'static str,
        /// Vertices of the region.
        vertices: usize,
    },
    /// The chart stretches the cloth beyond the limit.
    #[error(
        "mean stretch {stretch:.2} exceeds {limit:.2}; the surface around the hole is not cloth-like"
    )]
    TooStretched {
        /// Mean over edges of max(r, 1/r).
        stretch: f64,
        /// The limit it exceeds.
        limit: f64,
    },
    /// Faces stay flipped even with the flip-free energy.
    #[error(
        "{flipped} of {faces} faces flip in the chart; the surface around the hole is not cloth-like"
    )]
    Flipped {
        /// Faces that are upside down.
        flipped: usize,
        /// Faces of the region.
        faces: usize,
    },
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
}

impl FlattenError {
    /// The error of a stage whose system has no solution; `vertices` are the region's.
    pub(super) fn unsolved(error: SolveError, stage: &'static str, vertices: usize) -> Self {
        match error {
            SolveError::NotPositive => FlattenError::Singular { stage, vertices },
            SolveError::Exhausted(exhausted) => FlattenError::Exhausted(exhausted),
        }
    }
}
