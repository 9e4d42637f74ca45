//! A network's weights in all forms that the passes read; each packed form is made when it is first needed.

use std::sync::OnceLock;

use super::fuse::FusedWeights;
use super::layers::{AdjointLayers, ForwardLayers};
use super::simd::TargetIsa;
use crate::fill::InputKind;

/// A network and the instruction set that computes it.
#[derive(Debug)]
pub struct EngineModel {
    pub input: InputKind,
    pub target: TargetIsa,
    pub weights: FusedWeights,
    forward: OnceLock<ForwardLayers>,
    adjoint: OnceLock<AdjointLayers>,
}

impl EngineModel {
    /// A model without packed layers.
    pub fn new(input: InputKind, target: TargetIsa, weights: FusedWeights) -> EngineModel {
        EngineModel {
            input,
            target,
            weights,
            forward: OnceLock::new(),
            adjoint: OnceLock::new(),
        }
    }

    /// The layers of the forward pass; packs them at the first call.
    pub fn forward(&self) -> &ForwardLayers {
        self.forward
            .get_or_init(|| ForwardLayers::pack(&self.weights))
    }

    /// The layers of the adjoint pass; packs them at the first call.
    pub fn adjoint(&self) -> &AdjointLayers {
        self.adjoint
            .get_or_init(|| AdjointLayers::pack(&self.weights))
    }
}
