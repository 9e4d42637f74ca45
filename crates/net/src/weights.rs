//! Weights files: safetensors with readable tensor names (`down.0.conv0.weight`), f16 on disk, and a model card in the metadata.
//! Errors give the name of the tensor.

use std::collections::{BTreeMap, HashMap};

use half::f16;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::config::UnetConfig;
use crate::error::NetError;
use crate::error_model::ErrorModel;

pub use crate::tensors::NamedTensors;

/// The only metadata key. With several, their order in the file, and so its bytes, would change from run to run.
const CARD_KEY: &str = "darn";

/// A model card: what a weights file is and where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WeightsCard {
    /// The name by which requests choose it, e.g. `standard`.
    pub name: String,
    /// SHA-256 of the whole file in hex; not stored in the file.
    #[serde(skip)]
    pub sha256: String,
    /// The architecture of the network.
    pub architecture: UnetConfig,
    /// How it was trained.
    pub training: TrainingCard,
    /// Held-out scores by name, e.g. `rmse_cells`.
    pub scores: BTreeMap<String, f64>,
    /// How far its answers may be off; `None` for weights that were not calibrated: their patches get no confidence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<ErrorModel>,
    /// The version of darn that wrote the file.
    pub darn_version: String,
}

/// How a network was trained.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainingCard {
    /// Optimiser steps.
    pub steps: u64,
    /// Samples per step.
    pub batch: usize,
    /// Seed of weights and samples.
    pub seed: u64,
    /// Samples in total.
    pub samples: u64,
    /// Minutes of training.
    pub minutes: f64,
    /// Seed of the simulated sheets, if known.
    pub data_seed: Option<u64>,
    /// The terms of the loss and their weights, in words.
    pub loss: String,
}

/// Writes a weights file: matrices and kernels as f16, vectors (biases and statistics, which are few and of any magnitude) as f32.
///
/// # Errors
/// A value that is not finite in its type on disk.
///
/// # Examples
/// ```
/// use darn_net::weights::{self, NamedTensors};
/// use darn_net::{TrainingCard, UnetConfig, WeightsCard};
///
/// let tensors = NamedTensors::from([("last.bias".to_owned(), (vec![3], vec![0.5, 0.0, -1.0]))]);
/// let card = WeightsCard {
///     name: "mine".to_owned(),
///     sha256: String::new(),
///     architecture: UnetConfig::default(),
///     training: TrainingCard::default(),
///     scores: Default::default(),
///     errors: None,
///     darn_version: "0.1.0".to_owned(),
/// };
/// let bytes = weights::write(&tensors, &card)?;
/// let (read_card, read_tensors) = weights::read(&bytes)?;
/// assert_eq!(read_card.name, "mine");
/// assert_eq!(read_tensors, tensors);
/// # Ok::<(), darn_net::NetError>(())
/// ```
pub fn write(tensors: &NamedTensors, card: &WeightsCard) -> Result<Vec<u8>, NetError> {
    let mut encoded = Vec::with_capacity(tensors.len());
    for (name, (shape, values)) in tensors {
        let (kind, bytes): (Dtype, Vec<u8>) = if shape.len() > 1 {
            (
                Dtype::F16,
                values
                    .iter()
                    .flat_map(|v| f16::from_f32(*v).to_le_bytes())
                    .collect(),
            )
        } else {
            (
                Dtype::F32,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            )
        };
        if !decode(kind, &bytes).is_some_and(|v| v.iter().all(|x| x.is_finite())) {
            return Err(NetError::NotFinite { name: name.clone() });
        }
        encoded.push((name, kind, shape, bytes));
    }
    let json = serde_json::to_string(card).map_err(|e| NetError::Card(e.to_string()))?;
    let views: Result<Vec<_>, _> = encoded
        .iter()
        .map(|(name, kind, shape, bytes)| {
            TensorView::new(*kind, shape.to_vec(), bytes).map(|view| (name.as_str(), view))
        })
        .collect();
    let views = views.map_err(|e| NetError::Container(e.to_string()))?;
    safetensors::serialize(views, Some(HashMap::from([(CARD_KEY.to_owned(), json)])))
        .map_err(|e| NetError::Container(e.to_string()))
}

/// Reads a weights file: its card, and its tensors as f32.
///
/// # Errors
/// Not a safetensors container, no card or a malformed one, an element type other than f16, bf16 or f32, or a value that is not finite.
pub fn read(bytes: &[u8]) -> Result<(WeightsCard, NamedTensors), NetError> {
    let container = |e: safetensors::SafeTensorError| NetError::Container(e.to_string());
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(container)?;
    let json = metadata
        .metadata()
        .as_ref()
        .and_then(|m| m.get(CARD_KEY))
        .ok_or_else(|| NetError::Card("there is none".into()))?;
    let mut card: WeightsCard =
        serde_json::from_str(json).map_err(|e| NetError::Card(e.to_string()))?;
    card.sha256 = Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let file = SafeTensors::deserialize(bytes).map_err(container)?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.tensors() {
        let values = decode(view.dtype(), view.data()).ok_or_else(|| NetError::ElementType {
            name: name.clone(),
            found: format!("{:?}", view.dtype()),
        })?;
        if values.iter().any(|v| !v.is_finite()) {
            return Err(NetError::NotFinite { name });
        }
        tensors.insert(name, (view.shape().to_vec(), values));
    }
    Ok((card, tensors))
}

/// Checks that a card's width is supported and is that of the tensors.
///
/// # Errors
/// A width outside 1..=256, or another width than that of the last layer.
pub fn check(card: &WeightsCard, tensors: &NamedTensors) -> Result<(), NetError> {
    if !(1..=256).contains(&card.architecture.width) {
        return Err(NetError::Card(format!(
            "width {} is outside 1..=256",
            card.architecture.width
        )));
    }
    // A small file with a large width in its card must be refused before a network of that width is allocated.
    let last = tensors
        .get("last.weight")
        .ok_or_else(|| NetError::MissingTensor {
            name: "last.weight".into(),
        })?;
    let expected = vec![3, card.architecture.width, 1, 1];
    if last.0 != expected {
        return Err(NetError::Shape {
            name: "last.weight".into(),
            found: last.0.clone(),
            expected,
        });
    }
    Ok(())
}

/// Elements of a tensor as f32; `None` for other element types.
fn decode(kind: Dtype, bytes: &[u8]) -> Option<Vec<f32>> {
    let pairs = || bytes.chunks_exact(2).map(|b| [b[0], b[1]]);
    match kind {
        Dtype::F16 => Some(pairs().map(|b| f16::from_le_bytes(b).to_f32()).collect()),
        Dtype::BF16 => Some(
            pairs()
                .map(|b| half::bf16::from_le_bytes(b).to_f32())
                .collect(),
        ),
        Dtype::F32 => Some(
            bytes
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect(),
        ),
        _ => None,
    }
}
