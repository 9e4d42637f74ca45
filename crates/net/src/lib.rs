//! The network without burn: the attention U-Net's forward pass and gradient on the CPU, its weights file, and its input.
//!
//! Grids go in and positions come out, both in the network's units ([`darn_geometry::grid`]). [`Network::fill`] prepares the network's
//! input: the up direction, the plate under unknown cells, and the Procrustes frame. A [`Runtime`] computes the prediction: darn's own
//! [`engine`], or one of burn's backends, which `darn-lab` provides. This crate knows neither scene space nor constraints, and reads no
//! files.

mod alternatives;
mod anchor;
pub mod config;
pub mod engine;
mod error;
mod error_model;
pub mod fill;
mod frame;
mod network;
mod networks;
mod planes;
// Not part of the API: public only because the tests of `darn-lab` compare burn with it.
#[doc(hidden)]
pub mod reference;
mod runtime;
pub mod symmetry;
mod tensors;
pub mod weights;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use anchor::{AnchorLoss, AnchorProblem, SIGMA};
pub use config::UnetConfig;
pub use error::NetError;
pub use error_model::{DepthGrowth, ErrorModel, WITHIN_90};
pub use fill::{InputKind, plate, plates};
pub use frame::{FrameKind, NetworkFrame};
pub use network::{FillRequest, FilledGrid, Network};
pub use networks::Networks;
pub use planes::{GridPlanes, cells, planes};
pub use runtime::{EngineRuntime, Runtime};
pub use symmetry::Averaging;
pub use weights::{TrainingCard, WeightsCard};
