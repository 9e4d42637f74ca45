//! The backends that can compute a [`darn_net::Network`]: the engine, and burn's flex and ndarray.

use std::fmt;
use std::str::FromStr;

use burn::backend::{Autodiff, Flex, NdArray};
use burn::module::HasAutodiffModule;
use burn::tensor::{Tensor, TensorData};
use darn_geometry::grid::{CELLS, SIDE};
use darn_net::weights::{self, NamedTensors};
use darn_net::{
    AnchorLoss, AnchorProblem, EngineRuntime, GridPlanes, NetError, Network, Runtime, UnetConfig,
    engine,
};

use super::{Convolve, InputTensors, Unet, anchor, build};

/// What computes a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendKind {
    /// darn's own [`engine`].
    #[default]
    Engine,
    /// burn-flex.
    Flex,
    /// burn-ndarray: the numerical reference.
    Ndarray,
}

/// A name that is not in [`BackendKind::NAMES`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("backend `{name}` is unknown; there are: {}", BackendKind::NAMES.join(", "))]
pub struct UnknownBackend {
    /// The name.
    pub name: String,
}

impl BackendKind {
    /// The names that [`FromStr`] knows.
    pub const NAMES: &[&str] = &["engine", "flex", "ndarray"];
}

impl FromStr for BackendKind {
    type Err = UnknownBackend;

    fn from_str(name: &str) -> Result<Self, UnknownBackend> {
        match name {
            "engine" => Ok(BackendKind::Engine),
            "flex" => Ok(BackendKind::Flex),
            "ndarray" => Ok(BackendKind::Ndarray),
            other => Err(UnknownBackend {
                name: other.to_owned(),
            }),
        }
    }
}

/// What computes the predictions and the gradients of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BackendSettings {
    /// Forward passes.
    pub backend: BackendKind,
    /// Gradients of the anchor search; `None` means `backend`.
    pub autodiff: Option<BackendKind>,
    /// Options of the engine.
    pub engine: engine::EngineOptions,
}

impl From<BackendKind> for BackendSettings {
    fn from(backend: BackendKind) -> BackendSettings {
        BackendSettings {
            backend,
            ..BackendSettings::default()
        }
    }
}

/// Reads a weights file for any backend.
///
/// # Errors
/// As for [`Network::load`].
pub fn load_network(
    bytes: &[u8],
    settings: impl Into<BackendSettings>,
) -> Result<Network, NetError> {
    let settings = settings.into();
    let (card, tensors) = weights::read(bytes)?;
    weights::check(&card, &tensors)?;
    let config = &card.architecture;
    let runtime = |kind| runtime(kind, config, &tensors, settings.engine);
    let reverse = settings.autodiff.filter(|kind| *kind != settings.backend);
    let (forward, reverse) = (
        runtime(settings.backend)?,
        reverse.map(runtime).transpose()?,
    );
    Ok(Network::of(card, forward, reverse))
}

fn runtime(
    kind: BackendKind,
    config: &UnetConfig,
    tensors: &NamedTensors,
    options: engine::EngineOptions,
) -> Result<Box<dyn Runtime>, NetError> {
    Ok(match kind {
        BackendKind::Engine => Box::new(EngineRuntime::new(tensors, config, options)?),
        BackendKind::Flex => Box::new(BurnRuntime::<Flex>::new(config, tensors)?),
        BackendKind::Ndarray => Box::new(BurnRuntime::<NdArray>::new(config, tensors)?),
    })
}

/// A network in burn on a backend.
struct BurnRuntime<B: Convolve> {
    unet: Unet<B>,
    config: UnetConfig,
}

impl<B: Convolve> BurnRuntime<B> {
    fn new(config: &UnetConfig, tensors: &NamedTensors) -> Result<Self, NetError> {
        Ok(BurnRuntime {
            unet: build(config, tensors, &Default::default())?,
            config: *config,
        })
    }
}

impl<B: Convolve> fmt::Debug for BurnRuntime<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BurnRuntime")
            .field("config", &self.config)
            .finish_non_exhaustive()
    }
}

impl<B> Runtime for BurnRuntime<B>
where
    B: Convolve,
    Unet<B>: HasAutodiffModule<Autodiff<B>, TrainModule = Unet<Autodiff<B>>> + Sync,
{
    fn predict(&self, shown: &GridPlanes) -> Result<Vec<f32>, NetError> {
        let device = B::Device::default();
        let count = shown.known.len() / CELLS;
        let tensor = |planes: &[f32], channels: usize| {
            let data = TensorData::new(planes.to_vec(), [count, channels, SIDE, SIDE]);
            Tensor::from_data(data, &device)
        };
        let up = shown.up.clone().map(|up| TensorData::new(up, [count, 3]));
        let input = InputTensors {
            positions: tensor(&shown.positions, 3),
            known: tensor(&shown.known, 1),
            base: shown.base.as_deref().map(|base| tensor(base, 3)),
            up: up.map(|up| Tensor::from_data(up, &device)),
        };
        let answer = self.unet.predict(self.config.input, input);
        let numbers = answer.into_data().convert::<f32>().into_vec::<f32>();
        Ok(numbers.unwrap_or_default())
    }

    fn anchor_losses(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        anchor::losses(&self.unet, &self.config, problem, uvs)
    }

    fn anchor_gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        anchor::gradients(&self.unet, &self.config, problem, uvs)
    }
}
