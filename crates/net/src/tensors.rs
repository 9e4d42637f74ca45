//! A network's weights in memory.

use std::collections::BTreeMap;

/// The tensors of a network by name: shape and values.
pub type NamedTensors = BTreeMap<String, (Vec<usize>, Vec<f32>)>;
