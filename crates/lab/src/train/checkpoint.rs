//! Checkpoints: the state that a run continues from, in one safetensors file of f32 that is replaced atomically.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::error::TrainError;
use super::options::TrainOptions;
use super::snapshot::TrainSnapshot;
use darn_net::weights::NamedTensors;

/// File name inside the output directory.
const FILE: &str = "checkpoint.safetensors";
const KEY: &str = "darn-checkpoint";

#[derive(Debug, Serialize, Deserialize)]
struct CheckpointHeader {
    step: u64,
    seconds: f64,
    options: TrainOptions,
}

/// Writes the state of a run into `dir`; `seconds` is the training time of all sessions together.
///
/// # Errors
/// A file that cannot be written.
pub fn save(
    snapshot: &TrainSnapshot,
    seconds: f64,
    options: &TrainOptions,
    dir: &Path,
) -> Result<(), TrainError> {
    let mut tensors: BTreeMap<String, (Vec<usize>, &[f32])> = BTreeMap::new();
    for (prefix, named) in [
        ("network", &snapshot.network),
        ("averaged", &snapshot.averaged),
    ] {
        for (name, (shape, values)) in named {
            tensors.insert(format!("{prefix}.{name}"), (shape.clone(), values));
        }
    }
    for (index, moments) in snapshot.moments.iter().enumerate() {
        for (name, values) in ["first", "second"].iter().zip(moments) {
            tensors.insert(format!("{name}.{index:04}"), (vec![values.len()], values));
        }
    }
    let path = dir.join(FILE);
    let refuse = |reason: String| TrainError::Checkpoint {
        path: path.clone(),
        reason,
    };
    let header = CheckpointHeader {
        step: snapshot.step,
        // Decimals of three digits are read back exactly; serde_json may lose the last digit of longer ones.
        seconds: (seconds * 1e3).round() / 1e3,
        options: options.clone(),
    };
    let header = serde_json::to_string(&header).map_err(|e| refuse(e.to_string()))?;
    let bytes: Vec<(&String, &Vec<usize>, Vec<u8>)> = tensors
        .iter()
        .map(|(name, (shape, values))| {
            (
                name,
                shape,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            )
        })
        .collect();
    let views: Result<Vec<_>, _> = bytes
        .iter()
        .map(|(name, shape, data)| {
            TensorView::new(Dtype::F32, shape.to_vec(), data).map(|v| (name.as_str(), v))
        })
        .collect();
    let views = views.map_err(|e| refuse(e.to_string()))?;
    let file = safetensors::serialize(views, Some(HashMap::from([(KEY.to_owned(), header)])))
        .map_err(|e| refuse(e.to_string()))?;
    replace(&path, &file)
}

/// Reads the state in `dir`, and the training time of all sessions together in seconds.
///
/// # Errors
/// No checkpoint, a damaged one, or one of another architecture, batch size, seed, trainer or optimiser.
pub fn load(options: &TrainOptions, dir: &Path) -> Result<(TrainSnapshot, f64), TrainError> {
    let path = dir.join(FILE);
    let bytes = std::fs::read(&path).map_err(|source| TrainError::File {
        path: path.clone(),
        source,
    })?;
    let refuse = |reason: String| TrainError::Checkpoint {
        path: path.clone(),
        reason,
    };
    let container = |e: safetensors::SafeTensorError| refuse(e.to_string());
    let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(container)?;
    let header = metadata
        .metadata()
        .as_ref()
        .and_then(|m| m.get(KEY))
        .ok_or_else(|| refuse("not a checkpoint".into()))?;
    let header: CheckpointHeader =
        serde_json::from_str(header).map_err(|e| refuse(e.to_string()))?;
    let same = |o: &TrainOptions| (o.network, o.batch, o.seed, (o.trainer, o.optimiser));
    if same(&header.options) != same(options) {
        return Err(refuse(
            "it belongs to another architecture, batch size, seed, trainer or optimiser".into(),
        ));
    }
    let mut groups: BTreeMap<String, NamedTensors> = BTreeMap::new();
    for (name, view) in SafeTensors::deserialize(&bytes)
        .map_err(container)?
        .tensors()
    {
        let (group, name) = name
            .split_once('.')
            .ok_or_else(|| refuse(format!("unexpected tensor `{name}`")))?;
        let values = view
            .data()
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        groups
            .entry(group.to_owned())
            .or_default()
            .insert(name.to_owned(), (view.shape().to_vec(), values));
    }
    let mut group = |name: &str| groups.remove(name).unwrap_or_default();
    let snapshot = TrainSnapshot {
        network: group("network"),
        averaged: group("averaged"),
        moments: (group("first").into_values())
            .zip(group("second").into_values())
            .map(|((_, first), (_, second))| [first, second])
            .collect(),
        step: header.step,
    };
    Ok((snapshot, header.seconds))
}

/// Replaces a file so that a reader sees the old or the new file, never a part.
///
/// # Errors
/// A file that cannot be written.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), TrainError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| TrainError::File { path, source }
    };
    let mut partial: PathBuf = path.to_owned();
    partial.set_extension("partial");
    std::fs::write(&partial, bytes).map_err(failed(&partial))?;
    std::fs::rename(&partial, path).map_err(failed(path))
}
