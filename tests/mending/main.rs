//! From glTF to glTF with the shipped weights, on cloth that darn's own generator simulated.

mod borders;
mod cloth;
mod cuts;
mod editing;
mod laws;
mod ragged;
mod requests;
mod rims;
mod tubes;
