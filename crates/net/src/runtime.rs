//! The interface between [`Network`](crate::Network) and what computes its predictions, and its implementation by darn's own engine.

use std::fmt;
use std::time::Duration;

use darn_budget::Spares;

use crate::anchor::{AnchorBatch, AnchorLoss, AnchorProblem};
use crate::config::UnetConfig;
use crate::engine::{Engine, EngineOptions, InputGradient, Scratch};
use crate::error::NetError;
use crate::planes::GridPlanes;
use crate::tensors::NamedTensors;

/// What computes a network's predictions. It is called from many threads at once.
pub trait Runtime: fmt::Debug + Send + Sync {
    /// Packs the weights now instead of at the first prediction.
    fn prepare(&self) {}

    /// Frees buffers that no call has used for so long.
    fn release_idle(&self, _unused: Duration) {}

    /// Predicts all cells of some grids: `[n, 3, 64, 64]`, in the network's units and frame.
    ///
    /// # Errors
    /// Planes whose lengths are not those of the same number of grids.
    fn predict(&self, input: &GridPlanes) -> Result<Vec<f32>, NetError>;

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

/// darn's own engine, with one set of packed weights for all threads and a pool of [`Scratch`] buffers for their calls.
#[derive(Debug)]
pub struct EngineRuntime {
    engine: Engine,
    spare: Spares<Scratch>,
}

impl EngineRuntime {
    /// An engine for a network's tensors.
    ///
    /// # Errors
    /// Those of [`Engine::new`].
    pub fn new(
        tensors: &NamedTensors,
        config: &UnetConfig,
        options: EngineOptions,
    ) -> Result<EngineRuntime, NetError> {
        Ok(EngineRuntime {
            engine: Engine::new(tensors, config, options)?,
            spare: Spares::default(),
        })
    }
}

impl Runtime for EngineRuntime {
    fn prepare(&self) {
        self.engine.prepare();
    }

    fn release_idle(&self, unused: Duration) {
        self.spare.release(unused);
    }

    fn predict(&self, input: &GridPlanes) -> Result<Vec<f32>, NetError> {
        let mut out = vec![0.0; 3 * input.known.len()];
        let mut scratch = self.spare.take().unwrap_or_default();
        self.engine
            .predict(&mut scratch, input.as_input(), &mut out)?;
        self.spare.keep(scratch);
        Ok(out)
    }

    fn anchor_losses(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        let batch = AnchorBatch::new(problem, uvs);
        batch.losses(&self.predict(&batch.input())?)
    }

    fn anchor_gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        let batch = AnchorBatch::new(problem, uvs);
        let input = batch.input();
        let mut predictions = vec![0.0; input.positions.len()];
        let mut by_positions = vec![0.0; input.positions.len()];
        let mut by_mask = vec![0.0; input.known.len()];
        let cotangent = |place: usize, prediction: &[f32], by: &mut [f32]| {
            batch.cotangent(place, prediction, by);
        };
        let out = InputGradient {
            prediction: &mut predictions,
            by_positions: &mut by_positions,
            by_known: &mut by_mask,
        };
        let mut scratch = self.spare.take().unwrap_or_default();
        self.engine
            .gradient(&mut scratch, input.as_input(), &cotangent, out)?;
        self.spare.keep(scratch);
        batch.gradients(&predictions, &by_mask)
    }
}

#[cfg(test)]
mod tests {
    use darn_geometry::grid::CELLS;

    use super::*;
    use crate::fill::InputKind;
    use crate::frame::FrameKind;
    use crate::testing::random_tensors;

    #[test]
    fn buffers_that_no_call_uses_are_freed() {
        let config = UnetConfig {
            width: 2,
            input: InputKind::Membrane,
            frame: FrameKind::Canonical,
        };
        let options = EngineOptions::default();
        let engine = EngineRuntime::new(&random_tensors(&config), &config, options).unwrap();
        let input = GridPlanes {
            positions: vec![0.5; 3 * CELLS],
            known: vec![1.0; CELLS],
            base: None,
            up: None,
        };
        let first = engine.predict(&input).unwrap();
        engine.release_idle(Duration::from_secs(3600));
        assert_eq!(engine.spare.count(), 1);
        engine.release_idle(Duration::ZERO);
        assert_eq!(engine.spare.count(), 0);
        assert_eq!(engine.predict(&input).unwrap(), first);
    }
}
