//! The network in burn, simulated sheets of cloth, training and evaluation: where the weights come from.
//!
//! [`scarffolds`] simulates draped squares and draws samples from them; [`garments`] sews and drapes clothes with openings and holes. [`unet`] is
//! the paper's attention U-Net in burn, the definition that the engine of `darn-net` is tested against. [`train`] trains it. [`evaluate`] measures
//! fills on sheets and garments whose truth is known. This is the only crate that depends on burn; requests use [`unet::load_network`] only.

mod cell_normals;
mod line_chart;

pub mod evaluate;
pub mod garments;
pub mod scarffolds;
pub mod train;
pub mod unet;
