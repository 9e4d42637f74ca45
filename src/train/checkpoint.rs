//! Checkpoints: everything a run needs to go on, in one safetensors file of f32, replaced atomically.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use burn::tensor::backend::AutodiffBackend;
use burn::tensor::{Tensor, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::optimiser::AdamW;
use super::{TrainError, TrainOptions};
use crate::net::weights::{NamedTensors, export, import};
use crate::net::{Convolve, Unet};

/// File name inside the output directory.
const FILE: &str = "checkpoint.safetensors";
const KEY: &str = "darn-checkpoint";

/// A run between two steps. The samples' generator needs no state: batch k follows from the seed and k.
#[derive(Debug)]
pub struct State<B: AutodiffBackend> {
    /// The network being trained.
    pub network: Unet<B>,
    /// Its average over the last steps, which is what ships.
    pub averaged: Unet<B::InnerBackend>,
    /// The optimiser's moments and step.
    pub optimiser: AdamW<B::InnerBackend>,
    /// Seconds trained so far, over all sittings.
    pub seconds: f64,
}

#[derive(Debug, Serialize, Deserialize)]
struct Header {
    step: u64,
    seconds: f64,
    options: TrainOptions,
}

/// Writes the state into `dir`.
pub fn save<B: AutodiffBackend>(
    state: &State<B>,
    options: &TrainOptions,
    dir: &Path,
) -> Result<(), TrainError> {
    use burn::module::AutodiffModule;
    let mut tensors: NamedTensors = BTreeMap::new();
    let mut add = |prefix: &str, named: NamedTensors| {
        tensors.extend(
            named
                .into_iter()
                .map(|(name, t)| (format!("{prefix}{name}"), t)),
        )
    };
    add("network.", export(&state.network.valid()));
    add("averaged.", export(&state.averaged));
    for (index, moments) in state.optimiser.moments.iter().enumerate() {
        for (name, moment) in ["first", "second"].iter().zip(moments) {
            let values: Vec<f32> = moment
                .to_data()
                .convert::<f32>()
                .into_vec()
                .unwrap_or_default();
            tensors.insert(format!("{name}.{index:04}"), (vec![values.len()], values));
        }
    }
    let path = dir.join(FILE);
    let refuse = |reason: String| TrainError::Checkpoint {
        path: path.clone(),
        reason,
    };
    let header = Header {
        step: state.optimiser.step,
        seconds: state.seconds,
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

/// Reads the state in `dir` back into a network of the options' architecture.
///
/// # Errors
/// No checkpoint, a damaged one, or one of another architecture, batch size or seed.
pub fn load<B>(
    options: &TrainOptions,
    dir: &Path,
    device: &B::Device,
) -> Result<State<B>, TrainError>
where
    B: AutodiffBackend<InnerBackend: Convolve> + Convolve,
{
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
    let header: Header = serde_json::from_str(header).map_err(|e| refuse(e.to_string()))?;
    let same = |o: &TrainOptions| (o.network, o.batch, o.seed);
    if same(&header.options) != same(options) {
        return Err(refuse(
            "it belongs to another architecture, batch size or seed".into(),
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
    let inner = B::Device::default();
    let network = import(options.network.init::<B>(device), &group("network"))?;
    let averaged = import(
        options.network.init::<B::InnerBackend>(&inner),
        &group("averaged"),
    )?;
    let flat = |(_, values): (Vec<usize>, Vec<f32>)| {
        let n = values.len();
        Tensor::<B::InnerBackend, 1>::from_data(TensorData::new(values, [n]), &inner)
    };
    let moments = group("first")
        .into_values()
        .zip(group("second").into_values())
        .map(|(a, b)| [flat(a), flat(b)])
        .collect();
    Ok(State {
        network,
        averaged,
        optimiser: AdamW {
            step: header.step,
            moments,
        },
        seconds: header.seconds,
    })
}

/// Writes a file so that a reader sees the old or the new one, never a part.
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
