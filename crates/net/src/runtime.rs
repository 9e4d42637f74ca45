//! What computes a network's answers: the seam between [`Network`](crate::Network) and its engines.

use std::fmt;
use std::sync::{Mutex, PoisonError};

use crate::engine::{self, Cotangent, Engine, Gradient, Scratch};
use crate::weights::NamedTensors;
use crate::{AnchorLoss, AnchorProblem, GridPlanes, NetError, UnetConfig, anchor};

/// A network on some engine. Called from many threads at once.
pub trait Runtime: fmt::Debug + Send + Sync {
    /// Does now what the first prediction would do otherwise.
    fn prepare(&self) {}

    /// Predicts all cells of what is shown: `[n, 3, 64, 64]`, in the network's units and frame.
    ///
    /// # Errors
    /// Planes of another size.
    fn predict(&self, shown: &GridPlanes) -> Result<Vec<f32>, NetError>;

    /// The anchor loss at uvs.
    ///
    /// # Errors
    /// A loss that is not finite.
    fn anchor_losses(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError>;

    /// The anchor loss and its gradient at uvs.
    ///
    /// # Errors
    /// A loss or gradient that is not finite.
    fn anchor_gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError>;
}

/// darn's own engine for many threads: one set of packed weights, and scratch buffers that calls reuse instead of allocating.
#[derive(Debug)]
pub struct EngineRuntime {
    engine: Engine,
    idle: Mutex<Vec<Scratch>>,
}

/// Predictions, and the derivative of a scalar by the mask.
pub(crate) struct MaskGradient {
    /// `[n, 3, 64, 64]`.
    pub predictions: Vec<f32>,
    /// `[n, 1, 64, 64]`.
    pub by_mask: Vec<f32>,
}

impl EngineRuntime {
    /// An engine for a network's tensors.
    ///
    /// # Errors
    /// What [`Engine::new`] refuses.
    pub fn new(
        tensors: &NamedTensors,
        config: &UnetConfig,
        options: engine::EngineOptions,
    ) -> Result<EngineRuntime, NetError> {
        Ok(EngineRuntime {
            engine: Engine::new(tensors, config, options)?,
            idle: Mutex::default(),
        })
    }

    pub(crate) fn predict_planes(&self, shown: &GridPlanes) -> Result<Vec<f32>, NetError> {
        let mut out = vec![0.0; 3 * shown.known.len()];
        let mut scratch = self.scratch();
        self.engine
            .predict(&mut scratch, shown.as_input(), &mut out)?;
        self.lock().push(scratch);
        Ok(out)
    }

    /// See [`Engine::gradient`].
    pub(crate) fn gradient_by_mask(
        &self,
        shown: &GridPlanes,
        cotangent: &Cotangent,
    ) -> Result<MaskGradient, NetError> {
        let mut predictions = vec![0.0; shown.positions.len()];
        let mut by_positions = vec![0.0; shown.positions.len()];
        let mut by_mask = vec![0.0; shown.known.len()];
        let mut scratch = self.scratch();
        let out = Gradient {
            prediction: &mut predictions,
            by_positions: &mut by_positions,
            by_known: &mut by_mask,
        };
        self.engine
            .gradient(&mut scratch, shown.as_input(), cotangent, out)?;
        self.lock().push(scratch);
        Ok(MaskGradient {
            predictions,
            by_mask,
        })
    }

    /// Buffers that no other call is using.
    fn scratch(&self) -> Scratch {
        self.lock().pop().unwrap_or_default()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Scratch>> {
        // Nothing that is done under the lock can panic half-way.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Runtime for EngineRuntime {
    fn prepare(&self) {
        self.engine.prepare();
    }

    fn predict(&self, shown: &GridPlanes) -> Result<Vec<f32>, NetError> {
        self.predict_planes(shown)
    }

    fn anchor_losses(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        anchor::losses(self, problem, uvs)
    }

    fn anchor_gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        anchor::gradients(self, problem, uvs)
    }
}
