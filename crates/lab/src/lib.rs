//! Where the weights come from: the network as defined in burn, simulated sheets of cloth, training, and evaluation.
//!
//! [`scarffolds`] simulates draped squares and draws samples from them; [`unet`] is the paper's attention U-Net in burn, the definition that
//! the engine of `darn-net` is tested against; [`train`] trains it; [`evaluate`] measures fills on sheets with a known answer. This is the
//! only crate that knows burn; no request reaches it but through [`unet::load_network`].

pub mod evaluate;
pub mod scarffolds;
pub mod train;
pub mod unet;
