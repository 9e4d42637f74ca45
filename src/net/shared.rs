//! darn's own engine for many threads: one set of packed weights, and room for calls that is handed round instead of allocated anew.

use std::sync::{Mutex, PoisonError};

use super::engine::{self, Cotangent, Engine, Gradient, Input, Scratch};
use super::weights::NamedTensors;
use super::{NetError, Shown, UnetConfig};

/// An engine and the room of the calls that are over.
#[derive(Debug)]
pub struct Shared {
    engine: Engine,
    idle: Mutex<Vec<Scratch>>,
}

impl Shared {
    /// Packs the weights.
    ///
    /// # Errors
    /// What [`Engine::new`] refuses.
    pub fn new(
        tensors: &NamedTensors,
        config: &UnetConfig,
        options: engine::Options,
    ) -> Result<Shared, NetError> {
        Ok(Shared {
            engine: Engine::new(tensors, config, options)?,
            idle: Mutex::default(),
        })
    }

    /// See [`Engine::prepare`].
    pub fn prepare(&self) {
        self.engine.prepare();
    }

    /// Predicts all cells of what is shown: `[count, 3, 64, 64]`.
    ///
    /// # Errors
    /// Planes of another size.
    pub fn predict(&self, shown: &Shown) -> Result<Vec<f32>, NetError> {
        let mut out = vec![0.0; 3 * shown.known.len()];
        let mut scratch = self.room();
        self.engine.predict(&mut scratch, shown.input(), &mut out)?;
        self.lock().push(scratch);
        Ok(out)
    }

    /// Predictions and their derivative by the mask: `[count, 3, 64, 64]` and `[count, 1, 64, 64]`; see [`Engine::gradient`].
    ///
    /// # Errors
    /// Planes of another size.
    pub fn by_known(
        &self,
        shown: &Shown,
        cotangent: &Cotangent,
    ) -> Result<(Vec<f32>, Vec<f32>), NetError> {
        let mut prediction = vec![0.0; shown.positions.len()];
        let mut by_positions = vec![0.0; shown.positions.len()];
        let mut by_known = vec![0.0; shown.known.len()];
        let mut scratch = self.room();
        let out = Gradient {
            prediction: &mut prediction,
            by_positions: &mut by_positions,
            by_known: &mut by_known,
        };
        self.engine
            .gradient(&mut scratch, shown.input(), cotangent, out)?;
        self.lock().push(scratch);
        Ok((prediction, by_known))
    }

    /// Room that no other call is using.
    fn room(&self) -> Scratch {
        self.lock().pop().unwrap_or_default()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Scratch>> {
        // Nothing that is done under the lock can panic half-way.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shown {
    fn input(&self) -> Input<'_> {
        Input {
            positions: &self.positions,
            known: &self.known,
            base: self.base.as_deref(),
            up: self.up.as_deref(),
        }
    }
}
