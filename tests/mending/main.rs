//! The whole way from glTF to glTF with the shipped weights, on cloth that our own generator made.

mod cloth;
mod laws;
mod requests;
