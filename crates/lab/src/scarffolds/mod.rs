//! The ScarfFolds generator: cloth simulation, self-intersection filter, sheets on disk, hole masks and training samples.
//! It makes what the network learns from; everything is drawn from an explicit seed.
//! No network, no loss, no training loop: those live in `net` and `train`.

pub mod cloth;
pub mod collide;
pub mod export;
mod field;
mod files;
pub mod masks;
pub mod samples;
pub mod scanned;
pub mod scene;
pub mod sheets;
mod spline;
