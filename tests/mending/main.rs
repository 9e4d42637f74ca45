//! The whole way from glTF to glTF with the shipped weights, on cloth that our own generator made.

mod cloth;
mod editing;
mod laws;
mod requests;
mod rims;
